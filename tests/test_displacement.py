"""When the base counts as moved, and when that is over: every look is written by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot import displacement, faults
from robot.displacement import (
    CONTRADICTION,
    LOOKS,
    SILENCE_S,
    STILL_S,
    Displacement,
    contradicts,
    set_down,
    updated,
)
from robot.messages import EgoMotion, Pose2, Timed

GAP = 0.12
STILL = EgoMotion(
    since=0.0, wheels=Pose2(), eyes=Pose2(), lift=0.0, roll=0.0, pitch=0.0, sigma=(0.0005, 0.0005, 0.0005),
    deviation=0.4, points=80, inliers=78, dissent=0.0,
)  # fmt: skip
PUSHED = replace(STILL, eyes=Pose2(0.0, 0.036, 0.08), deviation=12.0)
RISING = replace(STILL, lift=0.036, deviation=9.0)
SINKING = replace(STILL, lift=-0.036, deviation=9.0)
SLOW_PUSH = replace(STILL, eyes=Pose2(0.0, 0.04, 0.0), deviation=9.0)
SLOW_LIFT = replace(STILL, lift=0.045, deviation=9.0)
RISING_SLOWLY = replace(STILL, lift=0.006, deviation=1.4)
SINKING_SLOWLY = replace(STILL, lift=-0.006, deviation=1.4)
DRIVING = replace(STILL, wheels=Pose2(0.03), eyes=Pose2(0.0299))


def told(
    looks: list[EgoMotion | None], begin: float = 0.0, state: Displacement | None = None
) -> Displacement:
    """The state after these looks, one every GAP; None: nothing was seen then."""
    state = state or Displacement()
    seen: Timed[EgoMotion] | None = None
    for k, look in enumerate(looks):
        at = begin + GAP * (k + 1)
        if look is not None:
            seen = Timed(replace(look, since=at - GAP), at)
        state = updated(state, seen, at + 0.04)
    return state


def test_two_looks_that_contradict_the_wheels_are_the_fault() -> None:
    once = told([STILL, STILL, PUSHED])
    assert not once.told, "one odd picture is none"
    assert displacement.faults(once) == ()
    twice = told([STILL, STILL, PUSHED, PUSHED])
    (fault,) = displacement.faults(twice)
    assert fault.key == "base.moved"
    assert fault.since == pytest.approx(4 * GAP)
    assert fault.evidence == (
        "eyes: 3.6 cm, turn 4.6 deg, up 0.0 cm, lean 0.0 deg; wheels: 0.0 cm, turn 0.0 deg; in 0.12 s"
    )
    assert faults.row(fault).action is faults.Action.STOP


def test_a_look_that_saw_nothing_between_them_does_not_hide_it() -> None:
    assert told([STILL, RISING, None, RISING]).told


def test_contradictions_far_apart_are_not_one_motion() -> None:
    assert not told([PUSHED, *[STILL] * 5, PUSHED, *[STILL] * 5, PUSHED]).told


def test_the_same_look_told_again_counts_once() -> None:
    seen = Timed(PUSHED, 0.12)
    state = Displacement()
    for tick in range(10):
        state = updated(state, seen, 0.12 + 0.04 * tick)
    assert not state.told


@pytest.mark.parametrize(
    "harmless",
    [
        replace(PUSHED, deviation=CONTRADICTION - 0.1),
        replace(PUSHED, dissent=0.2),  # much sides with the wheels: a thing moves, not the base
        replace(PUSHED, inliers=44),  # not enough that moves alike
        DRIVING,
    ],
)
def test_what_is_no_contradiction_is_never_told(harmless: EgoMotion) -> None:
    assert contradicts(PUSHED)
    assert not contradicts(harmless)
    assert not told([harmless] * 50).told


def test_it_is_over_when_base_and_wheels_have_stood_still_for_a_second() -> None:
    moved = told([PUSHED, PUSHED])
    ticks = math.ceil(STILL_S / GAP)
    assert told([STILL] * (ticks - 1), 2 * GAP, moved).told
    after = told([STILL] * ticks, 2 * GAP, moved)
    assert not after.told
    assert not told([PUSHED], 2 * GAP + ticks * GAP, after).told, "it begins from nothing"


@pytest.mark.parametrize(
    "restless",
    [
        PUSHED,
        DRIVING,
        replace(STILL, eyes=Pose2(0.006)),
        replace(STILL, wheels=Pose2(yaw=0.02)),
        replace(STILL, lift=0.005),
        replace(STILL, roll=0.02),
    ],
)
def test_it_is_not_over_while_anything_moves(restless: EgoMotion) -> None:
    moved = told([PUSHED, PUSHED])
    assert told([*[STILL] * 6, restless] * 6, 2 * GAP, moved).told


def test_a_base_held_in_calm_hands_is_waited_for_until_it_is_set_down() -> None:
    up = told([RISING] * 3)
    assert up.told
    held = told([STILL] * 20, 3 * GAP, up)
    assert held.told, "2.4 s of calm, but it did not come down again"
    down = told([*[SINKING] * 3, *[STILL] * 9], 23 * GAP, held)
    assert not down.told


def test_no_time_ends_it_for_a_base_that_was_not_seen_to_come_down() -> None:
    up = told([RISING] * 3)
    assert up.away
    held = told([STILL] * 1000, 3 * GAP, up)
    assert held.told, "two minutes of calm"
    assert updated(held, None, 1003 * GAP + 10 * SILENCE_S).told, "nor does seeing nothing"


def test_a_person_may_say_that_it_stands() -> None:
    up = told([RISING] * 3)
    stands = set_down(told([STILL] * 30, 3 * GAP, up))
    assert stands.told, "that alone does not end it, or hands could be at it again"
    assert not told([STILL], 33 * GAP, stands).told
    assert told([RISING], 33 * GAP, stands).told


def test_a_base_that_goes_where_its_wheels_drive_it_is_on_the_floor() -> None:
    up = told([RISING] * 3)
    driven = told([DRIVING] * 4, 3 * GAP, up)
    assert driven.told, "it has not stood still yet"
    assert not driven.away
    assert not told([STILL] * math.ceil(STILL_S / GAP), 7 * GAP, driven).told


def test_a_base_that_rises_as_it_goes_where_its_wheels_drive_it_is_not_proved_to_be_on_the_floor() -> None:
    carried = replace(DRIVING, lift=0.036, deviation=9.0)
    assert told([carried] * 6, 3 * GAP, told([RISING] * 3)).away


def test_turning_on_the_spot_as_the_wheels_say_proves_the_floor_as_well() -> None:
    turning = replace(STILL, wheels=Pose2(yaw=0.1), eyes=Pose2(yaw=0.098))
    assert not told([turning] * 6, 3 * GAP, told([RISING] * 3)).away


@pytest.mark.parametrize(
    "no_proof",
    [
        replace(STILL, wheels=Pose2(0.03), deviation=7.0),  # turning in the air
        replace(STILL, wheels=Pose2(0.008), deviation=1.9),  # so slowly that it is no contradiction
        replace(STILL, wheels=Pose2(yaw=0.04), deviation=2.0),
        replace(STILL, wheels=Pose2(0.002), eyes=Pose2(0.002)),  # too little to tell
        STILL,
    ],
)
def test_wheels_that_turn_in_the_air_prove_nothing(no_proof: EgoMotion) -> None:
    up = told([RISING] * 3)
    assert told([DRIVING, *[no_proof] * 60], 3 * GAP, up).away
    if no_proof is not STILL and no_proof.wheels.x != 0.002:
        assert told([DRIVING, no_proof] * 40, 3 * GAP, up).away, "each of them begins the proof anew"


# ----------------------------------------------------------------------------------------------- slow hands


def told_slowly(
    looks: list[tuple[EgoMotion, EgoMotion | None]], begin: float = 0.0, state: Displacement | None = None
) -> Displacement:
    """The state after looks from picture to picture, each with the long one of the same picture."""
    state, long = state or Displacement(), None
    for k, (short, over_long) in enumerate(looks):
        at = begin + GAP * (k + 1)
        if over_long is not None:
            long = Timed(replace(over_long, since=at - 0.84), at)
        state = updated(state, Timed(replace(short, since=at - GAP), at), at + 0.04, long)
    return state


def test_slow_hands_are_told_by_two_long_looks() -> None:
    once = [(STILL, None), (STILL, SLOW_PUSH), (STILL, None)]
    assert not told_slowly(once).told
    state = told_slowly([*once, (STILL, SLOW_PUSH)])
    (fault,) = displacement.faults(state)
    assert fault.key == "base.moved"
    assert fault.since == pytest.approx(4 * GAP)
    assert fault.evidence.endswith("in 0.84 s")


def test_a_long_and_a_short_look_of_one_odd_picture_are_not_two() -> None:
    assert LOOKS == 2
    assert contradicts(SLOW_PUSH)
    assert not told_slowly([(STILL, None), (PUSHED, SLOW_PUSH), (STILL, None), (STILL, None)]).told


def test_a_slow_lift_told_by_its_wheels_that_spin_counts_from_where_it_began() -> None:
    """The wheels drive on, so short looks tell at once; the long one shows what it had risen by before."""
    spinning = replace(RISING_SLOWLY, wheels=Pose2(0.03), deviation=6.0)
    short = told([spinning] * 2)
    assert not short.away
    at = 3 * GAP
    up = updated(short, None, at, Timed(replace(SLOW_LIFT, since=at - 0.84), at))
    assert up.away
    assert up.risen == pytest.approx(0.045)
    later = Timed(replace(SLOW_LIFT, lift=-0.1, since=short.since or 0.0), at)
    assert updated(short, None, at, later).risen == short.risen, (
        "what it looks back to was in the air already"
    )


def test_a_slow_tip_counts_its_lean_from_where_it_began() -> None:
    lean = replace(STILL, roll=0.1, pitch=0.05, deviation=9.0)
    tipped = told_slowly([(STILL, lean), (STILL, lean)])
    assert (tipped.rolled, tipped.pitched) == (0.1, 0.05)
    assert tipped.away


def test_two_long_looks_back_at_one_odd_picture_are_one() -> None:
    state = Displacement()
    for at in (1.0, 1.24, 1.48):
        state = updated(state, None, at, Timed(replace(SLOW_PUSH, since=0.5), at))
    assert not state.told
    assert updated(state, None, 1.6, Timed(replace(SLOW_PUSH, since=0.9), 1.6)).told


def test_long_looks_of_two_fixations_of_the_head_go_together_but_not_more() -> None:
    first = updated(Displacement(), None, 1.0, Timed(replace(SLOW_PUSH, since=0.5), 1.0))
    assert updated(first, None, 2.1, Timed(replace(SLOW_PUSH, since=1.6), 2.1)).told
    assert not updated(first, None, 2.3, Timed(replace(SLOW_PUSH, since=1.8), 2.3)).told


def test_after_a_slow_push_it_is_over_a_second_after_it_stands() -> None:
    """The long looks still see the push for a while: they neither hold it nor begin it again."""
    moved = told_slowly([(STILL, SLOW_PUSH), (STILL, SLOW_PUSH)])
    assert moved.told
    ticks = math.ceil(STILL_S / GAP)
    after = told_slowly([(STILL, SLOW_PUSH)] * 6 + [(STILL, STILL)] * (ticks - 6), 2 * GAP, moved)
    assert not after.told


def test_what_a_slow_lift_rose_by_before_it_stood_out_counts() -> None:
    """Seen 4.5 cm up when told, 3 cm more after it: it must come down by both."""
    up = told_slowly([(RISING_SLOWLY, SLOW_LIFT)] * 2 + [(RISING_SLOWLY, None)] * 5)
    assert up.risen == pytest.approx(0.045 + 5 * 0.006)
    assert told([STILL] * 100, 7 * GAP, up).told
    half = told([*[SINKING_SLOWLY] * 5, *[STILL] * 20], 7 * GAP, up)
    assert half.told
    assert not told([*[SINKING_SLOWLY] * 7, *[STILL] * 9], 32 * GAP, half).told


def test_a_tipped_base_is_waited_for_as_well() -> None:
    tipped = told([replace(STILL, roll=0.12, deviation=14.0)] * 2)
    assert told([STILL] * 20, 2 * GAP, tipped).told
    back = [replace(STILL, roll=-0.12, deviation=14.0)] * 2
    assert not told([*back, *[STILL] * 9], 2 * GAP, tipped).told


def test_eyes_that_see_nothing_for_long_do_not_hold_the_robot_for_ever() -> None:
    moved = told([PUSHED, PUSHED])
    heard = 2 * GAP
    assert updated(moved, None, heard + SILENCE_S - 0.1).told
    assert not updated(moved, None, heard + SILENCE_S + 0.1).told


@settings(deadline=None, max_examples=60)
@given(st.lists(st.sampled_from([STILL, DRIVING, RISING_SLOWLY, None]), max_size=60))
def test_without_a_contradiction_it_is_never_told(looks: list[EgoMotion | None]) -> None:
    assert not told(looks).told


@settings(deadline=None, max_examples=60)
@given(st.lists(st.sampled_from([STILL, DRIVING, PUSHED, RISING, None]), max_size=60))
def test_two_contradictions_running_are_always_told(looks: list[EgoMotion | None]) -> None:
    assert told([*looks, PUSHED, RISING]).told
