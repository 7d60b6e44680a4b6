"""Whether the base was lifted, tipped or pushed, or its wheels slip: what the eyes saw against the wheels.

Pure: `updated` takes the state so far and the newest looks and gives the next state; `faults` words it.
One odd picture is no fault, nor is a thing that fills the picture and moves by itself: only a motion nearly
everything seen agrees on, far beyond all doubts, in two looks within a short time. Fast hands are told by the
looks from picture to picture, slow ones by the long looks over most of a second, both by the same rule.

It is over when wheels and eyes have agreed for a second that the base stands still. A base that was seen to
rise or lean, and not to come back, is in somebody's hands however calm they are: no time ends that, for what
resumes by itself must not drive in the air. It must be seen to come down, or to go where its wheels drive it
(a person at the stick does that), or a person must say that it stands (`set_down`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from robot.messages import EgoMotion, Fault, Pose2, Timed

CONTRADICTION = 5.0
"""Standard deviations in all six directions together; undisturbed, the twelve scenes stay below
4.1 from picture to picture and below 2.3 over a long look."""
LARGEST_DISSENT, LEAST_AGREEMENT = 0.1, 0.6
"""Share of the points that may side with the wheels, and that must move as the eyes say."""
LOOKS, WITHIN_S, LONG_WITHIN_S = 2, 0.5, 1.2
"""So many contradictions within this time are the fault. Long looks are rare while the head looks about."""
STILL_S = 1.0
STILL_M_S, STILL_RAD_S = 0.02, math.radians(4.0)
"""Slower than this is still."""
AWAY_M, AWAY_RAD = 0.03, math.radians(6.0)
"""Net rise or lean since the first contradiction that means: not yet set down again."""
GROUNDED_M, GROUNDED_RAD = 0.08, math.radians(25.0)
"""So far the base must have gone just as its wheels drove it to be on the floor beyond doubt."""
LEAST_DRIVEN_M, LEAST_TURNED_RAD, SAME_SHARE = 0.004, math.radians(1.0), 0.3
"""Of one look that shows it: the wheels moved so much, and the eyes saw the same but for this share."""
SILENCE_S = 5.0
"""Eyes that saw too little for so long no longer uphold what they said; unless the base left the floor."""


@dataclass(frozen=True, slots=True)
class Displacement:
    """What is known of it. since: when the fault began, None while there is none.

    heard_at, long_heard_at: times of the newest looks taken in; contradictions: times of the recent ones;
    long_contradictions: times of both pictures of the recent long ones, the earlier first. risen, rolled,
    pitched: away from the floor since it began; grounded: share of what proves the floor.
    """

    since: float | None = None
    evidence: str = ""
    heard_at: float = -math.inf
    long_heard_at: float = -math.inf
    contradictions: tuple[float, ...] = ()
    long_contradictions: tuple[tuple[float, float], ...] = ()
    still_since: float | None = None
    risen: float = 0.0
    rolled: float = 0.0
    pitched: float = 0.0
    grounded: float = 0.0

    @property
    def told(self) -> bool:
        """True while the fault holds."""
        return self.since is not None

    @property
    def away(self) -> bool:
        """True if by all that was seen it has left the floor, or leans, and has not come back."""
        return abs(self.risen) > AWAY_M or math.hypot(self.rolled, self.pitched) > AWAY_RAD


def contradicts(motion: EgoMotion) -> bool:
    """True if what the eyes saw cannot be what the wheels say."""
    return (
        motion.deviation >= CONTRADICTION
        and motion.dissent <= LARGEST_DISSENT
        and motion.inlier_share >= LEAST_AGREEMENT
    )


def updated(
    before: Displacement, seen: Timed[EgoMotion] | None, now: float, over_long: Timed[EgoMotion] | None = None
) -> Displacement:
    """The state at `now`. seen: the newest look from picture to picture, over_long: the newest long one.

    A look that was taken in already changes nothing.

    >>> updated(Displacement(), None, now=3.0).told
    False
    """
    state = before
    if seen is not None and seen.at > before.heard_at:
        state = _heard(state, seen.value, seen.at)
    if over_long is not None and over_long.at > before.long_heard_at:
        state = _heard_long(state, over_long.value, over_long.at)
    silence = now - max(state.heard_at, state.long_heard_at)
    if state.told and not state.away and silence > SILENCE_S:
        return _over(state)
    return state


def set_down(before: Displacement) -> Displacement:
    """A person says that the base stands on its wheels: what was seen of its being away counts no more.

    The fault itself still ends by standing still: whoever says so too early is not believed for long.

    >>> set_down(Displacement(since=1.0, risen=0.3)).away
    False
    """
    return replace(before, risen=0.0, rolled=0.0, pitched=0.0, grounded=0.0)


def faults(state: Displacement) -> tuple[Fault, ...]:
    """`base.moved` while it holds."""
    return () if state.since is None else (Fault("base", "moved", state.since, state.evidence),)


def _heard(before: Displacement, motion: EgoMotion, at: float) -> Displacement:
    against = contradicts(motion)
    recent = tuple(past for past in before.contradictions if at - past <= WITHIN_S)
    recent = (*recent, at) if against else recent
    state = replace(before, heard_at=at, contradictions=recent)
    if before.told or recent:
        state = replace(
            state,
            risen=before.risen + motion.lift,
            rolled=before.rolled + motion.roll,
            pitched=before.pitched + motion.pitch,
        )
    else:
        state = set_down(state)
    if not before.told:
        return _begun(state, motion, at) if len(recent) >= LOOKS else state
    state = _weighed(state, motion, against)
    if against or not _still(motion, at):
        return replace(state, still_since=None)
    still_since = motion.since if before.still_since is None else before.still_since
    if at - still_since >= STILL_S and not state.away:
        return _over(state)
    return replace(state, still_since=still_since)


def _heard_long(before: Displacement, motion: EgoMotion, at: float) -> Displacement:
    """A long look begins the fault; once it is told, the looks from picture to picture follow it."""
    state = replace(before, long_heard_at=at)
    if before.since is not None:
        return _risen_at_least(state, motion) if motion.since < before.since - WITHIN_S else state
    recent = tuple(pair for pair in before.long_contradictions if at - pair[1] <= LONG_WITHIN_S)
    if contradicts(motion) and all(since != motion.since for since, _ in recent):
        recent = (*recent, (motion.since, at))  # one odd picture, looked back to twice, is one
    state = replace(state, long_contradictions=recent)
    return _begun(_risen_at_least(state, motion), motion, at) if len(recent) >= LOOKS else state


def _risen_at_least(state: Displacement, over_all: EgoMotion) -> Displacement:
    """With what a look back to before the first contradiction shows: hands that lift slowly began unseen."""
    if abs(over_all.lift) > abs(state.risen):
        state = replace(state, risen=over_all.lift)
    if math.hypot(over_all.roll, over_all.pitch) > math.hypot(state.rolled, state.pitched):
        state = replace(state, rolled=over_all.roll, pitched=over_all.pitch)
    return state


def _begun(state: Displacement, motion: EgoMotion, at: float) -> Displacement:
    return replace(state, since=at, evidence=_words(motion, at), still_since=None, grounded=0.0)


def _over(state: Displacement) -> Displacement:
    return Displacement(heard_at=state.heard_at, long_heard_at=state.long_heard_at)


def _weighed(state: Displacement, motion: EgoMotion, against: bool) -> Displacement:
    """With what this look adds to the proof that the wheels are on the floor: they drove, the eyes agree."""
    if against:
        return replace(state, grounded=0.0)
    wheels, eyes = motion.wheels, motion.eyes
    way, turn = math.hypot(wheels.x, wheels.y), abs(wheels.yaw)
    apart = math.hypot(eyes.x - wheels.x, eyes.y - wheels.y)
    drove, turned = way >= LEAST_DRIVEN_M, turn >= LEAST_TURNED_RAD
    if not drove and not turned:
        return state
    if (drove and apart > SAME_SHARE * way) or (turned and abs(eyes.yaw - wheels.yaw) > SAME_SHARE * turn):
        return replace(state, grounded=0.0)
    grounded = state.grounded + way / GROUNDED_M + turn / GROUNDED_RAD
    return set_down(state) if grounded >= 1.0 else replace(state, grounded=grounded)


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


def _words(motion: EgoMotion, at: float) -> str:
    """The motion in centimetres and degrees, the eyes' beside the wheels'."""
    eyes, wheels = motion.eyes, motion.wheels
    lean = math.degrees(math.hypot(motion.roll, motion.pitch))
    return (
        f"eyes: {_step_words(eyes)}, up {100 * motion.lift:.1f} cm, lean {lean:.1f} deg; "
        f"wheels: {_step_words(wheels)}; in {at - motion.since:.2f} s"
    )


def _step_words(step: Pose2) -> str:
    return f"{100 * math.hypot(step.x, step.y):.1f} cm, turn {math.degrees(step.yaw):.1f} deg"
