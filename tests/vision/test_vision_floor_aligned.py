"""Matching aligned to the floor: the shear is the floor's, and the disparities given are the given pair's."""

import numpy as np
import pytest
from rendered_pairs import MOUNT, RIG, TILT, Block, Room, render

from calib.model import StereoRig
from robot.vision.disparity import Disparity
from robot.vision.floor_aligned import FloorAlignedMatcher, floor_disparities
from robot.vision.ground import ground_homography
from robot.vision.stereo import AdaptiveWeightMatcher

ROWS, COLUMNS = 288, 352


class Scripted:
    """Answers what it is told, and keeps what it was given."""

    def __init__(self, value, valid=True):
        self._value, self._valid = value, valid

    def __call__(self, left, right):
        self.left, self.right = left, right
        shape = left.shape
        return Disparity(
            np.full(shape, self._value, np.float32),
            np.full(shape, self._valid),
            np.full(shape, 0.3, np.float32),
        )


def pictures(seed=0):
    return (
        np.random.default_rng((seed, eye)).integers(0, 256, (ROWS, COLUMNS)).astype(np.uint8)
        for eye in (0, 1)
    )


def true_disparity(pair):
    return RIG.left.fx * RIG.baseline / pair.depth


# ---------------------------------------------------------------------------------------- the floor's rows


@pytest.mark.parametrize("pan", [-0.7, 0.0, 0.4])
@pytest.mark.parametrize("tilt", [0.1, TILT, 0.8])
def test_floor_disparities_are_the_ground_homography(pan, tilt):
    rotation, eye = MOUNT.left_eye(pan, tilt)
    homography = ground_homography(RIG, rotation, float(eye[2]))
    floor = floor_disparities(RIG, MOUNT, pan, tilt, ROWS)
    assert floor.dtype == np.float32
    for v in (100, 200, 287):
        right = homography @ (150.0, v, 1.0)
        assert 150.0 - right[0] / right[2] == pytest.approx(floor[v], abs=1e-4)
        assert right[1] / right[2] == pytest.approx(v, abs=1e-6)


def test_floor_disparities_are_those_of_a_rendered_floor():
    pair = render(Room(size=40.0))
    floor = floor_disparities(RIG, MOUNT, 0.0, TILT, ROWS)
    below = slice(60, ROWS)
    assert true_disparity(pair)[below] == pytest.approx(
        np.repeat(floor[below, None], COLUMNS, axis=1), abs=0.01
    )


def test_above_the_horizon_the_floor_has_no_disparity():
    floor = floor_disparities(RIG, MOUNT, 0.0, 0.1, ROWS)
    horizon = RIG.left.cy - RIG.left.fy * np.tan(0.1)
    rows = np.arange(ROWS)
    assert (floor[rows < horizon - 0.01] < 0).all()
    assert (floor[rows > horizon + 0.01] > 0).all()
    assert (np.diff(floor) > 0).all()


def test_an_offset_of_the_principal_points_is_kept_in_the_pictures_own_columns():
    rig = StereoRig.parallel(352, 288, 305.0, 0.06, doffs=12.0)
    moved = floor_disparities(rig, MOUNT, 0.0, TILT, 288)
    assert np.allclose(moved + 12.0, floor_disparities(RIG, MOUNT, 0.0, TILT, 288), atol=1e-4)


# ----------------------------------------------------------------------------------------------- the shear


@pytest.mark.parametrize("margin", [0.0, 8.0, 20.0])
def test_the_right_picture_is_moved_by_the_floors_disparity_less_the_margin(margin):
    inner = Scripted(0.0)
    left, right = pictures()
    FloorAlignedMatcher(inner, RIG, MOUNT, margin)(left, right, 0.0, TILT)
    shift = np.maximum(floor_disparities(RIG, MOUNT, 0.0, TILT, ROWS) - margin, 0.0)
    assert (inner.left == left).all()
    assert inner.right.dtype == np.uint8
    for row in (0, 90, 180, 287):
        columns = np.arange(COLUMNS) - shift[row]
        expected = np.interp(columns, np.arange(COLUMNS), right[row])
        assert np.abs(inner.right[row] - expected).max() < 5, "(interpolation knows 32nds of a pixel)"


