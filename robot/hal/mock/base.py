"""A drive base that does exactly what it is told, as long as it is told."""

from __future__ import annotations

import math
from typing import Final

from robot.hal.kinematics import Limits, Wheels, arc, limited
from robot.hal.mock.script import Mock
from robot.messages import Odometry, Pose2, Twist

DEFAULT_LIMITS: Final = Limits(speed=0.25, turn=math.radians(70.0))
DEFAULT_WHEELS: Final = Wheels(radius=0.028, track_width=0.15)


class MockBase(Mock):
    """Follows each twist at once and without error for one pulse; then it stands until the next.

    >>> base = MockBase()
    >>> base.send(Twist(v=0.2), now=0.0)
    Twist(v=0.2, w=0.0)
    >>> round(base.read(now=5.0).pose.x, 6)  # one pulse of 0.3 s, then it stood
    0.06
    """

    def __init__(
        self,
        limits: Limits = DEFAULT_LIMITS,
        wheels: Wheels = DEFAULT_WHEELS,
        pulse_s: float = 0.3,
        battery_volts: float | None = 8.0,
    ) -> None:
        super().__init__("base")
        self.volts = battery_volts
        self._limits, self._wheels, self._pulse_s = limits, wheels, pulse_s
        self._twist = Twist()
        self._until = -math.inf
        self._time = -math.inf
        self._pose = Pose2()
        self._last = Odometry()

    def send(self, twist: Twist, now: float) -> Twist:
        """Drive; returns the twist after the limits, no motion while it fails."""
        self._advance(now)
        if not self._works(now, "send", twist):
            return Twist()
        self._twist = limited(twist, self._limits, self._wheels)
        self._until = now + self._pulse_s
        return self._twist

    def stop(self, now: float) -> None:
        """Stand."""
        self._advance(now)
        if self._works(now, "stop"):
            self._twist = Twist()

    def read(self, now: float) -> Odometry:
        """Pose and speed; the last known while it fails."""
        if self._works(now, "read"):
            self._advance(now)
            self._last = Odometry(self._pose, self._twist, now)
        return self._last

    def battery_volts(self) -> float | None:
        """The voltage it was given."""
        return self.volts

    def close(self) -> None:
        """Stand for good."""
        super().close()
        self._twist = Twist()

    def _advance(self, now: float) -> None:
        if now <= self._time:
            return
        if not self._twist.is_zero:
            dt = max(0.0, min(now, self._until) - self._time)
            self._pose = arc(self._pose, self._twist.v * dt, self._twist.w * dt)
            if now >= self._until - 1e-9:
                self._twist = Twist()
        self._time = now
