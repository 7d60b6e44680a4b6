"""The dense matchers: true disparities, honest sigma, and never far where it is near."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rendered_pairs import MOUNT, RIG, TILT, Block, Room, render

from calib.model import StereoRig
from robot.vision.ground import ground_homography
from robot.vision.stereo import AdaptiveWeightMatcher, FloorAlignedMatcher, floor_disparities


def shifted_pair(shift, seed=0, shape=(96, 240)):
    rng = np.random.default_rng(seed)
    rough = cv2.GaussianBlur(rng.standard_normal((shape[0], shape[1] + 160)), (0, 0), 1.5)
    scene = cv2.normalize(rough, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    left = scene[:, : shape[1]]
    return left, scene[:, shift : shift + shape[1]]


def true_disparity(pair):
    return RIG.left.fx * RIG.baseline / pair.depth


@settings(max_examples=8, deadline=None)
@given(shift=st.integers(1, 44), seed=st.integers(0, 1000))
def test_a_shifted_picture_comes_out_at_its_shift(shift, seed):
    found = AdaptiveWeightMatcher.normal(48)(*shifted_pair(shift, seed))
    assert found.values.dtype == np.float32
    assert found.valid[10:-10, shift + 8 : -8].mean() > 0.95
    assert np.median(np.abs(found.values[found.valid] - shift)) < 0.1


def test_the_left_margin_the_right_eye_cannot_see_is_not_measured():
    found = AdaptiveWeightMatcher.normal(48)(*shifted_pair(30))
    assert not found.valid[:, :28].any()
    assert (found.values[~found.valid] == 0).all()


@pytest.mark.parametrize("shift", [36, 48, 60])
def test_what_is_nearer_than_the_search_is_never_far(shift):
    found = AdaptiveWeightMatcher.normal(32)(*shifted_pair(shift))
    assert found.valid.mean() < 0.01


def test_blank_and_dark_pictures_measure_nothing():
    rng = np.random.default_rng(3)
    for level, noise in ((120, 3.0), (8, 3.0), (0, 0.0)):
        left, right = (
            np.clip(level + noise * rng.standard_normal((288, 352, 3)), 0, 255).astype(np.uint8)
            for _ in range(2)
        )
        assert AdaptiveWeightMatcher.normal(64)(left, right).valid.mean() < 0.02


def test_the_floor_is_measured_without_bias_and_with_honest_sigma():
    pair = render(Room())
    found = FloorAlignedMatcher(AdaptiveWeightMatcher.normal(64), RIG, MOUNT)(pair.left, pair.right, 0.0, TILT)
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
        FloorAlignedMatcher(AdaptiveWeightMatcher.normal(64), RIG, MOUNT)(pair.left, pair.right, 0.0, TILT),
    ):
        floor = found.valid & (np.arange(288)[:, None] > 150)
        bias.append(np.abs(found.values - true_disparity(pair))[floor].mean())
    assert bias[1] < 0.8 * bias[0]


def test_the_aligned_search_reaches_nearer_where_the_floor_is_near():
    block = Block(0.42, 0.0, 0.1, 0.3, 0.1)
    pair = render(Room((block,)))
    found = FloorAlignedMatcher(AdaptiveWeightMatcher.normal(48), RIG, MOUNT)(pair.left, pair.right, 0.0, TILT)
    nearer = found.valid & (true_disparity(pair) > 50) & (np.arange(352) > 100)
    assert nearer.sum() > 2000
    assert np.median(np.abs(found.values - true_disparity(pair))[nearer]) < 0.3


def test_floor_disparities_are_the_ground_homography():
    rotation, eye = MOUNT.left_eye(0.4, TILT)
    homography = ground_homography(RIG, rotation, float(eye[2]))
    floor = floor_disparities(RIG, MOUNT, 0.4, TILT, 288)
    for v in (100, 200, 287):
        right = homography @ (150.0, v, 1.0)
        assert 150.0 - right[0] / right[2] == pytest.approx(floor[v], abs=1e-4)
        assert right[1] / right[2] == pytest.approx(v, abs=1e-6)


def test_an_offset_of_the_principal_points_is_kept_in_the_pictures_own_columns():
    rig = StereoRig.parallel(352, 288, 305.0, 0.06, doffs=12.0)
    moved = floor_disparities(rig, MOUNT, 0.0, TILT, 288)
    assert np.allclose(moved + 12.0, floor_disparities(RIG, MOUNT, 0.0, TILT, 288), atol=1e-4)


@pytest.mark.parametrize("count", [0, -16, 40])
def test_refuses_a_search_range_opencv_cannot(count):
    with pytest.raises(ValueError, match="multiple of 16"):
        AdaptiveWeightMatcher.normal(count)


def test_refuses_eyes_of_different_size():
    with pytest.raises(ValueError, match="different size"):
        AdaptiveWeightMatcher.normal(32)(np.zeros((40, 60), np.uint8), np.zeros((40, 61), np.uint8))


def test_same_pair_same_bytes():
    pair = render(Room(), seed=4)
    one, two = (AdaptiveWeightMatcher.normal(64)(pair.left, pair.right) for _ in range(2))
    assert one.values.tobytes() == two.values.tobytes()
