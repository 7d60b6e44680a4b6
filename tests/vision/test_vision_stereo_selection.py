"""Selection against a search by hand through every level."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from robot.vision.stereo_selection import MAX_LEVELS, greatest, select


def volumes(most_levels=9):
    """Whole numbers: they are compared exactly, and often equal."""
    shapes = st.tuples(st.integers(2, most_levels), st.integers(1, 4), st.integers(1, 12))
    return hnp.arrays(np.float32, shapes, elements=st.integers(0, 40).map(float))


def offset(before, here, behind):
    """Two lines of equal slope through three samples, the middle one the least: where they meet."""
    rise = max(before, behind) - here
    return 0.0 if rise == 0 else (before - behind) / (2 * rise)


def least(costs):
    """The first of the least costs."""
    return min(range(len(costs)), key=lambda level: (costs[level], level))


def by_hand(costs):
    count, height, width = costs.shape
    level, stable = np.zeros((height, width)), np.zeros((height, width), bool)
    for row in range(height):
        for column in range(width):
            best = least(costs[: column + 1, row, column])
            there = column - best
            theirs = least([costs[k, row, there + k] for k in range(min(count, width - there))])
            stable[row, column] = abs(theirs - best) <= 1
            around = costs[best - 1 : best + 2, row, column] if 0 < best < count - 1 else (0.0, 0.0, 0.0)
            level[row, column] = best + np.clip(offset(*map(float, around)), -0.5, 0.5)
    return level, stable


@settings(max_examples=120, deadline=None)
@given(costs=volumes())
def test_winner_fraction_and_the_right_eyes_word_are_those_found_by_hand(costs):
    level, stable = by_hand(costs)
    won = select(costs)
    assert won.level.dtype == np.float32
    assert won.stable.dtype == np.bool_
    assert won.level == pytest.approx(level, abs=1e-5)
    assert (won.stable == stable).all()


@settings(max_examples=10, deadline=None)
@given(count=st.sampled_from([2, 3, 63, 64, 65, 88, 255, 256]), seed=st.integers(0, 99))
def test_any_number_of_levels_up_to_the_most(count, seed):
    costs = np.random.default_rng(seed).integers(0, 60, (count, 2, 40)).astype(np.float32)
    level, stable = by_hand(costs)
    won = select(costs)
    assert won.level == pytest.approx(level, abs=1e-5)
    assert (won.stable == stable).all()


@pytest.mark.parametrize("count", [0, 1, MAX_LEVELS + 1])
def test_more_levels_than_can_be_told_apart_are_refused_and_fewer_than_two(count):
    with pytest.raises(ValueError, match=f"2 to 256 levels can be told apart, got {count}"):
        select(np.ones((count, 2, 4), np.float32))


def test_a_level_that_lies_outside_the_right_picture_never_wins():
    costs = np.linspace(9.0, 1.0, 8, dtype=np.float32)[:, None, None] * np.ones((1, 3, 20), np.float32)
    won = select(costs)
    assert (won.level <= np.arange(20) + 0.5).all(), "the fraction alone may lean out by half a level"
    assert (won.level[:, 7:] == 7).all()


def test_what_only_the_left_eye_sees_is_not_stable():
    # A surface at level 4 stands before one at level 1, of which it hides columns 7, 8 and 9.
    true = np.where(np.arange(24) >= 10, 4, 1)
    costs = np.full((8, 1, 24), 30.0, np.float32)
    costs[true, 0, np.arange(24)] = 0.0
    costs[1, 0, 7:10] = 5.0
    won = select(costs)
    assert np.flatnonzero(~won.stable[0]).tolist() == [7, 8, 9]
    assert (won.level[0, 10:] == 4).all()


def test_nearly_equal_costs_count_as_equal_and_the_farther_wins():
    costs = np.full((256, 1, 300), 2.0, np.float32)
    costs[5], costs[200] = 1.0 + 1e-6, 1.0
    assert (select(costs).level[0, 200:] == 5.0).all()
    costs[5] = 1.001
    assert (select(costs).level[0, 200:] == 200.0).all()


@pytest.mark.parametrize("fraction", [-0.4, -0.1, 0.0, 0.25, 0.5])
def test_the_floor_of_a_v_shaped_valley_is_found_between_the_levels(fraction):
    levels = np.arange(9, dtype=np.float32)[:, None, None]
    costs = (3.0 * np.abs(levels - (4 + fraction)) * np.ones((1, 2, 20))).astype(np.float32)
    assert select(costs).level[:, 9:] == pytest.approx(np.full((2, 11), 4 + fraction), abs=1e-4)


def test_the_volume_is_left_as_it_was():
    costs = np.random.default_rng(3).random((5, 3, 9)).astype(np.float32)
    before = costs.tobytes()
    select(costs)
    greatest(costs)
    assert costs.tobytes() == before


@settings(max_examples=80, deadline=None)
@given(scores=volumes())
def test_the_greatest_score_wins_with_the_peaks_fraction(scores):
    found = greatest(scores)
    assert found.dtype == np.float32
    count, height, width = scores.shape
    for row in range(height):
        for column in range(width):
            here = scores[:, row, column].astype(float)
            top = np.flatnonzero(here == here.max())
            possible = [
                k + (offset(*(-here[k - 1 : k + 2])) if 0 < k < count - 1 else 0.0) for k in map(int, top)
            ]
            assert np.abs(np.clip(possible, top - 0.5, top + 0.5) - found[row, column]).min() < 1e-5
