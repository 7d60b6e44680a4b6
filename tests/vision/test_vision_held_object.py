"""What is held before the eyes: found by depth, refused with the cure where it cannot be told."""

from __future__ import annotations

import numpy as np
import pytest
from rendered_pairs import RIG, Block, Pair, Room, render

from robot.vision.disparity import Disparity
from robot.vision.held_object import HeldObject, NotHeld, held_object
from robot.vision.stereo import AdaptiveWeightMatcher

HELD = Block(0.45, 0.0, 0.06, 0.10, 0.30, 0.18, seed=3)
TURNED = Block(0.5, 0.03, 0.08, 0.12, 0.32, 0.16, yaw=0.6, seed=4)
ARM = Block(0.47, 0.0, 0.04, 0.04, 0.18, -0.2, seed=9)
MATCHER = AdaptiveWeightMatcher.floors(96)


def seen(*blocks: Block) -> tuple[Pair, HeldObject | NotHeld]:
    pair = render(Room(blocks), tilt=0.05)
    return pair, held_object(MATCHER(pair.left, pair.right), RIG)


def overlap(mask: np.ndarray, truth: np.ndarray) -> float:
    return float((mask & truth).sum() / (mask | truth).sum())


@pytest.mark.parametrize("block", [HELD, TURNED], ids=["square on", "turned"])
def test_the_object_is_found_with_its_mask_box_and_depth(block: Block) -> None:
    pair, found = seen(block)
    assert isinstance(found, HeldObject)
    truth = pair.depth < 0.7
    truth[220:] = False  # the floor before the eyes
    assert overlap(found.mask, truth) > 0.75
    rows, columns = np.nonzero(truth)
    for mine, true in zip(
        (found.box.x, found.box.y, found.box.x + found.box.w, found.box.y + found.box.h),
        (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1),
        strict=True,
    ):
        assert mine == pytest.approx(true, abs=8)
    assert found.depth_m == pytest.approx(float(np.median(pair.depth[truth])), rel=0.03)


def test_the_arm_that_holds_it_is_cut_off() -> None:
    _, alone = seen(HELD)
    _, held = seen(HELD, ARM)
    assert isinstance(alone, HeldObject)
    assert isinstance(held, HeldObject)
    assert held.box.iou(alone.box) > 0.8


@pytest.mark.parametrize(
    ("blocks", "words"),
    [
        ((), "nothing is held"),
        ((Block(1.6, 0, 0.2, 0.3, 0.5, seed=3),), "nothing is held"),
        ((Block(0.45, 0.24, 0.06, 0.14, 0.30, 0.20, seed=3),), "nothing is held|reaches out"),
        ((Block(0.45, 0, 0.06, 0.24, 0.40, 0.0, seed=3),), "reaches out|fills the picture"),
        ((HELD, Block(0.60, 0, 0.05, 0.2, 0.36, 0.12, seed=8)), "close behind"),
        ((Block(0.66, 0, 0.05, 0.8, 0.6, -0.1, seed=8),), "nothing is held"),
    ],
    ids=["an empty room", "too far", "beside the middle", "too large", "something behind", "a wall"],
)
def test_what_cannot_be_told_is_refused_with_the_cure(blocks: tuple[Block, ...], words: str) -> None:
    _, found = seen(*blocks)
    assert isinstance(found, NotHeld)
    assert any(part in found.words for part in words.split("|"))
    assert ": hold" in found.words


def flat(*places: tuple[slice, slice], metres: float = 0.5) -> Disparity:
    """A wall 2 m away and square things before it, all measured without error."""
    depth = np.full((288, 352), 2.0, np.float32)
    for place in places:
        depth[place] = metres
    values = (RIG.left.fx * RIG.baseline / depth).astype(np.float32)
    return Disparity(values, values > 0, np.full_like(values, 0.1))


def test_two_small_things_are_to_come_nearer() -> None:
    small = [np.s_[120:146, x : x + 26] for x in (100, 220)]
    found = held_object(flat(*small), RIG)
    assert isinstance(found, NotHeld)
    assert "too small: hold it nearer" in found.words
    alone = held_object(flat(np.s_[120:200, 140:210]), RIG)
    assert isinstance(alone, HeldObject)
    assert alone.depth_m == pytest.approx(0.5)


def test_where_nothing_is_measured_nothing_is_held() -> None:
    blank = np.zeros((288, 352), np.float32)
    unmeasured = Disparity(blank, blank > 0, np.full_like(blank, np.inf))
    assert isinstance(held_object(unmeasured, RIG), NotHeld)
