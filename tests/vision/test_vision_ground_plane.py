"""The floor's plane and its homography, there and back; matches that lie."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rendered_pairs import MOUNT, RIG

from calib.model import Camera, StereoRig
from robot.vision.ground_plane import GroundPlane, plane_from_homography, plane_from_matches
from robot.vision.ground_points import seen_points, triangulate

TURN = (math.cos(0.03), 0.0, math.sin(0.03), 0.0, 1.0, 0.0, -math.sin(0.03), 0.0, math.cos(0.03))
TOED_IN = StereoRig(
    Camera(352, 288, 305.0, 304.0, 170.0, 150.0),
    Camera(352, 288, 300.0, 301.0, 181.0, 139.0),
    TURN,
    (-0.06, 0.003, -0.002),
)


def plane_of(tilt, roll, height):
    normal = (math.sin(roll) * math.cos(tilt), math.cos(roll) * math.cos(tilt), math.sin(tilt))
    return GroundPlane(normal, height)


def floor_pixels(rig, plane, count, seed=0):
    """Left and right pixels of random points on a plane before both eyes."""
    rng = np.random.default_rng(seed)
    left = np.column_stack([rng.uniform(20, 330, count), rng.uniform(150, 280, count)])
    rays = np.column_stack([left, np.ones(count)]) @ np.linalg.inv(rig.left.matrix).T
    points = rays * (plane.height / (rays @ plane.normal))[:, None]
    right = (points @ rig.R.T + rig.translation) @ rig.right.matrix.T
    return left, right[:, :2] / right[:, 2:], points


@settings(deadline=None, max_examples=40)
@given(
    tilt=st.floats(0.0, 1.2), roll=st.floats(-0.3, 0.3), height=st.floats(0.05, 1.5),
    scale=st.sampled_from([1.0, -3.0, 0.01]), rig=st.sampled_from([RIG, TOED_IN]),
)  # fmt: skip
def test_a_homography_gives_its_plane_back(tilt, roll, height, scale, rig):
    plane = plane_of(tilt, roll, height)
    found = plane_from_homography(scale * plane.homography(rig), rig)
    assert found.tilt == pytest.approx(tilt, abs=1e-6)
    assert found.roll == pytest.approx(roll, abs=1e-6)
    assert found.height == pytest.approx(height, rel=1e-6)


def test_the_normal_of_a_tilted_head_is_the_published_one():
    for p in (0.1, 0.6):
        seen = GroundPlane.below(MOUNT.left_eye(0.4, p)[0], 0.25)
        assert np.allclose(seen.normal, (0.0, math.cos(p), math.sin(p)))


@pytest.mark.parametrize("homography", [np.diag([1.0, -1.0, 1.0]), np.zeros((3, 3)), np.eye(3)[::-1]])
def test_what_no_floor_can_do_is_refused(homography):
    with pytest.raises(ValueError, match="belongs to no floor"):
        plane_from_homography(homography, RIG)


@pytest.mark.parametrize("rig", [RIG, TOED_IN])
def test_matches_with_noise_and_some_false_ones_give_tilt_and_height(rig):
    plane = plane_of(0.35, 0.01, 0.25)
    left, right, _ = floor_pixels(rig, plane, 80)
    right += 0.15 * np.random.default_rng(3).standard_normal(right.shape)
    right[:6, 0] += 6.0
    found = plane_from_matches(left, right, rig, plane_of(0.3, 0.0, 0.22))
    assert found.tilt == pytest.approx(0.35, abs=math.radians(0.15))
    assert found.roll == pytest.approx(0.01, abs=math.radians(0.3))
    assert found.height == pytest.approx(0.25, abs=0.002)


def test_matches_that_cannot_tell_a_plane_are_refused():
    plane = plane_of(0.35, 0.0, 0.25)
    left, right, _ = floor_pixels(RIG, plane, 20)
    with pytest.raises(ValueError, match="3 or more"):
        plane_from_matches(left[:2], right[:2], RIG, plane)
    left = np.column_stack([np.linspace(50, 300, 20), np.full(20, 200.0)])
    right = left - (15.0, 0.0)
    with pytest.raises(ValueError, match="one line"):
        plane_from_matches(left, right, RIG, plane)


@pytest.mark.parametrize("rig", [RIG, TOED_IN])
def test_rays_meet_at_the_point_they_come_from(rig):
    left, right, points = floor_pixels(rig, plane_of(0.35, 0.0, 0.25), 50)
    depth, there = triangulate(left, right, rig)
    assert there.all()
    assert np.allclose(depth, points[:, 2], rtol=1e-9)


def test_rays_that_never_meet_have_no_depth():
    left = np.array([[100.0, 80.0], [100.0, 80.0]])
    _, there = triangulate(left, left + np.array([[0.0, 0.0], [5.0, 0.0]]), RIG)
    assert not there.any()


def test_the_depths_sigma_is_the_first_order_one():
    left, right, points = floor_pixels(RIG, plane_of(0.35, 0.0, 0.25), 30)
    seen = seen_points(left, right, np.full(30, 0.2), RIG, np.eye(3))
    expected = points[:, 2] ** 2 * 0.2 / (RIG.left.fx * RIG.baseline)
    assert np.allclose(seen.sigma, expected, rtol=1e-3)
