"""The free-passage circle: the published figures, the true circle against brute force, metres."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rendered_pairs import MOUNT, RIG, TILT, Block, Room, render

from calib.model import Camera, StereoRig
from robot.vision.disparity import Disparity
from robot.vision.passage import (
    Circle,
    centre_in_camera,
    centroid_circle,
    farther_than,
    fits,
    free_passage,
    inscribed_circle,
    metric_diameter,
    on_floor,
    rim_disparity,
)

HAND_EYE = Camera(352, 288, 408.0, 408.0, 192.93, 149.29)
HAND = StereoRig(HAND_EYE, HAND_EYE, translation=(-0.04, 0.0, 0.0))
PLANE_PX = 408.0 * 0.04 / 0.23695


def disparity_of(values, valid=None):
    values = np.asarray(values, np.float32)
    return Disparity(
        values, np.ones(values.shape, np.bool_) if valid is None else valid, np.full_like(values, 0.1)
    )


@pytest.mark.parametrize(
    ("pixel", "millimetres"),
    [
        ((256, 120), (36.64, -17.01)),
        ((240, 144), (27.35, -3.07)),
        ((268, 145), (43.61, -2.49)),
        ((243, 145), (29.09, -2.49)),
        ((235, 134), (24.45, -8.88)),
    ],
)
def test_the_published_centres(pixel, millimetres):
    x, y, z = centre_in_camera(Circle(pixel, 43.0), PLANE_PX, HAND)
    assert (1000 * x, 1000 * y) == pytest.approx(millimetres, abs=0.03)
    assert 1000 * z == pytest.approx(236.95)


def test_the_published_scale():
    assert 1000 * metric_diameter(Circle((0, 0), 1.0), PLANE_PX, HAND) == pytest.approx(0.581, abs=5e-4)
    assert 1000 * metric_diameter(Circle((0, 0), 43.0), PLANE_PX, HAND) == pytest.approx(25.0, abs=0.1)


def test_a_passage_too_low_for_the_head_is_no_passage():
    assert fits(0.0708, 0.05, 0.05)
    assert not fits(0.0707, 0.05, 0.05)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_the_inscribed_circle_is_the_largest(seed):
    rng = np.random.default_rng(seed)
    free = np.ones((24, 30), np.bool_)
    for _ in range(4):
        v, u = rng.integers(0, 24), rng.integers(0, 30)
        free[v : v + 4, u : u + 4] = False
    circle = inscribed_circle(free)
    padded = np.pad(free, 1)
    blocked, opened = np.argwhere(~padded), np.argwhere(padded)
    nearest = np.sqrt(((opened[:, None] - blocked[None]) ** 2).sum(axis=2)).min(axis=1)
    assert circle is not None
    assert circle.diameter_px == pytest.approx(2 * nearest.max() - 1, abs=1e-4)


def test_an_all_free_picture_is_bounded_by_its_border():
    circle = inscribed_circle(np.ones((101, 201), np.bool_))
    assert circle.diameter_px == pytest.approx(101.0)
    assert circle.centre[1] == 50


def test_a_centroid_outside_the_region_has_no_circle_but_the_true_one_stands():
    free = np.zeros((60, 60), np.bool_)
    free[5:55, 5:17] = free[5:17, 5:55] = free[43:55, 5:55] = True
    assert centroid_circle(free) is None
    assert inscribed_circle(free).diameter_px == pytest.approx(12, abs=3)


def test_both_circles_agree_on_a_disc():
    v, u = np.mgrid[:80, :100]
    free = np.hypot(u - 60, v - 40) < 20.2
    for circle in (inscribed_circle(free), centroid_circle(free)):
        assert circle.centre == pytest.approx((60, 40), abs=1)
        assert circle.diameter_px == pytest.approx(40, abs=1.5)


def test_noise_is_no_passage_and_nothing_free_is_none():
    speck = np.zeros((50, 50), np.bool_)
    speck[10:12, 10:40] = True
    for free in (speck, np.zeros((50, 50), np.bool_)):
        assert inscribed_circle(free) is None
        assert centroid_circle(free) is None


def test_near_and_unmeasured_pixels_are_not_free():
    values = np.full((20, 20), 10.0)
    values[:, 12:] = 30.0
    valid = np.ones((20, 20), np.bool_)
    valid[:5] = False
    free = farther_than(disparity_of(values, valid), RIG, 1.0)
    assert free[5:, :12].all()
    assert not free[:5].any()
    assert not free[:, 12:].any()


def test_the_rim_takes_its_largest_measured_disparity():
    values = np.full((60, 60), 5.0)
    values[30, 41] = 22.0
    values[30, 20] = 30.0
    free = np.ones((60, 60), np.bool_)
    circle = Circle((30.0, 30.0), 21.0)
    assert rim_disparity(circle, disparity_of(values), RIG, free) == pytest.approx(30.0)
    free[30, 41] = False
    assert rim_disparity(circle, disparity_of(values), RIG, free) == pytest.approx(22.0)
    assert rim_disparity(circle, disparity_of(values, np.zeros((60, 60), np.bool_)), RIG, free) is None


def test_a_gap_between_two_blocks_is_measured_in_metres_and_lies_in_it():
    gap, x = 0.5, 0.9
    blocks = tuple(Block(x, s * (gap / 2 + 0.4), 0.1, 0.8, 1.0, seed=3) for s in (1, -1))
    for tilt, lowest in ((0.03, 0.46), (TILT, 0.25)):
        pair = render(Room(blocks), samples=1, noise=0.0, tilt=tilt)
        values = RIG.left.fx * RIG.baseline / pair.depth
        found = free_passage(disparity_of(values), RIG, MOUNT, 0.0, tilt, beyond=1.3)
        assert lowest < found.diameter < 1.03 * gap
        assert abs(found.position[1]) < 0.12
        assert found.position[0] == pytest.approx(x, abs=0.15)
        assert found.position[2] > 0.1


def test_floor_is_taken_out_and_what_stands_on_it_is_not():
    pair = render(Room((Block(0.9, 0.0, 0.2, 0.3, 0.2),)), samples=1, noise=0.0)
    floor = on_floor(disparity_of(RIG.left.fx * RIG.baseline / pair.depth), RIG, MOUNT, 0.0, TILT)
    assert floor[250:].all()
    rotation, eye = MOUNT.left_eye(0.0, TILT)
    x, y, z = rotation.T @ (np.array([0.8, 0.0, 0.12]) - eye)
    u, v = round(305 * x / z + RIG.left.cx), round(305 * y / z + RIG.left.cy)
    assert pair.depth[v, u] == pytest.approx(z, abs=0.01)
    assert not floor[v - 3 : v + 4, u - 3 : u + 4].any()


def test_a_wall_right_ahead_leaves_no_passage():
    values = np.full((288, 352), 305 * 0.06 / 0.4)
    assert free_passage(disparity_of(values), RIG, MOUNT, 0.0, -0.3) is None
