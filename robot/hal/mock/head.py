"""A pan-tilt head that turns evenly to where it is sent."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from robot.hal.mock.script import Mock
from robot.messages import HeadPose


@dataclass(frozen=True, slots=True)
class HeadLimits:
    """Largest angles in radians (pan to either side, tilt up, tilt down) and the servos' rate in rad/s."""

    pan: float = math.radians(80.0)
    tilt_up: float = math.radians(20.0)
    tilt_down: float = math.radians(50.0)
    rate: float = math.radians(180.0)

    def applied(self, pose: HeadPose) -> HeadPose:
        """The nearest pose within the limits; an angle that is no number becomes 0."""
        return HeadPose(
            _within(pose.pan, -self.pan, self.pan), _within(pose.tilt, -self.tilt_up, self.tilt_down)
        )


DEFAULT_LIMITS: Final = HeadLimits()


class MockHead(Mock):
    """Turns both axes at the servos' rate; where it is follows from when it was sent there."""

    def __init__(self, limits: HeadLimits = DEFAULT_LIMITS) -> None:
        super().__init__("head")
        self._limits = limits
        self._at = HeadPose()
        self._goal = HeadPose()
        self._time = -math.inf

    def send(self, pose: HeadPose, now: float) -> HeadPose:
        """Go there; returns the pose after the limits, the old goal while it fails."""
        self._advance(now)
        if self._works(now, "send", pose):
            self._goal = self._limits.applied(pose)
        return self._goal

    def read(self, now: float) -> HeadPose:
        """Where it is now."""
        if self._works(now, "read"):
            self._advance(now)
        return self._at

    def _advance(self, now: float) -> None:
        if now > self._time:
            step = 0.0 if self._time == -math.inf else self._limits.rate * (now - self._time)
            self._at = HeadPose(
                _towards(self._at.pan, self._goal.pan, step), _towards(self._at.tilt, self._goal.tilt, step)
            )
            self._time = now


def _within(value: float, low: float, high: float) -> float:
    return 0.0 if math.isnan(value) else max(low, min(high, value))


def _towards(value: float, goal: float, step: float) -> float:
    return goal if abs(goal - value) <= step else value + math.copysign(step, goal - value)
