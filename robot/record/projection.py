"""Where a floor point of the robot frame appears in either eye."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from calib.model import Camera, HeadMount, Matrix, StereoRig, Vector
from robot.messages import HeadPose, Points

_NEAREST_DEPTH_M = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Eye:
    """One eye at one head pose: X_eye = rotation @ X_robot + translation."""

    camera: Camera
    rotation: Matrix
    translation: Vector
    left_rotation: Matrix
    left_translation: Vector
    doffs: float
    is_left: bool

    def project(self, floor: Points, height: float = 0.0) -> Points | None:
        """Pixels (N, 2) of floor points (N, 2) at `height` metres; None if one is not in front of the eye."""
        robot = np.column_stack([floor, np.full(len(floor), height)])
        seen = robot @ self.rotation.T + self.translation
        if not len(seen) or bool((seen[:, 2] < _NEAREST_DEPTH_M).any()):
            return None
        distortion = np.array(self.camera.distortion) if any(self.camera.distortion) else None
        pixels, _ = cv2.projectPoints(seen, np.zeros(3), np.zeros(3), self.camera.matrix, distortion)
        return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)

    def left_depth(self, position: Vector) -> float:
        """Depth of a robot-frame point (x, y, z) along the left eye's axis, metres."""
        return float((self.left_rotation @ position + self.left_translation)[2])

    def column_shift(self, disparity_px: float) -> float:
        """What to add to a left-image column: 0 in the left eye, -disparity (+ doffs) in the right one."""
        return 0.0 if self.is_left else self.doffs - disparity_px


def eyes(rig: StereoRig, mount: HeadMount, head: HeadPose) -> tuple[Eye, Eye]:
    """Left and right eye at this head pose.

    >>> left, right = eyes(StereoRig.parallel(352, 288, 305.0, 0.06), HeadMount(), HeadPose(tilt=0.3))
    >>> ahead = np.array([[1.0, 0.0]])
    >>> bool(left.project(ahead)[0, 0] > right.project(ahead)[0, 0])
    True
    """
    to_robot, position = mount.left_eye(head.pan, head.tilt)
    rotation = to_robot.T
    translation = -rotation @ position
    left = Eye(rig.left, rotation, translation, rotation, translation, rig.doffs, True)
    right = Eye(
        rig.right,
        rig.R @ rotation,
        rig.R @ translation + np.array(rig.translation),
        rotation,
        translation,
        rig.doffs,
        False,
    )
    return left, right
