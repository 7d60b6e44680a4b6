"""Where the floor is free, from a disparity map: measured pixels become points, cells on the floor vote.

The floor is divided into polar cells about the robot's origin. A cell is *free* where enough of the pixels
that look at its piece of floor measure floor there, *occupied* where enough points stand up from it (or fall
away). Each sector is then walked outward: it ends at the first occupied cell and at the first gap of unseen
cells. Unmeasured is not free. Sources: METHODS 10 (on wheels take the floor out first), METHODS 4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.model import HeadMount, StereoRig
from robot.messages import FreeSpace, Points
from robot.vision.disparity import Disparity
from robot.vision.floor_edges import height_jumps
from robot.vision.levelling import FloorLevel, floor_plane

Floats = NDArray[np.float32]
Counts = NDArray[np.float32]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]
Vector = NDArray[np.float64]

LEVEL_RANGE = 2.4
"""The floor's tilt is read off pixels that look at floor within so many metres."""
ROW_STEP = 2
"""Every second row is looked at: neighbouring rows of a matcher's map say the same."""

SUPPORT = 20.0
"""Pixels (at every second row) that must stand up in a cell one metre away; more where it is nearer.
A 4 cm step fills 50 there, a post of 3 cm hundreds; a false match, rarely 20."""

GATE_SHARE = 0.6
"""Of the step height: from there on a pixel stands up, for a step's own height is seen blurred."""
EDGE_BAND = 3.0
"""Step heights; what lies farther off the floor belongs to things."""
NOMINAL = FloorLevel()
OPEN_SHARE, OWN_SHARE = 0.35, 0.15
"""Of the pixels that look at a cell and its neighbours (of the cell alone) so many must measure floor."""


@dataclass(frozen=True, slots=True)
class FloorLimits:
    """What counts as floor, obstacle and cell. Metres and radians.

    step_height: what stands up more is an obstacle. body_height: what hangs higher may be driven under.
    """

    step_height: float = 0.03
    body_height: float = 0.35
    max_range: float = 3.0
    min_range: float = 0.15
    sector: float = math.radians(1.5)
    cell: float = 0.04
    max_gap: float = 0.1
    """Unseen floor is bridged as far as this between seen floor; a wider gap ends the sector."""
    max_pitch: float = math.radians(1.5)
    max_lift: float = 0.015
    """How far the base may be tipped or sunk against its nominal stand: found anew in each picture."""


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """The pixels looked at, flat arrays of one length; positions in the robot frame.

    floor_x, floor_y: where the pixel's ray meets the floor, far away above the horizon; sigma: of a height;
    level: how the floor lies, already taken out of `height`.
    """

    x: Floats
    y: Floats
    height: Floats
    sigma: Floats
    measured: Mask
    floor_x: Floats
    floor_y: Floats
    level: FloorLevel = NOMINAL


@dataclass(frozen=True, slots=True, eq=False)
class _Cells:
    """A polar raster: sectors from `first` on, rings between `edges`."""

    first: float
    sector: float
    sectors: int
    edges: Floats

    @property
    def rings(self) -> int:
        return len(self.edges) - 1

    def index(self, x: Floats, y: Floats) -> tuple[Index, Mask]:
        """Flat cell of every point, and which points lie inside the raster."""
        column = np.floor((np.arctan2(y, x) - np.float32(self.first)) * np.float32(1.0 / self.sector))
        ring = np.searchsorted(self.edges, np.hypot(x, y), side="right") - 1
        inside = (column >= 0) & (column < self.sectors) & (ring >= 0) & (ring < self.rings)
        return np.where(inside, column, 0).astype(np.intp) * self.rings + np.where(inside, ring, 0), inside

    def total(self, cell: Index, chosen: Mask, of: Floats) -> Counts:
        """Sum of a value of the points chosen in each cell, (sectors, rings)."""
        flat = np.bincount(cell[chosen], weights=of[chosen], minlength=self.sectors * self.rings)
        return flat.reshape(self.sectors, self.rings).astype(np.float32)

    def count(self, cell: Index, chosen: Mask) -> Counts:
        """Points chosen in each cell, (sectors, rings)."""
        flat = np.bincount(cell[chosen], minlength=self.sectors * self.rings)
        return flat.reshape(self.sectors, self.rings).astype(np.float32)


def looked(
    disparity: Disparity, rig: StereoRig, mount: HeadMount, pan: float, tilt: float, limits: FloorLimits
) -> Look:
    """The pixels of a rectified pair's disparity map as points over the floor as it lies in this picture.

    Args:
        disparity: of the left picture.
        rig: the pair's geometry; parallel (rectified).
        mount: where the head sits.
        pan, tilt: of the head when the picture was taken, radians.
        limits: how far the floor may lie from its nominal place.

    Raises:
        ValueError: the disparity map has not the rig's size.
    """
    check_size(disparity, rig)
    return _level(_look(disparity, rig, mount, pan, tilt), limits)


