"""From the aggregation's half-size winners to a disparity for every pixel of the picture.

`fill_rows` and `enlarge` make the map dense and as large as the picture; `fit` brings each disparity to where
the grey values of both eyes are most alike, by least squares. That removes the bias towards whole levels
(pixel locking) that any parabola over costs leaves, tells how sure the value is, and finds matches that are
none at all.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Index = NDArray[np.int32]

SMOOTHING_PX = 1.0
"""Of both pictures before the fit: what is finer, interpolation distorts."""
SLOW_PX = 9
"""Grey values' means over so many pixels are taken out: eyes differ in exposure."""
LARGEST_STEP_PX = 0.5
SMOOTH_PX = 1.0
"""Disparities this near to their window's mean lie on one surface: the mean replaces them before a step."""
LEAST_ENERGY = 0.02
"""Added to gradient energies, (grey levels / px)^2: nothing is learnt from a blank wall."""
LARGEST_CORRECTION_PX = 1.0
"""A fit that leads farther away has found something else."""
LEAST_RESIDUAL = np.float32(0.05)
"""Grey levels squared: rounding to whole grey levels is left in every picture."""
SIGMA_FLOOR_PX = 0.06
"""What no fit can know: calibration, slanted and curved surfaces."""
JUMP = 0.5
"""Levels; neighbours farther apart lie on different surfaces."""


@dataclass(frozen=True, slots=True)
class Window:
    """Of the least-squares fit: its half side in pixels (odd), the number of steps, and what is a match.

    Windows less alike than `least_correlation` are none: with windows of 14 px one value in nine between 0.7
    and 0.8 was more than 2 px off. Larger windows are alike by chance less often. Neighbouring pixels err
    together, by lens, smoothing and interpolation: `noise_correlation` of them count as one.
    """

    half_side_px: int = 7
    steps: int = 2
    least_correlation: float = 0.8
    noise_correlation: float = 10.0

    def __post_init__(self) -> None:
        if self.half_side_px < 1 or self.half_side_px % 2 == 0 or self.steps < 1:
            raise ValueError(
                f"half_side_px must be odd and steps 1 or more, got {self.half_side_px}, {self.steps}"
            )


WINDOW = Window()


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """values (H, W) float32 px; sigma_px (H, W) float32, standard deviation; good (H, W) bool: a match."""

    values: Floats
    sigma_px: Floats
    good: Mask


def fill_rows(values: Floats, known: Mask) -> Floats:
    """Values (h, w) with gaps taken from the row's nearest known neighbours, the farther surface's of both.

    A gap beside an object is what the object hides from the other eye, hence background. Rows without any
    known pixel take the nearest row's; all zeros where nothing is known.

    >>> fill_rows(np.array([[9, 0, 4, 0]], np.float32), np.array([[True, False, True, False]])).tolist()
    [[9.0, 4.0, 4.0, 4.0]]
    """
    height, width = values.shape
    columns = np.arange(width, dtype=np.int32)
    before = np.maximum.accumulate(np.where(known, columns, np.int32(-1)), axis=1)
    behind = np.minimum.accumulate(np.where(known, columns, np.int32(width))[:, ::-1], axis=1)[:, ::-1]
    rows = np.arange(height, dtype=np.int32)[:, None] * np.int32(width)
    nothing = np.float32(np.inf)
    from_left = np.where(before >= 0, np.take(values, rows + np.maximum(before, 0)), nothing)
    from_right = np.where(behind < width, np.take(values, rows + np.minimum(behind, width - 1)), nothing)
    filled: Floats = np.minimum(from_left, from_right)
    return _fill_blank_rows(filled, np.asarray(known.any(axis=1), np.bool_))


def _fill_blank_rows(filled: Floats, seen: Mask) -> Floats:
    if seen.all():
        return filled
    if not seen.any():
        return np.zeros_like(filled)
    rows = np.flatnonzero(seen)
    nearest = rows[np.abs(np.arange(len(seen))[:, None] - rows[None, :]).argmin(axis=1)]
    return np.ascontiguousarray(filled[nearest])


def median(values: Floats) -> Floats:
    """Median of each 3 x 3 pixels."""
    return np.asarray(cv2.medianBlur(values.astype(np.float32, copy=False), 3), np.float32)


def enlarge(halved: Floats, guide: Image, grey: Image) -> Index:
    """For each pixel of the picture (2h, 2w), which of the (h, w) values is its own, as a flat index.

    It is the nearest one; at jumps the one of the four nearest whose guide is most like the pixel, so that
    edges follow the picture instead of steps of two pixels. guide: (h, w) uint8, the picture at the values'
    size; grey: (2h, 2w) uint8, the picture itself.
    """
    height, width = halved.shape
    own_index = np.arange(height * width, dtype=np.int32).reshape(height, width)
    out = np.repeat(np.repeat(own_index, 2, axis=1), 2, axis=0)
    square = np.ones((3, 3), np.uint8)
    at = np.flatnonzero(cv2.dilate(halved, square) - cv2.erode(halved, square) > JUMP)
    rows, columns = np.divmod(at, width)
    corner = 4 * rows * width + 2 * columns
    flat_out, flat_guide, flat_grey = out.reshape(-1), guide.reshape(-1).astype(np.int16), grey.reshape(-1)
    for down in (0, 1):
        beside_row = np.clip(rows + (2 * down - 1), 0, height - 1) * width
        for right in (0, 1):
            beside = np.clip(columns + (2 * right - 1), 0, width - 1)
            pixel = corner + 2 * down * width + right
            own = np.take(flat_grey, pixel).astype(np.int16)
            best, unlike = at, np.abs(own - np.take(flat_guide, at))
            for there in (rows * width + beside, beside_row + columns, beside_row + beside):
                other = np.abs(own - np.take(flat_guide, there))
                closer = other < unlike
                best, unlike = np.where(closer, there, best), np.where(closer, other, unlike)
            flat_out[pixel] = best
    return out


