"""Voting is a count of weighted votes, written out pixel by pixel."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.vision.stereo_aggregation import Support, sample_intensities, shares
from robot.vision.stereo_voting import REACH, Voting, vote


def spatial(cells_apart, support):
    away = support.cell * cells_apart
    core = math.exp(-(away**2) / (2 * support.sigma**2))
    return core + support.tail * math.exp(-(away**2) / (2 * support.tail_sigma**2))


def counted(levels, stable, guide, count, voting):
    """Votes for each pixel and level (count, h, w): each pixel votes for each other one, by distance,
    likeness and weight; its ballot is `REACH` for its own level and falls by 1 with each level's distance."""
    support = voting.support
    share = shares(sample_intensities(guide, support.clusters)).astype(float)[guide]
    height, width = guide.shape
    out = np.zeros((count, height, width))
    steps = np.arange(count)
    for row in range(height):
        for column in range(width):
            weight = 1.0 if stable[row, column] else voting.filled_weight
            ballot = weight * np.maximum(0.0, REACH - np.abs(steps - levels[row, column]))
            like = share @ share[row, column]
            down = [spatial(r // support.cell - row // support.cell, support) for r in range(height)]
            along = [spatial(c // support.cell - column // support.cell, support) for c in range(width)]
            out += ballot[:, None, None] * np.outer(down, along) * like
    return out


def peak(votes):
    """The level of the most votes with the fraction of two lines of equal slope."""
    best = int(votes.argmax())
    if not 0 < best < len(votes) - 1:
        return float(best)
    before, here, behind = (float(v) for v in votes[best - 1 : best + 2])
    fall = here - min(before, behind)
    return best + (0.0 if fall <= 0 else min(max((behind - before) / (2 * fall), -0.5), 0.5))


VOTINGS = st.builds(
    Voting,
    support=st.builds(Support, clusters=st.sampled_from([2, 4, 8]), cell=st.integers(1, 3)),
    filled_weight=st.sampled_from([0.02, 0.1, 0.5]),
)


@settings(max_examples=20, deadline=None)
@given(voting=VOTINGS, count=st.integers(4, 12), seed=st.integers(0, 999))
def test_the_level_of_the_most_votes_counted_by_hand_wins(voting, count, seed):
    rng = np.random.default_rng(seed)
    shape = 4 * voting.support.cell, 3 * voting.support.cell
    guide = rng.integers(0, 256, shape).astype(np.uint8)
    levels = rng.uniform(0, count - 1, shape).astype(np.float32)
    levels[0, :2] = 0.0, count - 1.0
    stable = rng.random(shape) < 0.6
    votes = counted(levels, stable, guide, count, voting)
    found = vote(levels, stable, guide, count, voting)
    assert found.dtype == np.float32
    ranked = np.sort(votes, axis=0)
    clear = ranked[-1] > 1.001 * ranked[-2]
    assert clear.mean() > 0.5
    expected = np.array([[peak(votes[:, r, c]) for c in range(shape[1])] for r in range(shape[0])])
    # The fraction is a quotient of differences of votes: where those are small, single precision shows.
    assert found[clear] == pytest.approx(expected[clear], abs=0.02)


def blank(side=18):
    return np.full((side, side), 90, np.uint8)


@settings(max_examples=15, deadline=None)
@given(level=st.sampled_from([0.0, 15.0]) | st.floats(0.51, 14.49), seed=st.integers(0, 99))
def test_where_all_agree_nothing_changes(level, seed):
    """The first and the last level have no fraction: half-way to them either level may win."""
    guide = np.random.default_rng(seed).integers(0, 256, (9, 12)).astype(np.uint8)
    levels = np.full((9, 12), level, np.float32)
    assert vote(levels, np.ones((9, 12), bool), guide, 16, Voting()) == pytest.approx(levels, abs=0.02)


@pytest.mark.parametrize("wrong", [0.0, 2.0, 9.0, 15.0])
def test_a_speck_is_outvoted_even_if_stable(wrong):
    levels = np.full((18, 18), 5.0, np.float32)
    levels[8:10, 8:10] = wrong
    assert vote(levels, np.ones((18, 18), bool), blank(), 16, Voting()) == pytest.approx(
        np.full((18, 18), 5.0), abs=0.15
    )


def test_a_filled_pixel_takes_the_level_of_stable_ones_like_it():
    guide = blank()
    guide[:, 10:] = 200
    levels = np.where(guide == 90, 3.0, 11.0).astype(np.float32)
    stable = np.ones(guide.shape, bool)
    levels[6:12, 7:10], stable[6:12, 7:10] = 11.0, False  # filled in from the wrong side
    found = vote(levels, stable, guide, 16, Voting())
    assert found == pytest.approx(np.where(guide == 90, 3.0, 11.0), abs=0.1)


def stable_few_among_filled_many():
    levels, stable = np.full((18, 18), 9.0, np.float32), np.zeros((18, 18), bool)
    levels[6:12, 6:9], stable[6:12, 6:9] = 4.0, True
    return levels, stable


def test_few_stable_votes_weigh_more_than_many_filled_ones():
    levels, stable = stable_few_among_filled_many()
    assert vote(levels, stable, blank(), 16, Voting())[6:12, 9:11] == pytest.approx(
        np.full((6, 2), 4.0), abs=0.2
    )


def test_with_equal_weight_the_many_would_win():
    levels, stable = stable_few_among_filled_many()
    assert (vote(levels, stable, blank(), 16, Voting(filled_weight=1.0))[6:12, 9:12] > 8.5).all()


def test_without_any_stable_pixel_the_filled_ones_decide():
    found = vote(np.full((9, 9), 7.0, np.float32), np.zeros((9, 9), bool), blank(9), 16, Voting())
    assert found == pytest.approx(np.full((9, 9), 7.0), abs=0.02)


def test_what_is_given_is_left_as_it_was():
    levels, stable = stable_few_among_filled_many()
    guide = blank()
    before = levels.tobytes(), stable.tobytes(), guide.tobytes()
    vote(levels, stable, guide, 16, Voting())
    assert (levels.tobytes(), stable.tobytes(), guide.tobytes()) == before
