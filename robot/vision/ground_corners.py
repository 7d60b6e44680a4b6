"""Harris corners spread over a picture, for matching."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.vision.half_size import to_full

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Pixels = NDArray[np.float64]

BLOCK_PX, K = 3, 0.04
"""Window of the structure tensor, and Harris's own constant."""
APART_PX = 5
"""Two corners are farther apart than half of this, in pixels of the half-size picture."""
QUALITY = 1e-4
"""Of the strongest corner's response, which grows with contrast to the fourth power."""
LEAST_RESPONSE = 20.0
"""What a webcam's noise of 2.5 grey levels reaches in the half-size picture."""
TILE_PX = 32
"""Side of the tiles over which features are spread, full pixels: a hand's breadth of floor at a metre."""
EDGE_PX, EDGE_APART_PX = (3, 5), (7, 7)
"""Width and height of the box an edge's change is taken over, and of that in which it must be strongest."""
LEAST_CHANGE = 3.0
"""Grey levels per pixel of the half-size picture."""


def harris_corners(half: Floats) -> Pixels:
    """Corners (N, 2) u, v px of the full picture, strongest first; half: its half-size copy, grey float32."""
    response = np.asarray(cv2.cornerHarris(half, BLOCK_PX, 3, K), np.float32)
    highest = cv2.dilate(response, np.ones((APART_PX, APART_PX), np.uint8))
    least = max(LEAST_RESPONSE, QUALITY * float(response.max(initial=0.0)))
    return _strongest_first(response, (response == highest) & (response > least))


def upright_edges(half: Floats) -> Pixels:
    """Places (N, 2) u, v px of the full picture where brightness changes most along the row, strongest first.

    The edges of a plain post or table leg have no corners, yet all that matching along rows needs.
    """
    change = cv2.Sobel(half, cv2.CV_32F, 1, 0, ksize=3, scale=0.25)
    energy = np.asarray(cv2.boxFilter(cv2.multiply(change, change), cv2.CV_32F, EDGE_PX), np.float32)
    highest = cv2.dilate(energy, np.ones((EDGE_APART_PX[1], EDGE_APART_PX[0]), np.uint8))
    return _strongest_first(energy, (energy == highest) & (energy > LEAST_CHANGE**2))


def _strongest_first(strength: Floats, chosen: Mask) -> Pixels:
    """Chosen pixels of a half-size picture (H, W) as places (N, 2) of the full one."""
    at = np.flatnonzero(chosen)
    at = at[np.argsort(-strength.ravel()[at], kind="stable")]
    v, u = np.divmod(at, strength.shape[1])
    return to_full(np.column_stack([u, v]))


def spread(corners: Pixels, most: int, each: int) -> NDArray[np.intp]:
    """Which of the corners (N, 2), strongest first, to keep: at most `each` of a tile and `most` in all."""
    if not len(corners):
        return np.zeros(0, np.intp)
    column, row = (corners // TILE_PX).astype(np.int16).T
    tile = row * (column.max() + 1) + column
    order = np.argsort(tile, kind="stable")
    ordered = tile[order]
    first = np.ones(len(tile), np.bool_)
    first[1:] = ordered[1:] != ordered[:-1]
    starts = np.flatnonzero(first)
    # How many stronger ones of the same tile there are.
    rank = np.arange(len(tile)) - starts[np.cumsum(first) - 1]
    few = rank < each
    # Every tile's strongest before any tile's second.
    turn = np.argsort(rank[few] * len(tile) + order[few])[:most]
    kept: NDArray[np.intp] = np.sort(order[few][turn])
    return kept
