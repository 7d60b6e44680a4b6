"""The air seen from above: which places are empty over all of the body's heights.

Two answers. `outline`: what is not measured stands on the floor where the floor was last seen, for things
stand on floors; so the way to a bare wall is empty up to its foot. `proven`: only what was measured counts.
An opening is looked for in the outline and must be proven where it is narrowest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Points
from robot.vision.carving import NEAREST_M, Air, Rays, by_right_eye

Floats = NDArray[np.float32]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
Vector = NDArray[np.float64]

FARTHEST = 2.2
RING_RATIO = 1.02
"""Each ring lies so much farther than the one before."""
EMPTY_SHARE = 0.9
"""Of the rays that cross the body's heights so many must be measured to go on."""
HANGING_ROWS = 3
"""So many unproven rows (looked at) between proven ones may be a hanging edge: a board 2 cm thick at 1 m."""
STANDING_ROWS = 3
"""So many rays of one direction that end before a place bar it; fewer are false matches."""
THINNEST_M = 0.012
"""An unproven strip beside an edge that is narrower hides nothing: what stands by itself is wider."""
CORNER_COLUMNS, CORNER_SLACK = 4, 1.03
"""A corner belongs to a thing that is barred so many columns beside it at its distance, or so little on."""
IN_VIEW_SHARE = 0.9
"""Of the rows at a distance so many must lie in the picture, or a direction is out of view there."""


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Rings of places: tangents (K,) to the right, forward distances (J,) from the eyes; (K, J) masks.

    empty: no thing there, see `outline`; in_view: both pictures show it; top (J,): how high above the
    floor the picture reaches there. eye (3,): the left eye in the robot frame; pan: the head's.
    """

    tangents: Vector
    distances: Vector
    empty: Mask
    in_view: Mask
    top: Vector
    eye: Vector
    pan: float


def outline(air: Air) -> Plan:
    """The plan, unmeasured things standing where the floor was last seen."""
    rays = air.rays
    rings = int(math.log(FARTHEST / NEAREST_M) / math.log(RING_RATIO)) + 1
    distances: Vector = np.asarray(NEAREST_M * RING_RATIO ** np.arange(rings), np.float64)
    crossing = (rays.enters[:, None] <= distances) & (distances < rays.leaves[:, None])
    expected = rays.seen.T.astype(np.float32) @ crossing.astype(np.float32)
    shift: Vector = air.focal_baseline / distances
    in_view = expected >= np.maximum(IN_VIEW_SHARE * crossing.sum(axis=0), 1.0)
    in_view &= _moved(in_view, shift)
    left = np.where((air.left == 0.0) & rays.seen, air.foot, air.left)
    right = np.where(air.right > 0.0, air.right, by_right_eye(left, air.focal_baseline))
    empty = _empty(left, rays, distances, expected)
    empty |= _moved(_empty(right, rays, distances, expected), shift)
    top: Vector = rays.height - distances * float(rays.drop.min())
    return Plan(rays.tangents, distances, empty & in_view, in_view, top, rays.eye, rays.pan)


def head_axes(pan: float) -> tuple[Vector, Vector]:
    """Unit vectors (2,), robot frame: ahead of a head turned by `pan` radians, and to its right."""
    forward = np.array([math.cos(pan), math.sin(pan)])
    return forward, np.array([forward[1], -forward[0]])


def barred_by(plan: Plan, points: Points) -> Plan:
    """The same plan with nothing empty from these points on, (N, 3) robot frame, along their directions.

    A bare thing is unmeasured but for its edges, and those the ground's corners know: without them it stands
    where its foot was last taken for floor.
    """
    if not len(points):
        return plan
    away = (points[:, :2] - plan.eye[:2]) @ np.column_stack(head_axes(plan.pan))
    away = away[away[:, 0] > NEAREST_M]
    step = float(plan.tangents[1] - plan.tangents[0])
    column = np.rint((away[:, 1] / away[:, 0] - plan.tangents[0]) / step).astype(np.intp)
    inside = (column >= 0) & (column < len(plan.tangents))
    # A corner of what is barred already adds nothing but its own uncertain column.
    wide = cv2.dilate(
        (~plan.empty & plan.in_view).view(np.uint8), np.ones((2 * CORNER_COLUMNS + 1, 1), np.uint8)
    )
    ring = np.minimum(np.searchsorted(plan.distances, CORNER_SLACK * away[:, 0]), len(plan.distances) - 1)
    inside &= wide[np.clip(column, 0, len(plan.tangents) - 1), ring] == 0
    nearest = np.full(len(plan.tangents), np.inf)
    np.minimum.at(nearest, column[inside], away[inside, 0])
    return replace(plan, empty=plan.empty & (plan.distances < nearest[:, None]))


def standing_points(air: Air) -> Vector:
    """Where the nearest measured thing stands in each direction that has one, (N, 2) robot frame, metres."""
    rays = air.rays
    leaves = rays.leaves.astype(np.float32)[:, None]
    stands = (air.left > 0.0) & (air.left < leaves) & (air.left >= rays.enters.astype(np.float32)[:, None])
    nearest = np.partition(np.where(stands, air.left, np.float32(1e9)), STANDING_ROWS - 1, axis=0)[
        STANDING_ROWS - 1
    ]
    # A single direction is a false match: its neighbours must tell of something as near.
    nearest = cv2.medianBlur(nearest[None], 3)[0]
    held = nearest < FARTHEST
    return _places(rays.eye, rays.pan, rays.tangents[held], nearest[held].astype(np.float64))


def ends(plan: Plan) -> Vector:
    """Where the empty air of each direction ends, (K, 2) robot frame, metres; at the last ring if nowhere."""
    barred = ~plan.empty & plan.in_view
    first = np.where(barred.any(axis=1), barred.argmax(axis=1), len(plan.distances) - 1)
    return _places(plan.eye, plan.pan, plan.tangents, plan.distances[first])


def _places(eye: Vector, pan: float, tangents: Vector, distances: Vector) -> Vector:
    """Points (N, 2) of the robot frame at forward distances (N,) in directions (N,)."""
    forward, right = head_axes(pan)
    return np.asarray(eye[:2] + distances[:, None] * (forward + tangents[:, None] * right), np.float64)


def proven(air: Air, distance: float) -> Mask:
    """Directions (K,) in which the air at this forward distance is proven empty by one eye or the other.

    Nearly all of the rays must be measured to go on, and none of the others may be the edge of a board that
    hangs there. Strips narrower than `THINNEST_M` between proven directions count as proven.
    """
    rays = air.rays
    rows = np.flatnonzero((rays.enters <= distance) & (distance < rays.leaves))
    if not len(rows):
        return np.zeros(air.left.shape[1], np.bool_)
    shift = round(air.focal_baseline / distance)
    above = np.arange(rows[-1] + 1)
    measured = _passing(air.left[above], air.right[above], distance, shift)
    found: Mask = measured[rows].mean(axis=0) >= EMPTY_SHARE
    found &= _hanging(measured, int(rows[0])) < HANGING_ROWS
    strip = int(THINNEST_M / (distance * float(rays.tangents[1] - rays.tangents[0])))
    kernel = np.ones((1, strip + 1), np.uint8)
    # Opposite anchors: a closing by an even number of columns would else move all by one.
    closed = cv2.dilate(found.view(np.uint8)[None], kernel, anchor=(0, 0))
    closed = cv2.erode(closed, kernel, anchor=(strip, 0))
    return np.asarray(closed[0] > 0, np.bool_)


def _passing(left: Floats, right: Floats, distance: float, shift: int) -> Mask:
    """Rays (R, K) of the left eye's directions along which either eye sees beyond the distance."""
    columns = left.shape[1]
    other = np.arange(columns) - shift
    by_right = (right > distance)[:, np.clip(other, 0, columns - 1)] & (other >= 0)
    found: Mask = (left > distance) | by_right
    return found


