"""Matching aligned to the floor: a robot on wheels looks at floor most, and a floor is steep to a camera."""

from __future__ import annotations

import cv2
import numpy as np

from calib.model import HeadMount, StereoRig
from robot.messages import Image
from robot.vision.disparity import Disparity, Floats, Matcher
from robot.vision.pair_input import grey_pair


class FloorAlignedMatcher:
    """Matches with the right picture sheared so that the floor lies at one disparity everywhere.

    A floor seen from low above changes its disparity from row to row; windows expect it not to, and answer
    with steps and bias. Sheared, the floor is their easiest case, and the search begins `margin_px` below the
    floor's own disparity in every row: it reaches nearer where floor is near.

    Args:
        matcher: what matches the sheared pair; its search must start at 0.
        rig: parallel pair.
        mount: where the head sits; the head does not roll.
        margin_px: how much farther than the floor is still searched.
    """

    def __init__(self, matcher: Matcher, rig: StereoRig, mount: HeadMount, margin_px: float = 8.0) -> None:
        self._matcher = matcher
        self._rig, self._mount = rig, mount
        self._margin = margin_px

    def __call__(self, left: Image, right: Image, pan: float, tilt: float) -> Disparity:
        """Match a pair taken with the head at pan, tilt (radians); disparities are the given pair's.

        Raises:
            ValueError: pictures that are no pair.
        """
        left, right = grey_pair(left, right)
        height, width = left.shape
        floor = floor_disparities(self._rig, self._mount, pan, tilt, height)
        shift = np.maximum(floor - self._margin, 0.0).astype(np.float32)[:, None]
        columns = np.arange(width, dtype=np.float32)
        rows = np.repeat(np.arange(height, dtype=np.float32)[:, None], width, axis=1)
        sheared = cv2.remap(right, columns - shift, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        found = self._matcher(left, sheared.astype(np.uint8, copy=False))
        values = found.values + shift
        valid = found.valid & (values <= columns)
        return Disparity(np.maximum(values, np.float32(0.0)), valid, found.sigma_px)


def floor_disparities(rig: StereoRig, mount: HeadMount, pan: float, tilt: float, height: int) -> Floats:
    """Disparity u_l - u_r of the floor in each row, (height,) float32; below -doffs above the horizon.

    d = f B k / h - doffs, k the drop of the row's ray for each metre of depth, h the lens height: METHODS 4's
    plane-induced homography for a parallel pair and a head that does not roll.
    """
    rotation, eye = mount.left_eye(pan, tilt)
    ray = (np.arange(height) - rig.left.cy) / rig.left.fy
    drop = -(rotation[2, 1] * ray + rotation[2, 2])
    return np.asarray(rig.left.fx * rig.baseline * drop / eye[2] - rig.doffs, np.float32)
