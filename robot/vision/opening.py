"""The base's passage: the straight way with most room beside it, over the plan of what is measured empty.

A body drives straight from where it stands. For every bearing the plan tells how much room there is to the
left and to the right of that line, ring by ring; the way with the most room over its whole length is chosen.
Its narrowest place, the nearest two points of both sides, is the opening: that distance is the diameter of
the largest upright cylinder that passes it. Source: METHODS 10 for the question, the corridor is ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot.messages import FreeSpace
from robot.vision.carving import Plan

Vector = NDArray[np.float64]
Index = NDArray[np.intp]

BEARING_STEP = math.radians(0.5)
LEADS_TO_M = 1.6
"""A way that leads so far (from the robot's origin) leads somewhere."""
SHORTEST_M = 1.0
LENGTH_STEP_M = 0.1
BEYOND_M = 0.3
"""A shorter way counts if it leads so far beyond a narrow place."""
NARROW_M = 0.8
LEAST_ROOM_M = 0.04
"""Less room is no opening at all."""
BLIND_M = 0.5
"""Nearer (from the origin) the view may end beside the way: the floor about the body is known."""
FLOOR_SLACK_M = 0.12
"""The floor's cells are so coarse: a sector may end so much before a thing it only touches."""


@dataclass(frozen=True, slots=True)
class Opening:
    """The narrowest place of the way with most room, robot frame, metres.

    left, right: (x, y) of its two sides; bearing: of the straight way through its middle; room: how wide
    a body could go straight along it, `beyond` metres past the middle; top: how high the picture shows it.
    """

    left: tuple[float, float]
    right: tuple[float, float]
    bearing: float
    room: float
    top: float

    @property
    def width(self) -> float:
        """Distance between both sides: the diameter of the largest upright cylinder that passes."""
        return math.hypot(self.left[0] - self.right[0], self.left[1] - self.right[1])

    @property
    def middle(self) -> tuple[float, float]:
        """(x, y) half-way between both sides."""
        return 0.5 * (self.left[0] + self.right[0]), 0.5 * (self.left[1] + self.right[1])

    @property
    def distance(self) -> float:
        """Of the middle from the robot's origin."""
        return math.hypot(*self.middle)


@dataclass(frozen=True, slots=True, eq=False)
class _Sides:
    """Room beside straight ways: along, left, right (T, J) metres for bearings (T,) and the plan's rings."""

    bearings: Vector
    along: Vector
    left: Vector
    right: Vector


def widest_opening(plan: Plan, beyond: float) -> Opening | None:
    """The opening of the way with the most room; None if no way leads anywhere.

    Args:
        plan: where the air is empty.
        beyond: how far past its narrowest place the way must be free, metres.
    """
    half = 0.5 * (float(plan.tangents[-1]) - float(plan.tangents[0]))
    spread = math.atan(half) - math.radians(5.0)
    bearings = plan.pan + np.arange(-spread, spread, BEARING_STEP)
    sides = _beside(plan, bearings)
    for length in np.arange(LEADS_TO_M, SHORTEST_M - 1e-9, -LENGTH_STEP_M):
        found = _way_of(plan, sides, float(length), beyond)
        if found is not None and (length == LEADS_TO_M or _leads_through(found, float(length))):
            return found
    return None


def floor_reaches(floor: FreeSpace, bearing: float, length: float, width: float) -> bool:
    """True if the floor was seen free along a straight way of this width and length from the origin.

    Each sector is asked as far as the body sweeps all of it; sectors end at cells, so `FLOOR_SLACK_M` short
    of the way's end will do. What the view does not hold nearer than `BLIND_M` is not asked.
    """
    if len(floor.bearings) < 2:
        return False
    half_sector = 0.5 * float(np.median(np.diff(floor.bearings)))
    off = np.abs(floor.bearings - bearing) + half_sector
    swept = np.minimum(0.5 * width / np.maximum(np.sin(np.minimum(off, 0.5 * math.pi)), 1e-6), length)
    asked = (swept > BLIND_M) & (off < 0.5 * math.pi)
    needed = math.asin(min(0.5 * width / BLIND_M, 1.0)) - 2.0 * half_sector
    inside = (floor.bearings[0] <= bearing - needed) and (bearing + needed <= floor.bearings[-1])
    reached = (floor.free >= swept - FLOOR_SLACK_M) & (floor.near <= BLIND_M)
    return inside and bool(asked.any()) and bool(reached[asked].all())


def _beside(plan: Plan, bearings: Vector) -> _Sides:
    """Room to the left and right of straight ways from the robot's origin."""
    forward = np.array([math.cos(plan.pan), math.sin(plan.pan)])
    right = np.array([forward[1], -forward[0]])
    way = np.column_stack([np.cos(bearings), np.sin(bearings)])
    along = (plan.distances + plan.eye[:2] @ forward) / (way @ forward)[:, None]
    lateral = along * (way @ right)[:, None] - plan.eye[:2] @ right
    step = float(plan.tangents[1] - plan.tangents[0])
    column = np.rint((lateral / plan.distances - plan.tangents[0]) / step).astype(np.intp)
    inside = (column >= 0) & (column < len(plan.tangents))
    column = np.clip(column, 0, len(plan.tangents) - 1)
    # Beside the body the view may end; farther on what is not in view is not free.
    blind = plan.distances + float(plan.eye[:2] @ forward) < BLIND_M
    barred = ~(plan.empty | (blind & ~plan.in_view))
    last, following = _nearest_barred(barred)
    rings = np.arange(len(plan.distances))
    # A barred column bars all of its own width.
    edge_left = plan.tangents[0] + (last[column, rings] + 0.5) * step
    edge_right = plan.tangents[0] + (following[column, rings] - 0.5) * step
    slant = np.abs(way @ forward)[:, None]
    to_left = np.where(inside, (lateral - edge_left * plan.distances) * slant, 0.0)
    to_right = np.where(inside, (edge_right * plan.distances - lateral) * slant, 0.0)
    return _Sides(bearings, along, np.maximum(to_left, 0.0), np.maximum(to_right, 0.0))


def _nearest_barred(barred: NDArray[np.bool_]) -> tuple[Index, Index]:
    """For every column (K, J) the last barred column at or before it (-1: none) and the next at or after."""
    index = np.arange(len(barred))[:, None]
    last = np.maximum.accumulate(np.where(barred, index, -1), axis=0)
    following = np.minimum.accumulate(np.where(barred, index, len(barred))[::-1], axis=0)[::-1]
    return last, following


def _way_of(plan: Plan, sides: _Sides, length: float, beyond: float) -> Opening | None:
    within = sides.along <= length
    room = 2.0 * np.where(within, np.minimum(sides.left, sides.right), np.inf).min(axis=1)
    best = int(room.argmax())
    if room[best] < LEAST_ROOM_M:
        return None
    # Of ways with as much room the middle one.
    ties = np.flatnonzero(room >= room[best] - 0.005)
    run = ties[np.abs(ties - best) == np.abs(np.arange(len(ties)) - int(np.flatnonzero(ties == best)[0]))]
    best = int(run[len(run) // 2])
    left, right = _narrowest(plan, sides, best, within[best])
    middle = 0.5 * (left + right)
    bearing = math.atan2(middle[1], middle[0])
    through = _beside(plan, np.array([bearing]))
    end = min(float(np.hypot(*middle)) + beyond, float(through.along[0, -1]))
    passed = through.along[0] <= end
    straight = 2.0 * float(np.minimum(through.left, through.right)[0, passed].min())
    ring = int(np.searchsorted(through.along[0], float(np.hypot(*middle))))
    top = float(plan.top[min(ring, len(plan.top) - 1)])
    return Opening((left[0], left[1]), (right[0], right[1]), bearing, straight, top)


def _narrowest(plan: Plan, sides: _Sides, chosen: int, within: NDArray[np.bool_]) -> tuple[Vector, Vector]:
    """The two nearest points of both sides of one way, (2,) each, robot frame."""
    bearing = float(sides.bearings[chosen])
    way, aside = np.array([math.cos(bearing), math.sin(bearing)]), np.array([-math.sin(bearing), math.cos(bearing)])
    forward = np.array([math.cos(plan.pan), math.sin(plan.pan)])
    # Sides were measured along the rings, the sideways line of the head, and shortened to the way's normal.
    across = np.array([-forward[1], forward[0]]) / abs(float(way @ forward))
    rings = within & (sides.along[chosen] > BLIND_M)
    base = sides.along[chosen][rings, None] * way
    left = base + sides.left[chosen][rings, None] * across
    right = base - sides.right[chosen][rings, None] * across
    apart = np.linalg.norm(left[:, None] - right[None], axis=2)
    i, j = np.unravel_index(int(apart.argmin()), apart.shape)
    return left[i], right[j]


def _leads_through(found: Opening, length: float) -> bool:
    return found.width < NARROW_M and found.distance + BEYOND_M <= length
