"""Small squares cut out of a picture at places to a fraction of a pixel, many at once."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Columns = NDArray[np.float64]

LEAST_CONTRAST = 2.0
"""Standard deviation of a patch, grey levels: less is a webcam's noise."""


def bilinear(picture: Floats, u: Floats, v: Floats) -> Floats:
    """The picture's values at (u, v), both (N, M) px; beyond the rim it repeats."""
    if not u.size:
        return np.zeros(u.shape, np.float32)
    return np.asarray(cv2.remap(picture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)


def patches_at(picture: Floats, u: Columns, v: Columns, half: int) -> Floats:
    """Patches (N, S, S) about places u, v (N,), S = 2 half + 1."""
    step = np.arange(-half, half + 1, dtype=np.float32)
    side = len(step)
    at_u = np.repeat((u.astype(np.float32)[:, None] + step)[:, None, :], side, axis=1)
    at_v = np.repeat((v.astype(np.float32)[:, None] + step)[:, :, None], side, axis=2)
    return bilinear(picture, at_u.reshape(-1, side), at_v.reshape(-1, side)).reshape(-1, side, side)


def normalised(patches: Floats) -> Floats:
    """Mean 0 and length 1; all 0 where there is no contrast."""
    centred = patches - patches.mean(axis=(1, 2), keepdims=True)
    length = np.sqrt(np.einsum("nij,nij->n", centred, centred))
    clear = length >= LEAST_CONTRAST * patches.shape[1]
    return np.asarray(
        centred * np.where(clear, 1.0 / np.maximum(length, 1e-6), 0.0)[:, None, None], np.float32
    )
