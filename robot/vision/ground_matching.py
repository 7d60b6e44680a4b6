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
from robot.vision.ground_patches import LEAST_CONTRAST, bilinear, normalised, patches_at
from robot.vision.ground_subpixel import FINE_HALF, placed

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Pixels = NDArray[np.float64]
Columns = NDArray[np.float64]

COARSE_HALF = 3
"""Half the side of the patches compared in the half-size pictures, px of these."""
LEAST_COARSE, LEAST_CORRELATION = 0.75, 0.85
RIVAL_SHARE = 0.95
"""A second peak this share as high as the best makes a match ambiguous."""
WAY_BACK_PX = 2.0
STEEPEST_LINE = 0.6
"""Rise of an epipolar line per column: patches are not turned along it."""
FARTHEST_STEP_PX, BAND_PX = 2.0, 1.2
"""How far a match may lie from where the small pictures have it, and from its line."""


@dataclass(frozen=True, slots=True, eq=False)
class EyePictures:
    """A pair's pictures as matching wants them: float32 grey, full and half size, a little smoothed."""

    left: Floats
    right: Floats
    half_left: Floats
    half_right: Floats

    @classmethod
    def of(cls, left: Image | Floats, right: Image | Floats) -> EyePictures:
        """Prepare grey pictures (H, W) of equal size, 0..255."""
        one, other = (np.asarray(g, np.float32) for g in (left, right))
        return cls(one, other, _half(one), _half(other))

    @property
    def swapped(self) -> EyePictures:
        """The right eye's picture first."""
        return EyePictures(self.right, self.left, self.half_right, self.half_left)


@dataclass(frozen=True, slots=True, eq=False)
class EpipolarMatches:
    """Where features (N) of the left picture are in the right one.

    right (N, 2): u, v px. sigma_px (N,): standard deviation along the line. correlation (N,): -1..1. sure
    (N,) bool: well alike, without a rival, and found again from the right picture; others mean nothing.
    """

    right: Pixels
    sigma_px: Vector
    correlation: Vector
    sure: Mask


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Best places of one search: u, v px, score, and whether to believe them."""

    u: Columns
    v: Columns
    score: Floats
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
    found = np.linalg.inv(rig.right.matrix).T @ cross @ rig.R @ np.linalg.inv(rig.left.matrix)
    return np.asarray(found / np.linalg.norm(found))


def match_in_bands(
    pictures: EyePictures, points: Pixels, fundamental: Matrix, low: Columns, high: Columns
) -> EpipolarMatches:
    """Find features of the left picture in bands about their epipolar lines, one pixel to both sides.

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
    if len(points) == 0:
        return EpipolarMatches(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0, np.bool_))
    lines = epipolar_lines(fundamental, points)
    rough = _coarse(pictures, points, lines, low, high)
    rows = np.flatnonzero(rough.good)
    right = np.column_stack([rough.u, rough.v])
    rows = _found_back(pictures, points, right, fundamental, low, high, np.flatnonzero(rough.good))
    return _refined(pictures, points, right, rows)


def match_nearby(
    pictures: EyePictures, points: Pixels, fundamental: Matrix, reach_px: float
) -> EpipolarMatches:
    """The same for pictures so aligned that a match lies within `reach_px` columns of the feature.

    Nothing is searched back: the few columns leave little to confuse, and who asks has a model to check by.

    Args:
        pictures, points: see `match_in_bands`.
        fundamental: (3, 3) of the aligned pair.
        reach_px: to both sides.

    Raises:
        ValueError: lines so steep that columns do not run along them.
    """
    if len(points) == 0:
        return EpipolarMatches(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0, np.bool_))
    lines = epipolar_lines(fundamental, points)
    rough = _coarse(pictures, points, lines, points[:, 0] - reach_px, points[:, 0] + reach_px)
    return _refined(pictures, points, np.column_stack([rough.u, rough.v]), np.flatnonzero(rough.good))


def _refined(pictures: EyePictures, points: Pixels, right: Pixels, rows: NDArray[np.intp]) -> EpipolarMatches:
    """Matches with `rows` placed to a fraction, the others not sure."""
    count = len(points)
    sigma, correlation, sure = np.full(count, np.inf), np.zeros(count), np.zeros(count, np.bool_)
    if len(rows):
        start = right[rows]
        right[rows], sigma[rows], correlation[rows] = placed(
            pictures.left, pictures.right, points[rows], start
        )
        along, across = np.abs(right[rows] - start).T
        near = (along <= FARTHEST_STEP_PX) & (across <= BAND_PX)
        sure[rows] = (
            near & (correlation[rows] >= LEAST_CORRELATION) & _within(pictures.right, right[rows], FINE_HALF)
        )
    return EpipolarMatches(right, sigma, correlation, sure)


