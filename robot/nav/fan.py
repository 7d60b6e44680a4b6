"""The floor one look saw free, as a fan of sectors: which places lie in it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot.messages import FreeSpace, Points, Pose2


@dataclass(frozen=True, slots=True, eq=False)
class Fan:
    """Sectors about the robot's origin, robot frame, radians and metres.

    edges (N + 1,): borders between the sectors, ascending. near, far (N,): the floor of a sector is free
    between them; near inf and far -1 where it is free nowhere.
    """

    edges: Points
    near: Points
    far: Points

    @classmethod
    def of(cls, look: FreeSpace) -> Fan | None:
        """The fan of a look, None if it saw nothing free. Sectors that hold NaN or inf count as not free."""
        near, far = np.asarray(look.near, dtype=np.float64), np.asarray(look.free, dtype=np.float64)
        usable = np.isfinite(near) & np.isfinite(far) & (far > near) & (far > 0.0)
        if not usable.any():
            return None
        edges = _sector_edges(np.asarray(look.bearings, dtype=np.float64))
        return cls(edges, np.where(usable, np.maximum(near, 0.0), np.inf), np.where(usable, far, -1.0))

    def hull(self) -> Points:
        """Points (2 N + 1, 2), robot frame, whose bounding box holds the fan."""
        # A sector's arc bulges beyond its corners; sectors are narrow, so a hair of extra length covers it.
        reach = 1.01 * np.maximum(self.far, 0.0)
        corners = [
            np.column_stack([reach * np.cos(a), reach * np.sin(a)]) for a in (self.edges[:-1], self.edges[1:])
        ]
        return np.concatenate([np.zeros((1, 2)), *corners])

    def holds(self, x: NDArray[np.float32], y: NDArray[np.float32], pose: Pose2) -> NDArray[np.bool_]:
        """Whether places lie in the fan seen from `pose`; x (1, m), y (k, 1) of its frame, answer (k, m)."""
        dx, dy = x - np.float32(pose.x), y - np.float32(pose.y)
        # Angles are taken about the middle of the fan so that a look across +-pi needs no care.
        middle = 0.5 * (self.edges[0] + self.edges[-1])
        c, s = np.float32(math.cos(pose.yaw + middle)), np.float32(math.sin(pose.yaw + middle))
        angle = np.arctan2(c * dy - s * dx, c * dx + s * dy)
        sector = np.searchsorted((self.edges - middle).astype(np.float32), angle, side="right") - 1
        inside = (sector >= 0) & (sector < len(self.far))
        np.clip(sector, 0, len(self.far) - 1, out=sector)
        squared = dx * dx + dy * dy
        low, high = (self.near**2).astype(np.float32), (self.far * np.abs(self.far)).astype(np.float32)
        return np.asarray(inside & (squared >= low[sector]) & (squared <= high[sector]))


def _sector_edges(bearings: Points) -> Points:
    """Borders (N + 1,) between the sectors of ascending bearings (N,): half-way to each neighbour."""
    if len(bearings) == 1:
        half = math.radians(1.0)
        return np.array([bearings[0] - half, bearings[0] + half])
    between = 0.5 * (bearings[1:] + bearings[:-1])
    first, last = bearings[0] - (between[0] - bearings[0]), bearings[-1] + (bearings[-1] - between[-1])
    return np.concatenate([[first], between, [last]])
