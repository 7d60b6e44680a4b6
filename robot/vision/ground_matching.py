"""Matching features along epipolar lines by normalised correlation, all at once, with an honest sigma.

A feature of the left picture is looked for in a band about its line l' = F x in the right one (METHODS 4).
The search runs in pictures of half size; what is found there is placed in the full ones to a fraction (least
squares, the patch free to slant, see `ground_subpixel`). Rows of a rectified pair are the special case.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from calib.model import Matrix, StereoRig, Vector
from robot.messages import Image
from robot.vision.ground_patches import (
    LEAST_CONTRAST,
    bilinear,
    normalised,
    patches_at,
    squares,
    through_squares,
)
from robot.vision.ground_plane import through, to_rays, warp_to_left
from robot.vision.ground_subpixel import FINE_HALF, placed
from robot.vision.half_size import half_size, homography_to_half, to_full, to_half

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Pixels = NDArray[np.float64]
Columns = NDArray[np.float64]

COARSE_HALF = 3
"""Half the side of the patches compared in the half-size pictures, px of these."""
LEAST_COARSE, LEAST_CORRELATION = 0.75, 0.85
"""Correlation of the half-size patches, and of the full ones once they are placed to a fraction."""
RIVAL_SHARE = 0.95
"""A second peak this share as high as the best makes a match ambiguous."""
WAY_BACK_PX = 2.0
"""Way there and way back may differ by a pixel of the half-size pictures."""
STEEPEST_LINE = 0.6
"""Rise of an epipolar line per column: patches are not turned along it."""
FARTHEST_STEP_PX, BAND_PX = 2.0, 1.2
"""How far a match may lie from where the small pictures have it, and from its line."""
WORST_SIGMA_PX = 0.33
"""One good match in a hundred is worse; a patch that shows two things one behind the other mostly is."""


@dataclass(frozen=True, slots=True, eq=False)
class EyePictures:
    """A pair's pictures as matching wants them: grey float32 (H, W) 0..255, full and half size."""

    left: Floats
    right: Floats
    half_left: Floats
    half_right: Floats

    @classmethod
    def of(cls, left: Image | Floats, right: Image | Floats) -> EyePictures:
        """Prepare grey pictures (H, W) of equal size, 0..255."""
        one, other = (np.asarray(g, np.float32) for g in (left, right))
        return cls(one, other, half_size(one), half_size(other))


