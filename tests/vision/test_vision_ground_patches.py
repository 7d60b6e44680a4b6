"""Patches, and placing them to a fraction: against plain code, at the rim, without texture, in doubt."""

import cv2
import numpy as np
import pytest
from layered_scenes import Layer, cast

from robot.vision.ground_patches import alikeness, normalised, patches_at, squares, through_squares
from robot.vision.ground_subpixel import FINE_HALF, placed


def cloud(seed=0, size=(80, 100), spread=1.5):
    noise = np.random.default_rng(seed).integers(0, 255, size).astype(np.float32)
    return cv2.GaussianBlur(noise, (0, 0), spread)


def test_whole_pixels_are_cut_out_row_by_row() -> None:
    picture = cloud()
    (found,) = patches_at(picture, np.array([[40.0, 30.0]]), 2)
    assert np.allclose(found, picture[28:33, 38:43].ravel(), atol=1e-3)
    between = patches_at(picture, np.array([[40.5, 30.0]]), 2)[0]
    assert np.allclose(between, 0.5 * (picture[28:33, 38:43] + picture[28:33, 39:44]).ravel(), atol=0.5)


def test_beyond_the_rim_the_picture_repeats_and_none_is_none() -> None:
    picture = cloud()
    (found,) = patches_at(picture, np.array([[0.0, 0.0]]), 1)
    assert np.allclose(found.reshape(3, 3)[:2, :2], picture[0, 0], atol=1e-3)
    assert patches_at(picture, np.zeros((0, 2)), 3).shape == (0, 49)
    assert alikeness(*2 * [np.zeros((0, 49), np.float32)]).shape == (0,)


def test_a_homography_moves_every_pixel_of_a_patch() -> None:
    homography = np.array([[1.0, 0.2, -30.0], [0.02, 1.1, 3.0], [1e-4, 2e-4, 1.0]])
    points = np.array([[50.0, 40.0], [200.0, 150.0]])
    moved = np.stack(through_squares(homography, points, 3), axis=-1)
    plain = np.stack(squares(points, 3), axis=-1).astype(np.float64)
    assert np.allclose(moved, cv2.perspectiveTransform(plain, homography), atol=1e-3)


def test_likeness_is_the_correlation_whatever_the_exposure() -> None:
    one, other = cloud(1).reshape(80, 100)[:20], cloud(2).reshape(80, 100)[:20]
    expected = [np.corrcoef(a, b)[0, 1] for a, b in zip(one, other, strict=True)]
    assert np.allclose(alikeness(one, other), expected, atol=1e-4)
    assert np.allclose(alikeness(one, 0.5 * one + 60.0), 1.0, atol=1e-4)
    # One grey level of noise is no texture.
    faint = np.random.default_rng(3).normal(90.0, 1.0, (5, 100)).astype(np.float32)
    assert (alikeness(faint, faint) == 0.0).all()
    assert (normalised(np.full((2, 9), 255.0, np.float32)) == 0.0).all()


@pytest.mark.parametrize("gain", [0.6, 1.0, 1.6])
@pytest.mark.parametrize("slant", [0.0, 0.06])
def test_a_shift_is_found_through_gain_and_slant(gain: float, slant: float) -> None:
    scene = cast((Layer(6.4, (0, 0, 0, 0), 120, 3, contrast=20.0, down=slant),), 160, 120, 0.5, 1)
    left, right = (g.astype(np.float32) for g in (scene.left, scene.right))
    u, v = (g.ravel() for g in np.meshgrid(np.arange(40.5, 130, 15), np.arange(24.5, 100, 15)))
    points = np.column_stack([u, v])
    truth = 6.4 + slant * (points[:, 1] + 0.5 - 60.0)
    start = points - np.column_stack([np.rint(truth), np.zeros(len(u))])
    places, sigma, correlation = placed(left, gain * right + 10.0, points, *squares(start, FINE_HALF))
    off = points[:, 0] - places[:, 0] - truth
    assert np.median(np.abs(off)) < 0.05
    assert np.abs(places[:, 1] - points[:, 1]).max() < 0.3
    assert np.median(correlation) > 0.98
    assert 0.03 < np.median(sigma) < 0.1


def test_other_texture_is_unlike_and_vague() -> None:
    left, right = cloud(4), cloud(5)
    points = np.column_stack([np.arange(20.0, 80.0, 4), np.full(15, 40.0)])
    _, sigma, correlation = placed(left, right, points, *squares(points, FINE_HALF))
    _, sure, same = placed(left, left, points, *squares(points, FINE_HALF))
    assert (same > 0.99).all()
    assert np.median(correlation) < 0.7
    assert np.median(sigma) > 3 * np.median(sure)


@pytest.mark.parametrize("level", [0.0, 128.0, 255.0])
def test_plain_pictures_move_nothing_and_are_finite(level: float) -> None:
    plain = np.full((60, 60), level, np.float32)
    points = np.array([[30.0, 30.0], [0.0, 0.0], [59.0, 59.0]])
    places, sigma, correlation = placed(plain, plain, points, *squares(points, FINE_HALF))
    assert np.allclose(places, points)
    assert np.isfinite(sigma).all()
    assert np.isfinite(correlation).all()
    assert (correlation < 0.5).all()
