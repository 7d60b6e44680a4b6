"""How unlike the two eyes see what a disparity says they both see."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

SMOOTHING_PX = 0.8
"""Standard deviation of the Gaussian that takes some noise out first."""
SUBPIXEL = 0.3
"""Of the gradient along the row: so much a match a third of a pixel off differs by."""
LARGEST = 25
"""Grey levels; what is more unlike is as unlike as can be."""
WINDOW = (3, 3)
"""Rows and columns looked at over which unlikeness is averaged."""
LEAST_ALIKE, MOST_ALIKE = 3.0, 8.0
"""Grey levels within which the limit of what is alike is sought: noise and exposure differ by camera."""
KNOWN_ALIKE = 0.98
"""So many of the measured pixels are alike."""


@dataclass(frozen=True, slots=True, eq=False)
class EyePair:
    """One eye's picture and the other's, seen from the one: (H, W, C) uint8, rows looked at.

    Seen from an eye, a point's column in the other eye is its own less the disparity; `mirrored` makes that
    true of the right eye too. edges (H, W): steepest gradient along the row, grey levels / px.
    """

    own: Image
    other: Image
    edges: Image

    @property
    def steps(self) -> Image:
        """Largest difference (H, W) to the row above or below, grey levels."""
        padded = np.pad(self.own, ((1, 1), (0, 0), (0, 0)), mode="edge")
        up, down = (cv2.absdiff(self.own, other) for other in (padded[:-2], padded[2:]))
        return _largest_channel(np.asarray(cv2.max(up, down), np.uint8).reshape(self.own.shape))

    @classmethod
    def of(cls, left: Image, right: Image, row_step: int) -> EyePair:
        """The pair seen from the left eye, every `row_step`-th row. left, right: (H, W[, 3]) uint8."""
        eyes = [_every(image, row_step) for image in (left, right)]
        return cls(eyes[0], eyes[1], _steepest(eyes[0]))

    @property
    def mirrored(self) -> EyePair:
        """The pair seen from the other eye, left and right exchanged."""
        own, other = (np.ascontiguousarray(image[:, ::-1]) for image in (self.other, self.own))
        return EyePair(own, other, _steepest(own))

    def unlike(self, disparity: Floats) -> Image:
        """Grey levels (H, W) uint8, of the most different channel, by which the other eye sees differently.

        disparity (H, W): px of every pixel; what the other eye has not in view is as unlike as can be.
        """
        height, width = disparity.shape
        column = np.arange(width, dtype=np.float32)[None, :] - disparity
        row = np.repeat(np.arange(height, dtype=np.float32)[:, None], width, axis=1)
        seen = cv2.remap(self.other, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        difference = _largest_channel(
            np.asarray(cv2.absdiff(self.own, seen.reshape(self.own.shape)), np.uint8)
        )
        tolerated = cv2.convertScaleAbs(self.edges, alpha=SUBPIXEL)
        found: Image = np.minimum(
            np.asarray(cv2.subtract(difference, tolerated), np.uint8), np.uint8(LARGEST)
        )
        found[column < -0.5] = LARGEST
        return found


def averaged(unlike: Image) -> Floats:
    """Unlikeness averaged over each pixel's small window."""
    return np.asarray(cv2.boxFilter(unlike, cv2.CV_32F, WINDOW[::-1]), np.float32)


def alike_limit(unlike: Floats, known: Mask) -> float:
    """Grey levels up to which averaged unlikeness is that of a match: most measured pixels are."""
    if not known.any():
        return LEAST_ALIKE
    return float(np.clip(np.quantile(unlike[known][::7], KNOWN_ALIKE), LEAST_ALIKE, MOST_ALIKE))


def _every(image: Image, row_step: int) -> Image:
    smooth = cv2.GaussianBlur(image, (0, 0), SMOOTHING_PX)[::row_step]
    return np.ascontiguousarray(smooth.reshape(*smooth.shape[:2], -1))


def _steepest(image: Image) -> Image:
    padded = np.pad(image, ((0, 0), (1, 1), (0, 0)), mode="edge")
    return _largest_channel(np.asarray(cv2.absdiff(padded[:, 2:], padded[:, :-2]), np.uint8)) // 2


def _largest_channel(image: Image) -> Image:
    if image.ndim == 2:  # OpenCV drops a single channel's axis
        return image
    found = image[:, :, 0]
    for channel in range(1, image.shape[2]):
        found = np.maximum(found, image[:, :, channel])
    return np.ascontiguousarray(found)
