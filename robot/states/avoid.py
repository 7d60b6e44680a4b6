"""AVOID: a detour through the obstacle map to where the target can be followed again."""

from __future__ import annotations

import math

import numpy as np

from robot.messages import Event, Follow, HeadPose, Hold, Intent, Pose2, Situation, Want
from robot.nav.grid import ObstacleMap
from robot.nav.planner import corridor_free, plan_to_view
from robot.states.behaviour import Behaviour, distance_between, look_at_place, pan_towards

REPLAN_EVERY = 0.8
PATIENCE = 30.0
STUCK_AFTER = 6.0  # seconds without moving although there is a path; glances at the floor take some of them
LOOK_AROUND_FOR = 4.0


class Avoid:
    """Plan, drive the plan, look where it goes and at the target; leave when the straight way is free."""

    def __init__(self, behaviour: Behaviour, obstacle_map: ObstacleMap) -> None:
        self._behaviour = behaviour
        self._map = obstacle_map

    def enter(self, situation: Situation) -> None:
        """Plan anew."""
        self._since = situation.now
        self._planned_at = -math.inf
        self._path: tuple[tuple[float, float], ...] | None = None
        self._pathless_since: float | None = None
        self._moved_at = situation.now

    def step(self, situation: Situation) -> tuple[Intent, Event | None]:
        """Follow the detour; leave when the way to the target is free, or hopeless."""
        place = situation.percepts.place
        if place is None:
            return Intent(), Event("target_lost", "it was never known where the target is", {})
        self._replan(situation, place.value)
        intent = self._drive(situation, place.value)
        return intent, self._leave(situation, place.value)

    def _replan(self, situation: Situation, place: tuple[float, float]) -> None:
        if situation.now - self._planned_at < REPLAN_EVERY:
            return
        self._planned_at = situation.now
        pose = situation.odometry.pose
        path = plan_to_view(
            self._map,
            (pose.x, pose.y),
            place,
            self._goal_distance(),
            self._behaviour.body_radius,
            self._behaviour.margin,
        )
        self._path = path
        if path is not None:
            self._pathless_since = None
        elif self._pathless_since is None:
            self._pathless_since = situation.now

    def _goal_distance(self) -> float:
        # The stand-off is measured from the eyes to the target's surface, the plan from centre to centre.
        return self._behaviour.stand_off + self._behaviour.head_forward + 0.1

    def _drive(self, situation: Situation, place: tuple[float, float]) -> Intent:
        wants = {Want.TRACK}
        track = situation.percepts.track
        if track is None or track.value.lost:
            wants.add(Want.RECOGNIZE)
        pose = situation.odometry.pose
        if self._path is None:
            return Intent(look=self._look_around(situation), motion=Hold(), wants=frozenset(wants))
        look = self._look_along(pose, place)
        return Intent(look=look, motion=Follow(self._path), wants=frozenset(wants))

    def _look_around(self, situation: Situation) -> HeadPose:
        """Without a way: look at the widest passage in sight, else from side to side, for a way to appear.

        A passage that is wide enough but not sure is looked at from farther up: what keeps it from being
        sure most often is that the picture does not show the body's whole height there.
        """
        free_space = situation.percepts.free_space
        passage = free_space.value.passage if free_space is not None else None
        since = situation.now - (self._pathless_since or situation.now)
        if (
            passage is not None
            and passage.diameter > 2 * self._behaviour.body_radius
            and since < LOOK_AROUND_FOR / 2
        ):
            x, y, _ = passage.position
            tilt = self._behaviour.rest_tilt * (1.0 if passage.safe else 0.5)
            return HeadPose(pan_towards(x, y, self._behaviour), tilt)
        pan = self._behaviour.pan_limit * 0.8 * math.sin(math.tau * since / LOOK_AROUND_FOR)
        return HeadPose(pan, self._behaviour.rest_tilt)

    def _look_along(self, pose: Pose2, place: tuple[float, float]) -> HeadPose:
        assert self._path is not None
        ahead = _point_ahead(self._path, pose, 0.4)
        local = pose.to_local(np.array([ahead]))[0]
        along = pan_towards(float(local[0]), float(local[1]), self._behaviour)
        target = look_at_place(place, pose, self._behaviour).pan
        # The way must stay within the middle of the picture; the rest of the turn is for the target.
        pan = along + max(-0.3, min(0.3, target - along))
        return HeadPose(
            max(-self._behaviour.pan_limit, min(self._behaviour.pan_limit, pan)), self._behaviour.rest_tilt
        )

    def _leave(self, situation: Situation, place: tuple[float, float]) -> Event | None:
        pose, track = situation.odometry.pose, situation.percepts.track
        distance = distance_between(pose, place)
        to_go = max(distance - self._goal_distance(), 0.0)
        share = to_go / max(distance, 1e-6)
        stop = (pose.x + share * (place[0] - pose.x), pose.y + share * (place[1] - pose.y))
        free = corridor_free(self._map, (pose.x, pose.y), stop, self._behaviour.body_radius)
        seen = track is not None and not track.value.lost and track.age(situation.now) < 0.3
        evidence = {"distance_m": distance, "after_s": situation.now - self._since}
        settled = situation.now - self._since > 1.0
        if free and seen and settled:
            return Event("way_free", "the straight way is free again", evidence)
        at_end = (
            self._path is not None
            and math.hypot(self._path[-1][0] - pose.x, self._path[-1][1] - pose.y) < 0.1
        )
        if settled and (at_end or (free and to_go < 0.15)):
            return Event("target_lost", "the detour is driven and the target is not in view", evidence)
        if self._pathless_since is not None and situation.now - self._pathless_since > LOOK_AROUND_FOR:
            return Event("target_lost", "there is no way to the target from here", evidence)
        twist = situation.odometry.twist
        if self._path is None or abs(twist.v) > 0.02 or abs(twist.w) > 0.1:
            self._moved_at = situation.now
        if situation.now - self._moved_at > STUCK_AFTER:
            return Event("target_lost", "no way was made on the detour", evidence)
        if situation.now - self._since > PATIENCE:
            return Event("target_lost", "the detour takes too long", evidence)
        return None


def _point_ahead(path: tuple[tuple[float, float], ...], pose: Pose2, reach: float) -> tuple[float, float]:
    """The first point of the path at least `reach` away, past the one nearest to the robot."""
    distances = [math.hypot(x - pose.x, y - pose.y) for x, y in path]
    nearest = distances.index(min(distances))
    for point, distance in zip(path[nearest:], distances[nearest:], strict=True):
        if distance >= reach:
            return point
    return path[-1]
