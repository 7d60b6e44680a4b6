"""Pose and speed from two wheel encoders that may be read at different times."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from robot.hal.kinematics import Wheels, arc
from robot.hal.nxt.wheel import Sample, between
from robot.messages import Odometry, Pose2, Twist

# A speed over one tick would be the encoder's whole degrees: 25 deg/s at 25 readings a second.
_SPEED_WINDOW_S: Final = 0.12


class WheelOdometry:
    """Integrates wheel rotations (degrees) to a pose by exact arcs.

    When the wheels are read in turn (Bluetooth), the pose is that of the newest time both are known at, the
    later reading interpolated: `Odometry.at` says which time that is.
    """

    def __init__(self, wheels: Wheels) -> None:
        self._wheels = wheels
        self._pose = Pose2()
        self._left: Sample | None = None
        self._right: Sample | None = None
        self._recent: deque[tuple[Sample, Sample]] = deque()
        self.value = Odometry()

    def restart(self) -> None:
        """Keep the pose, but count from the next readings: the counters jumped."""
        self._left = self._right = None
        self._recent.clear()

    def update(self, left: Sample, right: Sample) -> Odometry:
        """Take the newest readings of both wheels; returns the new odometry (also kept in `value`)."""
        if self._left is None or self._right is None:
            # Wheels stand still where a count begins, so readings at different times go together.
            at = min(left.at, right.at)
            self._left, self._right = Sample(left.rotation, at), Sample(right.rotation, at)
            self._recent.append((self._left, self._right))
            self.value = Odometry(self._pose, at=at)
            return self.value
        at = min(left.at, right.at)
        if at <= self._left.at:
            return self.value
        new_left, new_right = between(self._left, left, at), between(self._right, right, at)
        step = self._wheels.twist(
            math.radians(new_left.rotation - self._left.rotation),
            math.radians(new_right.rotation - self._right.rotation),
        )
        self._pose = arc(self._pose, step.v, step.w)
        self._left, self._right = new_left, new_right
        self.value = Odometry(self._pose, self._speed_with(new_left, new_right), at)
        return self.value

    def _speed_with(self, left: Sample, right: Sample) -> Twist:
        self._recent.append((left, right))
        while left.at - self._recent[0][0].at > _SPEED_WINDOW_S + 1e-6 and len(self._recent) > 2:
            self._recent.popleft()
        first_left, first_right = self._recent[0]
        dt = left.at - first_left.at
        if dt <= 0:
            return Twist()
        return self._wheels.twist(
            math.radians((left.rotation - first_left.rotation) / dt),
            math.radians((right.rotation - first_right.rotation) / dt),
        )
