"""The free passage in a disparity map: the largest circle of free pixels, in pixels and in metres.

Two circles: `inscribed_circle` is the true largest one (maximum of the distance transform), `centroid_circle`
the published one about the region's centroid, which has none where the centroid lies outside the region.
What must pass is a `section`; a base's way over the floor is found by `free_way`, a hand's by `hole`.
Source: [T] by METHODS 10; the metric scale by the nearest rim point is ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.model import StereoRig
from robot.vision.disparity import Disparity
from robot.vision.section import blocked_distance, largest_circle_px

Mask = NDArray[np.bool_]

RIM_PX = 2.0
"""Blocked pixels so close outside the circle bound it."""
NOISE_PX = 3
"""Free specks and threads thinner than this are noise."""
MIN_RADIUS_PX = 3.0
CERTAIN = 6
"""Free pixels about an unmeasured one that make it free."""


@dataclass(frozen=True, slots=True)
class Circle:
    """centre (u, v) and diameter in pixels: 2 DT - 1, DT its distance to the nearest blocked pixel."""

    centre: tuple[float, float]
    diameter_px: float

    @property
    def radius_px(self) -> float:
        """Half the diameter."""
        return 0.5 * self.diameter_px


def farther_than(disparity: Disparity, rig: StereoRig, distance: float) -> Mask:
    """Pixels (H, W) measured farther than `distance` metres. What was not measured is not free.

    [T] says it in pixels (d > 30 is an obstacle); the metric form holds for every rig.
    """
    nearest = rig.left.fx * rig.baseline / distance
    return disparity.valid & (disparity.values + np.float32(rig.doffs) < nearest)


def doubts_opened(free: Mask, measured: Mask) -> Mask:
    """The free mask (H, W) with single unmeasured pixels opened: the matcher's doubts, not obstacles.

    Only where at least `CERTAIN` of the eight pixels about one are free and none of them is measured blocked.
    (Closing would join sparse false matches on a bare wall to a free region: a hole that becomes a passage.)

    >>> free = np.ones((5, 5), np.bool_)
    >>> free[2, 2] = False
    >>> bool(doubts_opened(free, free)[2, 2]), bool(doubts_opened(free, np.ones_like(free))[2, 2])
    (True, False)
    """
    about = cv2.boxFilter(
        free.astype(np.float32), -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT
    )
    blocked = cv2.dilate((measured & ~free).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    opened: Mask = free | (~measured & (about >= CERTAIN) & ~blocked)
    return opened


def largest_region(free: Mask) -> Mask:
    """The largest 4-connected region of free pixels after noise is removed; all False if there is none."""
    clean = cv2.morphologyEx(
        free.astype(np.uint8), cv2.MORPH_OPEN, np.ones((NOISE_PX, NOISE_PX), np.uint8),
        borderType=cv2.BORDER_CONSTANT, borderValue=0,
    )  # fmt: skip
    count, labels, stats, _ = cv2.connectedComponentsWithStats(clean, connectivity=4)
    if count < 2:
        return np.zeros_like(free)
    region: Mask = labels == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())
    return region


def inscribed_circle(free: Mask) -> Circle | None:
    """The largest circle inside the free region; the picture's border blocks. None if nothing is free.

    >>> inscribed_circle(np.ones((21, 31), np.bool_)).diameter_px
    21.0
    """
    (u, v), diameter = largest_circle_px(largest_region(free))
    return Circle((float(u), float(v)), diameter) if diameter > 0.0 else None


def centroid_circle(free: Mask) -> Circle | None:
    """[T]'s circle about the free region's centroid; None where the centroid is not in the region."""
    region = largest_region(free)
    rows, columns = np.nonzero(region)
    if not len(rows):
        return None
    u, v = float(columns.mean()), float(rows.mean())
    distance = blocked_distance(region)
    return _circle(u, v, float(distance[round(v), round(u)]))


def rim_disparity(circle: Circle, disparity: Disparity, rig: StereoRig, free: Mask) -> float | None:
    """The largest disparity (from the principal points, px) measured on the circle's rim; None if none was.

    free: (H, W), the mask the circle was found in. What is not free bounds the circle; where only the
    picture's border does, all of the rim counts.
    """
    (u, v), reach = circle.centre, circle.radius_px + RIM_PX + 1.0
    top, left = max(math.floor(v - reach), 0), max(math.floor(u - reach), 0)
    window = slice(top, math.ceil(v + reach) + 1), slice(left, math.ceil(u + reach) + 1)
    values, valid = disparity.values[window], disparity.valid[window]
    rows, columns = np.arange(values.shape[0])[:, None], np.arange(values.shape[1])[None, :]
    away_squared = (columns + left - u) ** 2 + (rows + top - v) ** 2
    inner, outer = max(circle.radius_px - RIM_PX, 0.0), circle.radius_px + RIM_PX
    rim = valid & (away_squared >= inner**2) & (away_squared <= outer**2)
    bounds = rim & ~free[window]
    rim = bounds if bounds.any() else rim
    if not rim.any():
        return None
    largest = float(values[rim].max()) + rig.doffs
    return largest if largest > 0.0 else None


def metric_diameter(circle: Circle, rim_px: float, rig: StereoRig) -> float:
    """Diameter in metres at the depth of the rim: diameter_px B / d_rim (METHODS 10).

    >>> rig = StereoRig.parallel(352, 288, 408.0, 0.04)
    >>> round(1000 * metric_diameter(Circle((176, 144), 1.0), 408.0 * 0.04 / 0.23695, rig), 3)
    0.581
    """
    return circle.diameter_px * rig.baseline / rim_px


def centre_in_camera(circle: Circle, rim_px: float, rig: StereoRig) -> tuple[float, float, float]:
    """The circle's centre (x right, y down, z forward) in the left camera's frame, metres, at rim depth."""
    camera = rig.left
    z = camera.fx * rig.baseline / rim_px
    u, v = circle.centre
    return z * (u - camera.cx) / camera.fx, z * (v - camera.cy) / camera.fy, z


def _circle(u: float, v: float, distance: float) -> Circle | None:
    return Circle((u, v), 2.0 * distance - 1.0) if distance > 0.0 else None
