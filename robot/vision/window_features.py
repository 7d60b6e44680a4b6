"""What a window net sees: directions of edges in cells of a picture, whatever the light."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image
from robot.vision.gradient_histograms import CELL_PX, UNSIGNED, gradient_histograms

Floats = NDArray[np.float32]

SMOOTHING_PX = 0.8
DIRECTIONS = UNSIGNED
FAINT = 1.0
"""Noise of a dark picture must not look like edges."""


def edge_cells(grey: Image) -> Floats:
    """(H / CELL_PX, W / CELL_PX, DIRECTIONS) float32 in 0 .. 0.4: strengths of edges by direction, unsigned.

    grey (H, W) uint8; what is over at the right and below is left out.
    """
    height, width = (edge // CELL_PX * CELL_PX for edge in grey.shape)
    smooth = cv2.GaussianBlur(grey[:height, :width], (0, 0), SMOOTHING_PX)
    found = gradient_histograms(np.asarray(smooth, np.uint8), FAINT)[-DIRECTIONS:]
    return np.ascontiguousarray(found.transpose(1, 2, 0))


def windows_of(cells: Floats, rows: int, columns: int) -> Floats:
    """All windows of so many cells: (R - rows + 1, C - columns + 1, rows * columns * DIRECTIONS) of cells
    (R, C, DIRECTIONS); a view's copy, row by row of each window.

    >>> cells = np.arange(3 * 4 * DIRECTIONS, dtype=np.float32).reshape(3, 4, DIRECTIONS)
    >>> windows_of(cells, 2, 2).shape == (2, 3, 4 * DIRECTIONS)
    True
    """
    views = np.lib.stride_tricks.sliding_window_view(cells, (rows, columns), axis=(0, 1))
    return views.transpose(0, 1, 3, 4, 2).reshape(*views.shape[:2], -1)
