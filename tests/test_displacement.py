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
    PATIENCE_S,
    SILENCE_S,
    STILL_S,
    Displacement,
    contradicts,
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
        "eyes: 3.6 cm, turn 4.6 deg, up 0.0 cm, lean 0.0 deg; wheels: 0.0 cm, turn 0.0 deg"
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


def test_a_base_that_came_down_unseen_is_free_after_some_patience() -> None:
    up = told([RISING] * 3)
    assert not told([STILL] * math.ceil(PATIENCE_S / GAP + 1), 3 * GAP, up).told


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
@given(st.lists(st.sampled_from([STILL, DRIVING, None]), max_size=60))
def test_without_a_contradiction_it_is_never_told(looks: list[EgoMotion | None]) -> None:
    assert not told(looks).told


@settings(deadline=None, max_examples=60)
@given(st.lists(st.sampled_from([STILL, DRIVING, PUSHED, RISING, None]), max_size=60))
def test_two_contradictions_running_are_always_told(looks: list[EgoMotion | None]) -> None:
    assert told([*looks, PUSHED, RISING]).told
