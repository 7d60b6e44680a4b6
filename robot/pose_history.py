"""Where base and head were when a picture was taken: pictures arrive later than they were made."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from typing import TypeVar

from robot.messages import HeadPose, Odometry, Pose2, wrap

T = TypeVar("T")

KEPT_S = 2.0
_AHEAD_S = 0.1
"""A picture newer than the newest reading is carried on from it by no more than this."""


class PoseHistory:
    """Readings of base and head of the last two seconds, asked for the moment between them.

    >>> history = PoseHistory()
    >>> history.add(Odometry(Pose2(0.0), at=1.0), HeadPose(0.0), 1.0)
    >>> history.add(Odometry(Pose2(0.2), at=2.0), HeadPose(0.5), 2.0)
    >>> history.base(1.5).x, history.head(1.5).pan
    (0.1, 0.25)
    """

    def __init__(self) -> None:
        self._bases: deque[tuple[float, Odometry]] = deque()
        self._heads: deque[tuple[float, HeadPose]] = deque()

    def add(self, odometry: Odometry, head: HeadPose, head_at: float) -> None:
        """Note the newest readings; the base's is of `odometry.at`."""
        if not self._bases or odometry.at > self._bases[-1][0]:
            self._bases.append((odometry.at, odometry))
        if not self._heads or head_at > self._heads[-1][0]:
            self._heads.append((head_at, head))
        for readings in (self._bases, self._heads):
            while len(readings) > 2 and readings[1][0] < readings[-1][0] - KEPT_S:
                readings.popleft()

    def base(self, at: float) -> Pose2:
        """The base's pose at a time; the oldest or newest known outside of what is known."""
        before, after, share = _around(self._bases, at)
        if after is None:
            ahead = min(max(at - before.at, 0.0), _AHEAD_S)
            return before.pose if ahead == 0.0 else _carried_on(before, ahead)
        start, end = before.pose, after.pose
        return Pose2(
            start.x + share * (end.x - start.x),
            start.y + share * (end.y - start.y),
            wrap(start.yaw + share * wrap(end.yaw - start.yaw)),
        )

    def head(self, at: float) -> HeadPose:
        """The head's pose at a time."""
        before, after, share = _around(self._heads, at)
        if after is None:
            return before
        return HeadPose(
            before.pan + share * (after.pan - before.pan), before.tilt + share * (after.tilt - before.tilt)
        )


def _around(readings: deque[tuple[float, T]], at: float) -> tuple[T, T | None, float]:
    """The readings before and after a time, and how far between them it lies; None after the newest."""
    if not readings:
        raise ValueError("no reading was added yet")
    index = bisect_right(readings, at, key=lambda reading: reading[0])
    if index == len(readings):
        return readings[-1][1], None, 0.0
    if index == 0:
        return readings[0][1], readings[0][1], 0.0
    (start, before), (end, after) = readings[index - 1], readings[index]
    return before, after, (at - start) / (end - start)


def _carried_on(odometry: Odometry, seconds: float) -> Pose2:
    twist = odometry.twist
    return odometry.pose.compose(Pose2(twist.v * seconds, 0.0, twist.w * seconds))
