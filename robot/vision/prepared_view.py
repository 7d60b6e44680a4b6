"""Views of a target as columns of a matrix: one size, one mean, one spread of grey.

Source: Wu & Snášel, *A Vision-based Navigation System of Mobile Tracking Robot*, SMC 2010, section II.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

TARGET_MEAN = 0.25
TARGET_STD = 0.25
# A view whose grey values (0..255) spread less than this shows nothing that could be recognised.
FLAT_STD = 1.5


class FlatViewError(ValueError):
    """The view has (almost) no contrast, so that it cannot be scaled to the wanted spread."""


def normalise(pixels: NDArray[Any]) -> Matrix:
    """Scale grey values linearly to mean 0.25 and standard deviation 0.25, then clip to [0, 1].

    pixels: any shape, at least two different values on any scale. Returns float64 of the same shape;
    mean and spread hold exactly *before* clipping ([W], section II).

    Raises FlatViewError where all pixels are equal.

    >>> normalise(np.array([0.0, 2.0]))
    array([0. , 0.5])
    """
    values = np.asarray(pixels, dtype=np.float64)
    std = float(values.std())
    if not std > 1e-9:
        raise FlatViewError("the view has no contrast: all its pixels are equal")
    scaled: Matrix = np.clip(TARGET_MEAN + TARGET_STD * (values - values.mean()) / std, 0.0, 1.0)
    return scaled


def prepare(view: NDArray[Any], size: tuple[int, int]) -> Matrix:
    """Make one column of V from a grey view.

    view: (H, W) uint8, or floating point on the same 0..255 scale. size: (width, height) every view is
    brought to, in pixels. Returns (width * height,) float64 in [0, 1], row by row; clipping what lies below 0
    lifts the mean a little above 0.25.

    Raises FlatViewError for a view without contrast, ValueError for one that is not a grey picture.

    >>> view = np.tile(np.arange(0, 80, 10, dtype=np.uint8), (8, 1))
    >>> column = prepare(view, (4, 4))
    >>> column.shape, round(float(column.mean()), 3)
    ((16,), 0.271)
    """
    if view.ndim != 2 or min(view.shape) < 1:
        raise ValueError(f"a grey view (H, W) is needed, got shape {view.shape}")
    grey = np.asarray(view, dtype=np.float32)
    if not np.isfinite(grey).all():
        raise ValueError("the view holds values that are not numbers")
    shrinks = size[0] < grey.shape[1] and size[1] < grey.shape[0]
    resized = cv2.resize(grey, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    if float(resized.std()) < FLAT_STD:
        raise FlatViewError(f"the view is flat: its grey values spread by only {float(resized.std()):.2f}")
    return normalise(resized).ravel()