def _found_back(
    pictures: EyePictures, points: Pixels, right: Pixels, fundamental: Matrix, low: Columns, high: Columns,
    rows: NDArray[np.intp],
) -> NDArray[np.intp]:  # fmt: skip
    """Of the matches `rows` those whose right place leads back to the left one, over the same disparities."""
    if not len(rows):
        return rows
    home, there = points[rows, 0], right[rows, 0]
    lines = epipolar_lines(fundamental.T, right[rows])
    back = _coarse(pictures.swapped, right[rows], lines, there + home - high[rows], there + home - low[rows])
    return np.asarray(rows[back.good & (np.abs(back.u - home) <= WAY_BACK_PX)])


def epipolar_lines(fundamental: Matrix, points: Pixels) -> Matrix:
    """Lines (N, 3) a u + b v + c = 0 of points (N, 2) in the other picture, scaled to b = 1.

    Raises:
        ValueError: steeper than 31 degrees.
    """
    lines = np.column_stack([points, np.ones(len(points))]) @ fundamental.T
    if (np.abs(lines[:, 0]) > STEEPEST_LINE * np.abs(lines[:, 1])).any():
        raise ValueError("epipolar lines as steep as this are not followed: rectify the pair first")
    return np.asarray(lines / lines[:, 1:2])


def alikeness(left: Floats, right: Floats, points: Pixels) -> Floats:
    """Correlation -1..1 (N,) of the patches about the same pixels (N, 2) of two pictures; 0 where plain."""
    one, other = (patches_at(g, points[:, 0], points[:, 1], FINE_HALF) for g in (left, right))
    return np.asarray(np.einsum("nij,nij->n", normalised(one), normalised(other)), np.float32)


# -------------------------------------------------------------------------------------- coarse and fine


def _half(picture: Floats) -> Floats:
    size = max(picture.shape[1] // 2, 1), max(picture.shape[0] // 2, 1)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)


def _coarse(pictures: EyePictures, points: Pixels, lines: Matrix, low: Columns, high: Columns) -> _Found:
    """The same in pictures of half size, whose pixel k covers 2k and 2k + 1. Places in full pixels."""
    here = 0.5 * (points - 0.5)
    halved = np.column_stack(
        [lines[:, 0], np.ones(len(lines)), 0.5 * (lines[:, 2] + 0.5 + 0.5 * lines[:, 0])]
    )
    first, last = np.floor(0.5 * (low - 0.5)) - 1.0, np.ceil(0.5 * (high - 0.5)) + 1.0
    count = int((last - first).max()) + 1
    patches = normalised(patches_at(pictures.half_left, here[:, 0], here[:, 1], COARSE_HALF))
    score = _scores(patches, pictures.half_right, halved, first, count)
    place = first[:, None] + np.arange(count)
    width = pictures.half_right.shape[1]
    allowed = (place >= COARSE_HALF) & (place <= width - 1 - COARSE_HALF) & (place <= last[:, None])
    score = np.where(allowed, score, np.float32(-1.0))
    at, best = np.arange(len(points)), score.argmax(axis=1)
    peak = score[at, best]
    beside = np.abs(np.arange(count) - best[:, None]) > COARSE_HALF
    rival = np.where(beside, score, np.float32(-1.0)).max(axis=1)
    # At the band's end it may rise further outside.
    ends = (best == 0) | (best >= np.minimum(last - first, count - 1)) | (place[at, best] <= COARSE_HALF)
    good = (
        (peak >= LEAST_COARSE)
        & (rival < RIVAL_SHARE * peak)
        & ~ends
        & _within(pictures.half_left, here, COARSE_HALF)
    )
    u = 2.0 * place[at, best] + 0.5
    return _Found(u, -(lines[:, 0] * u + lines[:, 2]), peak, good)


def _within(picture: Floats, points: Pixels, half: int) -> Mask:
    height, width = picture.shape
    u, v = points.T
    inside = (u >= half) & (u <= width - 1 - half)
    return np.asarray(inside & (v >= half) & (v <= height - 1 - half))


def _scores(patches: Floats, other: Floats, lines: Matrix, first: Columns, count: int) -> Floats:
    """Correlation (N, count) of patches (N, S, S) with columns first.. of the lines."""
    number, side = patches.shape[:2]
    half = side // 2
    long = count + 2 * half
    u = (first[:, None] + np.arange(-half, count + half)).astype(np.float32)
    v = -(lines[:, :1].astype(np.float32) * u + lines[:, 2:].astype(np.float32))
    off = np.arange(-half, half + 1, dtype=np.float32)
    v_all = v[:, None, :] + off[:, None]
    u_all = np.repeat(u[:, None, :], side, axis=1)
    band = bilinear(other, u_all.reshape(-1, long), v_all.reshape(-1, long))
    band -= np.float32(128.0)
    return _correlated(patches, band.reshape(number, side, long))


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
    return np.asarray(
        cv2.boxFilter(values, cv2.CV_32F, (side, 1), normalize=False, anchor=(0, 0))[
            :, : values.shape[1] - side + 1
        ],
        np.float32,
    )
