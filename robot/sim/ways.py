"""Free ways in a known room: the shortest one, whether the straight one is blocked, who sees whom.

Only the referee and the drawing of rooms use this; the robot plans with what it has seen.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from robot.sim.solids import Solid

Point = tuple[float, float]

CELL_M = 0.05
INFLATION_M = 0.155  # the robot's 0.13 and a little air
CORRIDOR_M = 0.14  # half width of the straight way: the robot itself, and one centimetre
PASS_UNDER_M = 0.32
MIDDLES_M = 0.13  # eyes ahead of the robot's middle, and the target's face before its own
SEE_OVER_M = 0.2  # what is lower does not hide a target from eyes at 0.25


class Ways:
    """Ways between standing solids in a room of length x width metres (room frame of `scene`)."""

    def __init__(self, length: float, width: float, solids: Sequence[Solid]) -> None:
        self._length, self._width = length, width
        self._hindrances = [s for s in solids if s.bottom < PASS_UNDER_M]
        self._screens = [s for s in solids if s.top > SEE_OVER_M and s.bottom < SEE_OVER_M]
        self._shape = (math.ceil(length / CELL_M), math.ceil(width / CELL_M))

    def distance(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance on the floor from points to the nearest obstacle or wall, metres (negative outside)."""
        nearest = np.minimum(np.minimum(x, self._length - x), self._width / 2 - np.abs(y))
        for solid in self._hindrances:
            nearest = np.minimum(nearest, solid.distance(x, y))
        return nearest

    def line_free(self, start: Point, end: Point, half_width: float) -> bool:
        """True if a disc of that radius can move straight from start to end."""
        x, y = _along(start, end)
        return bool((self.distance(x, y) >= half_width).all())

    def sees(self, eye: Point, target: Point, half_width: float = 0.05) -> bool:
        """True if the middle and both sides of a target are in plain sight of the eye (walls do not hide)."""
        bearing = math.atan2(target[1] - eye[1], target[0] - eye[0])
        sideways = (-math.sin(bearing) * half_width, math.cos(bearing) * half_width)
        for k in (-1, 0, 1):
            x, y = _along(eye, (target[0] + k * sideways[0], target[1] + k * sideways[1]))
            if any((solid.distance(x, y) <= 0.0).any() for solid in self._screens):
                return False
        return True

    def corridor_blocked(self, start: Point, target: Point, stand_off: float) -> bool:
        """True if the robot's own width does not fit straight from start to `stand_off` before the target."""
        length = math.dist(start, target)
        share = max(length - stand_off - MIDDLES_M, 0.0) / max(length, 1e-9)
        end = (start[0] + share * (target[0] - start[0]), start[1] + share * (target[1] - start[1]))
        return not self.line_free(start, end, CORRIDOR_M)

    def shortest_way(self, start: Point, target: Point, stand_off: float) -> tuple[Point, ...] | None:
        """The shortest way from start to a place that sees the target from `stand_off`; None if none.

        A grid search (8 neighbours), then pulled taut, so that its length has no grid error worth naming.
        The place may be up to 20 % nearer or farther than the stand-off.
        """
        reach = stand_off * 1.2 + MIDDLES_M
        inner = stand_off * 0.8 + MIDDLES_M
        if inner <= math.dist(start, target) <= reach and self.sees(start, target):
            return (start,)
        cells = self._search(self._cell(start), target, inner, reach)
        if cells is None:
            return None
        return self._taut([start, *(self._point(c) for c in cells[1:])])

    # ------------------------------------------------------------------------------------------ the grid

    @cached_property
    def _free(self) -> NDArray[np.bool_]:
        x = (np.arange(self._shape[0], dtype=np.float64)[:, None] + 0.5) * CELL_M
        y = (np.arange(self._shape[1], dtype=np.float64)[None, :] + 0.5) * CELL_M - self._width / 2
        return self.distance(x, y) >= INFLATION_M

    def _cell(self, point: Point) -> tuple[int, int]:
        i, j = int(point[0] / CELL_M), int((point[1] + self._width / 2) / CELL_M)
        return min(max(i, 0), self._shape[0] - 1), min(max(j, 0), self._shape[1] - 1)

    def _point(self, cell: tuple[int, int]) -> Point:
        return (cell[0] + 0.5) * CELL_M, (cell[1] + 0.5) * CELL_M - self._width / 2

    def _search(
        self, start: tuple[int, int], target: Point, inner: float, reach: float
    ) -> list[tuple[int, int]] | None:
        """A* to the first cell within inner..reach metres of the target that sees it."""
        free = self._free
        best = {start: 0.0}
        parent: dict[tuple[int, int], tuple[int, int]] = {}
        heap = [(0.0, start)]
        while heap:
            _, cell = heapq.heappop(heap)
            point = self._point(cell)
            distance = math.dist(point, target)
            if inner <= distance <= reach and self.sees(point, target):
                way = [cell]
                while way[-1] in parent:
                    way.append(parent[way[-1]])
                return way[::-1]
            for di, dj in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
                near = (cell[0] + di, cell[1] + dj)
                if not (0 <= near[0] < self._shape[0] and 0 <= near[1] < self._shape[1] and free[near]):
                    continue
                cost = best[cell] + CELL_M * math.hypot(di, dj)
                if cost < best.get(near, math.inf) - 1e-12:
                    best[near] = cost
                    parent[near] = cell
                    ahead = max(math.dist(self._point(near), target) - reach, 0.0)
                    heapq.heappush(heap, (cost + ahead, near))
        return None

    def _taut(self, points: list[Point]) -> tuple[Point, ...]:
        taut = [points[0]]
        k = 0
        while k < len(points) - 1:
            far = len(points) - 1
            while far > k + 1 and not self.line_free(points[k], points[far], INFLATION_M - 0.01):
                far -= 1
            k = far
            taut.append(points[k])
        return tuple(taut)


def length(way: Sequence[Point]) -> float:
    """Length of a polyline in metres.

    >>> length([(0.0, 0.0), (3.0, 4.0)])
    5.0
    """
    return sum(math.dist(a, b) for a, b in itertools.pairwise(way))


def _along(start: Point, end: Point) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    count = max(2, math.ceil(math.dist(start, end) / 0.015))
    share = np.linspace(0.0, 1.0, count)
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])