def from_look(look: Look, rig: StereoRig, mount: HeadMount, limits: FloorLimits) -> FreeSpace:
    """Free floor and obstacles of the pixels looked at: sectors and obstacle points in the robot frame.

    A height is accurate to sigma_d z / d times the ray's drop. A pixel stands up if it is higher than 0.6
    `step_height` and 2.5 such sigma, but never needs more than about twice the step height; a cell needs many
    such pixels.

    >>> from robot.vision.floor_aligned import floor_disparities
    >>> rig, mount, limits = StereoRig.parallel(352, 288, 305.0, 0.06), HeadMount(), FloorLimits()
    >>> floor = np.maximum(floor_disparities(rig, mount, 0.0, 0.35, 288), np.float32(0.0))
    >>> values = np.repeat(floor[:, None], 352, axis=1)
    >>> flat = Disparity(values, values > 0.0, np.full_like(values, 0.2))
    >>> seen = from_look(looked(flat, rig, mount, 0.0, 0.35, limits), rig, mount, limits)
    >>> len(seen.obstacles), bool(seen.free[len(seen.free) // 2] > 2.5)
    (0, True)
    """
    cells = _raster(look, rig, mount, limits)
    if cells is None:
        none = np.zeros(0)
        return FreeSpace(none, none, none, np.zeros((0, 2)))
    occupied, free, points = _vote(look, cells, limits)
    near, far = _walk(free, occupied, cells, limits)
    bearings: Vector = np.asarray(cells.first + (np.arange(cells.sectors) + 0.5) * cells.sector, np.float64)
    return FreeSpace(bearings, near, far, points)


def check_size(disparity: Disparity, rig: StereoRig) -> None:
    """Raise ValueError if the disparity map has not the size of the rig's pictures."""
    if disparity.values.shape != (rig.left.height, rig.left.width):
        raise ValueError(
            f"the disparity map is {disparity.values.shape[::-1]}, the rig "
            f"{rig.left.width}x{rig.left.height}: give the rig these pictures were rectified for"
        )


# -------------------------------------------------------------------------------------- pixels to points


def _look(disparity: Disparity, rig: StereoRig, mount: HeadMount, pan: float, tilt: float) -> Look:
    rotation, eye = mount.left_eye(pan, tilt)
    left = rig.left
    height, width = disparity.values.shape
    values = disparity.values[::ROW_STEP] + np.float32(rig.doffs)
    measured = disparity.valid[::ROW_STEP] & (values > 0.5)
    across = ((np.arange(width) - left.cx) / left.fx)[None, :]
    downward = ((np.arange(0, height, ROW_STEP) - left.cy) / left.fy)[:, None]
    ray = [
        (rotation[k, 0] * across + (rotation[k, 1] * downward + rotation[k, 2])).astype(np.float32)
        for k in range(3)
    ]
    depth = np.float32(left.fx * rig.baseline) / np.where(measured, values, np.float32(1.0))
    x, y, h = (np.float32(eye[k]) + depth * ray[k] for k in range(3))
    sigma = (
        depth * np.abs(ray[2]) * disparity.sigma_px[::ROW_STEP] / np.where(measured, values, np.float32(1.0))
    )
    drop = np.maximum(-ray[2], np.float32(1e-6))
    reach = np.where(drop > 0.02, np.float32(eye[2]) / drop, np.float32(1e4))
    floor_x, floor_y = np.float32(eye[0]) + reach * ray[0], np.float32(eye[1]) + reach * ray[1]
    x, y, h, sigma, floor_x, floor_y = (
        np.asarray(a, np.float32).ravel() for a in (x, y, h, sigma, floor_x, floor_y)
    )
    return Look(x, y, h, sigma, measured.ravel(), floor_x, floor_y)


def _level(look: Look, limits: FloorLimits) -> Look:
    """Heights over the floor as it lies in this picture: a base that brakes tips by a degree."""
    floor_range = np.hypot(look.floor_x, look.floor_y)
    rows = np.flatnonzero(look.measured & (floor_range < LEVEL_RANGE))
    bound = np.array([limits.max_lift, limits.max_pitch, limits.max_pitch])
    plane = floor_plane(look.x[rows], look.y[rows], look.height[rows], look.sigma[rows])
    level = FloorLevel(*(float(c) for c in np.clip(plane, -bound, bound)))
    lift, ahead, aside = (np.float32(c) for c in (level.lift, level.ahead, level.aside))
    return replace(look, height=look.height - (lift + ahead * look.x + aside * look.y), level=level)


# ---------------------------------------------------------------------------------------- points to cells


def _raster(look: Look, rig: StereoRig, mount: HeadMount, limits: FloorLimits) -> _Cells | None:
    """Sectors over all that is in view; rings at least a cell deep and at least two picture rows."""
    seen = np.hypot(look.floor_x, look.floor_y) < limits.max_range
    seen |= look.measured & (np.hypot(look.x, look.y) < limits.max_range)
    if not seen.any():
        return None
    bearing = np.arctan2(look.floor_y[seen], look.floor_x[seen])
    # A sector only half in view would look like one half unseen.
    first = math.ceil(float(bearing.min()) / limits.sector) * limits.sector
    sectors = math.floor((float(bearing.max()) - first) / limits.sector)
    if sectors < 1:
        return None
    edges = [limits.min_range]
    while edges[-1] < limits.max_range:
        edges.append(edges[-1] + max(limits.cell, 2.0 * edges[-1] ** 2 / (rig.left.fy * mount.height)))
    return _Cells(first, limits.sector, sectors, np.array(edges, np.float32))


