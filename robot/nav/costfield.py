"""What it costs to be where: the obstacle map seen with the eyes of a body that has a size.

A `CostField` is made afresh from the map for every question. Fine cells give distances, a lattice of twice
their size the shortest paths: each node stands at the fine cell of its 2 x 2 block that is farthest from
obstacles, so that the lattice does not close a passage that is one node wide.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from robot.messages import Points
from robot.nav.grid import Mask, ObstacleMap

_STEPS = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, -1), (1, -1), (-1, 1))
_FAR = 1e6
"""Cost beyond which nothing is reached; blocked edges cost inf, so the search never enters them."""
ROUND = 1.2
"""Metres about what was seen in which a way round is looked for."""


@dataclass(frozen=True, slots=True)
class Body:
    """The body the paths are for, and how it likes to go.

    radius: of the body in metres; its middle never comes nearer than that to an occupied cell. margin: what
    it likes to keep beyond that; less costs up to `crowding` more per metre, so a passage narrower than the
    margin asks for is taken where there is no better way. unknown_cost: price of a metre of unseen floor, in
    metres of seen floor (>= 1; inf: never).
    """

    radius: float = 0.13
    margin: float = 0.06
    unknown_cost: float = 3.0
    crowding: float = 3.0

    def __post_init__(self) -> None:
        if not (self.radius > 0 and self.margin >= 0 and self.unknown_cost >= 1 and self.crowding >= 0):
            raise ValueError(f"radius must be positive, margin and crowding >= 0, unknown_cost >= 1: {self}")

    @property
    def comfort(self) -> float:
        """Metres beyond the radius in which the cost falls from `crowding` to none."""
        return self.margin + 0.14


@dataclass(frozen=True, slots=True, eq=False)
class Reach:
    """All shortest paths from one node: cost (n * n,), inf where unreachable, and predecessors."""

    cost: Points
    previous: NDArray[np.int32]

    def trace(self, node: int) -> list[int]:
        """Nodes from the start to `node`, both included."""
        path = [node]
        while (before := int(self.previous[path[-1]])) >= 0:
            path.append(before)
        return path[::-1]


class CostField:
    """Distances to obstacles and prices of floor, for one body on one state of the map.

    It covers the part of the map that was seen, the given places (K, 2) and `ROUND` metres about both.
    Fine arrays, rows are y: occupied, seen (free or occupied), distance (metres to the nearest
    occupied cell's middle). Node arrays of shape `nodes`: node_distance, node_seen, node_occupied (any
    cell), node_cost (per metre, inf where blocked); flat ones: passable (N,) bool, stands (N, 2) where the
    nodes stand, metres.
    """

    def __init__(
        self, floor: ObstacleMap, body: Body, places: Points, now: float = 0.0, memory_s: float = math.inf
    ) -> None:
        self.body = body
        self.cell = floor.settings.cell
        occupied = floor.occupied()
        seen = floor.seen_free(now, memory_s) | occupied
        rows, columns = _window(seen, floor.cells(places), math.ceil(ROUND / self.cell))
        self.corner = floor.origin + self.cell * np.array([columns.start, rows.start])
        self.occupied: Mask = occupied[rows, columns]
        self.seen: Mask = seen[rows, columns]
        self.distance: NDArray[np.float32] = self._distance_to(self.occupied)
        self.nodes = (self.seen.shape[0] // 2, self.seen.shape[1] // 2)
        self.stands, self.node_distance = self._stands()
        s00, s01, s10, s11 = _quarters(self.seen)
        # At least two of the four cells.
        self.node_seen: Mask = (s00 & s01) | (s10 & s11) | ((s00 | s01) & (s10 | s11))
        o00, o01, o10, o11 = _quarters(self.occupied)
        self.node_occupied: Mask = o00 | o01 | o10 | o11
        self.node_cost = self._price(self.node_distance, self.node_seen)
        self.passable: Mask = np.isfinite(self.node_cost).ravel()

    # -------------------------------------------------------------------------------------- single places

    def fine(self, points: Points) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns of the cells that hold points (..., 2), clipped to the window."""
        index = np.floor((np.asarray(points) - self.corner) / self.cell).astype(np.intp)
        rows, columns = self.seen.shape
        return np.clip(index[..., 1], 0, rows - 1), np.clip(index[..., 0], 0, columns - 1)

    def node_at(self, x: float, y: float) -> int:
        """Flat index of the node whose block holds (x, y), clipped to the window."""
        row, column = self.fine(np.array([x, y]))
        columns: int = self.nodes[1]
        return int(row) // 2 * columns + int(column) // 2

    def price_at(self, points: Points) -> Points:
        """Cost per metre at points (..., 2); inf within the body's radius of an occupied cell."""
        cells = self.fine(points)
        return self._price(self.distance[cells], self.seen[cells])

    # ------------------------------------------------------------------------------------------- straights

    def straight_costs(self, start: Points, ends: Points) -> tuple[Points, Points]:
        """Cost and smallest obstacle distance along straight lines from one point (2,) to many (N, 2).

        The cost is finite everywhere: the caller judges by the distance whether a line may go that near.
        """
        lengths = np.hypot(*(ends - start).T)
        samples = max(2, math.ceil(float(lengths.max(initial=0.0)) / (0.75 * self.cell)) + 1)
        t = (np.arange(samples) + 0.5) / samples
        points = start + t[None, :, None] * (ends - start)[:, None, :]
        rows, columns = self.fine(points)
        distance = self.distance[rows, columns]
        price = self.soft_price(distance, self.seen[rows, columns])
        return lengths * price.mean(axis=1), np.asarray(distance.min(axis=1), dtype=np.float64)

    def sight_free(self, eyes: Points, target: Points, ignore_radius: float) -> Mask:
        """(N,) bool: no occupied cell between eye (N, 2) and target (2,), but for those near the target."""
        away = np.hypot(*(eyes - target).T)
        reach = np.maximum(1.0 - ignore_radius / np.maximum(away, 1e-9), 0.0)
        samples = max(2, math.ceil(float(away.max(initial=0.0)) / (0.75 * self.cell)) + 1)
        t = np.linspace(0.0, 1.0, samples)[None, :] * reach[:, None]
        rows, columns = self.fine(eyes[:, None, :] + t[:, :, None] * (target - eyes)[:, None, :])
        return np.asarray(~self.occupied[rows, columns].any(axis=1))

    # ---------------------------------------------------------------------------------------- shortest paths

    def reach(self, node: int) -> Reach:
        """Shortest paths from a node to every other (Dijkstra on 8 neighbours)."""
        cost = self.node_cost
        weights = np.full((*self.nodes, len(_STEPS)), np.inf)
        step = 2 * self.cell
        for k, (di, dj) in enumerate(_STEPS):
            here, there = _shifted(self.nodes, di, dj)
            weights[(*here, k)] = 0.5 * step * math.hypot(di, dj) * (cost[here] + cost[there])
        indices, starts = _topology(self.nodes)
        graph = csr_array((weights.ravel(), indices, starts), shape=(cost.size, cost.size))
        found, previous = dijkstra(graph, indices=node, return_predecessors=True, limit=_FAR)
        return Reach(found, previous)

    # ------------------------------------------------------------------------------------------------ inside

    def _distance_to(self, mask: Mask) -> NDArray[np.float32]:
        if not mask.any():
            return np.full(mask.shape, _FAR, np.float32)
        pixels = cv2.distanceTransform((~mask).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
        return np.asarray(pixels * np.float32(self.cell), dtype=np.float32)

    def _stands(self) -> tuple[Points, NDArray[np.float32]]:
        """Per node its place (n * n, 2), the best of its four cells, and that cell's obstacle distance."""
        d00, d01, d10, d11 = _quarters(self.distance)
        upper, lower = np.maximum(d00, d01), np.maximum(d10, d11)
        down = lower > upper
        right = np.where(down, d11 > d10, d01 > d00)
        step = 2.0 * self.cell
        stands = np.empty((*self.nodes, 2))
        stands[..., 0] = self.corner[0] + step * np.arange(self.nodes[1])[None, :] + self.cell * (right + 0.5)
        stands[..., 1] = self.corner[1] + step * np.arange(self.nodes[0])[:, None] + self.cell * (down + 0.5)
        return stands.reshape(-1, 2), np.maximum(upper, lower)

    def soft_price(self, distance: NDArray[np.float32], seen: Mask) -> Points:
        """Cost per metre by obstacle distance and whether the floor was seen; finite even where blocked."""
        comfort = np.float32(self.body.comfort)
        nearness = (np.float32(self.body.radius) + comfort - distance) / comfort
        floor = np.where(seen, 1.0, self.body.unknown_cost)
        return np.asarray(floor + self.body.crowding * np.clip(nearness, 0.0, 1.0) ** 2)

    def _price(self, distance: NDArray[np.float32], seen: Mask) -> Points:
        return np.where(distance < self.body.radius, np.inf, self.soft_price(distance, seen))


def _window(seen: Mask, places: NDArray[np.intp], around: int) -> tuple[slice, slice]:
    """Rows and columns that hold what was seen and the places (N, 2), and `around` cells more.

    Borders are multiples of 16 cells, so that few different lattices are ever needed.
    """
    size = seen.shape[0]
    used = []
    for axis in (0, 1):
        known = np.flatnonzero(seen.any(axis=1 - axis))
        here = np.concatenate([known[:1], known[-1:], np.clip(places[:, axis], 0, size - 1)])
        low = max((int(here.min()) - around) // 16 * 16, 0)
        high = min(-(-(int(here.max()) + 1 + around) // 16) * 16, size // 2 * 2)
        used.append(slice(low, high))
    return used[0], used[1]


def _quarters(grid: NDArray[Any]) -> list[NDArray[Any]]:
    """The four cells of every 2 x 2 block as four views, row by row."""
    return [grid[i::2, j::2] for i in (0, 1) for j in (0, 1)]


def _shifted(shape: tuple[int, int], di: int, dj: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Windows of the nodes that have a neighbour at (di, dj), and of those neighbours."""
    rows, columns = shape
    here = (slice(max(0, -di), rows - max(0, di)), slice(max(0, -dj), columns - max(0, dj)))
    there = (slice(max(0, di), rows + min(0, di)), slice(max(0, dj), columns + min(0, dj)))
    return here, there


@lru_cache(maxsize=16)
def _topology(shape: tuple[int, int]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """CSR indices and row starts of a lattice with 8 slots a node; slots over the rim point home."""
    count = shape[0] * shape[1]
    index = np.arange(count, dtype=np.int32).reshape(shape)
    neighbours = np.repeat(index[:, :, None], len(_STEPS), axis=2)
    for k, (di, dj) in enumerate(_STEPS):
        here, there = _shifted(shape, di, dj)
        neighbours[(*here, k)] = index[there]
    return neighbours.ravel(), np.arange(0, 8 * count + 1, 8, dtype=np.int32)