def fit(left: Image, right: Image, coarse: Floats, window: Window = WINDOW) -> Fit:
    """Least-squares fit of the disparities (H, W) to the grey values of (H, W) uint8 pictures.

    Gauss-Newton on the shift of a small window (Lucas & Kanade 1981) with the mean of both eyes' gradients
    (Benhimane & Malis 2004), all windows at once. sigma^2 = residual variance over gradient energy, times how
    far neighbouring pixels err together; on simulated rooms two thirds of the errors lie inside one sigma.
    `values` are the coarse ones where the fit is no match.

    >>> noise = np.random.default_rng(2).integers(0, 255, (60, 100)).astype(np.uint8)
    >>> scene = cv2.GaussianBlur(noise, (0, 0), 2.0)
    >>> found = fit(scene[:, :90], scene[:, 6:96], np.full((60, 90), 5.4, np.float32))
    >>> round(float(np.median(found.values)), 1)
    6.0
    """
    means = _Means(coarse.shape, window.half_side_px)
    level_left, level_right = _levelled(left), _levelled(right)
    values = coarse
    for _ in range(window.steps):
        values = _smooth(values, means)
        warped = _warped(level_right, values)
        gradient = cv2.Sobel(cv2.add(level_left, warped), cv2.CV_32F, 1, 0, ksize=3, scale=1 / 16)
        energy = means.of(gradient, gradient)
        slope = means.of(gradient, cv2.subtract(level_left, warped))
        step = np.clip(slope / (energy + LEAST_ENERGY), -LARGEST_STEP_PX, LARGEST_STEP_PX)
        values = np.asarray(cv2.subtract(values, means.enlarged(step)), np.float32)
    own, other = means.of(level_left, level_left), means.of(warped, warped)
    both = means.of(level_left, warped)
    correlation = both / np.sqrt(own * other + np.float32(1e-3))
    residual = np.maximum(own + other - 2.0 * both - step * slope, LEAST_RESIDUAL)
    information = np.float32(means.pixels / window.noise_correlation) * np.maximum(energy, np.float32(1e-6))
    sigma = means.enlarged(np.sqrt(np.float32(SIGMA_FLOOR_PX**2) + residual / information))
    good = means.enlarged(correlation) > window.least_correlation
    good &= cv2.absdiff(values, coarse) <= LARGEST_CORRECTION_PX
    return Fit(np.where(good, values, coarse), sigma, good)


class _Means:
    """Means of products over windows, at half the size: windows side by side see the same."""

    def __init__(self, shape: tuple[int, ...], half_side_px: int) -> None:
        self._full = shape[1], shape[0]
        self._half = (shape[1] + 1) // 2, (shape[0] + 1) // 2
        self._window = half_side_px, half_side_px
        self.pixels = 4 * half_side_px**2

    def of(self, one: NDArray[Any], other: NDArray[Any]) -> Floats:
        """Mean of one * other in each window, (H / 2, W / 2)."""
        return self._mean(cv2.multiply(one, other))

    def _mean(self, plane: NDArray[Any]) -> Floats:
        pooled = cv2.resize(plane, self._half, interpolation=cv2.INTER_AREA)
        return np.asarray(cv2.blur(pooled, self._window), np.float32)

    def local(self, plane: Floats) -> Floats:
        """Mean of a plane in each pixel's window, (H, W)."""
        return self.enlarged(self._mean(plane))

    def enlarged(self, plane: Floats) -> Floats:
        """A half-size plane at full size."""
        return np.asarray(cv2.resize(plane, self._full, interpolation=cv2.INTER_LINEAR), np.float32)


def _smooth(values: Floats, means: _Means) -> Floats:
    """A fit shifts a whole window: what its pixels disagree on must be settled before."""
    mean = means.local(values)
    return np.where(cv2.absdiff(mean, values) < SMOOTH_PX, mean, values)


def _warped(right: Floats, values: Floats) -> Floats:
    """What the right eye sees at each left pixel's match."""
    height, width = values.shape
    columns = np.arange(width, dtype=np.float32)[None, :] - values
    rows = np.repeat(np.arange(height, dtype=np.float32)[:, None], width, axis=1)
    warped = cv2.remap(right, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(warped, np.float32)


def _levelled(grey: Image) -> Floats:
    smooth = cv2.GaussianBlur(grey.astype(np.float32), (5, 5), SMOOTHING_PX)
    return np.asarray(cv2.subtract(smooth, cv2.blur(smooth, (SLOW_PX, SLOW_PX))), np.float32)


def doubled(plane: NDArray[Any]) -> NDArray[Any]:
    """Twice the size, each pixel four times."""
    return cv2.resize(plane, None, fx=2.0, fy=2.0, interpolation=cv2.INTER_NEAREST)