def _vote(look: Look, cells: _Cells, limits: FloorLimits) -> tuple[Mask, Mask, Points]:
    """Which cells are occupied, which are free, and the obstacle points."""
    gate = np.minimum(
        GATE_SHARE * limits.step_height + 2.5 * look.sigma, 2.0 * limits.step_height + 0.03 * look.sigma
    )
    up = look.measured & (look.height > gate) & (look.height < limits.body_height)
    down = look.measured & (look.height < -limits.step_height - 3.0 * look.sigma)
    level = look.measured & (np.abs(look.height) <= gate)

    place, inside = cells.index(look.x, look.y)
    aim, aimed = cells.index(look.floor_x, look.floor_y)
    expected = cells.count(aim, aimed)
    standing = cells.count(place, inside & up)
    lying = cells.count(place, inside & level)
    falling = cells.count(aim, aimed & down)
    floor = cells.count(aim, aimed & level)

    needed = SUPPORT / (0.5 * (cells.edges[1:] + cells.edges[:-1]))
    occupied = (standing >= np.maximum(needed, 0.4 * expected)) & (standing > 0.5 * lying)
    sure = occupied & (standing >= 2.0 * needed)
    occupied |= falling >= np.maximum(needed, 0.6 * expected)
    near_floor = inside & look.measured & (np.abs(look.height) < EDGE_BAND * limits.step_height)
    heights, sigmas = (cells.total(place, near_floor, of) for of in (look.height, look.sigma))
    count = cells.count(place, near_floor)
    occupied |= height_jumps(heights, sigmas, count, cells.edges, limits.step_height)
    share = _blur(floor) / np.maximum(_blur(expected), 1.0)
    free = (share >= OPEN_SHARE) & (floor >= OWN_SHARE * expected) & (expected > 0) & ~occupied
    hit = up & inside & occupied.ravel()[place]
    return occupied, free, _points(look, place, hit, occupied, sure, cells)


def _blur(counts: Counts) -> Counts:
    return cv2.blur(counts, (1, 3), borderType=cv2.BORDER_CONSTANT).astype(np.float32, copy=False)


def _points(look: Look, place: Index, hit: Mask, occupied: Mask, sure: Mask, cells: _Cells) -> Points:
    """Four points of every sure cell and one of others, so that a map trusts one look or waits for the next.

    Where only falling floor speaks, the cell's middle.
    """
    chosen = np.flatnonzero(hit)
    order = chosen[np.argsort(place[chosen], kind="stable")]
    starts = np.flatnonzero(np.diff(place[order], prepend=-1))
    sizes = np.diff(np.append(starts, len(order)))
    strong = sure.ravel()[place[order[starts]]] if len(order) else np.zeros(0, np.bool_)
    spread = [starts[strong] + (sizes[strong] * k) // 8 for k in (1, 3, 5, 7)]
    picks = np.unique(np.concatenate([starts[~strong] + sizes[~strong] // 2, *spread]))
    found = np.stack([look.x[order[picks]], look.y[order[picks]]], axis=1).astype(np.float64)
    holds = np.zeros(occupied.size, np.bool_)
    holds[place[order]] = True
    rest = np.flatnonzero(occupied.ravel() & ~holds)
    sector, ring = rest // cells.rings, rest % cells.rings
    bearing = cells.first + (sector + 0.5) * cells.sector
    away = 0.5 * (cells.edges[ring] + cells.edges[ring + 1])
    return np.vstack([found, np.stack([away * np.cos(bearing), away * np.sin(bearing)], axis=1)])


# ------------------------------------------------------------------------------------------- along sectors


def _walk(free: Mask, occupied: Mask, cells: _Cells, limits: FloorLimits) -> tuple[Points, Points]:
    """Where each sector's free floor begins and ends, metres."""
    rings = cells.rings
    ring = np.arange(rings)
    wall = np.where(occupied.any(axis=1), occupied.argmax(axis=1), rings)
    open_ = free & (ring < wall[:, None])
    start = np.where(open_.any(axis=1), open_.argmax(axis=1), rings)
    edges = cells.edges.astype(np.float64)
    # The end of the newest free cell at or before each ring, and how far the next free cell lies beyond it.
    ends = np.maximum.accumulate(np.where(open_, edges[1:], 0.0), axis=1)
    before = np.hstack([np.zeros((len(free), 1)), ends[:, :-1]])
    gap = open_ & (ring > start[:, None]) & (edges[:-1] - before > limits.max_gap)
    stop = np.where(gap.any(axis=1), gap.argmax(axis=1), rings)
    last = np.where(open_ & (ring < stop[:, None]), ring, -1).max(axis=1)
    near = np.where(start < rings, edges[np.minimum(start, rings - 1)], 0.0)
    far = np.where(last >= 0, edges[last + 1], near)
    return near, far
