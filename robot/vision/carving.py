"""How far the air is measured empty: space carving by the rays of both eyes, over the floor's plan.

A ray that is measured to end at a far surface proves the air before it empty, whichever eye it belongs to.
Beside every near thing lies a strip that one eye alone sees: it has no disparity. But the other eye looks
through that very place to a background both see, and so it is measured empty after all. No right-referenced
matching is needed for this: a matched pixel is a ray of the left eye and one of the right.

The plan is laid out from the left eye: columns are directions (tangents to the right of the head's own
direction), rings are forward distances. A place in the plan is *empty* if nearly all rays of one eye that
cross the body's heights there go on behind it, and none to speak of ended before it.
Source: METHODS 10 with Kutulakos & Seitz, "A theory of shape by space carving" (2000), for the rays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.model import HeadMount, StereoRig
from robot.vision.levelling import FloorLevel
from robot.vision.stereo import Disparity

Floats = NDArray[np.float32]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
Vector = NDArray[np.float64]

ROW_STEP = 2
"""Every second row is looked at: neighbouring rows of a matcher's map say the same."""
RING_RATIO = 1.03
"""Each ring lies so much farther than the one before."""
EMPTY_SHARE = 0.85
"""Of the rays that cross the body's heights so many must be measured to go on."""
STANDING_ROWS = 3
"""So many rays of one direction that end before a place bar it; fewer are false matches."""
IN_VIEW_SHARE = 0.9
"""Of the rows at a distance so many must lie in the picture, or a direction is out of view there."""


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Where the air is measured empty, seen from above.

    tangents (K,): directions of the columns to the right of the head's forward direction; distances (J,):
    forward from the eyes, metres, ascending; empty (K, J) bool; in_view (K, J) bool: within the left picture;
    top (J,): how high above the floor the picture reaches there, metres.
    eye (3,): the left eye in the robot frame; pan: the head's, radians.
    """

    tangents: Vector
    distances: Vector
    empty: Mask
    in_view: Mask
    top: Vector
    eye: Vector
    pan: float


def carve(
    disparity: Disparity,
    rig: StereoRig,
    mount: HeadMount,
    pan: float,
    tilt: float,
    level: FloorLevel,
    heights: tuple[float, float],
    reach: tuple[float, float] = (0.2, 2.5),
) -> Plan:
    """The plan of the air between two heights above the floor, as one disparity map measures it.

    Args:
        disparity: of the left picture.
        rig: parallel pair.
        mount: where the head sits; pan, tilt: of the head, radians.
        level: how the floor really lies.
        heights: lowest and highest metres that must be empty.
        reach: nearest and farthest forward distance from the eyes, metres.
    """
    rows = _Rows.of(disparity, rig, mount, pan, tilt, level, heights)
    distances = reach[0] * RING_RATIO ** np.arange(
        1 + int(math.log(reach[1] / reach[0]) / math.log(RING_RATIO))
    )
    tangents = _tangents(rig, rows)
    left, seen = _upright(disparity, rig, rows, tangents)
    crossing = (rows.enters[:, None] <= distances) & (distances < rows.leaves[:, None])
    expected = seen.T.astype(np.float32) @ crossing.astype(np.float32)
    in_view = expected >= np.maximum(IN_VIEW_SHARE * crossing.sum(axis=0), 1.0)
    shift = rig.left.fx * rig.baseline / distances
    empty = _empty(left, rows, distances, expected) & in_view
    empty |= _moved(
        _empty(_seen_from_right(left, rig.left.fx * rig.baseline), rows, distances, expected) & in_view, shift
    )
    top = rows.eye_height - distances * float(rows.drop.min())
    return Plan(tangents, distances, empty, in_view, top, rows.eye, pan)


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """The picture's rows looked at, arrays (R,): of a row's rays.

    rows: picture row; forward: metres forward for each metre of depth; drop: metres down for each metre
    forward, against the floor; enters, leaves: between which forward distances they cross the heights.
    """

    rows: Index
    forward: Vector
    drop: Vector
    enters: Vector
    leaves: Vector
    eye: Vector
    eye_height: float

    @classmethod
    def of(
        cls,
        disparity: Disparity,
        rig: StereoRig,
        mount: HeadMount,
        pan: float,
        tilt: float,
        level: FloorLevel,
        heights: tuple[float, float],
    ) -> _Rows:
        rotation, eye = mount.left_eye(pan, tilt)
        ahead = np.array([math.cos(pan), math.sin(pan), 0.0])
        rows = np.arange(0, disparity.values.shape[0], ROW_STEP)
        down = (rows - rig.left.cy) / rig.left.fy
        forward = rotation[:, 1] @ ahead * down + rotation[:, 2] @ ahead
        keep = forward > 0.2
        rows, down, forward = rows[keep], down[keep], forward[keep]
        slope = level.ahead * ahead[0] + level.aside * ahead[1]
        drop = -(rotation[2, 1] * down + rotation[2, 2]) / forward + slope
        height = float(eye[2]) - level.at(float(eye[0]), float(eye[1]))
        steep = np.where(np.abs(drop) < 1e-4, 1e-4, drop)
        to_low, to_high = (height - heights[0]) / steep, (height - heights[1]) / steep
        enters = np.maximum(np.minimum(to_low, to_high), 0.0)
        return cls(rows, forward, drop, enters, np.maximum(to_low, to_high), eye, height)


def _tangents(rig: StereoRig, rows: _Rows) -> Vector:
    """Directions one pixel apart that hold the whole picture."""
    camera = rig.left
    widest = max(camera.cx, camera.width - 1 - camera.cx) / max(float(rows.forward.min()), 0.2)
    half = math.ceil(widest)
    return np.arange(-half, half + 1) / camera.fx


def _upright(
    disparity: Disparity, rig: StereoRig, rows: _Rows, tangents: Vector
) -> tuple[Floats, Mask]:
    """Forward distance (R, K) to what each ray ends at, 0 where unmeasured; which lie in the picture."""
    camera = rig.left
    column = np.rint(camera.cx + camera.fx * rows.forward[:, None] * tangents).astype(np.intp)
    seen = (column >= 0) & (column < camera.width)
    column = np.clip(column, 0, camera.width - 1)
    values = np.take_along_axis(disparity.values[rows.rows], column, axis=1) + np.float32(rig.doffs)
    valid = np.take_along_axis(disparity.valid[rows.rows], column, axis=1) & seen & (values > 0.5)
    scale = (camera.fx * rig.baseline * rows.forward).astype(np.float32)[:, None]
    return np.where(valid, scale / np.where(valid, values, np.float32(1.0)), np.float32(0.0)), seen


def _seen_from_right(left: Floats, focal_baseline: float) -> Floats:
    """The same distances (R, K) by the right eye's directions."""
    row, column = np.nonzero(left > 0.0)
    distance = left[row, column]
    other = column - np.rint(focal_baseline / distance).astype(np.intp)
    inside = other >= 0
    right = np.zeros_like(left)
    # Where two surfaces share a ray the nearer one is the farther to the right in the left picture: it is
    # written last and hides the other.
    right[row[inside], other[inside]] = distance[inside]
    # A surface seen wider by the right eye leaves holes of a column: the nearer neighbour bounds them.
    between = np.minimum(right[:, :-2], right[:, 2:])
    hole = right[:, 1:-1] == 0.0
    right[:, 1:-1][hole] = between[hole]
    return right


def _empty(surface: Floats, rows: _Rows, distances: Vector, expected: Floats) -> Mask:
    """Places (K, J) that nearly all rays of this eye are measured to pass, and before which none ends."""
    columns, rings = surface.shape[1], len(distances)
    measured = surface > 0.0
    leaves = rows.leaves.astype(np.float32)[:, None]
    end = _ring(np.minimum(surface, leaves), distances)
    start = np.broadcast_to(_ring(rows.enters.astype(np.float32)[:, None], distances), surface.shape)
    cell = np.broadcast_to(np.arange(columns) * (rings + 1), surface.shape)
    far = measured & (end > start)
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
    moved = np.take_along_axis(empty, np.clip(other, 0, columns - 1), axis=0)
    return moved & (other >= 0)
