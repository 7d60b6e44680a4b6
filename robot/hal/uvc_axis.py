"""One axis of a head that turns by a camera's control."""

from __future__ import annotations

import math
from typing import Final

from robot.hal.webcam.controls import ControlInfo

ARC_SECONDS: Final = 3600.0 * 180.0 / math.pi
_STUCK_S: Final = 0.6
_PROGRESS_RAD: Final = math.radians(0.3)
_TOLERANCE_RAD: Final = math.radians(1.0)


class Axis:
    """One axis: angle in radians in the robot's sense to control values and back, and where it is.

    The kernel and most cameras answer with the value last set, some with where the head is. So a read-back
    other than the goal is taken as measured, and one equal to the goal as 'on its way or there': then the
    axis is modelled to turn at `slew` rad/s.
    """

    def __init__(self, name: str, info: ControlInfo, at: float, slew: float) -> None:
        self.name = name
        self._info = info
        self._slew = slew
        self._tolerance = max(_TOLERANCE_RAD, abs(info.step) / ARC_SECONDS)
        self.at = at
        self.goal = at
        self._told = at
        self._reference = at
        self._moved_at: float | None = None
        self._time: float | None = None

    def units(self, angle: float) -> int:
        """The control's value for an angle: UVC counts right and up, the robot left and down."""
        return self._info.fitted(-angle * ARC_SECONDS)

    def within(self, angle: float) -> float:
        """The angle within the control's range."""
        low, high = -self._info.maximum / ARC_SECONDS, -self._info.minimum / ARC_SECONDS
        return min(max(angle, low), high)

    def rounded(self, angle: float) -> float:
        """The angle that the control's value for this angle means."""
        return -self.units(angle) / ARC_SECONDS

    def aim(self, angle: float, now: float) -> None:
        """The goal was set."""
        self._advance(now)
        angle = self.rounded(angle)
        if angle == self.goal:
            return
        if abs(self.goal - self._told) <= self._tolerance:
            self._moved_at = now  # it had arrived: its time to move begins now
        self._reference = self._told
        self.goal = angle

    def observe(self, value: int, now: float) -> None:
        """The control read this value."""
        self._advance(now)
        self._told = -value / ARC_SECONDS
        if abs(value - self.units(self.goal)) > max(1, self._info.step):
            self.at = self._told
        self._watch(now)

    def is_stuck(self, now: float) -> bool:
        """True if it has been away from its goal for 0.6 s without coming nearer."""
        return self._moved_at is not None and now - self._moved_at > _STUCK_S

    def where(self) -> str:
        """Name, angle told and goal, in degrees."""
        return (
            f"{self.name} stays at {math.degrees(self._told):.1f}, not {math.degrees(self.goal):.1f} degrees"
        )

    def forget(self) -> None:
        """The link broke: nothing is known of what happened meanwhile."""
        self._moved_at = self._time = None

    def _watch(self, now: float) -> None:
        left, before = abs(self.goal - self._told), abs(self.goal - self._reference)
        if self._moved_at is None or left <= self._tolerance or before - left > _PROGRESS_RAD:
            self._reference, self._moved_at = self._told, now

    def _advance(self, now: float) -> None:
        if self._time is not None and now > self._time:
            step = self._slew * (now - self._time)
            way = self.goal - self.at
            self.at = self.goal if abs(way) <= step else self.at + math.copysign(step, way)
        self._time = now
