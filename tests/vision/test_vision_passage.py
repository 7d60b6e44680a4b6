"""The free-passage circle: the published figures, the true circle against brute force, metres."""

import numpy as np
import pytest
from rendered_pairs import RIG

from calib.model import Camera, StereoRig
from robot.vision.disparity import Disparity
from robot.vision.passage import (
    Circle,
    centre_in_camera,
    centroid_circle,
    doubts_opened,
    farther_than,
    inscribed_circle,
    metric_diameter,
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


def test_single_doubts_are_opened_and_nothing_measured_near_is():
    free = np.ones((30, 40), np.bool_)
    free[10, 10] = free[15, 20] = False
    measured = np.ones((30, 40), np.bool_)
    measured[10, 10] = False
    opened = doubts_opened(free, measured)
    assert opened[10, 10]
    assert not opened[15, 20]
    # A doubt beside something measured near may be its edge.
    measured[14, 20] = free[14, 20] = False
    assert not doubts_opened(free, measured)[14, 20]


@pytest.mark.parametrize("apart", [2, 3, 4])
def test_false_matches_strewn_over_a_bare_wall_are_no_passage(apart):
    measured = np.zeros((120, 160), np.bool_)
    measured[::apart, ::apart] = True
    assert inscribed_circle(doubts_opened(measured, measured)) is None


def test_a_hole_in_the_map_does_not_widen_a_passage():
    free = np.zeros((120, 160), np.bool_)
    free[10:110, 20:60] = True
    for measured in (free, np.ones_like(free)):
        assert inscribed_circle(doubts_opened(free, measured)).diameter_px == pytest.approx(39.0, abs=1.0)
    parted = free.copy()
    parted[:, 40:43] = False
    assert inscribed_circle(doubts_opened(parted, parted)).diameter_px <= 20.0
