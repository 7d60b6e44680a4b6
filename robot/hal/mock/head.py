"""A pan-tilt head that turns evenly to where it is sent."""

from __future__ import annotations

import math

from robot.hal.head_limits import DEFAULT_LIMITS, HeadLimits
from robot.hal.mock.script import Mock
from robot.messages import HeadPose


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


def _towards(value: float, goal: float, step: float) -> float:
    return goal if abs(goal - value) <= step else value + math.copysign(step, goal - value)
