"""What a matcher gives, and what a matcher is: any callable `(left, right) -> Disparity`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robot.messages import Image

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Disparity:
    """Column of a point in the left picture less its column in the right one, for every left pixel.

    values (H, W) float32 px: measured where valid; elsewhere filled in, for the eye alone. valid (H, W) bool.
    sigma_px (H, W) float32: standard deviation of a valid value; a matcher gives infinity elsewhere, so that
    nobody takes a guess for sure.
    """

    values: Floats
    valid: Mask
    sigma_px: Floats


class Matcher(Protocol):
    """Finds the disparities of a rectified pair of BGR or grey uint8 pictures of equal size."""

    def __call__(self, left: Image, right: Image) -> Disparity:
        """Match left (H, W[, 3]) with right."""
