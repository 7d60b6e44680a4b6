"""RANGE: bring the target between the axes of the eyes and measure how far it is."""

from __future__ import annotations

import statistics

from robot.messages import Event, HeadPose, Intent, Situation, Want
from robot.states.behaviour import Behaviour, pan_towards

SAMPLES = 5
PATIENCE = 3.0
LARGEST_SIGMA_SHARE = 0.12


class Range:
    """Stand still, turn the head to the target, take the median of several ranges that agree."""

    def __init__(self, behaviour: Behaviour) -> None:
        self._behaviour = behaviour

    def enter(self, situation: Situation) -> None:
        """Start with no samples, the head where it is."""
        self._since = situation.now
        self._seen_at = situation.now
        self._look = situation.head
        self._samples: list[float] = []

    def step(self, situation: Situation) -> tuple[Intent, Event | None]:
        """Collect ranges; leave with their median, or without if the target does not hold still in view."""
        self._measure(situation)
        intent = Intent(look=self._look, wants=frozenset({Want.TRACK}))
        if len(self._samples) >= SAMPLES:
            median = statistics.median(self._samples)
            spread = max(self._samples) - min(self._samples)
            if spread <= 4 * LARGEST_SIGMA_SHARE * median:
                evidence = {"distance_m": median, "spread_m": spread, "samples": len(self._samples)}
                return intent, Event("target_ranged", "the ranges agree", evidence)
            self._samples.clear()
        if situation.now - self._since > PATIENCE:
            return intent, Event("target_lost", "no agreeing ranges", {"samples": len(self._samples)})
        return intent, None

    def _measure(self, situation: Situation) -> None:
        target, track = situation.percepts.target, situation.percepts.track
        if target is None or track is None or track.value.lost or target.at <= self._seen_at:
            return
        self._seen_at = target.at
        x, y, _ = target.value.position
        self._look = HeadPose(pan_towards(x, y, self._behaviour), self._behaviour.rest_tilt)
        if target.value.sigma <= LARGEST_SIGMA_SHARE * target.value.distance:
            self._samples.append(target.value.distance)
            del self._samples[:-SAMPLES]
