"""TRACK: follow the target at the set distance, eyes on it, as long as the straight way is free."""

from __future__ import annotations

import math

import numpy as np

from robot.messages import Approach, Event, HeadPose, Hold, Intent, Range, Situation, Timed, Want
from robot.nav.grid import ObstacleMap
from robot.nav.planner import corridor_free
from robot.states.behaviour import Behaviour, distance_between, look_at_place, pan_towards

SEARCH_AFTER = 1.2  # seconds after which the whole picture is searched, not only where the target must be
LOST_AFTER = 2.2  # seconds without a good track; a glance at the floor takes one of them
BLOCKED_FOR = 0.2  # seconds the way must look blocked before a detour is made
STUCK_AFTER = 2.5  # seconds without coming nearer although there is way to go


class Track:
    """Head and wheels follow the target; leaves when it is lost or something stands between."""

    def __init__(self, behaviour: Behaviour, obstacle_map: ObstacleMap) -> None:
        self._behaviour = behaviour
        self._map = obstacle_map

    def enter(self, situation: Situation) -> None:
        """Nothing was lost, blocked or stuck yet."""
        self._entered = self._good_at = situation.now
        self._look = situation.head
        self._free_at = situation.now
        self._moved_at = situation.now

    def step(self, situation: Situation) -> tuple[Intent, Event | None]:
        """Follow; say so when the target is lost, the way is blocked, or something is more like it."""
        now = situation.now
        target = self._good_target(situation)
        if target is None:
            self._look = self._look_for(situation)
            wants = {Want.TRACK}
            if now - self._good_at > SEARCH_AFTER:
                wants.add(Want.RECOGNIZE)
            intent = Intent(look=self._look, motion=Hold(), wants=frozenset(wants))
            if now - self._good_at > LOST_AFTER:
                return intent, Event("target_lost", "the track was lost", {"for_s": now - self._good_at})
            return intent, None
        self._good_at = now
        x, y = self._place_now(situation, target)
        self._look = self._follow_with_head(x, y, target.value.position[2])
        motion = Approach(target.value.distance, math.atan2(y, x), self._behaviour.stand_off)
        intent = Intent(look=self._look, motion=motion, wants=frozenset({Want.TRACK, Want.REVIEW}))
        return intent, self._better(situation) or self._blocked(situation, target.value)

    def _better(self, situation: Situation) -> Event | None:
        better = situation.percepts.better
        if better is None or better.at <= self._entered:
            return None
        evidence = {"score": better.value.score, "azimuth": better.value.azimuth}
        return Event("candidate_seen", "something looks more like the target", evidence)

    def _look_for(self, situation: Situation) -> HeadPose:
        place = situation.percepts.place
        return (
            self._look
            if place is None
            else look_at_place(place.value, situation.odometry.pose, self._behaviour)
        )

    def _good_target(self, situation: Situation) -> Timed[Range] | None:
        track, target = situation.percepts.track, situation.percepts.target
        if track is None or track.value.lost or target is None or target.age(situation.now) > 0.4:
            return None
        return target

    def _place_now(self, situation: Situation, target: Timed[Range]) -> tuple[float, float]:
        """The target in the robot's present frame: what was seen, less what the base moved since."""
        place = situation.percepts.place
        if place is None or place.at != target.at:
            return target.value.position[0], target.value.position[1]
        local = situation.odometry.pose.to_local(np.array([place.value]))[0]
        return float(local[0]), float(local[1])

    def _follow_with_head(self, x: float, y: float, z: float) -> HeadPose:
        pan = pan_towards(x, y, self._behaviour)
        reach = max(math.hypot(x - self._behaviour.head_forward, y), 0.1)
        down = math.atan2(self._behaviour.head_height - z, reach)
        # The floor just ahead must stay in view, so the head follows up and down only a little.
        rest = self._behaviour.rest_tilt
        return HeadPose(pan, max(rest - 0.1, min(rest + 0.17, down)))

    def _blocked(self, situation: Situation, target: Range) -> Event | None:
        now, pose = situation.now, situation.odometry.pose
        to_go = target.distance - self._behaviour.stand_off
        if situation.percepts.place is None or to_go < 0.15:
            self._free_at = self._moved_at = now
            return None
        place = situation.percepts.place.value
        distance = distance_between(pose, place)
        share = max(to_go, 0.0) / max(distance, 1e-6)
        stop = (pose.x + share * (place[0] - pose.x), pose.y + share * (place[1] - pose.y))
        if corridor_free(self._map, (pose.x, pose.y), stop, self._behaviour.body_radius):
            self._free_at = now
        if abs(situation.odometry.twist.v) > 0.02 or abs(situation.odometry.twist.w) > 0.1:
            self._moved_at = now
        evidence = {"distance_m": target.distance, "bearing_rad": target.bearing}
        if now - self._free_at > BLOCKED_FOR:
            return Event("way_blocked", "something stands in the straight way", evidence)
        if now - self._moved_at > STUCK_AFTER:
            return Event("way_blocked", "no way was made", evidence)
        return None
