"""Camera, stereo rig and head: the geometry everything else is measured with.

Frames. Image: pixels (u, v), u to the right, v down. Camera: x right, y down, z forward (OpenCV).
Robot: x forward, y left, z up, origin on the floor below the middle of the axle (REP 103).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Camera:
    """One pinhole camera with lens distortion.

    fx, fy, cx, cy in pixels; distortion as OpenCV orders it (k1, k2, p1, p2, k3), empty for none.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()

    @property
    def matrix(self) -> Matrix:
        """The 3x3 intrinsic matrix K."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def bearing(self, u: float) -> float:
        """Angle of column u from the optical axis in radians, positive to the left (as yaw is)."""
        return -math.atan2(u - self.cx, self.fx)


@dataclass(frozen=True, slots=True)
class StereoRig:
    """Two cameras; a point goes from left to right as X_r = R X_l + t (cv2.stereoCalibrate).

    rotation is R row by row (9 numbers), translation t in metres. An ideal pair has R = I and
    t = (-baseline, 0, 0).
    """

    left: Camera
    right: Camera
    rotation: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    translation: tuple[float, float, float] = (-0.06, 0.0, 0.0)

    @classmethod
    def parallel(
        cls,
        width: int,
        height: int,
        f: float,
        baseline: float,
        *,
        cx: float | None = None,
        cy: float | None = None,
        doffs: float = 0.0,
    ) -> StereoRig:
        """An ideal parallel pair. doffs = cx_right - cx_left in pixels; the centre is the default cx, cy."""
        cx = (width - 1) / 2 if cx is None else cx
        cy = (height - 1) / 2 if cy is None else cy
        left = Camera(width, height, f, f, cx, cy)
        right = Camera(width, height, f, f, cx + doffs, cy)
        return cls(left, right, translation=(-baseline, 0.0, 0.0))

    @property
    def R(self) -> Matrix:
        """Rotation from the left to the right camera frame, 3x3."""
        return np.array(self.rotation, dtype=np.float64).reshape(3, 3)

    @property
    def baseline(self) -> float:
        """Distance between the lens centres in metres."""
        return math.sqrt(sum(c * c for c in self.translation))

    @property
    def doffs(self) -> float:
        """cx_right - cx_left in pixels: what to add to a column difference before Z = f B / d."""
        return self.right.cx - self.left.cx

    def is_parallel(self, tolerance: float = 1e-6) -> bool:
        """True if the pair needs no rectification: shifted sideways only, no distortion, one focal length."""
        a, b = self.left, self.right
        return (
            bool(np.allclose(self.R, np.eye(3), atol=tolerance))
            and abs(self.translation[1]) < tolerance
            and abs(self.translation[2]) < tolerance
            and not any(a.distortion)
            and not any(b.distortion)
            and abs(a.fx - b.fx) < 1e-9
            and abs(a.fy - b.fy) < 1e-9
            and abs(a.cy - b.cy) < 1e-9
        )

    def depth(self, disparity: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Z = f B / (u_l - u_r + doffs) in metres for a parallel pair; inf where that is <= 0."""
        d = np.asarray(disparity, dtype=np.float64) + self.doffs
        with np.errstate(divide="ignore"):
            return np.where(d > 0, self.left.fx * self.baseline / np.where(d > 0, d, 1.0), np.inf)


@dataclass(frozen=True, slots=True)
class HeadMount:
    """Where the pan-tilt head sits and how the left eye hangs on it. Metres, robot frame.

    The pan axis is vertical through (forward, 0); the tilt axis crosses it at `height`. The eyes lie
    `eye_forward` ahead of the axes and +- baseline/2 to the sides.
    """

    forward: float = 0.06
    height: float = 0.25
    eye_forward: float = 0.02
    baseline: float = 0.06

    def left_eye(self, pan: float, tilt: float) -> tuple[Matrix, Vector]:
        """Rotation (3x3, camera to robot) and position (3,) of the left eye.

        pan in radians, positive to the left; tilt positive downwards.

        >>> R, p = HeadMount(forward=0.0, height=0.2, eye_forward=0.0, baseline=0.06).left_eye(0.0, 0.0)
        >>> bool(np.allclose(R @ [0, 0, 1], [1, 0, 0])), [round(float(c), 3) for c in p]
        (True, [0.0, 0.03, 0.2])
        """
        cp, sp, ct, st = math.cos(pan), math.sin(pan), math.cos(tilt), math.sin(tilt)
        forward = np.array([cp * ct, sp * ct, -st])
        right = np.array([sp, -cp, 0.0])
        down = np.array([-st * cp, -st * sp, -ct])
        position = (
            np.array([self.forward, 0.0, self.height])
            + self.eye_forward * forward
            - 0.5 * self.baseline * right
        )
        return np.column_stack([right, down, forward]), position
