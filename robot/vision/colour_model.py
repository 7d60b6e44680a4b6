"""Which pixels have the target's colours rather than its surroundings': two histograms.

Source: the colour part of Bertinetto et al., "Staple: complementary learners for real-time tracking" (CVPR
2016); Bayes' rule on histograms as Swain and Ballard, "Color indexing" (IJCV 1991).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image

Floats = NDArray[np.float32]

BITS = 4
"""Of each channel: 16 steps."""
INNER, OUTER = 0.8, 1.1
"""Of the target's edges: surely of it within, surely not beyond."""
UNSEEN = 0.5
"""What a colour never met is likely to be."""
RARE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class ColourModel:
    """Shares of colours inside and outside of the target, (2^(3 BITS),) each."""

    inside: Floats
    outside: Floats

    @classmethod
    def learnt(cls, patch: Image, target: tuple[float, float]) -> ColourModel:
        """From a BGR patch with the target, of (width, height) px, in its middle."""
        steps = _steps(patch)
        inner, outer = (_central(steps.shape, target, share) for share in (INNER, OUTER))
        around = np.ones(steps.shape, np.bool_)
        around[outer] = False
        return cls(_shares(steps[inner]), _shares(steps[around]))

    def and_met(self, patch: Image, target: tuple[float, float], rate: float) -> ColourModel:
        """The model after one more look; rate 0..1: its share."""
        new, old = ColourModel.learnt(patch, target), np.float32(1.0 - rate)
        mixed = (
            old * a + np.float32(rate) * b
            for a, b in ((self.inside, new.inside), (self.outside, new.outside))
        )
        return ColourModel(*mixed)

    def likelihood(self, patch: Image) -> Floats:
        """How likely each pixel (H, W) of a BGR patch is of the target, 0..1.

        >>> patch = np.zeros((30, 30, 3), np.uint8)
        >>> patch[10:20, 10:20] = (0, 0, 255)
        >>> found = ColourModel.learnt(patch, (10.0, 10.0)).likelihood(patch)
        >>> float(found[15, 15]), float(found[2, 2])
        (1.0, 0.0)
        """
        total = self.inside + self.outside
        table = np.where(total > RARE, self.inside / np.maximum(total, RARE), np.float32(UNSEEN))
        return np.asarray(table.astype(np.float32)[_steps(patch)], np.float32)


def box_means(likelihood: Floats, target: tuple[float, float]) -> Floats:
    """Mean likelihood (H, W) in a box of the target's inner size about each pixel."""
    size = max(round(INNER * target[0]), 1), max(round(INNER * target[1]), 1)
    return np.asarray(cv2.blur(likelihood, size), np.float32)


def _steps(patch: Image) -> NDArray[np.intp]:
    coarse = (patch >> (8 - BITS)).astype(np.intp)
    return (coarse[..., 0] << 2 * BITS) + (coarse[..., 1] << BITS) + coarse[..., 2]


def _shares(steps: NDArray[np.intp]) -> Floats:
    counted = np.bincount(steps.ravel(), minlength=1 << 3 * BITS).astype(np.float32)
    return counted / np.float32(max(steps.size, 1))


def _central(shape: tuple[int, ...], target: tuple[float, float], share: float) -> tuple[slice, slice]:
    """The middle of a patch: so much of the target's height and width, at least a pixel."""
    (y0, y1), (x0, x1) = (
        (max(int(0.5 * (whole - share * edge)), 0), int(0.5 * (whole + share * edge)) + 1)
        for whole, edge in zip(shape, reversed(target), strict=True)
    )
    return slice(y0, y1), slice(x0, x1)
