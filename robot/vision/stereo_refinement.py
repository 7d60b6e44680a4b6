"""From the aggregation's half-size winners to a disparity for every pixel of the picture.

`fill_rows` and `enlarge` make the map dense and as large as the picture; `subpixel` fits each disparity to
the grey values by least squares, which removes the bias towards whole levels (pixel locking) that any
parabola over costs leaves, and tells how sure the value is.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Index = NDArray[np.int32]

WINDOW_PX = 9
"""Side of the window of the least-squares fit."""
SMOOTHING_PX = 1.0
"""Of both pictures before the fit: what is finer, interpolation distorts."""
SLOW_PX = 9
"""Grey values' means over so many pixels are taken out: eyes differ in exposure."""
LARGEST_STEP_PX = 0.5
"""A fit that leads farther away has found something else."""
JUMP = 0.5
"""Levels; neighbours farther apart lie on different surfaces."""
LEAST_ENERGY = np.float32(0.02)
"""Added to gradient energies, (grey levels / px)^2: nothing is learnt from a blank wall."""


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
    return _fill_blank_rows(filled, known.any(axis=1))


def _fill_blank_rows(filled: Floats, seen: Mask) -> Floats:
    if seen.all():
        return filled
    if not seen.any():
        return np.zeros_like(filled)
    rows = np.flatnonzero(seen)
    nearest = rows[np.abs(np.arange(len(seen))[:, None] - rows[None, :]).argmin(axis=1)]
    return np.ascontiguousarray(filled[nearest])


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
    for down in (0, 1):
        for right in (0, 1):
            own = grey[2 * rows + down, 2 * columns + right].astype(np.int16)
            best, unlike = at, np.abs(own - guide[rows, columns])
            for dy, dx in ((0, 2 * right - 1), (2 * down - 1, 0), (2 * down - 1, 2 * right - 1)):
                y, x = np.clip(rows + dy, 0, height - 1), np.clip(columns + dx, 0, width - 1)
                other = np.abs(own - guide[y, x])
                best = np.where(other < unlike, y * width + x, best)
                unlike = np.minimum(other, unlike)
            out[2 * rows + down, 2 * columns + right] = best
    return out


def subpixel(left: Image, right: Image, values: Floats) -> tuple[Floats, Floats]:
    """One Gauss-Newton step of the disparities (H, W) towards equal grey values in a small window.

    left, right: (H, W) uint8. Returns the refined values (no farther off than `LARGEST_STEP_PX`) and the
    windows' mean squared gradient, (grey levels / px)^2, from which the value's standard deviation follows.

    >>> noise = np.random.default_rng(2).integers(0, 255, (60, 100)).astype(np.uint8)
    >>> scene = cv2.GaussianBlur(noise, (0, 0), 2.0)
    >>> refined, _ = subpixel(scene[:, :90], scene[:, 6:96], np.full((60, 90), 5.6, np.float32))
    >>> round(float(np.median(refined)), 1)
    6.0
    """
    level_left, level_right = _levelled(left), _levelled(right)
    height, width = values.shape
    columns = np.arange(width, dtype=np.float32)[None, :] - values
    rows = np.repeat(np.arange(height, dtype=np.float32)[:, None], width, axis=1)
    warped = cv2.remap(level_right, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    # The mean of both gradients makes the step accurate to second order (ESM, Benhimane & Malis 2004).
    gradient = cv2.Sobel(cv2.add(level_left, warped), cv2.CV_32F, 1, 0, ksize=3, scale=1 / 16)
    error = cv2.multiply(gradient, cv2.subtract(level_left, warped))
    window = (WINDOW_PX, WINDOW_PX)
    energy = cv2.blur(cv2.multiply(gradient, gradient), window)
    step = cv2.divide(cv2.blur(error, window), cv2.add(energy, float(LEAST_ENERGY)))
    refined = values - np.clip(step, -LARGEST_STEP_PX, LARGEST_STEP_PX)
    return refined.astype(np.float32, copy=False), energy.astype(np.float32, copy=False)


def _levelled(grey: Image) -> Floats:
    smooth = cv2.GaussianBlur(grey.astype(np.float32), (5, 5), SMOOTHING_PX)
    return cv2.subtract(smooth, cv2.blur(smooth, (SLOW_PX, SLOW_PX))).astype(np.float32, copy=False)