def _hanging(passing: Mask, first: int) -> Index:
    """The longest run of rows from `first` on, of each direction (K,), that is unproven between proven ones.

    A bare board's edge hangs so in a picture, floor seen below it and a wall above.
    """
    rows = np.arange(len(passing), dtype=np.int16)[:, None]
    above = np.maximum.accumulate(np.where(passing, rows, np.int16(-1)), axis=0)
    below = np.minimum.accumulate(np.where(passing, rows, np.int16(len(rows)))[::-1], axis=0)[::-1]
    between = ~passing & (above >= 0) & (below < len(rows)) & (rows >= first)
    return np.asarray(np.where(between, below - above - 1, 0).max(axis=0), np.intp)


def _empty(surface: Floats, rays: Rays, distances: Vector, expected: Floats) -> Mask:
    """Places (K, J) that nearly all rays of this eye pass, and before which none to speak of ends."""
    columns, rings = surface.shape[1], len(distances)
    leaves = rays.leaves.astype(np.float32)[:, None]
    end = _ring(np.minimum(surface, leaves), distances)
    start = np.broadcast_to(_ring(rays.enters.astype(np.float32)[:, None], distances), surface.shape)
    cell = np.broadcast_to(np.arange(columns) * (rings + 1), surface.shape)
    far = (surface > 0.0) & (end > start)
    standing = far & (surface < leaves)

    def tally(index: Index, chosen: Mask) -> Floats:
        counts = np.bincount((cell + index)[chosen], minlength=columns * (rings + 1))
        return np.cumsum(counts.reshape(columns, rings + 1)[:, :rings], axis=1).astype(np.float32)

    passing = tally(start, far) - tally(end, far)
    ended = tally(end, standing)
    empty: Mask = (passing >= EMPTY_SHARE * expected) & (ended < STANDING_ROWS)
    return empty


def _ring(distance: Floats, distances: Vector) -> Index:
    """The first ring at or beyond each distance, 0..J."""
    scaled = np.log(np.maximum(distance, np.float32(1e-3)) * np.float32(1.0 / distances[0]))
    index = np.ceil(scaled * np.float32(1.0 / math.log(RING_RATIO)))
    return np.clip(index, 0, len(distances)).astype(np.intp)


def _moved(empty: Mask, shift: Vector) -> Mask:
    """The right eye's places (K, J) by the left eye's directions: each ring moves by its disparity."""
    columns = len(empty)
    other = np.arange(columns)[:, None] - np.rint(shift).astype(np.intp)
    moved: Mask = np.take_along_axis(empty, np.clip(other, 0, columns - 1), axis=0) & (other >= 0)
    return moved
