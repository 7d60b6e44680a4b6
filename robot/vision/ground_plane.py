"""The floor as a plane before two eyes: its homography, from calibration or matches, and back to a plane.

Camera frame of the left eye: x right, y down, z forward. n is the unit normal pointing *down to* the floor,
n . X = h for its points. X_r = R X + t. Source: [B], METHODS 4 first paragraph.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.model import Camera, Matrix, StereoRig, Vector

Mask = NDArray[np.bool_]
Pixels = NDArray[np.float64]
Grey = TypeVar("Grey", NDArray[np.uint8], NDArray[np.float32])

LEAST_SPREAD_PX = 3.0
"""Matches that lie so near to one line hold no homography."""
REFINING_STEPS = 8
CLEAR_SHARE = 0.5
"""Of a homography's size: one that misses every plane before the rig by so much is none of its floor."""


@dataclass(frozen=True, slots=True)
class GroundPlane:
    """A floor seen by the left eye: n . X = height. normal: unit, pointing down; height in metres, > 0.

    >>> from calib.model import HeadMount
    >>> flat = GroundPlane.below(HeadMount().left_eye(0.0, 0.35)[0], 0.25)
    >>> round(flat.tilt, 6), flat.height
    (0.35, 0.25)
    """

    normal: tuple[float, float, float]
    height: float

    @classmethod
    def below(cls, rotation: Matrix, height: float) -> GroundPlane:
        """The level floor under a lens at `height` metres; rotation (3, 3): left camera to robot frame.

        Raises:
            ValueError: height not positive.
        """
        if not height > 0.0:
            raise ValueError(f"the lens must be above the floor, got height {height}")
        x, y, z = (-rotation[2]).tolist()
        return cls((x, y, z), height)

    @property
    def tilt(self) -> float:
        """How far the camera looks down: n = (sin q cos p, cos q cos p, sin p), this is p. Radians."""
        return math.asin(min(max(self.normal[2], -1.0), 1.0))

    @property
    def roll(self) -> float:
        """How far the camera is turned about its axis: q of the same formula. Radians."""
        return math.atan2(self.normal[0], self.normal[1])

    def homography(self, rig: StereoRig) -> Matrix:
        """The 3x3 matrix that takes its pixels of the left picture to the right one."""
        plane = rig.R + np.outer(rig.translation, self.normal) / self.height
        return np.asarray(rig.right.matrix @ plane @ to_rays(rig.left))


def ground_homography(rig: StereoRig, rotation: Matrix, height: float) -> Matrix:
    """The 3x3 homography that takes floor pixels of the left picture to the right one.

    H = K_r (R + t n' / h) K_l^-1 with X_r = R X_l + t and n . X_l = h for floor points (METHODS 4).

    Args:
        rig: undistorted pair.
        rotation: (3, 3) left camera to robot frame; carries tilt and roll.
        height: of the left lens above the floor, metres, > 0.

    Raises:
        ValueError: height not positive.

    >>> from calib.model import HeadMount
    >>> rig = StereoRig.parallel(352, 288, 305.0, 0.06)
    >>> ground_homography(rig, HeadMount().left_eye(0.0, 0.3)[0], 0.25).shape
    (3, 3)
    """
    return GroundPlane.below(rotation, height).homography(rig)


def to_rays(camera: Camera) -> Matrix:
    """K^-1 (3, 3): takes homogeneous pixels to lines of sight, camera frame.

    >>> eye = Camera(352, 288, 305.0, 300.0, 175.5, 143.5)
    >>> bool(np.allclose(to_rays(eye) @ eye.matrix, np.eye(3)))
    True
    """
    across, down = 1.0 / camera.fx, 1.0 / camera.fy
    return np.array([[across, 0.0, -camera.cx * across], [0.0, down, -camera.cy * down], [0.0, 0.0, 1.0]])


def warp_to_left(right: Grey, homography: Matrix) -> Grey:
    """The right picture, grey (H, W), as the left eye would see it if all lay on the floor; 0 elsewhere."""
    size = (right.shape[1], right.shape[0])
    warped = cv2.warpPerspective(right, homography, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    return np.asarray(warped, right.dtype)


def through(homography: Matrix, pixels: Pixels) -> Pixels:
    """Where a homography (3, 3) takes pixels (N, 2).

    >>> through(np.diag([2.0, 2.0, 1.0]), np.array([[3.0, 4.0]])).tolist()
    [[6.0, 8.0]]
    """
    seen = pixels @ homography[:, :2].T + homography[:, 2]
    return np.asarray(seen[:, :2] / seen[:, 2:])


def homography_from_matches(left: Pixels, right: Pixels, tolerance_px: float = 1.5) -> tuple[Matrix, Mask]:
    """The homography of >= 4 floor matches, found robustly (RANSAC), and which matches obey it.

    Args:
        left, right: (N, 2) pixels.
        tolerance_px: how far a match may miss.

    Returns:
        H (3, 3) scaled to H[2, 2] = 1, and (N,) bool.

    Raises:
        ValueError: fewer than 4 matches, unequal counts, not finite, or no homography fits (all on a line).
    """
    a, b = np.asarray(left, np.float64).reshape(-1, 2), np.asarray(right, np.float64).reshape(-1, 2)
    if len(a) != len(b) or len(a) < 4:
        raise ValueError(f"a homography needs 4 or more pairs, got {len(a)} left and {len(b)} right")
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise ValueError("a match lies nowhere (NaN or infinite): leave such pairs out")
    found, inliers = cv2.findHomography(a, b, cv2.RANSAC, tolerance_px)
    if found is None or _on_one_line(a[inliers.ravel() > 0]):
        raise ValueError("no homography fits these matches: take floor points that do not lie on one line")
    return np.asarray(found, np.float64), inliers.ravel() > 0


def _on_one_line(points: Pixels) -> bool:
    if len(points) < 4:
        return True
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) / math.sqrt(len(points))
    return bool(spread[1] < LEAST_SPREAD_PX)


