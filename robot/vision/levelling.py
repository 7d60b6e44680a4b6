"""How the floor really lies in a picture: the plane through most of the heights measured near it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Floats = NDArray[np.float32]

NEAR_FLOOR_M = 0.06
"""Heights beyond this belong to things, not to a floor seen tipped."""
MOST_PIXELS, FEWEST_PIXELS = 3000, 60
"""More tell no more of a plane's three numbers; fewer are a thing's foot as well as a floor."""
INDEPENDENT = 50.0
"""Neighbouring pixels err together: all of them weigh as so many independent ones."""
REST_SIGMA = (0.005, math.radians(0.5), math.radians(0.3))
"""How far a base may lie off: lift in metres, slope ahead, slope aside. Holds what no pixel speaks of."""
SCALES_M = (0.035, 0.025, 0.018, 0.018)
"""Half widths of Tukey's biweight, which narrows: a low step must not lift the floor, a tipped floor may."""


@dataclass(frozen=True, slots=True)
class FloorLevel:
    """How the floor lies in the nominal robot frame: height = lift + ahead x + aside y. Metres, slopes.

    >>> round(FloorLevel(0.002, 0.01, 0.0).at(0.5, 0.0), 4)
    0.007
    """

    lift: float = 0.0
    ahead: float = 0.0
    aside: float = 0.0

    def at(self, x: float, y: float) -> float:
        """Height of the floor at (x, y), metres."""
        return self.lift + self.ahead * x + self.aside * y


def floor_plane(x: Floats, y: Floats, height: Floats, sigma: Floats) -> Vector:
    """Lift and slopes (3,) of the floor: height = lift + ahead x + aside y; zeros if too little is seen.

    x, y, height (N,): measured points in the nominal robot frame, metres; sigma (N,): of height.

    >>> x, y = np.meshgrid(np.linspace(0.4, 2.0, 40), np.linspace(-0.5, 0.5, 20))
    >>> flat = floor_plane(x.ravel(), y.ravel(), 0.01 * x.ravel(), np.full(x.size, 0.005))
    >>> bool(abs(flat[0] + 1.2 * flat[1] - 0.012) < 0.003)
    True
    """
    rows = np.flatnonzero(np.abs(height) < NEAR_FLOOR_M)
    rows = rows[:: max(1, len(rows) // MOST_PIXELS)]
    plane: Vector = np.zeros(3)
    if len(rows) < FEWEST_PIXELS:
        return plane
    basis = np.stack([np.ones(len(rows)), x[rows], y[rows]]).astype(np.float64)
    high, spread = height[rows].astype(np.float64), sigma[rows].astype(np.float64) + 0.002
    rest = np.diag(1.0 / np.square(REST_SIGMA))
    for scale in SCALES_M:
        off = (high - plane @ basis) / (scale + 2.0 * spread)
        weight = (
            np.where(np.abs(off) < 1.0, (1.0 - off * off) ** 2, 0.0) / spread**2 * (INDEPENDENT / len(rows))
        )
        plane = np.asarray(
            np.linalg.solve((basis * weight) @ basis.T + rest, basis @ (weight * high)), np.float64
        )
    return plane
