"""Upright boxes and cylinders: what every obstacle is made of. Distances and overlaps seen from above."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Solid:
    """An upright box or cylinder in the room frame: centre, yaw, half sizes, bottom and top in metres.

    A cylinder's radius is `half_x` (equal to `half_y`).
    """

    kind: Literal["box", "cylinder"]
    x: float
    y: float
    yaw: float
    half_x: float
    half_y: float
    bottom: float
    top: float

    @property
    def outline(self) -> tuple[tuple[float, float], ...]:
        """Corners seen from above, counter-clockwise; a cylinder as sixteen."""
        if self.kind == "cylinder":
            steps = [math.tau * k / 16 for k in range(16)]
            return tuple(
                (self.x + self.half_x * math.cos(a), self.y + self.half_x * math.sin(a)) for a in steps
            )
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
        return tuple(
            (
                self.x + c * i * self.half_x - s * j * self.half_y,
                self.y + s * i * self.half_x + c * j * self.half_y,
            )
            for i, j in signs
        )

    def distance(self, x: Points, y: Points) -> Points:
        """Distance on the floor from points (any shape) to this solid, 0 inside.

        >>> float(Solid("box", 0, 0, 0, 1, 1, 0, 1).distance(np.array(4.0), np.array(5.0)))
        5.0
        """
        dx, dy = x - self.x, y - self.y
        if self.kind == "cylinder":
            return np.maximum(np.hypot(dx, dy) - self.half_x, 0.0)
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.hypot(
            np.maximum(np.abs(c * dx + s * dy) - self.half_x, 0.0),
            np.maximum(np.abs(c * dy - s * dx) - self.half_y, 0.0),
        )


def overlap(a: Solid, b: Solid, space: float = 0.0) -> bool:
    """True if the two come nearer than `space` metres seen from above and share some height.

    >>> overlap(Solid("box", 0, 0, 0, 1, 1, 0, 1), Solid("box", 2.1, 0, 0, 1, 1, 0, 1), space=0.2)
    True
    """
    if a.bottom >= b.top or b.bottom >= a.top:
        return False
    reach = math.hypot(a.half_x, a.half_y) + math.hypot(b.half_x, b.half_y) + space
    if math.hypot(a.x - b.x, a.y - b.y) > reach:
        return False
    return _gap(a, b) < max(space, 1e-9) or _gap(b, a) < max(space, 1e-9)


def _gap(a: Solid, b: Solid) -> float:
    """Smallest distance from points along a's outline and its middle to b."""
    corners = np.array([*a.outline, a.outline[0]])
    along = np.linspace(0.0, 1.0, 9)[:, None, None]
    points = (corners[:-1] + along * (corners[1:] - corners[:-1])).reshape(-1, 2)
    points = np.vstack([points, [(a.x, a.y)]])
    return float(b.distance(points[:, 0], points[:, 1]).min())
