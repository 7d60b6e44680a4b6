"""How far the air is measured empty: space carving by the rays of both eyes.

A ray that is measured to end at a far surface proves the air before it empty, whichever eye it belongs to.
Beside every near thing lies a strip that one eye alone sees: it has no disparity. But the other eye looks
through that very place to a background both see (`both_eyes`), and so it is measured empty after all.

All is laid out upright from the left eye: columns are directions (tangents to the right of the head's own
direction), rows are rays of equal drop, distances are forward ones. Source: METHODS 10 with Kutulakos and
Seitz, "A theory of shape by space carving" (IJCV 2000).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.model import HeadMount, StereoRig
from robot.vision.both_eyes import ROW_STEP, BothEyes
from robot.vision.disparity import Disparity
from robot.vision.levelling import FloorLevel

Floats = NDArray[np.float32]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
Vector = NDArray[np.float64]

NEAREST_M = 0.3
"""Forward from the eyes; rays that land nearer are left to the floor's cells."""
FOOT_COLUMNS = 11
"""Unmeasured spots of the floor narrower than this are bridged sideways, columns."""
FLOOR_GAP = 0.1
"""Unseen floor is bridged as far as this at least, metres: floors have bare spots."""
FIRST_FLOOR = 0.65
"""Floor first seen farther away than this, metres from the eyes, says nothing of what stands before it."""


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """The upright rays of the left eye; rows (R,), directions (K,).

    tangents: metres to the right for each metre forward; drop: metres down for each metre forward, against
    the floor; enters, leaves: between which forward distances a row's rays cross the body's heights; seen
    (R, K): which lie in the picture. eye (3,): robot frame; height: above the floor; pan: of the head.
    """

    tangents: Vector
    drop: Vector
    enters: Vector
    leaves: Vector
    seen: Mask
    eye: Vector
    height: float
    pan: float


@dataclass(frozen=True, slots=True, eq=False)
class Air:
    """What the rays end at.

    left, right (R, K): forward distance in metres to what each ray of the left eye, of the right eye is
    measured to end at, 0 where unmeasured. foot (K,): up to where the floor was seen without a wide gap.
    focal_baseline: disparity times forward distance, pixels of direction times metres.
    """

    rays: Rays
    left: Floats
    right: Floats
    foot: Floats
    focal_baseline: float


def carve(
    eyes: BothEyes,
    rig: StereoRig,
    mount: HeadMount,
    pan: float,
    tilt: float,
    level: FloorLevel,
    heights: tuple[float, float],
) -> Air:
    """What the rays of both eyes end at.

    Args:
        eyes: disparities by either eye's pixels.
        rig: parallel pair.
        mount: where the head sits; pan, tilt: of the head, radians.
        level: how the floor really lies.
        heights: lowest and highest metres above the floor that must be empty.
    """
    picked, forward, rays = _rays(eyes.left.values.shape[0], rig, mount, pan, tilt, level, heights)
    left, right = (_upright(seen, rig, picked, forward, rays) for seen in (eyes.left, eyes.right))
    return Air(rays, left, right, _feet(left, rays, heights[0]), rig.left.fx * rig.baseline)


def by_right_eye(left: Floats, focal_baseline: float) -> Floats:
    """The same distances (R, K) by the right eye's directions, 0 where it sees none of them."""
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


def _rays(
    rows: int,
    rig: StereoRig,
    mount: HeadMount,
    pan: float,
    tilt: float,
    level: FloorLevel,
    heights: tuple[float, float],
) -> tuple[Index, Vector, Rays]:
    """Picture rows looked at, metres forward for each metre of their depth, and their rays."""
    camera = rig.left
    rotation, eye = mount.left_eye(pan, tilt)
    ahead = np.array([math.cos(pan), math.sin(pan), 0.0])
    picked = np.arange(0, rows, ROW_STEP)
    down = (picked - camera.cy) / camera.fy
    forward = rotation[:, 1] @ ahead * down + rotation[:, 2] @ ahead
    # Rays that look almost straight down show nothing of the way.
    picked, down, forward = picked[forward > 0.2], down[forward > 0.2], forward[forward > 0.2]
    slope = level.ahead * ahead[0] + level.aside * ahead[1]
    drop = -(rotation[2, 1] * down + rotation[2, 2]) / forward + slope
    height = float(eye[2]) - level.at(float(eye[0]), float(eye[1]))
    steep = np.where(np.abs(drop) < 1e-4, 1e-4, drop)
    to_low, to_high = (height - heights[0]) / steep, (height - heights[1]) / steep
    enters, leaves = np.maximum(np.minimum(to_low, to_high), 0.0), np.maximum(to_low, to_high)
    picked, forward, drop, enters, leaves = (
        a[leaves > NEAREST_M] for a in (picked, forward, drop, enters, leaves)
    )
    half = math.ceil(max(camera.cx, camera.width - 1 - camera.cx) / float(forward.min()))
    tangents = np.arange(-half, half + 1) / camera.fx
    column = camera.cx + camera.fx * forward[:, None] * tangents
    seen = (column > -0.5) & (column < camera.width - 0.5)
    return picked, forward, Rays(tangents, drop, enters, leaves, seen, eye, height, pan)


def _upright(disparity: Disparity, rig: StereoRig, picked: Index, forward: Vector, rays: Rays) -> Floats:
    """Forward distance (R, K) at which each ray of the disparities' eye ends, 0 where unmeasured."""
    camera = rig.left
    column = np.rint(camera.cx + camera.fx * forward[:, None] * rays.tangents).astype(np.intp)
    column = np.clip(column, 0, camera.width - 1)
    pixel = column + picked[:, None] * camera.width
    values = np.take(disparity.values, pixel) + np.float32(rig.doffs)
    valid = np.take(disparity.valid, pixel) & rays.seen & (values > 0.5)
    scale = (camera.fx * rig.baseline * forward).astype(np.float32)[:, None]
    return np.where(valid, scale / np.maximum(values, np.float32(0.5)), np.float32(0.0))


def _feet(left: Floats, rays: Rays, low: float) -> Floats:
    """Forward distance (K,) up to which each direction's floor was seen without a wide gap; 0: not at all."""
    hits = rays.drop > 0.02
    landing = np.where(hits, rays.height / np.where(hits, rays.drop, 1.0), 0.0).astype(np.float32)
    leaves = np.where(hits, rays.leaves, np.inf).astype(np.float32)
    order = np.argsort(landing[hits])
    rows = np.flatnonzero(hits)[order]
    land = landing[rows][:, None]
    measured = (left[rows] >= leaves[rows][:, None]).astype(np.uint8)
    on_floor = cv2.morphologyEx(measured, cv2.MORPH_CLOSE, np.ones((1, FOOT_COLUMNS), np.uint8)) > 0
    ends = np.maximum.accumulate(np.where(on_floor, land, np.float32(0.0)), axis=0)
    before = np.vstack([np.zeros((1, ends.shape[1]), np.float32), ends[:-1]])
    # An unseen stretch so long hides nothing as high as the lowest thing that matters.
    bridged = np.maximum(before * np.float32(low / max(rays.height - low, 0.01)), np.float32(FLOOR_GAP))
    unseen = (land - before > np.where(before > 0.0, bridged, np.float32(FIRST_FLOOR))) & rays.seen[rows]
    first = np.where(unseen.any(axis=0), unseen.argmax(axis=0), len(rows) - 1)
    return (
        np.take_along_axis(before, first[None], axis=0)[0]
        if len(rows)
        else np.zeros(left.shape[1], np.float32)
    )
