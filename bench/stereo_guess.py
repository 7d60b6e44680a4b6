"""Disparities between the measured ones, for the eye: what a person would guess a blank wall's distance is.

Every pixel takes the mean of the measured disparities about it, near ones and those of like grey value first
(METHODS 7's weights, over far greater distances). A guess, for pictures only: free space is never made of it.
"""

from __future__ import annotations

import cv2
import numpy as np

from robot.messages import Image
from robot.vision.disparity import Disparity, Floats
from robot.vision.stereo_aggregation import (
    EMPTY,
    Support,
    by_cells,
    by_rows,
    sample_intensities,
    shares,
    smoothed,
)

CELL_PX = 8
ANYTHING = np.float32(0.02)
"""How much a neighbour of quite another grey value counts, one of like grey value counting 1."""


def densified(found: Disparity, picture: Image) -> Floats:
    """(H, W) float32 disparities, guessed where none was measured; zeros if nothing was measured.

    picture: the left picture, (H, W) grey or (H, W, 3) BGR uint8.

    >>> half = np.arange(16)[None, :] < np.full((16, 1), 8)
    >>> five, one = np.full((16, 16), 5.0, np.float32), np.ones((16, 16), np.float32)
    >>> guess = densified(Disparity(five, half, one), np.zeros((16, 16), np.uint8))
    >>> bool(np.allclose(guess, 5.0))
    True
    """
    height, width = found.values.shape
    grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    rim = 0, -height % CELL_PX, 0, -width % CELL_PX
    guide = cv2.copyMakeBorder(grey, *rim, cv2.BORDER_REPLICATE).astype(np.uint8, copy=False)
    measured = np.where(found.valid, found.values, np.float32(0.0))
    both = [
        cv2.copyMakeBorder(plane, *rim, cv2.BORDER_CONSTANT, value=0.0)
        for plane in (measured, found.valid.astype(np.float32))
    ]
    reach = Support(
        clusters=8, cell=CELL_PX, sigma=12.0, tail=0.002, tail_sigma=float(max(height, width)) / 4
    )
    share = by_cells(np.take(shares(sample_intensities(guide, reach.clusters)), guide, axis=0), CELL_PX)
    share = share + ANYTHING
    gathered = smoothed(np.matmul(share.transpose(0, 1, 3, 2), by_cells(np.dstack(both), CELL_PX)), reach)
    sums = by_rows(np.matmul(share, gathered), CELL_PX)[:height, :width]
    guess = sums[..., 0] / np.maximum(sums[..., 1], EMPTY * EMPTY)
    return np.where(found.valid, found.values, guess).astype(np.float32)
