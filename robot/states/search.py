"""SEARCH: look where the target was last, sweep the head, turn, then move to the next best view."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise

from robot.messages import (
    Detection,
    Event,
    Follow,
    HeadPose,
    Hold,
    Intent,
    Motion,
    Pose2,
    Situation,
    Turn,
    Want,
    wrap,
)
from robot.nav.grid import ObstacleMap
from robot.nav.nextview import next_view
from robot.nav.planner import plan
from robot.states.behaviour import Behaviour, look_at_place

SWEEP_PANS = (0.0, math.radians(56.0), math.radians(-56.0))
TURN = math.radians(120.0)  # two of them and three sweeps see all round
FEET_TILT = math.radians(45.0)
SETTLED = math.radians(2.5)
TURN_PATIENCE = 6.0
LOOK_PATIENCE = 2.5
HINT_PICTURES = 5  # where the target was last is worth a longer look
SWING = math.radians(20.0)  # looking about on the way, the way itself still in view
SWING_PERIOD = 3.0
REJECTED_FOR = 5.0  # a rejected direction is not tried again for so long


@dataclass(frozen=True, slots=True)
class Look:
    """Point the head and wait until `pictures` taken after it settled were searched through."""

    head: HeadPose
    pictures: int = 2


@dataclass(frozen=True, slots=True)
class Glance:
    """Point the head and wait until the floor there was measured after it settled."""

    head: HeadPose


@dataclass(frozen=True, slots=True)
class TurnBy:
    """Turn on the spot by an angle from wherever the turn begins."""

    angle: float


@dataclass(frozen=True, slots=True)
class TurnTo:
    """Turn on the spot to a heading in the odometry frame."""

    heading: float


@dataclass(frozen=True, slots=True)
class Travel:
    """Drive a path, looking about."""

    motion: Follow
    patience: float


Step = Look | Glance | TurnBy | TurnTo | Travel


class Search:
    """A list of steps; the first detection ends it, an exhausted room or the time-out gives up."""

    def __init__(self, behaviour: Behaviour, obstacle_map: ObstacleMap) -> None:
        self._behaviour = behaviour
        self._map = obstacle_map
        self._since: float | None = None
        self._rejected: tuple[float, float] | None = None  # (azimuth, when)
        self._visited: list[tuple[float, float]] = []

    def enter(self, situation: Situation) -> None:
        """Begin with the last known place if there is one; the time-out counts from the last sight."""
        place = situation.percepts.place
        if self._since is None or (place is not None and place.at > self._since):
            self._since = situation.now
            self._visited.clear()
        self._entered = situation.now
        self._steps: deque[Step] = deque()
        if place is not None and situation.now - place.at < 20.0:
            self._steps.extend(self._steps_towards(place.value, situation.odometry.pose))
        self._steps.extend(self._sweep())
        for _ in range(2):
            self._steps.append(TurnBy(TURN))
            self._steps.extend(self._sweep())
        self._begun: float | None = None
        self._settled_at: float | None = None
        self._searched = 0
        self._heading: float | None = None

    def step(self, situation: Situation) -> tuple[Intent, Event | None]:
        """Do the next look or move; say so when something like the target is in view."""
        found = self._candidate(situation)
        if found is not None:
            return self._intent(HeadPose(situation.head.pan, situation.head.tilt), Hold()), found
        assert self._since is not None
        if situation.now - self._since > self._behaviour.search_timeout:
            return self._give_up(situation, "the search time is over")
        if not self._steps and not self._extend(situation):
            return self._give_up(situation, "everything within reach was looked at")
        current = self._steps[0]
        if self._begun is None:
            self._begun = situation.now
            self._settled_at = None
            self._searched = 0
            self._heading = None
        look, motion, done = self._do(current, situation)
        if done:
            self._steps.popleft()
            self._begun = None
        return self._intent(look, motion), None

    def _intent(self, look: HeadPose, motion: Motion) -> Intent:
        return Intent(look=look, motion=motion, wants=frozenset({Want.RECOGNIZE}))

    def _sweep(self) -> list[Step]:
        rest = self._behaviour.rest_tilt
        return [Glance(HeadPose(0.0, FEET_TILT)), *(Look(HeadPose(pan, rest)) for pan in SWEEP_PANS)]

    def _steps_towards(self, place: tuple[float, float], pose: Pose2) -> list[Step]:
        head = look_at_place(place, pose, self._behaviour)
        bearing = math.atan2(place[1] - pose.y, place[0] - pose.x) - pose.yaw
        if abs(wrap(bearing)) > self._behaviour.pan_limit:
            return [TurnBy(wrap(bearing)), Look(HeadPose(0.0, self._behaviour.rest_tilt), HINT_PICTURES)]
        return [Look(head, HINT_PICTURES)]

    def _do(self, step: Step, situation: Situation) -> tuple[HeadPose, Motion, bool]:
        match step:
            case Look() | Glance():
                return step.head, Hold(), self._looked(step, situation)
            case TurnBy():
                if self._heading is None:
                    self._heading = wrap(situation.odometry.pose.yaw + step.angle)
                return self._turn(self._heading, situation)
            case TurnTo():
                return self._turn(step.heading, situation)
            case Travel():
                return self._travel(step, situation)

    def _turn(self, heading: float, situation: Situation) -> tuple[HeadPose, Motion, bool]:
        off = abs(wrap(heading - situation.odometry.pose.yaw))
        return self._ahead(), Turn(heading), off < SETTLED or self._waited(situation) > TURN_PATIENCE

    def _travel(self, step: Travel, situation: Situation) -> tuple[HeadPose, Motion, bool]:
        pose, end = situation.odometry.pose, step.motion.path[-1]
        arrived = math.hypot(end[0] - pose.x, end[1] - pose.y) < 0.08
        swing = SWING * math.sin(math.tau * self._waited(situation) / SWING_PERIOD)
        return (
            HeadPose(swing, self._behaviour.rest_tilt),
            step.motion,
            arrived or self._waited(situation) > step.patience,
        )

    def _looked(self, step: Look | Glance, situation: Situation) -> bool:
        head = situation.head
        if self._settled_at is None:
            if abs(head.pan - step.head.pan) < SETTLED and abs(head.tilt - step.head.tilt) < SETTLED:
                self._settled_at = situation.now
            return self._waited(situation) > LOOK_PATIENCE
        percepts = situation.percepts
        result = percepts.detections if isinstance(step, Look) else percepts.free_space
        if result is not None and result.at >= self._settled_at:
            self._settled_at = math.nextafter(result.at, math.inf)  # the same picture counts once
            self._searched += 1
        wanted = step.pictures if isinstance(step, Look) else 1
        return self._searched >= wanted or self._waited(situation) > LOOK_PATIENCE

    def _waited(self, situation: Situation) -> float:
        assert self._begun is not None
        return situation.now - self._begun

    def _ahead(self) -> HeadPose:
        return HeadPose(0.0, self._behaviour.rest_tilt)

    def _candidate(self, situation: Situation) -> Event | None:
        looks = situation.percepts.detections
        if looks is None or not looks.value or looks.at <= self._entered:
            return None
        best: Detection = looks.value[0]
        if self._rejected is not None:
            old, when = self._rejected
            if situation.now - when < REJECTED_FOR and abs(wrap(best.azimuth - old)) < math.radians(15.0):
                return None
        self._rejected = (best.azimuth, situation.now)
        evidence = {"score": best.score, "azimuth": best.azimuth, "height_px": best.box.h}
        return Event("candidate_seen", f"something looks like {best.label}", evidence)

    def _extend(self, situation: Situation) -> bool:
        pose = situation.odometry.pose
        self._visited.append((pose.x, pose.y))
        view = next_view(self._map, pose, tuple(self._visited), self._behaviour.body_radius)
        if view is None:
            return False
        x, y, heading = view
        radius, margin = self._behaviour.body_radius, self._behaviour.margin
        path = plan(self._map, (pose.x, pose.y), (x, y), radius, margin)
        if path is None:
            return False
        length = sum(math.dist(a, b) for a, b in pairwise(path))
        self._steps.append(Travel(Follow(path), 6.0 + length / 0.1))
        self._steps.append(TurnTo(heading))
        self._steps.extend(self._sweep())
        return True

    def _give_up(self, situation: Situation, why: str) -> tuple[Intent, Event | None]:
        assert self._since is not None
        searched = situation.now - self._since
        self._since = None
        event = Event(
            "given_up", f"target not found: {why}", {"searched_s": searched, "views": len(self._visited)}
        )
        return Intent(look=self._ahead()), event
