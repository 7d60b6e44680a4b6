"""Regions of the left picture that differ from the right one warped onto it over the floor: off the floor."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

NOISY_GREY = 3.0
"""Grey levels by which a smoothed difference must exceed its own median to be bright."""
BRIGHT_SHARE, BRIGHT_WINDOW = 0.15, 7
"""Many is this share of the pixels in a window of so many px."""


def bright_regions(left: Floats, warped: Floats) -> Mask:
    """Where many pixels of the left picture differ from the right one warped onto it over the floor.

    left, warped: grey float32 (H, W), of half size. Returns (H, W) bool.
    """
    difference = cv2.absdiff(cv2.GaussianBlur(left, (3, 3), 0.7), cv2.GaussianBlur(warped, (3, 3), 0.7))
    # Eyes differ a little in gain: what is usual on this floor is not bright.
    usual = float(np.median(difference[::4, ::4]))
    _, bright = cv2.threshold(difference, usual + NOISY_GREY, 1.0, cv2.THRESH_BINARY)
    many = cv2.boxFilter(bright, cv2.CV_32F, (BRIGHT_WINDOW, BRIGHT_WINDOW))
    dense: Mask = np.asarray(many) > BRIGHT_SHARE
    return dense
