"""The ground-plane homography and the features that do not obey it."""

import math

import numpy as np
import pytest
from rendered_pairs import MOUNT, RIG, TILT, Block, Room, render

from calib.model import HeadMount, StereoRig
from robot.vision.ground import find_obstacles, obstacle_points
from robot.vision.ground_plane import ground_homography, homography_from_matches


def project(camera, points):
    return points[:, :2] / points[:, 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy)


def floor_matches(rig, rotation, eye, count=40):
    """Floor points seen by both eyes: left pixels, right pixels."""
    rng = np.random.default_rng(2)
    floor = np.column_stack([rng.uniform(0.5, 2.0, count), rng.uniform(-0.4, 0.4, count), np.zeros(count)])
    left = (floor - eye) @ rotation
    right = left @ rig.R.T + rig.translation
    return project(rig.left, left), project(rig.right, right)


@pytest.mark.parametrize("roll", [0.0, 0.2])
@pytest.mark.parametrize("tilt", [0.1, 0.35, 0.8])
def test_the_homography_takes_floor_pixels_to_floor_pixels(tilt, roll):
    rotation, eye = MOUNT.left_eye(0.3, tilt)
    c, s = math.cos(roll), math.sin(roll)
    rotation = rotation @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    turn = (math.cos(0.02), 0.0, math.sin(0.02), 0.0, 1.0, 0.0, -math.sin(0.02), 0.0, math.cos(0.02))
    rig = StereoRig(RIG.left, RIG.right, turn, (-0.06, 0.002, 0.001))
    left, right = floor_matches(rig, rotation, eye)
    mapped = np.column_stack([left, np.ones(len(left))]) @ ground_homography(rig, rotation, eye[2]).T
    assert np.allclose(mapped[:, :2] / mapped[:, 2:], right, atol=1e-6)


def test_the_published_normal_for_a_pitched_camera():
    p = 0.35
    rotation, eye = MOUNT.left_eye(0.0, p)
    normal = np.array([0.0, math.cos(p), math.sin(p)])
    published = (
        RIG.right.matrix
        @ (np.eye(3) + np.outer(RIG.translation, normal) / eye[2])
        @ np.linalg.inv(RIG.left.matrix)
    )
    assert np.allclose(ground_homography(RIG, rotation, eye[2]), published)


def test_matches_give_the_same_homography_despite_false_ones():
    rotation, eye = MOUNT.left_eye(0.0, TILT)
    left, right = floor_matches(RIG, rotation, eye)
    right[:8] += 25.0
    found, inliers = homography_from_matches(left, right)
    expected = ground_homography(RIG, rotation, eye[2])
    assert np.allclose(found, expected / expected[2, 2], rtol=1e-4, atol=1e-4)
    assert not inliers[:8].any()
    assert inliers[8:].all()


def test_too_few_or_collinear_matches_are_refused():
    with pytest.raises(ValueError, match="4 or more"):
        homography_from_matches(np.zeros((3, 2)), np.zeros((3, 2)))
    line = np.column_stack([np.arange(10.0), 2 * np.arange(10.0)])
    with pytest.raises(ValueError, match="do not lie on one line"):
        homography_from_matches(line, line)
    with pytest.raises(ValueError, match="above the floor"):
        ground_homography(RIG, np.eye(3), 0.0)


def painted(x, y):
    """Floor lines and a shadow's edge."""
    lines = (np.mod(x, 0.4) < 0.03) | (np.mod(y + 0.1, 0.5) < 0.03)
    return np.where(lines, 0.25, 1.0) * np.where(y > 0.1 * x, 1.0, 0.6)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_lines_and_shadows_on_the_floor_are_no_obstacles(seed):
    pair = render(Room(floor_paint=painted, floor_seed=seed), seed=seed, samples=2)
    points = obstacle_points(pair.left, pair.right, RIG, MOUNT, 0.0, TILT)
    assert points.shape == (0, 3) or (np.hypot(points[:, 0], points[:, 1]) > 1.8).all()


@pytest.mark.parametrize(
    "block",
    [Block(1.0, 0.0, 0.3, 0.3, 0.3), Block(0.9, -0.1, 0.04, 0.04, 0.6), Block(0.8, 0.0, 0.2, 0.5, 0.06)],
)
def test_what_stands_up_is_found_where_it_stands(block):
    pair = render(Room((block,), floor_paint=painted), samples=2)
    found = find_obstacles(pair.left, pair.right, RIG, MOUNT, 0.0, TILT)
    near = np.hypot(found.points[:, 0], found.points[:, 1]) < 1.4
    assert near.sum() >= 3
    off = np.abs(found.points[near, :2] - (block.x, block.y)) - (block.length / 2, block.width / 2)
    assert (off.max(axis=1) < 0.05 + 3 * found.sigma[near]).all()
    assert (found.points[near, 2] < block.z1 + 0.03).all()
    assert found.points.shape == (len(found.sigma), 3) == (len(found.pixels), 3)
    assert len(found.falls) == len(found.heights) == len(found.height_sigmas) == len(found.points)
    assert not found.falls[near].any()


def test_what_hangs_higher_than_the_body_is_free():
    high = HeadMount(height=1.0)
    for bottom, found in ((0.5, False), (0.0, True)):
        pair = render(
            Room((Block(0.9, 0.0, 0.2, 0.5, bottom + 0.1, z0=bottom),)), mount=high, tilt=0.6, samples=2
        )
        points = obstacle_points(pair.left, pair.right, RIG, high, 0.0, 0.6)
        assert (np.hypot(points[:, 0], points[:, 1]) < 1.3).any() == found


def test_black_pictures_hold_nothing():
    black = np.zeros((288, 352, 3), np.uint8)
    assert obstacle_points(black, black, RIG, MOUNT, 0.0, TILT).shape == (0, 3)
