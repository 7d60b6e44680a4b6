"""The base's passage: the straight way with most room beside it, over the plan of what is measured empty.

A body drives straight from where it stands. For every bearing the plan tells how much room there is to the
left and to the right of that line, ring by ring; the way with the most room over its whole length is chosen.
Its narrowest place, the nearest two points of both sides, is the opening: that distance is the diameter of
the largest upright cylinder that passes it. Source: METHODS 10 for the question, the corridor is ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot.messages import FreeSpace
from robot.vision.carving import Air
from robot.vision.plan import Plan, head_axes, proven

Vector = NDArray[np.float64]
Index = NDArray[np.int32]

BEARING_STEP, WAY_STEP = math.radians(0.5), math.radians(0.4)
LEADS_TO_M = 1.55
"""A way that leads so far (from the robot's origin) leads somewhere."""
SHORTEST_M = 1.0
LENGTH_STEP_M = 0.1
BEYOND_M = 0.3
"""A shorter way counts if it leads so far beyond a narrow place."""
NARROW_M = 0.8
OPEN_M, OPEN_AT_M = 0.45, 1.05
"""Room beside a way is looked for so far; a way that is nowhere narrower is judged so far ahead."""
FIRST_NARROW, OPENING_DEPTH_M = 1.25, 0.1
"""A place this much wider than the narrowest counts if it comes first; so deep an opening is looked at."""
FIRM_M = 0.05
"""A bare side of an opening may stand so much nearer than where its foot was taken for floor."""
MOUTH_TIE = 1.03
"""Places so little wider are as narrow."""
ALIKE_M = 0.005
LEAST_ROOM_M = 0.04
"""Less room is no opening at all."""
BLIND_M = 0.6
"""Nearer (from the origin) the view may end beside the way: the floor about the body is known."""
FIRST_FLOOR_M = 0.6
"""Floor first seen farther away than this leaves too much before it unseen."""
FLOOR_SLACK_M = 0.12
"""The floor's cells are so coarse: a sector may end so much before a thing it only touches."""


@dataclass(frozen=True, slots=True)
class Opening:
    """The narrowest place of the way with most room, robot frame, metres.

    left, right: (x, y) of its two sides; top: how high above the floor the picture shows it; leads_to: how
    far from the origin the way through it leads.
    """

    left: tuple[float, float]
    right: tuple[float, float]
    top: float
    leads_to: float

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

    @property
    def bearing(self) -> float:
        """Of the straight way through its middle."""
        return math.atan2(self.middle[1], self.middle[0])


@dataclass(frozen=True, slots=True)
class Needed:
    """What a body needs, metres: its width; proven: the width that must be measured to be empty, room: that
    must be left between all that may stand; beyond: how far past an opening it must be so."""

    width: float
    proven: float
    room: float
    beyond: float


@dataclass(frozen=True, slots=True)
class Way:
    """A straight way from the robot's origin: its bearing, and how far it is to the opening, metres."""

    bearing: float
    distance: float

    @property
    def place(self) -> tuple[float, float]:
        """(x, y) of the way in the opening."""
        return self.distance * math.cos(self.bearing), self.distance * math.sin(self.bearing)


@dataclass(frozen=True, slots=True, eq=False)
class _Sides:
    """Room beside straight ways: along, left, right (T, J) metres for bearings (T,) and the plan's rings."""

    bearings: Vector
    along: Vector
    left: Vector
    right: Vector


def widest_opening(plan: Plan, width: float) -> Opening | None:
    """The opening of the way with the most room; None if no way leads anywhere.

    Args:
        plan: where the air is empty.
        width: of the body; a way that has room for it is preferred to a longer one that has not.
    """
    spread = math.atan(float(plan.tangents[-1])) - math.radians(5.0)
    bearings = plan.pan + np.arange(-spread, spread, BEARING_STEP)
    ways, things = (
        _beside(plan, barred, bearings) for barred in (_blocked(plan), ~plan.empty & plan.in_view)
    )
    lengths = [float(n) for n in np.arange(LEADS_TO_M, SHORTEST_M - 1e-9, -LENGTH_STEP_M)]
    for least in (width, LEAST_ROOM_M):
        for length in lengths:
            best = _roomiest(ways, length, least)
            if best is None:
                continue
            found = _opening(plan, things, best, length)
            if length == LEADS_TO_M or (found.width < NARROW_M and found.distance + BEYOND_M <= length):
                return found
    return None


def way_through(air: Air, plan: Plan, found: Opening, needed: Needed) -> Way | None:
    """The straight way through the opening by which the body surely fits; None if there is none.

    The way through the middle if it will do, else the one with most room to spare: where one side of an
    opening is seen less well, the body keeps away from it.
    """
    aside = max(found.width - needed.width, 0.0) / (2.0 * found.distance)
    steps = np.arange(WAY_STEP, aside, WAY_STEP)
    bearings = found.bearing + np.concatenate([[0.0], -steps, steps])
    along = plan.distances + _ahead_of_origin(plan)
    asked = (along >= found.distance - FIRM_M) & (along <= found.distance + needed.beyond)
    # Rings lie two centimetres apart: nothing hides between every second of them.
    rings = np.flatnonzero(asked)[::2]
    if not len(rings):
        return None
    barred = ~np.stack([proven(air, float(d)) for d in plan.distances[rings]], axis=1)
    proof = _beside(replace(plan, distances=plan.distances[rings]), barred, bearings)
    ends = found.distance + needed.beyond
    spare = _room(proof, found.distance - FIRM_M, ends) - needed.proven
    ways = _beside(plan, _blocked(plan), bearings)
    spare = np.minimum(spare, _room(ways, 0.0, ends) - needed.room)
    # Beside the way through the middle there may be none: a wall stands there a little farther on.
    spare = np.minimum(spare, _room(ways, 0.0, found.leads_to) - needed.width)
    best = 0 if spare[0] >= 0.0 else int(spare.argmax())
    return Way(float(bearings[best]), found.distance) if spare[best] >= 0.0 else None


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
    reached = (floor.free >= swept - FLOOR_SLACK_M) & (floor.near <= FIRST_FLOOR_M)
    return inside and bool(asked.any()) and bool(reached[asked].all())


def _ahead_of_origin(plan: Plan) -> float:
    return float(plan.eye[0] * math.cos(plan.pan) + plan.eye[1] * math.sin(plan.pan))


def _blocked(plan: Plan) -> NDArray[np.bool_]:
    """Places (K, J) a way must not lead through: things, and what is not in view."""
    # Beside the body the view may end; farther on what is not in view is not free.
    blind = plan.distances + _ahead_of_origin(plan) < BLIND_M
    return ~plan.empty & (plan.in_view | ~blind)


def _room(sides: _Sides, start: float, end: float) -> Vector:
    """How wide a body may be, twice the lesser side, on each way (T,) between two distances along it."""
    within = (sides.along >= start) & (sides.along <= end)
    room: Vector = 2.0 * np.where(within, np.minimum(sides.left, sides.right), np.inf).min(axis=1)
    return room


def _beside(plan: Plan, barred: NDArray[np.bool_], bearings: Vector) -> _Sides:
    """Room to the left and right of straight ways from the robot's origin, up to barred places (K, J)."""
    forward, right = head_axes(plan.pan)
    way = np.column_stack([np.cos(bearings), np.sin(bearings)])
    along = (plan.distances + _ahead_of_origin(plan)) / (way @ forward)[:, None]
    lateral = along * (way @ right)[:, None] - plan.eye[:2] @ right
    step = float(plan.tangents[1] - plan.tangents[0])
    column = np.rint((lateral / plan.distances - plan.tangents[0]) / step).astype(np.intp)
    inside = (column >= 0) & (column < len(plan.tangents))
    column = np.clip(column, 0, len(plan.tangents) - 1)
    last, following = _nearest_barred(barred)
    rings = np.arange(len(plan.distances))
    # A barred column bars all of its own width.
    edge_left = plan.tangents[0] + (last[column, rings] + 0.5) * step
    edge_right = plan.tangents[0] + (following[column, rings] - 0.5) * step
    slant = np.abs(way @ forward)[:, None]
    to_left = np.where(last[column, rings] < 0, OPEN_M, (lateral - edge_left * plan.distances) * slant)
    to_right = np.where(
        following[column, rings] >= len(barred), OPEN_M, (edge_right * plan.distances - lateral) * slant
    )
    to_left, to_right = (np.where(inside, np.clip(room, 0.0, OPEN_M), 0.0) for room in (to_left, to_right))
    return _Sides(bearings, along, to_left, to_right)


def _nearest_barred(barred: NDArray[np.bool_]) -> tuple[Index, Index]:
    """For every column (K, J) the last barred column at or before it (-1: none) and the next at or after."""
    index = np.arange(len(barred), dtype=np.int32)[:, None]
    last = np.maximum.accumulate(np.where(barred, index, np.int32(-1)), axis=0)
    following = np.minimum.accumulate(np.where(barred, index, np.int32(len(barred)))[::-1], axis=0)[::-1]
    return last, following


def _roomiest(ways: _Sides, length: float, least: float) -> int | None:
    """The way with the most room over this length, of equally roomy ones the middle; None below `least`."""
    room = _room(ways, 0.0, length)
    best = int(room.argmax())
    if room[best] < least:
        return None
    alike = room >= room[best] - ALIKE_M
    first = best - int(np.argmin(alike[best::-1])) + 1 if not alike[best::-1].all() else 0
    last = best + int(np.argmin(alike[best:])) - 1 if not alike[best:].all() else len(room) - 1
    return (first + last) // 2


def _opening(plan: Plan, things: _Sides, chosen: int, length: float) -> Opening:
    left, right = _narrowest(plan, things, chosen, length)
    x, y = (float(c) for c in 0.5 * (left + right))
    away = (plan.distances + _ahead_of_origin(plan)) / math.cos(math.atan2(y, x) - plan.pan)
    ring = min(int(np.searchsorted(away, math.hypot(x, y))), len(plan.top) - 1)
    sides = [(float(p[0]), float(p[1])) for p in (left, right)]
    return Opening(sides[0], sides[1], float(plan.top[ring]), length)


def _narrowest(plan: Plan, things: _Sides, chosen: int, length: float) -> tuple[Vector, Vector]:
    """The nearest two points of a way's sides, (2,) each, robot frame; of an open way at `OPEN_AT_M`."""
    bearing = float(things.bearings[chosen])
    way = np.array([math.cos(bearing), math.sin(bearing)])
    forward = np.array([math.cos(plan.pan), math.sin(plan.pan)])
    # Sides were measured along the rings, across the head's direction, and shortened to the way's normal.
    across = np.array([-forward[1], forward[0]]) / abs(float(way @ forward))
    rings = (things.along[chosen] <= length) & (things.along[chosen] > BLIND_M)
    along, to_left, to_right = (side[chosen][rings] for side in (things.along, things.left, things.right))
    left = along[:, None] * way + to_left[:, None] * across
    right = along[:, None] * way - to_right[:, None] * across
    apart = np.linalg.norm(left[:, None] - right[None], axis=2)
    # Behind an opening what it hides narrows the plan again: the first narrow place is the opening.
    first = along[int((apart.min(axis=1) <= FIRST_NARROW * apart.min()).argmax())]
    apart[(along < first) | (along > first + OPENING_DEPTH_M)] = np.inf
    # Between parallel sides all pairs are as near: the opening is where one comes to it.
    entry = np.where(apart <= MOUTH_TIE * apart.min(), along[:, None] + along[None], np.inf)
    i, j = np.unravel_index(int(entry.argmin()), apart.shape)
    if max(to_left[i], to_right[j]) < OPEN_M:
        return left[i], right[j]
    # What is bounded on one side alone is no opening: the way itself counts, as far ahead as matters.
    half, ring = np.minimum(to_left, to_right), int(np.abs(along - OPEN_AT_M).argmin())
    return along[ring] * way + half[ring] * across, along[ring] * way - half[ring] * across
