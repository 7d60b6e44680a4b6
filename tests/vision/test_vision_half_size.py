"""Half-size pictures and where their pixels lie: what both say of one place is the same."""

import cv2
import numpy as np
import pytest

from calib.model import Camera
from robot.vision.half_size import half_camera, half_size, homography_to_half, to_full, to_half

EYE = Camera(352, 288, 305.0, 300.0, 170.0, 150.0)


@pytest.mark.parametrize(
    ("shape", "half"), [((288, 352), (144, 176)), ((7, 9), (3, 4)), ((1, 5), (1, 2)), ((1, 1), (1, 1))]
)
@pytest.mark.parametrize("kind", [np.uint8, np.float32])
def test_size_and_type(shape, half, kind) -> None:
    made = half_size(np.full(shape, 77, kind))
    assert made.shape == half
    assert made.dtype == kind
    assert (made == 77).all()


def test_a_spot_lies_where_it_is_said_to() -> None:
    u, v = np.meshgrid(np.arange(120.0), np.arange(80.0))
    spot = (200 * np.exp(-((u - 61.3) ** 2 + (v - 30.8) ** 2) / 18)).astype(np.float32)
    small = half_size(spot)
    rows, columns = np.mgrid[: small.shape[0], : small.shape[1]]
    middle = np.array([(small * columns).sum(), (small * rows).sum()]) / small.sum()
    assert to_full(middle) == pytest.approx((61.3, 30.8), abs=0.02)
    assert to_half(np.array([61.3, 30.8])) == pytest.approx(middle, abs=0.01)


def test_a_ray_is_the_same_in_both() -> None:
    point = np.array([0.1, -0.05, 1.0])
    full, small = EYE.matrix @ point, half_camera(EYE).matrix @ point
    assert to_half(full[:2]) == pytest.approx(small[:2], abs=1e-12)
    assert half_camera(EYE).width == 176
    assert half_camera(EYE).height == 144


def test_a_homography_takes_the_same_pixels_to_the_same() -> None:
    homography = np.array([[1.0, 0.2, -30.0], [0.02, 1.1, 3.0], [1e-4, 2e-4, 1.0]])
    points = np.array([[[20.0, 30.0]], [[200.0, 150.0]]])
    full = cv2.perspectiveTransform(points, homography)
    small = cv2.perspectiveTransform(to_half(points), homography_to_half(homography))
    assert np.allclose(to_full(small), full)
