"""What must pass through an opening: a round cross-section (the hand) or an upright rectangle (the base).

And the largest circle in a mask. Source: METHODS 10: [T] compares a circle with the cross-section; a body of
width w and height h is better compared by its own rectangle.
"""

from __future__ import annotations

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


def _check(name: str, metres: float) -> None:
    if not 0.0 < metres <= LARGEST_M:
        raise ValueError(f"a section's {name} must be above 0 and at most {LARGEST_M:g} m, got {metres}")