def test_the_shear_is_given_back_and_rows_above_the_floor_stay():
    found = FloorAlignedMatcher(Scripted(2.5), RIG, MOUNT)(*pictures(), 0.0, TILT)
    floor = floor_disparities(RIG, MOUNT, 0.0, TILT, ROWS)
    expected = 2.5 + np.maximum(floor - 8.0, 0.0)
    assert found.values.dtype == np.float32
    assert found.values[:, -1] == pytest.approx(expected, abs=1e-4)
    assert (found.sigma_px == np.float32(0.3)).all()


def test_a_match_left_of_the_right_picture_is_none():
    found = FloorAlignedMatcher(Scripted(10.0), RIG, MOUNT)(*pictures(), 0.0, TILT)
    shift = np.maximum(floor_disparities(RIG, MOUNT, 0.0, TILT, ROWS) - 8.0, 0.0)
    inside = np.arange(COLUMNS) >= (10.0 + shift)[:, None]
    assert (found.valid == inside).all()
    assert not FloorAlignedMatcher(Scripted(10.0, valid=False), RIG, MOUNT)(
        *pictures(), 0.0, TILT
    ).valid.any()


def test_refuses_pictures_that_are_no_pair():
    aligned = FloorAlignedMatcher(Scripted(1.0), RIG, MOUNT)
    with pytest.raises(ValueError, match="different size"):
        aligned(np.zeros((40, 60), np.uint8), np.zeros((41, 60), np.uint8), 0.0, TILT)


def test_what_is_not_measured_keeps_the_value_it_was_filled_with():
    found = FloorAlignedMatcher(Scripted(2.5, valid=False), RIG, MOUNT)(*pictures(), 0.0, TILT)
    shift = np.maximum(floor_disparities(RIG, MOUNT, 0.0, TILT, ROWS) - 8.0, 0.0)
    assert not found.valid.any()
    assert found.values[:, 0] == pytest.approx(2.5 + shift, abs=1e-4)


# ---------------------------------------------------------------------------------------- what it is good for


def aligned_normal(disparities):
    return FloorAlignedMatcher(AdaptiveWeightMatcher.normal(disparities), RIG, MOUNT)


def test_the_floor_is_measured_without_bias_and_with_honest_sigma():
    pair = render(Room())
    found = aligned_normal(64)(pair.left, pair.right, 0.0, TILT)
    error = (found.values - true_disparity(pair))[found.valid]
    z = np.abs(error) / found.sigma_px[found.valid]
    assert found.valid[:, 80:].mean() > 0.9
    assert abs(np.median(error)) < 0.1
    assert np.mean(z < 1) > 0.6
    assert np.mean(z < 2) > 0.9


def test_alignment_to_the_floor_takes_the_bias_out():
    pair = render(Room(contrast=0.4), noise=3.0)
    bias = []
    for found in (
        AdaptiveWeightMatcher.normal(64)(pair.left, pair.right),
        aligned_normal(64)(pair.left, pair.right, 0.0, TILT),
    ):
        floor = found.valid & (np.arange(288)[:, None] > 150)
        bias.append(np.abs(found.values - true_disparity(pair))[floor].mean())
    assert bias[1] < 0.8 * bias[0]


def test_the_aligned_search_reaches_nearer_where_the_floor_is_near():
    block = Block(0.42, 0.0, 0.1, 0.3, 0.1)
    pair = render(Room((block,)))
    found = aligned_normal(48)(pair.left, pair.right, 0.0, TILT)
    nearer = found.valid & (true_disparity(pair) > 50) & (np.arange(352) > 100)
    assert nearer.sum() > 2000
    assert np.median(np.abs(found.values - true_disparity(pair))[nearer]) < 0.3


def test_what_lies_below_the_floor_is_never_taken_for_floor():
    """A pit 0.4 m deep lies farther than the aligned search reaches in the lower rows."""
    pair = render(Room(floor=-0.4))
    found = aligned_normal(64)(pair.left, pair.right, 0.0, TILT)
    unseen = floor_disparities(RIG, MOUNT, 0.0, TILT, ROWS)[:, None] - 8.0 > true_disparity(pair) + 2.0
    assert unseen.sum() > 10_000
    assert found.valid[unseen].mean() < 0.01
