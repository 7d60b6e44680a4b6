"""Harris corners spread over a picture, for matching."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Pixels = NDArray[np.float64]

BLOCK_PX, K = 3, 0.04
APART_PX = 5
"""Two corners are farther apart than half of this, in pixels of the half-size picture."""
QUALITY = 1e-4
"""Of the strongest corner's response, which grows with contrast to the fourth power."""
LEAST_RESPONSE = 20.0
TILE_PX = 32
EDGE_PX, EDGE_APART_PX = (3, 5), (7, 7)
"""Width and height of the box an edge's change is taken over, and of that in which it must be strongest."""
LEAST_CHANGE = 3.0
"""Grey levels per pixel of the half-size picture."""


def harris_corners(half: Floats) -> Pixels:
    """Corners (N, 2) u, v px of the full picture, strongest first; half: its half-size copy, grey float32."""
    response = np.asarray(cv2.cornerHarris(half, BLOCK_PX, 3, K), np.float32)
    highest = cv2.dilate(response, np.ones((APART_PX, APART_PX), np.uint8))
    least = max(LEAST_RESPONSE, QUALITY * float(response.max(initial=0.0)))
    v, u = np.nonzero((response == highest) & (response > least))
    return _by_strength(response, u, v)


def upright_edges(half: Floats) -> Pixels:
    """Places (N, 2) u, v px of the full picture where brightness changes most along the row, strongest first.

    The edges of a plain post or table leg have no corners, yet all that matching along rows needs.
    """
    change = cv2.Sobel(half, cv2.CV_32F, 1, 0, ksize=3, scale=0.25)
    energy = np.asarray(cv2.boxFilter(cv2.multiply(change, change), cv2.CV_32F, EDGE_PX), np.float32)
    highest = cv2.dilate(energy, np.ones((EDGE_APART_PX[1], EDGE_APART_PX[0]), np.uint8))
    v, u = np.nonzero((energy == highest) & (energy > LEAST_CHANGE**2))
    return _by_strength(energy, u, v)


def _by_strength(strength: Floats, u: NDArray[np.intp], v: NDArray[np.intp]) -> Pixels:
    order = np.argsort(-strength[v, u], kind="stable")
    # Pixel k of the half-size picture covers pixels 2k and 2k + 1.
    return np.asarray(np.column_stack([u, v])[order] * 2.0 + 0.5, np.float64)


def spread(corners: Pixels, most: int, each: int) -> NDArray[np.intp]:
    """Which of the corners (N, 2), strongest first, to keep: at most `each` of a tile and `most` in all."""
    tile = (corners[:, 1] // TILE_PX).astype(np.intp) * 1024 + (corners[:, 0] // TILE_PX).astype(np.intp)
    order = np.argsort(tile, kind="stable")
    ordered = tile[order]
    starts = np.flatnonzero(np.diff(ordered, prepend=-1))
    rank = np.arange(len(ordered)) - np.repeat(starts, np.diff(np.append(starts, len(ordered))))
    kept: NDArray[np.intp] = np.sort(order[rank < each])[:most]
    return kept
