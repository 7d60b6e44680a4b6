"""Whether the base was lifted, tipped or pushed, or its wheels slip: what the eyes saw against the wheels.

Pure: `updated` takes the state so far and the newest `EgoMotion` and gives the next state; `faults` words it.
One odd picture is no fault, nor is a thing that fills the picture and moves by itself: only a motion nearly
everything seen agrees on, far beyond all doubts, in two looks within a short time. It is over when wheels and
eyes have agreed for a second that the base stands still; a base that was seen to rise or lean and not to come
back is waited for longer, for it may be held in hands that are calm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from robot.messages import EgoMotion, Fault, Pose2, Timed

CONTRADICTION = 5.0
"""Standard deviations in all six directions together; in the twelve scenes driving normally stays below 4."""
LARGEST_DISSENT, LEAST_AGREEMENT = 0.1, 0.6
"""Share of the points that may side with the wheels, and that must move as the eyes say."""
LOOKS, WITHIN_S = 2, 0.5
"""So many contradictions within this time are the fault."""
STILL_S = 1.0
STILL_M_S, STILL_RAD_S = 0.02, math.radians(4.0)
"""Slower than this is still."""
AWAY_M, AWAY_RAD = 0.04, math.radians(6.0)
"""Net rise or lean since the first contradiction that means: not yet set down again."""
PATIENCE_S = 8.0
"""So long a base that seems not set down must be still: the eyes may have missed how it was."""
SILENCE_S = 5.0
"""Eyes that saw too little for so long no longer uphold what they said."""


@dataclass(frozen=True, slots=True)
class Displacement:
    """What is known of it. since: when the fault began, None while there is none."""

    since: float | None = None
    evidence: str = ""
    heard_at: float = -math.inf
    contradictions: tuple[float, ...] = ()
    still_since: float | None = None
    risen: float = 0.0
    rolled: float = 0.0
    pitched: float = 0.0

    @property
    def told(self) -> bool:
        """True while the fault holds."""
        return self.since is not None


def contradicts(motion: EgoMotion) -> bool:
    """True if what the eyes saw cannot be what the wheels say."""
    return (
        motion.deviation >= CONTRADICTION
        and motion.dissent <= LARGEST_DISSENT
        and motion.inlier_share >= LEAST_AGREEMENT
    )


def updated(before: Displacement, seen: Timed[EgoMotion] | None, now: float) -> Displacement:
    """The state at `now`. seen: the newest look; one that was taken in already changes nothing.

    >>> updated(Displacement(), None, now=3.0).told
    False
    """
    if seen is not None and seen.at > before.heard_at:
        return _heard(before, seen.value, seen.at)
    if before.told and now - before.heard_at > SILENCE_S:
        return Displacement(heard_at=before.heard_at)
    return before


def faults(state: Displacement) -> tuple[Fault, ...]:
    """`base.moved` while it holds."""
    return () if state.since is None else (Fault("base", "moved", state.since, state.evidence),)


def _heard(before: Displacement, motion: EgoMotion, at: float) -> Displacement:
    recent = tuple(past for past in before.contradictions if at - past <= WITHIN_S)
    against = contradicts(motion)
    if against:
        recent = (*recent, at)
    state = replace(before, heard_at=at, contradictions=recent)
    if before.told or recent:
        state = replace(
            state,
            risen=before.risen + motion.lift,
            rolled=before.rolled + motion.roll,
            pitched=before.pitched + motion.pitch,
        )
    else:
        state = replace(state, risen=0.0, rolled=0.0, pitched=0.0)
    if not before.told:
        if len(recent) < LOOKS:
            return state
        return replace(state, since=at, evidence=_words(motion), still_since=None)
    if against or not _still(motion, at):
        return replace(state, still_since=None)
    still_since = motion.since if before.still_since is None else before.still_since
    if at - still_since >= (PATIENCE_S if _away(state) else STILL_S):
        return Displacement(heard_at=at)
    return replace(state, still_since=still_since)


def _still(motion: EgoMotion, at: float) -> bool:
    gap = max(at - motion.since, 1e-3)
    leans = max(abs(motion.roll), abs(motion.pitch))
    return (
        all(_slow(step, gap) for step in (motion.wheels, motion.eyes))
        and abs(motion.lift) <= STILL_M_S * gap
        and leans <= max(STILL_RAD_S * gap, math.radians(0.6))
    )


def _slow(step: Pose2, gap: float) -> bool:
    return math.hypot(step.x, step.y) <= STILL_M_S * gap + 0.001 and abs(step.yaw) <= STILL_RAD_S * gap


def _away(state: Displacement) -> bool:
    return abs(state.risen) > AWAY_M or math.hypot(state.rolled, state.pitched) > AWAY_RAD


def _words(motion: EgoMotion) -> str:
    """The motion in centimetres and degrees, the eyes' beside the wheels'."""
    eyes, wheels = motion.eyes, motion.wheels
    lean = math.degrees(math.hypot(motion.roll, motion.pitch))
    return (
        f"eyes: {_step_words(eyes)}, up {100 * motion.lift:.1f} cm, lean {lean:.1f} deg; "
        f"wheels: {_step_words(wheels)}"
    )


def _step_words(step: Pose2) -> str:
    return f"{100 * math.hypot(step.x, step.y):.1f} cm, turn {math.degrees(step.yaw):.1f} deg"