@dataclass(frozen=True, slots=True, eq=False)
class EpipolarMatches:
    """Where features (N) of the left picture are in the right one.

    right (N, 2): u, v px. sigma_px (N,): standard deviation along the line. correlation (N,): -1..1. sure
    (N,) bool: well alike and without a rival; others mean nothing.
    """

    right: Pixels
    sigma_px: Vector
    correlation: Vector
    sure: Mask


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Best places (N, 2) of one search in half-size pictures, px of full ones; which (N,) to believe."""

    places: Pixels
    good: Mask


def fundamental_matrix(rig: StereoRig) -> Matrix:
    """F with x_r' F x_l = 0 for pixels of one point: K_r^-T [t]x R K_l^-1, (3, 3), scaled to unit norm.

    >>> F = fundamental_matrix(StereoRig.parallel(352, 288, 305.0, 0.06))
    >>> line = F @ (100.0, 80.0, 1.0)
    >>> round(float(-line[2] / line[1]), 6)  # the row of a rectified pair
    80.0
    """
    x, y, z = rig.translation
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    found = to_rays(rig.right).T @ cross @ rig.R @ to_rays(rig.left)
    return np.asarray(found / np.linalg.norm(found))


def match_in_bands(
    pictures: EyePictures, points: Pixels, fundamental: Matrix, low: Columns, high: Columns
) -> EpipolarMatches:
    """Find features of the left picture in bands about their epipolar lines, one pixel to both sides.

    What one eye alone sees may still be like something else by chance: see `leads_back`.

    Args:
        pictures: of both eyes.
        points: (N, 2) u, v px of the left picture.
        fundamental: (3, 3), see `fundamental_matrix`.
        low, high: (N,) columns of the right picture between which to search.

    Raises:
        ValueError: lines so steep that columns do not run along them.

    >>> noise = np.random.default_rng(1).integers(0, 255, (120, 260), np.uint8)
    >>> scene = cv2.GaussianBlur(noise, (0, 0), 2.0)
    >>> rows = fundamental_matrix(StereoRig.parallel(240, 120, 200.0, 0.06))
    >>> at = np.array([[100.0, 60.0], [150.0, 40.0]])
    >>> eyes = EyePictures.of(scene[:, :240], scene[:, 12:252])
    >>> found = match_in_bands(eyes, at, rows, at[:, 0] - 60, at[:, 0])
    >>> (at - found.right)[:, 0].round(1).tolist(), found.sure.tolist()
    ([12.0, 12.0], [True, True])
    """
    count = len(points)
    sigma, correlation, sure = np.full(count, np.inf), np.zeros(count), np.zeros(count, np.bool_)
    if not count:
        return EpipolarMatches(np.zeros((0, 2)), sigma, correlation, sure)
    lines = epipolar_lines(fundamental, points)
    rough = _coarse(pictures.half_left, pictures.half_right, points, lines, low, high)
    right, rows = rough.places, np.flatnonzero(rough.good)
    if len(rows):
        start = right[rows]
        right[rows], sigma[rows], correlation[rows] = placed(
            pictures.left, pictures.right, points[rows], *squares(start, FINE_HALF)
        )
        sure[rows] = _well_placed(right[rows], start, sigma[rows], correlation[rows])
        sure &= _within(pictures.right, right, FINE_HALF)
    return EpipolarMatches(right, sigma, correlation, sure)


def match_near(
    pictures: EyePictures, points: Pixels, fundamental: Matrix, homography: Matrix, reach_px: float
) -> EpipolarMatches:
    """Find features of the left picture near where a homography takes them: a plane's own features.

    A plane seen under a flat angle looks slanted to the other eye; here patches are cut out slanted alike.
    Nothing is searched back: the few columns leave little to confuse, and who asks has a model to check by.

    Args:
        pictures, points, fundamental: see `match_in_bands`.
        homography: (3, 3) takes pixels of the left picture to the right one.
        reach_px: how far to both sides of there.

    Raises:
        ValueError: lines so steep that columns do not run along them.
    """
    count = len(points)
    sigma, correlation, sure = np.full(count, np.inf), np.zeros(count), np.zeros(count, np.bool_)
    if not count:
        return EpipolarMatches(np.zeros((0, 2)), sigma, correlation, sure)
    lines = epipolar_lines(homography.T @ fundamental, points)
    aligned = warp_to_left(pictures.half_right, homography_to_half(homography))
    rough = _coarse(
        pictures.half_left, aligned, points, lines, points[:, 0] - reach_px, points[:, 0] + reach_px
    )
    right, rows = through(homography, rough.places), np.flatnonzero(rough.good)
    if len(rows):
        start = right[rows]
        right[rows], sigma[rows], correlation[rows] = placed(
            pictures.left, pictures.right, points[rows],
            *through_squares(homography, rough.places[rows], FINE_HALF),
        )  # fmt: skip
        sure[rows] = _well_placed(right[rows], start, sigma[rows], correlation[rows])
        sure &= _within(pictures.right, right, FINE_HALF)
    return EpipolarMatches(right, sigma, correlation, sure)


def _well_placed(places: Pixels, start: Pixels, sigma_px: Vector, correlation: Vector) -> Mask:
    """Which places (N, 2) are alike enough, and where the search in small pictures had them."""
    along, across = np.abs(places - start).T
    near = (along <= FARTHEST_STEP_PX) & (across <= BAND_PX)
    good: Mask = near & (correlation >= LEAST_CORRELATION) & (sigma_px <= WORST_SIGMA_PX)
    return good


def leads_back(
    pictures: EyePictures, points: Pixels, right: Pixels, fundamental: Matrix, low: Columns, high: Columns
) -> Mask:
    """Which matches (N,) are found again the other way, over the same disparities: the left-right check.

    right: (N, 2) px of the right picture, where `match_in_bands` found `points`; the rest as there.
    """
    if not len(points):
        return np.zeros(0, np.bool_)
    ends = right[:, 0] + points[:, 0]
    lines = epipolar_lines(fundamental.T, right)
    back = _coarse(pictures.half_right, pictures.half_left, right, lines, ends - high, ends - low)
    return back.good & (np.abs(back.places[:, 0] - points[:, 0]) <= WAY_BACK_PX)


def epipolar_lines(fundamental: Matrix, points: Pixels) -> Matrix:
    """Lines (N, 3) a u + b v + c = 0 of points (N, 2) in the other picture, scaled to b = 1.

    Raises:
        ValueError: steeper than 31 degrees.
    """
    lines = np.column_stack([points, np.ones(len(points))]) @ fundamental.T
    if (np.abs(lines[:, 0]) > STEEPEST_LINE * np.abs(lines[:, 1])).any():
        raise ValueError("epipolar lines as steep as this are not followed: rectify the pair first")
    return np.asarray(lines / lines[:, 1:2])


# ------------------------------------------------------------------------------------------ the search


def _coarse(
    picture: Floats, other: Floats, points: Pixels, lines: Matrix, low: Columns, high: Columns
) -> _Found:
    """The best places of points (N, 2) of one half-size picture in the other, along lines (N, 3).

    Points, lines and columns low..high are those of the full pictures.
    """
    here = to_half(points)
    slope = lines[:, :1]
    halved = np.column_stack([slope, 0.5 * (lines[:, 2:] + 0.5 + 0.5 * slope)])
    first, last = np.floor(to_half(low)) - 1.0, np.ceil(to_half(high)) + 1.0
    count = int((last - first).max()) + 1
    score = _scores(normalised(patches_at(picture, here, COARSE_HALF)), other, halved, first, count)
    step = np.arange(count)
    place = first[:, None] + step
    rim = other.shape[1] - 1 - COARSE_HALF
    score[(place < COARSE_HALF) | (place > np.minimum(rim, last)[:, None])] = -1.0
    at, best = np.arange(len(points)), score.argmax(axis=1)
    peak, u = score[at, best], place[at, best]
    score[np.abs(step - best[:, None]) <= COARSE_HALF] = -1.0
    # At the band's end it may rise further outside.
    ends = (best == 0) | (best >= last - first) | (u <= COARSE_HALF)
    good = (peak >= LEAST_COARSE) & (score.max(axis=1) < RIVAL_SHARE * peak) & ~ends
    good &= _within(picture, here, COARSE_HALF)
    full = to_full(u)
    return _Found(np.column_stack([full, -(lines[:, 0] * full + lines[:, 2])]), good)


def _within(picture: Floats, points: Pixels, half: int) -> Mask:
    height, width = picture.shape
    u, v = points.T
    inside = (u >= half) & (u <= width - 1 - half)
    return np.asarray(inside & (v >= half) & (v <= height - 1 - half))


def _scores(patches: Floats, other: Floats, lines: Matrix, first: Columns, count: int) -> Floats:
    """Correlation (N, count) of normal patches (N, S S) along lines v = -(a u + c), (N, 2): a, c."""
    number, half = len(patches), COARSE_HALF
    side = 2 * half + 1
    long = count + 2 * half
    u = (first[:, None] + np.arange(-half, count + half)).astype(np.float32)
    v = -(lines[:, :1].astype(np.float32) * u + lines[:, 1:].astype(np.float32))
    off = np.arange(-half, half + 1, dtype=np.float32)
    v_all = (v[:, None, :] + off[:, None]).reshape(number, -1)
    u_all = np.broadcast_to(u[:, None, :], (number, side, long)).reshape(number, -1)
    band = bilinear(other, u_all, v_all).reshape(number, side, long)
    # Small numbers keep their sums of squares exact.
    band -= np.float32(128.0)
    return _correlated(patches.reshape(number, side, side), band)


def _correlated(patches: Floats, band: Floats) -> Floats:
    """Correlation (N, W - S + 1) of normal patches (N, S, S) along bands (N, S, W)."""
    number, side, long = band.shape
    count = long - side + 1
    # Column j of the patch against every column of the band, then the sum along the diagonals.
    table = np.matmul(patches.transpose(0, 2, 1), band)
    each, row, item = table.strides
    cross = np.einsum("njd->nd", as_strided(table, (number, side, count), (each, row + item, item)))
    mean = _sums(np.einsum("nrw->nw", band), side)
    square = _sums(np.einsum("nrw,nrw->nw", band, band), side)
    least = np.float32((LEAST_CONTRAST * side) ** 2)
    energy = np.maximum(square - mean * mean * np.float32(1.0 / side**2), least)
    return np.asarray(cross / np.sqrt(energy), np.float32)


def _sums(values: Floats, side: int) -> Floats:
    """Sums of `side` neighbours along rows (N, W) -> (N, W - S + 1)."""
    summed = cv2.boxFilter(values, cv2.CV_32F, (side, 1), normalize=False, anchor=(0, 0))
    return np.asarray(summed[:, : values.shape[1] - side + 1], np.float32)
