"""Small squares cut out of a picture at places to a fraction of a pixel, many at once; how alike they are."""

from __future__ import annotations

import math
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.model import Matrix

Floats = NDArray[np.float32]
Pixels = NDArray[np.float64]

LEAST_CONTRAST = 2.0
"""Standard deviation of a patch, grey levels: less is a webcam's noise."""


@cache
def offsets(half: int) -> Floats:
    """Columns and rows (2, S S) of a patch's pixels from its middle, row by row, S = 2 half + 1. Shared."""
    step = np.arange(-half, half + 1, dtype=np.float32)
    y, x = np.meshgrid(step, step, indexing="ij")
    found: Floats = np.stack([x.ravel(), y.ravel()])
    found.flags.writeable = False
    return found


def squares(points: Pixels, half: int) -> tuple[Floats, Floats]:
    """Columns and rows (N, S S) of the pixels of patches about points (N, 2) u, v px."""
    x, y = offsets(half)
    middle = points.astype(np.float32)
    return middle[:, :1] + x, middle[:, 1:] + y


def through_squares(homography: Matrix, points: Pixels, half: int) -> tuple[Floats, Floats]:
    """Where a homography (3, 3) takes the pixels of patches about points (N, 2): u, v (N, S S)."""
    u, v = squares(points, half)
    first, second, third = (u * row[0] + (v * row[1] + row[2]) for row in homography.astype(np.float32))
    return first / third, second / third


def bilinear(picture: Floats, u: Floats, v: Floats) -> Floats:
    """The picture's values at (u, v), both (N, M) px; beyond the rim it repeats."""
    if not u.size:
        return np.zeros(u.shape, np.float32)
    return np.asarray(cv2.remap(picture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)


def patches_at(picture: Floats, points: Pixels, half: int) -> Floats:
    """Patches (N, S S) about points (N, 2) u, v px, S = 2 half + 1, row by row."""
    return bilinear(picture, *squares(points, half))


def normalised(patches: Floats) -> Floats:
    """Patches (N, M) with mean 0 and length 1; all 0 where there is no contrast."""
    side = math.sqrt(patches.shape[1])
    found: Floats = patches - patches.mean(axis=1, dtype=np.float32, keepdims=True)
    length = np.sqrt(np.einsum("nm,nm->n", found, found))
    found *= np.where(length >= LEAST_CONTRAST * side, 1.0 / np.maximum(length, 1e-6), 0.0)[:, None]
    return found


def alikeness(one: Floats, other: Floats) -> Floats:
    """Correlation -1..1 (N,) of patches (N, M) with others; 0 where one of both is plain."""
    return np.asarray(np.einsum("nm,nm->n", normalised(one), normalised(other)), np.float32)
