"""Bare boards painted into the free-space bench's views: where they must be, hidden by what is nearer."""

from __future__ import annotations

import numpy as np
import pytest

from bench.freespace_boards import board_bars, board_rows, boarded
from bench.freespace_truth import FloorTruth, Gap
from bench.freespace_views import BASE_MOUNT, BASE_RIG, FreeSpaceView

AWAY_M = 1.2


def grey_view(depth_m: float) -> FreeSpaceView:
    """All grey at one depth; a gap of 0.4 m at 1.2 m is said to be there."""
    grey = np.full((288, 352, 3), 90, np.uint8)
    truth = FloorTruth((), gap=Gap(0.4, (AWAY_M, 0.0, 0.0)))
    depth = np.full((288, 352), depth_m, np.float32)
    return FreeSpaceView("narrow", 1, grey, grey, BASE_RIG, BASE_MOUNT, 0.0, 0.3, depth, truth)


@pytest.mark.parametrize("seed", range(12))
def test_a_board_lies_level_with_its_gap_in_both_eyes(seed: int) -> None:
    given = grey_view(3.0)
    shown = boarded(given, np.random.default_rng(seed))
    spans = []
    for picture in (shown.left, shown.right):
        unlike = np.abs(picture.astype(int) - 90).max(axis=2)
        painted = unlike > unlike.max() / 2
        row, column = np.nonzero(painted)
        assert 4 <= np.ptp(row) + 1 <= 40
        # 0.46 m at 1.0 to 1.2 m of a camera of 305 px, from eyes 6 cm apart.
        assert 100 <= np.ptp(column) + 1 <= 165
        spans.append((column.min(), column.max()))
    moved = np.subtract(*spans)
    assert 12 <= moved.min() <= moved.max() <= 22
    assert not given.left[given.left != 90].size


def test_what_is_nearer_hides_the_board() -> None:
    given = grey_view(0.5)
    shown = boarded(given, np.random.default_rng(1))
    assert (shown.left == given.left).all()
    assert (shown.right == given.right).all()


def test_each_kind_has_its_row_and_no_board_may_be_passed() -> None:
    answers = [("open", True), ("open", False), ("narrow", None), ("dark", False)]
    rows = board_rows(("open", "narrow", "dark"), answers)
    assert rows == [
        {"kind": "board, open", "views": 2, "passed": 1},
        {"kind": "board, dark", "views": 1, "passed": 0},
    ]
    assert [bar.holds for bar in board_bars(rows)] == [False, True]
