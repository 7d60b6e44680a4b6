"""Colour layout: which hue lies where in a view, whatever the light's strength.

Log ratios of the channels do not change when the brightness does, so that a printed object keeps its
layout from bright to dark, and an object of the same shape with another print does not pass for it.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image
from robot.vision.windows import Floats

GRID_COLUMNS, GRID_ROWS = 6, 8
LAYOUT_LENGTH = 2 * GRID_COLUMNS * GRID_ROWS
# Dark pixels' ratios are noise: this much grey value is added to every channel before dividing.
_FLOOR = 6.0
# Layouts weaker than this (log units, root mean square) count as colourless.
_COLOURLESS = 0.12


class ColourSums:
    """Sums over rectangles of one BGR picture, made once so that many boxes' layouts are cheap.

    >>> picture = np.full((40, 30, 3), (20, 40, 80), np.uint8)
    >>> bright = ColourSums(picture).layouts(np.array([[0.0, 0.0, 30.0, 40.0]]))
    >>> bright.shape, bool(bright[0, 0] < 0 < bright[0, -1])
    ((1, 96), True)
    """

    def __init__(self, image: Image) -> None:
        self._sums = cv2.integral(image, sdepth=cv2.CV_64F)
        self._height, self._width = image.shape[:2]

    def layouts(self, boxes: NDArray[np.float64]) -> Floats:
        """Log ratios blue/green and red/green on a 6 x 8 grid of each box.

        boxes (k, 4): x, y, w, h in pixels; what lies outside the picture repeats its rim. Returns
        (k, 96) float32: 48 cells of blue/green row by row, then red/green.
        """
        left, right = _cell_edges(boxes[:, 0], boxes[:, 2], GRID_COLUMNS, self._width)
        top, bottom = _cell_edges(boxes[:, 1], boxes[:, 3], GRID_ROWS, self._height)
        left, right = left[:, None, :], right[:, None, :]
        top, bottom = top[:, :, None], bottom[:, :, None]
        sums = self._sums
        totals = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
        areas = (right - left) * (bottom - top)
        logs = np.log(totals / areas[..., None] + _FLOOR)
        blue = (logs[..., 0] - logs[..., 1]).reshape(len(boxes), LAYOUT_LENGTH // 2)
        red = (logs[..., 2] - logs[..., 1]).reshape(len(boxes), LAYOUT_LENGTH // 2)
        return np.concatenate([blue, red], axis=1).astype(np.float32)


def _cell_edges(
    start: NDArray[np.float64], length: NDArray[np.float64], cells: int, limit: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Whole-pixel first and last edges (k, cells) of equal cells, at least a pixel each, inside 0..limit."""
    edges = np.rint(start[:, None] + length[:, None] * (np.arange(cells + 1) / cells)).astype(np.int64)
    first = np.clip(edges[:, :-1], 0, limit - 1)
    return first, np.clip(edges[:, 1:], first + 1, limit)


def layout_similarity(layouts: Floats, others: Floats) -> Floats:
    """Agreement of every layout (k, 96) with every other (m, 96): (k, m), 1 same, 0 unrelated, -1 opposite.

    Two colourless layouts agree.
    """
    strength, other_strength = np.square(layouts).mean(axis=1), np.square(others).mean(axis=1)
    product = layouts @ others.T / layouts.shape[1]
    total = strength[:, None] + other_strength[None, :] + _COLOURLESS**2
    return np.asarray((2.0 * product + _COLOURLESS**2) / total, dtype=np.float32)
