"""What a piece of picture looks like, coarsely: histograms of gradient directions in square cells.

Each cell counts the strength of its gradients by direction, once with sign (dark to bright) and once
without, and is divided by the strength of its neighbourhood: light changes little of it.

Source: Dalal and Triggs, "Histograms of oriented gradients for human detection" (CVPR 2005); signed and
unsigned together as Felzenszwalb et al., "Object detection with discriminatively trained part-based models"
(PAMI 2010), by one normalisation instead of four.
"""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image

Floats = NDArray[np.float32]

CELL_PX = 4
UNSIGNED = 9
"""Directions within half a turn; twice as many within a whole one."""
CHANNELS = 3 * UNSIGNED
FAINT = 0.1
"""Squared mean gradient (grey levels / 2 px) up to which a cell counts as bare, unless said otherwise."""
MOST = 0.4
"""One strong edge is no more than this."""


def gradient_histograms(grey: Image, faint: float = FAINT) -> Floats:
    """(CHANNELS, H / CELL_PX, W / CELL_PX) float32 in 0 .. `MOST`: signed directions first, then unsigned.

    Args:
        grey: (H, W) uint8, both multiples of `CELL_PX`.
        faint: squared mean gradient up to which a cell counts as bare.

    >>> stripes = np.tile(np.repeat(np.array([50, 200], np.uint8), 4), (16, 2))
    >>> found = gradient_histograms(stripes)
    >>> found.shape, int(found[18:].sum(axis=(1, 2)).argmax())
    ((27, 4, 4), 0)
    """
    rows, columns = grey.shape[0] // CELL_PX, grey.shape[1] // CELL_PX
    across = cv2.Sobel(grey, cv2.CV_32F, 1, 0, ksize=1)
    down = cv2.Sobel(grey, cv2.CV_32F, 0, 1, ksize=1)
    strength, angle = cv2.cartToPolar(across, down)
    direction = np.multiply(angle, 2 * UNSIGNED / (2.0 * math.pi)).ravel()
    first = direction.astype(np.intp)
    upper = (direction - first) * strength.ravel()
    first[first == 2 * UNSIGNED] = 0
    cell, cells = _cell_of(rows, columns), rows * columns
    signed = _counted(first * cells + cell, strength.ravel() - upper, cells)
    signed += np.roll(_counted(first * cells + cell, upper, cells), 1, axis=0)
    signed /= CELL_PX * CELL_PX
    unsigned = signed[:UNSIGNED] + signed[UNSIGNED:]
    energy = np.square(unsigned).sum(axis=0).reshape(rows, columns)
    about = cv2.blur(energy, (3, 3), borderType=cv2.BORDER_REFLECT)
    found = np.concatenate([signed, unsigned]).reshape(CHANNELS, rows, columns)
    found /= np.sqrt(about + np.float32(faint))
    return np.asarray(np.minimum(found, np.float32(MOST)), np.float32)


def _counted(index: NDArray[np.intp], weight: Floats, cells: int) -> Floats:
    counted = np.bincount(index, weights=weight, minlength=2 * UNSIGNED * cells)
    return counted.reshape(2 * UNSIGNED, cells).astype(np.float32)


@lru_cache(maxsize=32)
def _cell_of(rows: int, columns: int) -> NDArray[np.intp]:
    """The cell of every pixel, row by row."""
    down = np.repeat(np.arange(rows), CELL_PX)[:, None] * columns
    found = (down + np.repeat(np.arange(columns), CELL_PX)[None, :]).ravel()
    found.flags.writeable = False
    return found
