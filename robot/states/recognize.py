"""RECOGNIZE: is the candidate really the target? Several agreeing looks are needed."""

from __future__ import annotations

import math

from robot.messages import Detection, Event, HeadPose, Intent, Situation, Want
from robot.states.behaviour import Behaviour

AGREE_PX = 40.0  # a candidate that keeps its place moves less than this between looks
PATIENCE = 2.5  # seconds for all looks together


class Recognize:
    """Stand still, look on, count looks that agree on the place; sure after `confirm_frames` of them."""

    def __init__(self, behaviour: Behaviour) -> None:
        self._behaviour = behaviour

    def enter(self, situation: Situation) -> None:
        """Start counting anew, with the head where it is."""
        self._since = situation.now
        self._head = situation.head
        self._seen_at = situation.now
        self._last: Detection | None = None
        self._agreeing = 0
        self._misses = 0

    def step(self, situation: Situation) -> tuple[Intent, Event | None]:
        """Count the newest look; leave when sure, or when looks miss or time runs out."""
        intent = Intent(look=HeadPose(self._head.pan, self._head.tilt), wants=frozenset({Want.RECOGNIZE}))
        self._count(situation)
        waited = situation.now - self._since
        if self._agreeing >= self._behaviour.confirm_frames and self._last is not None:
            evidence = {"looks": self._agreeing, "score": self._last.score, "u_px": self._last.box.centre[0]}
            return intent, Event("target_confirmed", f"{self._agreeing} looks agree", evidence)
        if self._misses >= self._behaviour.confirm_frames or waited > PATIENCE:
            evidence = {"looks": self._agreeing, "misses": self._misses}
            return intent, Event("candidate_rejected", "the candidate did not last", evidence)
        return intent, None

    def _count(self, situation: Situation) -> None:
        looks = situation.percepts.detections
        if looks is None or looks.at <= self._seen_at:
            return
        self._seen_at = looks.at
        if not looks.value:
            self._misses += 1
            self._agreeing = 0
            return
        best = looks.value[0]
        self._agreeing = self._agreeing + 1 if self._last is None or _near(best, self._last) else 1
        self._last = best


def _near(a: Detection, b: Detection) -> bool:
    (ua, va), (ub, vb) = a.box.centre, b.box.centre
    return math.hypot(ua - ub, va - vb) < max(AGREE_PX, 0.5 * a.box.w)
