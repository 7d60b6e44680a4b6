"""What must pass through an opening: a round cross-section (the hand) or an upright rectangle (the base).

Source: METHODS 10: [T] compares a circle with the cross-section; a body of width w and height h needs
sqrt(w^2 + h^2) of it, or better its own rectangle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
LARGEST_M = 5.0


@dataclass(frozen=True, slots=True)
class RoundSection:
    """A cylinder seen end-on: a hand with what it holds. diameter in metres, above 0, at most 5.

    Raises ValueError for another diameter.
    """

    diameter: float

    def __post_init__(self) -> None:
        _check("diameter", self.diameter)

    def fits_into(self, free: Mask, metres_per_pixel: float, margin: float = 0.0) -> bool:
        """True if the section fits somewhere into the free mask (H, W) with `margin` metres more diameter.

        What lies outside the mask blocks. metres_per_pixel > 0, or ValueError.

        >>> hole = np.zeros((40, 40), np.bool_)
        >>> hole[5:35, 5:35] = True
        >>> RoundSection(0.028).fits_into(hole, 0.001), RoundSection(0.032).fits_into(hole, 0.001)
        (True, False)
        """
        _check_scale(metres_per_pixel)
        return largest_circle_px(free)[1] * metres_per_pixel >= self.diameter + margin


@dataclass(frozen=True, slots=True)
class BoxSection:
    """An upright rectangle standing on the floor: a base. width, height in metres, above 0, at most 5.

    Raises ValueError for other sizes.
    """

    width: float
    height: float

    def __post_init__(self) -> None:
        _check("width", self.width)
        _check("height", self.height)

    @property
    def diagonal(self) -> float:
        """Diameter of the circle about the rectangle: what it needs in any roll."""
        return math.hypot(self.width, self.height)

    def fits_into(self, free: Mask, metres_per_pixel: float, margin: float = 0.0) -> bool:
        """True if the rectangle, `margin` metres wider, fits somewhere standing on the mask's last row.

        free (H, W) bool: a vertical plane, rows from the top, the last one on the floor; what lies outside
        blocks. metres_per_pixel > 0, or ValueError.

        >>> gate = np.zeros((40, 60), np.bool_)
        >>> gate[5:, 10:50] = True
        >>> BoxSection(0.4, 0.3).fits_into(gate, 0.01), BoxSection(0.4, 0.36).fits_into(gate, 0.01)
        (True, False)
        """
        _check_scale(metres_per_pixel)
        rows = math.ceil(self.height / metres_per_pixel - 1e-9)
        if rows > free.shape[0]:
            return False
        columns: Mask = np.asarray(free[free.shape[0] - rows :].all(axis=0))
        width_px = longest_run(columns)
        return width_px * metres_per_pixel + 1e-9 >= self.width + margin


Section = RoundSection | BoxSection


def largest_circle_px(free: Mask) -> tuple[tuple[int, int], float]:
    """Centre (u, v) and diameter 2 DT - 1 in pixels of the largest circle in a free mask; 0 if none is free.

    DT is the distance to the nearest blocked pixel. A blocked border is padded on, or an all-free mask would
    have no bound at all.

    >>> largest_circle_px(np.ones((21, 31), np.bool_))[1]
    21.0
    """
    if free.size == 0:
        return (0, 0), 0.0
    distance = blocked_distance(free)
    v, u = np.unravel_index(int(distance.argmax()), distance.shape)
    return (int(u), int(v)), max(2.0 * float(distance[v, u]) - 1.0, 0.0)


def blocked_distance(free: Mask) -> NDArray[np.float32]:
    """Distance in pixels (H, W) from each pixel to the nearest blocked one, 0 on those; the border blocks."""
    padded = cv2.copyMakeBorder(free.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    distance = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return distance[1:-1, 1:-1].astype(np.float32, copy=False)


def longest_run(free: Mask) -> int:
    """Length of the longest run of True in (N,).

    >>> longest_run(np.array([True, False, True, True]))
    2
    """
    edges = np.diff(np.concatenate([[False], free, [False]]).astype(np.int8))
    lengths = np.flatnonzero(edges < 0) - np.flatnonzero(edges > 0)
    return int(lengths.max()) if len(lengths) else 0


def _check(name: str, metres: float) -> None:
    if not 0.0 < metres <= LARGEST_M:
        raise ValueError(f"a section's {name} must be above 0 and at most {LARGEST_M:g} m, got {metres}")


def _check_scale(metres_per_pixel: float) -> None:
    if not 0.0 < metres_per_pixel < math.inf:
        raise ValueError(f"metres per pixel must be above 0 and finite, got {metres_per_pixel}")
