"""How the target moves: from stop to stop, resting where it is told to, never into the robot."""

from __future__ import annotations

import math

from robot.messages import Pose2
from robot.sim.layout import Motion

KEEP_AWAY_M = 0.45
"""The target waits while the robot's middle is nearer than this and its next step would not lead away."""


class Mover:
    """Moves a target along a `Motion`; deterministic, given the robot's positions."""

    def __init__(self, home: Pose2, motion: Motion) -> None:
        self.pose = home
        self.under_way = False
        self._motion = motion
        self._next = 0
        self._rest = 0.0

    @property
    def finished(self) -> bool:
        """True once it has come to its last stop for good (or never was to move)."""
        return self._next >= len(self._motion.stops)

    def advance(self, dt: float, now: float, robot: tuple[float, float]) -> None:
        """Let `dt` seconds pass; `now` is the time at their end, `robot` the robot's middle on the floor."""
        motion = self._motion
        if self._next >= len(motion.stops) or not self._started(now, robot):
            return
        if self._rest > 0.0:
            self._rest -= dt
            return
        stop = motion.stops[self._next]
        distance = math.hypot(stop.x - self.pose.x, stop.y - self.pose.y)
        step = motion.speed * dt
        if distance <= step:
            place = (stop.x, stop.y)
        else:
            share = step / distance
            place = (
                self.pose.x + share * (stop.x - self.pose.x),
                self.pose.y + share * (stop.y - self.pose.y),
            )
        gap = math.dist(place, robot)
        if gap < KEEP_AWAY_M and gap < math.dist((self.pose.x, self.pose.y), robot):
            return
        self.pose = Pose2(*place, self.pose.yaw)
        if distance <= step:
            self._rest = stop.pause
            self._next += 1

    def _started(self, now: float, robot: tuple[float, float]) -> bool:
        if not self.under_way:
            within = self._motion.starts_within
            near = within is None or math.dist((self.pose.x, self.pose.y), robot) <= within
            self.under_way = now >= self._motion.starts_at and near
        return self.under_way