def plane_from_homography(homography: Matrix, rig: StereoRig) -> GroundPlane:
    """The plane a homography stands for, given the rig: s (R + t m') closest to K_r^-1 H K_l, m = n / h.

    With R and t known there is one plane to find, not the up to four of a free decomposition; it is linear
    in (s, s m).

    Args:
        homography: (3, 3), of any scale and sign.
        rig: undistorted pair.

    Raises:
        ValueError: no plane in front of this rig has such a homography.

    >>> from calib.model import HeadMount
    >>> rig = StereoRig.parallel(352, 288, 305.0, 0.06)
    >>> seen = plane_from_homography(ground_homography(rig, HeadMount().left_eye(0.0, 0.3)[0], 0.25), rig)
    >>> round(seen.tilt, 6), round(seen.height, 6)
    (0.3, 0.25)
    """
    wanted = to_rays(rig.right) @ np.asarray(homography, np.float64) @ rig.left.matrix
    shift = np.asarray(rig.translation)
    # A = s R + t w': nine equations, unknown s and w.
    system = np.column_stack([rig.R.ravel(), np.kron(shift[:, None], np.eye(3))])
    solution, *_ = np.linalg.lstsq(system, wanted.ravel(), rcond=None)
    scale, bent = float(solution[0]), solution[1:]
    miss = float(np.linalg.norm(system @ solution - wanted.ravel()))
    size = float(np.linalg.norm(bent))
    if not (abs(scale) > 0.0 and miss < CLEAR_SHARE * abs(scale) and size > 1e-6 * abs(scale)):
        raise ValueError("this homography belongs to no floor before this rig: check the matches and the rig")
    return _plane_of(bent / scale)


def plane_from_matches(left: Pixels, right: Pixels, rig: StereoRig, start: GroundPlane) -> GroundPlane:
    """The plane whose homography misses matches of its points the least (Gauss-Newton, pixels, Huber).

    Three unknowns where a homography has eight: matches on a short stretch of floor still tell its tilt.

    Args:
        left, right: (N, 2) pixels, N >= 3, hardly any false.
        rig: undistorted pair.
        start: where to begin, as `plane_from_homography` gives it.

    Raises:
        ValueError: fewer than 3 matches, or they lie on one line.
    """
    a, b = np.asarray(left, np.float64).reshape(-1, 2), np.asarray(right, np.float64).reshape(-1, 2)
    if len(a) != len(b) or len(a) < 3:
        raise ValueError(f"a plane needs 3 or more pairs, got {len(a)} left and {len(b)} right")
    rays = np.column_stack([a, np.ones(len(a))]) @ to_rays(rig.left).T
    turned, shift = rays @ rig.R.T, np.asarray(rig.translation)
    focal, centre = (rig.right.fx, rig.right.fy), (rig.right.cx, rig.right.cy)
    bent = np.asarray(start.normal) / start.height
    for _ in range(REFINING_STEPS):
        seen = turned + (rays @ bent)[:, None] * shift
        flat = seen[:, :2] / seen[:, 2:]
        miss = (b - centre) / focal - flat
        # The picture moves along the epipole's direction as m . ray grows.
        moves = (shift[:2] - flat * shift[2]) / seen[:, 2:]
        jacobian = (moves[:, :, None] * rays[:, None, :]).reshape(-1, 3)
        off = miss.ravel() * np.tile(focal, len(a))
        scale = max(1.4826 * float(np.median(np.abs(off))), 0.05)
        weight = 1.0 / np.maximum(np.abs(off) / (1.345 * scale), 1.0)
        normal_matrix = (jacobian * weight[:, None]).T @ jacobian
        if np.linalg.cond(normal_matrix) > 1e9:
            raise ValueError("these matches lie on one line: take floor points that do not")
        bent = bent + np.linalg.solve(normal_matrix, (jacobian * weight[:, None]).T @ miss.ravel())
    return _plane_of(bent)


def _plane_of(bent: Vector) -> GroundPlane:
    """The plane m . X = 1."""
    size = float(np.linalg.norm(bent))
    x, y, z = (bent / size).tolist()
    return GroundPlane((x, y, z), 1.0 / size)
