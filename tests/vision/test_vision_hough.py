"""Votes arrive where they were cast, are traced back to who cast them, and maxima are found by mean shift."""

import numpy as np
import pytest

from robot.messages import Box
from robot.vision.hough import CELL_STEPS, MOST_VOTES, Codebook, Voters, smoothed
from robot.vision.mean_shift import peaks

LEAVES = 4


def codebook(up, aside, votes):
    """One fern; votes: {(leaf, cells down, cells right): votes}."""
    table = np.zeros((1, LEAVES, (2 * up + 1) * (2 * aside + 1)), np.int16)
    for (leaf, down, right), count in votes.items():
        table[0, leaf, (down + up) * (2 * aside + 1) + right + aside] = count
    return Codebook(table, up, aside)


def leaves_at(*places, shape=(20, 30)):
    found = np.zeros((1, *shape), np.uint16)
    for leaf, row, column in places:
        found[0, row, column] = leaf
    return found


def test_votes_arrive_at_their_offsets():
    book = codebook(2, 1, {(1, 2, -1): 700, (2, -2, 1): 500})
    seven, five = (votes**2 >> book.square_shift for votes in (700, 500))
    above, beside = book.margin
    counted = book.counted(leaves_at((1, 4, 9), (2, 10, 3)))
    assert counted.shape == (20 + 2 * above, 30 + 2 * beside)
    assert counted[above + 4 + 2 * CELL_STEPS, beside + 9 - CELL_STEPS] == seven
    assert counted[above + 10 - 2 * CELL_STEPS, beside + 3 + CELL_STEPS] == five
    assert counted.sum() == seven + five


def test_votes_may_fall_outside_the_picture():
    book = codebook(3, 3, {(1, -3, -3): 200})
    assert book.counted(leaves_at((1, 0, 0)))[0, 0] == 200**2 >> book.square_shift


def test_ferns_that_agree_count_more_than_ferns_apart():
    table = np.zeros((2, LEAVES, 9), np.int16)
    table[:, 1, 4] = 600  # both ferns' leaf 1 votes for its own place
    book = Codebook(table, 1, 1)
    agreeing, apart = np.zeros((2, 2, 20, 30), np.uint16)
    agreeing[:, 8, 8] = 1
    apart[0, 8, 8] = apart[1, 8, 14] = 1
    assert book.counted(agreeing).sum() == pytest.approx(2 * book.counted(apart).sum(), rel=0.01)


@pytest.mark.parametrize("ferns", [1, 12, 20, 32])
def test_the_most_votes_there_can_be_do_not_overflow(ferns):
    book = Codebook(np.full((ferns, 2, 1), MOST_VOTES, np.int16), 0, 0)
    counted = book.counted(np.ones((ferns, 3, 3), np.uint16))
    assert (counted == (ferns * MOST_VOTES) ** 2 >> book.square_shift).all()
    assert counted.max() > 2**13, "no more bits are dropped than need be"


def test_many_places_are_counted_as_few(monkeypatch):
    rng = np.random.default_rng(0)
    table = rng.integers(0, 50, (3, LEAVES, 15)).astype(np.int16)
    book, found = Codebook(table, 1, 2), rng.integers(0, LEAVES, (3, 25, 31)).astype(np.uint16)
    whole = book.cast(found)
    plain = sum(table[fern][found[fern].ravel()] for fern in range(3))
    assert (whole == plain).all()
    monkeypatch.setattr("robot.vision.hough.PART", 40)
    assert (book.cast(found) == whole).all()


def test_voters_of_a_centre_are_those_who_cast_for_it():
    book = codebook(2, 2, {(1, 1, 2): 9, (2, 0, 0): 9})
    found = leaves_at((1, 8, 6), (2, 3, 3), (1, 15, 20))
    centre = (8.0 + CELL_STEPS, 6.0 + 2 * CELL_STEPS)
    voters = book.voters(found, centre, reach=1.0)
    assert voters[8, 6] == pytest.approx(9.0)
    assert voters[3, 3] < 0.1
    assert voters[15, 20] < 1e-6


def test_the_voters_share_outside_boxes_and_their_support():
    votes = np.zeros((10, 12), np.float32)
    votes[2:8, 2:6] = votes[2:8, 8:10] = 1.0
    voters = Voters(votes, corner=(100.0, 50.0), pitch=4.0)
    assert voters.outside([]) == 1.0
    assert voters.outside([Box(100.0, 50.0, 24.0, 60.0)]) == pytest.approx(1 / 3)
    assert voters.outside([Box(0.0, 0.0, 500.0, 500.0)]) == 0.0
    support = voters.support((200, 300))
    assert support[50 + 20, 100 + 14]
    assert not support[50 + 20, 100 + 44]
    assert not support[:40].any()
    assert not Voters(np.zeros((3, 3), np.float32), (0.0, 0.0), 2.0).support((20, 20)).any()


# --- maxima ---


def votes_of(*spots, shape=(60, 80)):
    found = np.zeros(shape, np.float32)
    for row, column, height in spots:
        found[row, column] = height
    return smoothed(found) * 10.0


def test_a_maximum_is_told_in_pixels_of_the_full_picture():
    level = votes_of((20, 30, 1.0))
    (found,) = peaks([level], [0.5], (6, 4), 2, (40.0, 30.0), 0.2, 5)
    assert (found.u, found.v) == pytest.approx(((30 - 6) * 2 / 0.5, (20 - 4) * 2 / 0.5), abs=0.5)
    assert found.scale == pytest.approx(2.0)


def test_of_two_levels_the_scale_between_is_found():
    levels = [votes_of((30, 40, 1.0)), votes_of((20, 27, 1.0), shape=(40, 54))]
    (found, *_) = peaks(levels, [1.0, 2 / 3], (0, 0), 2, (40.0, 40.0), 0.2, 5)
    assert 1.05 < found.scale < 1.45


def test_maxima_near_a_higher_one_are_of_the_same_object():
    near = votes_of((20, 30, 1.0), (20, 35, 0.8))
    far = votes_of((20, 20, 1.0), (20, 60, 0.8))
    assert len(peaks([near], [1.0], (0, 0), 2, (48.0, 40.0), 0.2, 5)) == 1
    found = peaks([far], [1.0], (0, 0), 2, (48.0, 40.0), 0.2, 5)
    assert [p.score > 0 for p in found] == [True, True]
    assert found[0].score > found[1].score


def test_there_are_at_most_so_many_and_none_that_is_too_low():
    level = votes_of((10, 10, 1.0), (10, 60, 0.9), (50, 10, 0.8), (50, 60, 0.1))
    assert len(peaks([level], [1.0], (0, 0), 2, (20.0, 20.0), 0.2, 2)) == 2
    assert len(peaks([level], [1.0], (0, 0), 2, (20.0, 20.0), 0.2, 9)) == 3
    assert peaks([level], [1.0], (0, 0), 2, (20.0, 20.0), 99.0, 9) == []
