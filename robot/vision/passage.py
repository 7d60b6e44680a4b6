"""The free passage in a disparity map: the largest circle of free pixels, in pixels and in metres.

Two circles: `inscribed_circle` is the true largest one (maximum of the distance transform), `centroid_circle`
the published one about the region's centroid, which has none where the centroid lies outside the region.
Source: [T] by METHODS 10; the metric scale by the nearest rim point and the floor taken out are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.model import HeadMount, StereoRig
from robot.messages import Passage
from robot.vision.disparity import Disparity
from robot.vision.floor_aligned import floor_disparities
from robot.vision.section import blocked_distance, largest_circle_px

Mask = NDArray[np.bool_]

RIM_PX = 2.0
"""Blocked pixels so close outside the circle bound it."""
NOISE_PX = 3
"""Free specks and threads thinner than this are noise."""
MIN_RADIUS_PX = 3.0
CERTAIN = 6
"""Free pixels about an unmeasured one that make it free."""
SPECK_PX = 60
"""So few standing pixels are false matches."""


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


def on_floor(
    disparity: Disparity, rig: StereoRig, mount: HeadMount, pan: float, tilt: float, step_height: float = 0.03
) -> Mask:
    """Pixels (H, W) measured on the floor, up to `step_height` above or below it: wheels go there."""
    floor = floor_disparities(rig, mount, pan, tilt, disparity.values.shape[0])[:, None] + np.float32(
        rig.doffs
    )
    eye_height = float(mount.left_eye(pan, tilt)[1][2])
    # h = eye height (1 - d_floor / d): a height is a ratio of disparities.
    height = eye_height * (
        1.0 - floor / np.maximum(disparity.values + np.float32(rig.doffs), np.float32(0.1))
    )
    near: Mask = (
        disparity.valid
        & (floor > 0)
        & (np.abs(height) < step_height + 2.0 * _height_sigma(disparity, floor, eye_height))
    )
    return near


def _height_sigma(disparity: Disparity, floor: NDArray[np.float32], eye_height: float) -> NDArray[np.float32]:
    sigma = eye_height * disparity.sigma_px / np.maximum(floor, np.float32(1.0))
    return sigma.astype(np.float32, copy=False)


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


def fits(diameter: float, width: float, height: float) -> bool:
    """True if a body of this width and height (metres) goes through a circle of this diameter in any roll.

    >>> fits(0.26, 0.2, 0.15), fits(0.24, 0.2, 0.15)
    (True, False)
    """
    return diameter > math.hypot(width, height)


def free_passage(
    disparity: Disparity, rig: StereoRig, mount: HeadMount, pan: float, tilt: float, beyond: float = 1.0
) -> Passage | None:
    """Where a robot on wheels could pass between what stands nearer than `beyond` metres.

    The circle lies in the plane of the nearest thing that stands on the floor: pixels measured behind that
    plane are free (floor before it lies below the plane's foot), save other things nearer than `beyond`.

    Args:
        disparity: of the left picture.
        rig: parallel pair.
        mount: where the head sits; pan, tilt: of the head, radians.
        beyond: metres of depth; what is farther does not block.

    Returns:
        The circle with its metric diameter and its centre in the robot frame; None without one to speak of.
        A circle that only the picture's border bounds is at least so wide.
    """
    far = farther_than(disparity, rig, beyond)
    standing = disparity.valid & ~far & ~on_floor(disparity, rig, mount, pan, tilt)
    free = disparity.valid & (
        disparity.values + np.float32(rig.doffs) < _plane_px(disparity, rig, standing, beyond)
    )
    free &= ~standing
    free = doubts_opened(free, disparity.valid)
    circle = inscribed_circle(free)
    if circle is None or circle.radius_px < MIN_RADIUS_PX:
        return None
    rim = rim_disparity(circle, disparity, rig, free)
    if rim is None:
        return None
    rotation, eye = mount.left_eye(pan, tilt)
    x, y, z = (float(c) for c in eye + rotation @ np.array(centre_in_camera(circle, rim, rig)))
    return Passage(circle.centre, circle.radius_px, metric_diameter(circle, rim, rig), (x, y, z))


def _plane_px(disparity: Disparity, rig: StereoRig, standing: Mask, beyond: float) -> float:
    """Disparity (from the principal points) of the nearest standing surface, or of `beyond`."""
    limit = rig.left.fx * rig.baseline / beyond
    values = disparity.values[standing]
    if len(values) <= SPECK_PX:
        return limit
    return max(limit, float(np.partition(values, -SPECK_PX)[-SPECK_PX]) + rig.doffs)


def _circle(u: float, v: float, distance: float) -> Circle | None:
    return Circle((u, v), 2.0 * distance - 1.0) if distance > 0.0 else None
