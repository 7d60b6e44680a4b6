"""Rectified points lie on one row and triangulate to where they are; an ideal pair is left alone."""

import cv2
import numpy as np
import pytest

from calib.model import Camera, StereoRig
from calib.rectify import rectifier

TOED_IN = StereoRig(
    Camera(352, 288, 305.0, 304.0, 178.0, 141.0, (-0.12, 0.03, 0.001, -0.0005, 0.0)),
    Camera(352, 288, 299.0, 300.0, 172.0, 146.0, (-0.1, 0.02, 0.0, 0.0008, 0.0)),
    rotation=tuple(cv2.Rodrigues(np.array([0.01, 0.035, -0.012]))[0].ravel().tolist()),
    translation=(-0.06, 0.0008, -0.001),
)


def seen(eye: Camera, points: np.ndarray) -> np.ndarray:
    """Pixels (N, 2) of points (N, 3) in the eye's own frame."""
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), eye.matrix, np.array(eye.distortion))
    return pixels.reshape(-1, 2)


def test_an_ideal_pair_is_left_alone() -> None:
    rig = StereoRig.parallel(352, 288, 305.0, 0.06, doffs=4.0)
    straight = rectifier(rig)
    left, right = (np.full((288, 352, 3), c, np.uint8) for c in (1, 2))
    assert straight.rig is rig
    assert straight(left, right)[0] is left
    assert straight(left, right)[1] is right
    assert np.array_equal(straight.left_points(np.array([[3.0, 4.0]])), [[3.0, 4.0]])


def test_left_points_lie_where_the_ideal_left_camera_sees_them() -> None:
    draw = np.random.default_rng(0)
    points = draw.uniform((-0.4, -0.3, 1.0), (0.4, 0.3, 3.0), (50, 3))
    straight = rectifier(TOED_IN)
    found = straight.left_points(seen(TOED_IN.left, points))
    turned = points @ straight.rotation.T
    eye = straight.rig.left
    expected = np.column_stack([eye.fx * turned[:, 0], eye.fy * turned[:, 1]]) / turned[:, 2:] + (
        eye.cx,
        eye.cy,
    )
    assert np.allclose(found, expected, atol=0.01)


def test_rectified_pictures_have_equal_rows_and_true_distances() -> None:
    """Gaussian dots drawn where a toed-in, distorted pair sees known points."""
    points = np.array(
        [[x, y, z] for z, x in ((0.8, -0.1), (1.2, 0.2), (2.0, -0.3)) for y in (-0.2, 0.0, 0.2)]
    )
    others = points @ TOED_IN.R.T + np.array(TOED_IN.translation)
    v, u = np.mgrid[:288, :352]
    straight = rectifier(TOED_IN)
    assert straight.rig.is_parallel()
    assert straight.rig.baseline == pytest.approx(TOED_IN.baseline)
    for point, other in zip(points, others, strict=True):
        eyes = []
        for eye, p in ((TOED_IN.left, point), (TOED_IN.right, other)):
            at = seen(eye, p[None])[0]
            dot = 250 * np.exp(-((u - at[0]) ** 2 + (v - at[1]) ** 2) / (2 * 2.5**2))
            eyes.append(np.rint(dot).astype(np.uint8))
        (ul, vl), (ur, vr) = (centroid(image) for image in straight(*eyes))
        depth = float((straight.rotation @ point)[2])
        assert vl == pytest.approx(vr, abs=0.1)
        assert float(straight.rig.depth(ul - ur)) == pytest.approx(depth, rel=0.02)


def centroid(image: np.ndarray) -> tuple[float, float]:
    weight = np.where(image > 20, image, 0).astype(float)
    v, u = np.mgrid[: image.shape[0], : image.shape[1]]
    return float((u * weight).sum() / weight.sum()), float((v * weight).sum() / weight.sum())


def test_pictures_of_another_size_are_refused() -> None:
    good, bad = np.zeros((288, 352), np.uint8), np.zeros((240, 320), np.uint8)
    for pair, name in (((bad, good), "left"), ((good, bad), "right")):
        with pytest.raises(ValueError, match=f"{name} picture is 320x240, the calibration 352x288"):
            rectifier(TOED_IN)(*pair)
