"""RECOGNIZE: is the candidate really the target? Several agreeing looks are needed."""

from __future__ import annotations

import math

from robot.messages import Detection, Event, HeadPose, Intent, Situation, Want, wrap
from robot.states.behaviour import Behaviour

AGREE = math.radians(6.0)
"""A candidate that keeps its place changes its direction less than this between looks."""
SETTLING = 0.2
"""Seconds: pictures taken while the head still turns do not count."""
FRESH = 0.6
PATIENCE = 2.5
"""Seconds for each look: a busy computer looks seldom, and sees as well as any."""
LOOKS_FOR_EACH_AGREEING = 4
"""So many looks in all, for each that must agree, are enough to tell."""


class Recognize:
    """Stand still, look on, count looks that agree on the place; sure after `confirm_frames` of them."""

    def __init__(self, behaviour: Behaviour) -> None:
        self._behaviour = behaviour

    def enter(self, situation: Situation) -> None:
        """Start counting anew, the head turned to where the candidate was seen."""
        self._heard_at = situation.now
        self._last: Detection | None = None
        looks = situation.percepts.detections
        if looks is not None and looks.value and looks.age(situation.now) < FRESH:
            self._last = looks.value[0]
        self._seen_at = situation.now + SETTLING
        self._looks = 0
        self._agreeing = 0
        self._misses = 0

    def step(self, situation: Situation) -> tuple[Intent, Event | None]:
        """Count the newest look; leave when sure, or when looks miss, disagree or do not come."""
        intent = Intent(look=self._look(situation), wants=frozenset({Want.RECOGNIZE}))
        self._count(situation)
        needed = self._behaviour.confirm_frames
        if self._agreeing >= needed and self._last is not None:
            evidence = {"looks": self._agreeing, "score": self._last.score, "azimuth": self._last.azimuth}
            return intent, Event("target_confirmed", f"{self._agreeing} looks agree", evidence)
        none_comes = situation.now - self._heard_at > PATIENCE
        if none_comes or self._misses >= needed or self._looks >= LOOKS_FOR_EACH_AGREEING * needed:
            evidence = {"looks": self._looks, "agreeing": self._agreeing, "misses": self._misses}
            return intent, Event("candidate_rejected", "the candidate did not last", evidence)
        return intent, None

    def _look(self, situation: Situation) -> HeadPose:
        rest = self._behaviour.rest_tilt
        if self._last is None:
            return HeadPose(situation.head.pan, rest)
        pan = wrap(self._last.azimuth - situation.odometry.pose.yaw)
        return HeadPose(max(-self._behaviour.pan_limit, min(self._behaviour.pan_limit, pan)), rest)

    def _count(self, situation: Situation) -> None:
        looks = situation.percepts.detections
        if looks is None or looks.at <= self._seen_at:
            return
        self._seen_at, self._heard_at = looks.at, situation.now
        self._looks += 1
        if not looks.value:
            self._misses += 1
            self._agreeing = 0
            return
        best = looks.value[0]
        self._agreeing = self._agreeing + 1 if self._last is None or _near(best, self._last) else 1
        self._last = best


def _near(a: Detection, b: Detection) -> bool:
    return abs(wrap(a.azimuth - b.azimuth)) < AGREE
