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
SAMPLED = 11
"""Every so manyth measured pixel is asked."""


@dataclass(frozen=True, slots=True, eq=False)
class EyePair:
    """One eye's picture and the other's, seen from the one: (H, W) uint8 grey, rows looked at.

    Seen from an eye, a point's column in the other eye is its own less the disparity; `mirrored` makes that
    true of the right eye too. (Colours were tried: they tell no more edges in simulated rooms.)
    """

    own: Image
    other: Image

    @classmethod
    def of(cls, left: Image, right: Image, row_step: int) -> EyePair:
        """The pair seen from the left eye, every `row_step`-th row. left, right: (H, W) uint8."""
        own, other = (cv2.GaussianBlur(eye, (0, 0), SMOOTHING_PX)[::row_step] for eye in (left, right))
        return cls(np.ascontiguousarray(own, np.uint8), np.ascontiguousarray(other, np.uint8))

    @property
    def mirrored(self) -> EyePair:
        """The pair seen from the other eye, left and right exchanged."""
        return EyePair(*(np.ascontiguousarray(image[:, ::-1]) for image in (self.other, self.own)))

    @property
    def edges(self) -> Image:
        """Gradient (H, W) along the row, grey levels / px."""
        padded = np.pad(self.own, ((0, 0), (1, 1)), mode="edge")
        return np.asarray(cv2.absdiff(padded[:, 2:], padded[:, :-2]), np.uint8) // 2

    @property
    def steps(self) -> Image:
        """Larger difference (H, W) to the row above and below, grey levels."""
        padded = np.pad(self.own, ((1, 1), (0, 0)), mode="edge")
        up, down = (cv2.absdiff(self.own, other) for other in (padded[:-2], padded[2:]))
        return np.asarray(cv2.max(up, down), np.uint8)

    def unlike(self, disparity: Floats) -> Image:
        """Grey levels (H, W) uint8 by which the other eye sees differently.

        disparity (H, W): px of every pixel; what the other eye has not in view is as unlike as can be.
        """
        height, width = disparity.shape
        column = np.arange(width, dtype=np.float32)[None, :] - disparity
        row = np.repeat(np.arange(height, dtype=np.float32)[:, None], width, axis=1)
        seen = cv2.remap(self.other, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        tolerated = cv2.convertScaleAbs(self.edges, alpha=SUBPIXEL)
        differs = np.asarray(cv2.subtract(cv2.absdiff(self.own, seen), tolerated), np.uint8)
        found: Image = np.minimum(differs, np.uint8(LARGEST))
        found[column < -0.5] = LARGEST
        return found


def averaged(unlike: Image) -> Floats:
    """Unlikeness averaged over each pixel's small window."""
    return np.asarray(cv2.boxFilter(unlike, cv2.CV_32F, WINDOW[::-1]), np.float32)


def alike_limit(unlike: Floats, known: Mask) -> float:
    """Grey levels up to which averaged unlikeness is that of a match: most measured pixels are."""
    if not known.any():
        return LEAST_ALIKE
    some = unlike[known][::SAMPLED]
    rank = int(KNOWN_ALIKE * (len(some) - 1))
    return float(np.clip(np.partition(some, rank)[rank], LEAST_ALIKE, MOST_ALIKE))
