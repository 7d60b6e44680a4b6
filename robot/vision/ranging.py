"""How far the surface in the middle of a box is: one patch of the left eye, found again in the right one.

First the whole-pixel match along the row (normalised correlation, checked both ways and for rivals), then a
least-squares fit of a small slanted plane in disparity. Its sigma comes from what the fit leaves over.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, spline_filter

from calib.model import HeadMount, StereoRig
from robot.messages import Box, Image, Range

Grey = NDArray[np.float32]
Array = NDArray[np.float64]

NEAREST_M = 0.25
"""Nearer surfaces are not searched for; they come out as None, never as far."""
FARTHEST_PX = 0.5
"""A smaller disparity says only 'far'."""


@dataclass(frozen=True, slots=True)
class PatchMatch:
    """A patch found again: disparity u_l - u_r at its middle in whole pixels, rows lower, correlation -1..1."""

    shift: int
    lower: int
    correlation: float


@dataclass(frozen=True, slots=True)
class PlaneFit:
    """Column difference u_l - u_r at the patch's middle, px, with its standard deviation; slope in px per px."""

    shift: float
    sigma: float
    slope: tuple[float, float]
    correlation: float


def range_box(
    left: Image, right: Image, box: Box, rig: StereoRig, mount: HeadMount, pan: float, tilt: float,
    nearest_m: float = NEAREST_M,
) -> Range | None:  # fmt: skip
    """Distance to the visible surface at the box's centre; None where it cannot be told without doubt.

    left, right: rectified, (H, W, 3) BGR or (H, W) grey uint8 of equal size. box in left pixels. rig: a parallel
    pair (its f, baseline and principal points). pan, tilt of the head in radians at capture. Disparities of
    surfaces from `nearest_m` metres on are searched. Signed triangulation of [W] (METHODS 2), D = f B / d.
    """
    match = match_box(left, right, box, _search(rig, nearest_m))
    if match is None:
        return None
    disparity = match.shift + rig.doffs
    if disparity < FARTHEST_PX or match.sigma > 0.5 * disparity:
        return None
    distance = rig.left.fx * rig.baseline / disparity
    u, v = box.centre
    seen = np.array([(u - rig.left.cx) / rig.left.fx, (v - rig.left.cy) / rig.left.fy, 1.0]) * distance
    rotation, eye = mount.left_eye(pan, tilt)
    x, y, z = (float(c) for c in rotation @ seen + eye)
    return Range(distance, distance * match.sigma / disparity, (x, y, z), disparity)


def _search(rig: StereoRig, nearest_m: float) -> tuple[int, int]:
    """Column differences that surfaces from `nearest_m` to far away can have."""
    most = rig.left.fx * rig.baseline / nearest_m
    return math.floor(-rig.doffs) - 2, math.ceil(most - rig.doffs) + 2
