"""Which pictures make a pair, and what is wrong when none do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.hal.webcam.pairing import Expected, EyeState, diagnosis, newest_pair
from robot.hal.webcam.source import TimedImage

PIXEL = np.zeros((1, 1, 3), np.uint8)
TIMES = st.lists(st.integers(0, 400), max_size=5, unique=True).map(lambda ms: [t / 1000 for t in sorted(ms)])


def eye(times):  # type: ignore[no-untyped-def]
    return [TimedImage(PIXEL, at) for at in times]


def times_of(pair):  # type: ignore[no-untyped-def]
    return None if pair is None else (pair[0].at, pair[1].at)


@settings(deadline=None, max_examples=200)
@given(TIMES, TIMES)
def test_a_pair_is_near_and_each_is_the_others_nearest(left, right) -> None:  # type: ignore[no-untyped-def]
    pair = times_of(newest_pair(eye(left), eye(right), 0.02))
    mutual = [
        (a, b)
        for a in left
        for b in right
        if abs(a - b) <= 0.02
        and all(abs(a - b) <= abs(a - other) for other in right)
        and all(abs(a - b) <= abs(b - other) for other in left)
    ]
    if not mutual:
        assert pair is None
    else:
        assert pair in mutual
        # The newest, up to a tie between two neighbours equally near.
        assert pair[0] >= max(a for a, _ in mutual) - 0.04


@settings(deadline=None, max_examples=100)
@given(TIMES, TIMES)
def test_order_of_arrival_does_not_matter(left, right) -> None:  # type: ignore[no-untyped-def]
    forward = times_of(newest_pair(eye(left), eye(right), 0.02))
    assert times_of(newest_pair(eye(left[::-1]), eye(right[::-1]), 0.02)) == forward


@settings(deadline=None, max_examples=100)
@given(st.floats(-0.0199, 0.0199), st.integers(0, 10), st.integers(0, 10))
def test_two_free_running_cameras_are_paired_whatever_their_phase(skew, cut_left, cut_right) -> None:  # type: ignore[no-untyped-def]
    grid = [round(0.04 * n, 6) for n in range(12)]
    left = grid[: 12 - min(cut_left, 2)][-4:]
    right = [t + skew for t in grid][: 12 - min(cut_right, 2)][-4:]
    pair = times_of(newest_pair(eye(left), eye(right), 0.02))
    assert pair is not None
    assert pair[1] - pair[0] == pytest.approx(skew)
    assert pair[0] == min(left[-1], grid[11 - min(cut_right, 2)])


def test_a_right_picture_that_came_early_is_not_given_to_the_left_one_before() -> None:
    # The right eye is 10 ms behind; its 50 ms picture is here, the left one of 40 ms is not yet.
    assert times_of(newest_pair(eye([0.000]), eye([0.010, 0.018]), 0.02)) == (0.000, 0.010)
    assert times_of(newest_pair(eye([0.0, 0.04]), eye([0.03, 0.058]), 0.02)) == (0.04, 0.03)


def test_too_far_apart_is_no_pair() -> None:
    assert newest_pair(eye([0.0]), eye([0.021]), 0.02) is None
    assert newest_pair([], eye([0.0]), 0.02) is None
    assert newest_pair(eye([0.0]), [], 0.02) is None


EXPECTED = Expected((64, 48), 0.5)
FRESH = {"newest_at": 9.9, "size": (64, 48)}


def judged(left, right, pair_at=9.9, since=0.0, now=10.0):  # type: ignore[no-untyped-def]
    eyes = [EyeState("left eye", **left), EyeState("right eye", **right)]
    return diagnosis(eyes, pair_at, since, EXPECTED, now)


def test_nothing_is_wrong_while_pairs_come_and_just_after_the_start() -> None:
    assert judged(FRESH, FRESH) == {}
    assert judged({}, {}, pair_at=None, since=9.6) == {}


@pytest.mark.parametrize(
    ("left", "right", "pair_at", "kind", "words"),
    [
        ({"broken": "unplugged"} | FRESH, FRESH, 9.9, "link", "left eye: unplugged"),
        ({}, {"broken": "unplugged"}, None, "link", "right eye: unplugged"),
        (FRESH, {"broken": "it is over", "ended": True}, 9.9, "missing", "right eye: it is over"),
        (FRESH, {}, None, "missing", "right eye: no picture yet"),
        (FRESH, {"newest_at": 9.2, "size": (64, 48)}, 9.2, "stale", "right eye: newest picture 0.8 s old"),
        (FRESH, {"newest_at": 9.872, "size": (64, 48)}, 9.2, "unpaired", "28 ms apart"),
        (FRESH, {"newest_at": 9.872, "size": (64, 48)}, None, "unpaired", "28 ms apart"),
        (FRESH, {"newest_at": 9.9, "size": (32, 48)}, 9.9, "size", "right eye gives 32 x 48, not 64 x 48"),
    ],
)
def test_what_is_wrong_has_one_name_and_names_the_eye(left, right, pair_at, kind, words) -> None:  # type: ignore[no-untyped-def]
    found = judged(left, right, pair_at)
    assert list(found) == [kind]
    assert words in found[kind]
    assert ("left eye" in found[kind]) == ("left eye" in words)


def test_both_eyes_are_named_when_both_are_broken() -> None:
    assert judged({"broken": "a"}, {"broken": "b"})["link"] == "left eye: a; right eye: b"


def test_it_is_told_half_a_second_after_the_last_pair() -> None:
    stopped = {"newest_at": 9.5, "size": (64, 48)}
    assert judged(stopped, stopped, pair_at=9.5, now=10.0) == {}
    assert list(judged(stopped, stopped, pair_at=9.5, now=10.01)) == ["stale"]
