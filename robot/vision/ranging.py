"""How far the surface in the middle of a box is: [W]'s signed triangulation of a matched patch."""

from __future__ import annotations

import math

import cv2
import numpy as np

from calib.model import HeadMount, StereoRig
from robot.messages import Box, Image, Range
from robot.vision import patch_match
from robot.vision.patch_match import Grey
from robot.vision.triangulation import depth, depth_sigma

NEAREST_M = 0.25
"""Nearer surfaces are not searched for; they come out as None, never as far."""
FARTHEST_PX = 0.5
"""A smaller disparity says only 'far'."""
PATCH_SHARE = 0.3
"""Half the patch's edge as a share of the box's: the middle of the box, not its rim."""
LARGEST_HALF_PX = 14
DOUBT = 0.25
"""A sigma above this share of the disparity is no measurement."""


def range_box(
    left: Image, right: Image, box: Box, rig: StereoRig, mount: HeadMount, pan: float, tilt: float,
    nearest_m: float = NEAREST_M, calibration_sigma_px: float = 0.0,
) -> Range | None:  # fmt: skip
    """Distance to the visible surface at the box's centre; None where it cannot be told without doubt.

    left, right: rectified, (H, W, 3) BGR or (H, W) grey uint8, equal in size. box in pixels of the left
    picture. rig: a parallel pair. pan, tilt of the head in radians at capture. Disparities of surfaces from
    `nearest_m` metres on are searched. calibration_sigma_px: standard deviation of what calibration leaves
    in disparities. [W]'s triangulation (METHODS 2): D = f B / d, sigma_D = D^2 sigma_d / (f B).
    """
    u, v = box.centre
    half_u, half_v = (min(PATCH_SHARE * edge, LARGEST_HALF_PX) for edge in (box.w, box.h))
    patch = patch_match.patch_at(u, v, half_u, half_v, left.shape[1], left.shape[0])
    if patch is None:
        return None
    fit = patch_match.match(_grey(left), _grey(right), patch, _shifts(rig, nearest_m))
    if fit is None:
        return None
    disparity = fit.shift + rig.doffs
    sigma = math.hypot(fit.sigma, calibration_sigma_px)
    if disparity < FARTHEST_PX or sigma > DOUBT * disparity:
        return None
    f, baseline = rig.left.fx, rig.baseline
    distance = depth(f, baseline, disparity)
    ray = np.array([(u - rig.left.cx) / f, (v - rig.left.cy) / rig.left.fy, 1.0])
    rotation, eye = mount.left_eye(pan, tilt)
    x, y, z = (float(c) for c in rotation @ (distance * ray) + eye)
    return Range(distance, depth_sigma(f, baseline, distance, sigma), (x, y, z), disparity)


def _shifts(rig: StereoRig, nearest_m: float) -> tuple[int, int]:
    """Column differences u_l - u_r of surfaces from `nearest_m` to far away, and a little more."""
    most = rig.left.fx * rig.baseline / nearest_m
    return math.floor(-rig.doffs) - 2, math.ceil(most - rig.doffs) + 2


def _grey(image: Image) -> Grey:
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    return np.asarray(grey, dtype=np.float32)
