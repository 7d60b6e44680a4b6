"""Obstacles by the ground-plane homography: what the warped eyes disagree on does not lie on the floor.

The floor's homography takes left pixels to right ones; the right picture warped by it agrees with the left
one on the floor, whatever is painted there. Corners in regions that disagree are matched along their row,
triangulated, and kept if they stand up from the floor or lie below it.
Source: [B], METHODS 4 first paragraph; the left-right check, the gates and the neighbour rule are ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.model import HeadMount, Matrix, StereoRig, Vector
from robot.messages import Image, Points

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Pixels = NDArray[np.float64]

PATCH = 5
"""Half side of the correlated patch, pixels."""
MAX_CORNERS = 120
MIN_CORRELATION = 0.85
MAX_RIVAL = 0.95
"""A second peak this share as high as the best makes a match ambiguous."""
NOISY_GREY = 9.0
"""Grey levels by which a smoothed difference must exceed its own median to be bright."""
BRIGHT_SHARE = 0.3
BRIGHT_WINDOW = 15
MATCH_SIGMA_PX = 0.3


@dataclass(frozen=True, slots=True)
class GroundLimits:
    """What stands up. Metres: heights, the tilt a base may have unnoticed, ranges."""

    step_height: float = 0.03
    body_height: float = 0.35
    unnoticed_tilt: float = 0.012
    max_range: float = 2.0
    min_depth: float = 0.2
    neighbour: float = 0.12
    """A feature with no other one so near is taken for a false match."""


@dataclass(frozen=True, slots=True, eq=False)
class GroundObstacles:
    """points (N, 3) robot frame, metres; sigma (N,) metres along the line of sight; pixels (N, 2) left u, v.

    A point below the floor stands where its ray meets the floor's level: the edge one would fall over.
    """

    points: Points
    sigma: Vector
    pixels: Pixels


def ground_homography(rig: StereoRig, rotation: Matrix, height: float) -> Matrix:
    """The 3x3 homography that takes floor pixels of the left picture to the right one.

    H = K_r (R + t n' / h) K_l^-1 with X_r = R X_l + t and n . X_l = h for floor points (METHODS 4).

    Args:
        rig: undistorted pair.
        rotation: (3, 3) left camera to robot frame; carries tilt and roll.
        height: of the left lens above the floor, metres, > 0.

    Raises:
        ValueError: height not positive.

    >>> rig = StereoRig.parallel(352, 288, 305.0, 0.06)
    >>> ground_homography(rig, HeadMount().left_eye(0.0, 0.3)[0], 0.25).shape
    (3, 3)
    """
    if not height > 0.0:
        raise ValueError(f"the lens must be above the floor, got height {height}")
    down = rotation.T @ np.array([0.0, 0.0, -1.0])
    plane = rig.R + np.outer(rig.translation, down) / height
    return np.asarray(rig.right.matrix @ plane @ np.linalg.inv(rig.left.matrix))


def homography_from_matches(left: Pixels, right: Pixels, tolerance_px: float = 1.5) -> tuple[Matrix, Mask]:
    """The homography of >= 4 floor matches, found robustly (RANSAC), and which matches obey it.

    Args:
        left, right: (N, 2) pixels.
        tolerance_px: how far a match may miss.

    Returns:
        H (3, 3) scaled to H[2, 2] = 1, and (N,) bool.

    Raises:
        ValueError: fewer than 4 matches, unequal counts, or no homography fits (all on a line).
    """
    a, b = np.asarray(left, np.float64).reshape(-1, 2), np.asarray(right, np.float64).reshape(-1, 2)
    if len(a) != len(b) or len(a) < 4:
        raise ValueError(f"a homography needs 4 or more pairs, got {len(a)} left and {len(b)} right")
    found, inliers = cv2.findHomography(a, b, cv2.RANSAC, tolerance_px)
    if found is None or np.linalg.matrix_rank(a[inliers.ravel() > 0] - a.mean(axis=0)) < 2:
        raise ValueError("no homography fits these matches: take floor points that do not lie on one line")
    return np.asarray(found, np.float64), inliers.ravel() > 0


def obstacle_points(
    left: Image, right: Image, rig: StereoRig, mount: HeadMount, pan: float, tilt: float
) -> Points:
    """Points (N, 3) in the robot frame that stand up from the floor; see `find_obstacles`."""
    return find_obstacles(left, right, rig, mount, pan, tilt).points


def find_obstacles(
    left: Image,
    right: Image,
    rig: StereoRig,
    mount: HeadMount,
    pan: float,
    tilt: float,
    limits: GroundLimits | None = None,
) -> GroundObstacles:
    """Corner features that do not lie on the floor, triangulated.

    Args:
        left, right: rectified BGR or grey pair, uint8.
        rig: parallel pair (epipolar lines are rows).
        mount: where the head sits.
        pan, tilt: of the head, radians.
        limits: what stands up.
    """
    limits = limits or GroundLimits()
    rotation, eye = mount.left_eye(pan, tilt)
    grey_left, grey_right = _grey(left), _grey(right)
    homography = ground_homography(rig, rotation, float(eye[2]))
    bright = disagreement(grey_left, grey_right, homography)
    corners = _corners(grey_left, bright & _feet(rig, rotation, eye, limits.max_range, grey_left.shape[0]))
    reach = int(np.ceil(rig.left.fx * rig.baseline / limits.min_depth - rig.doffs))
    disparity, good = match_along_rows(grey_left, grey_right, corners, reach)
    depth = rig.left.fx * rig.baseline / np.maximum(disparity + rig.doffs, 0.1)
    good &= disparity + rig.doffs > 1.0
    return _standing(corners[good], depth[good], rig, rotation, eye, limits)


def disagreement(left: Image, right: Image, homography: Matrix) -> Mask:
    """Where many pixels of the left picture differ from the right one warped onto it over the floor.

    Pixels whose floor point lies outside the right picture say nothing. (H, W) bool.
    """
    size = (left.shape[1], left.shape[0])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    warped = cv2.warpPerspective(right, homography, size, flags=flags)
    inside = cv2.warpPerspective(np.full_like(right, 255), homography, size, flags=flags) == 255
    smooth_left, smooth_warped = (cv2.GaussianBlur(g, (5, 5), 1.0) for g in (left, warped))
    difference = cv2.absdiff(smooth_left, smooth_warped).astype(np.float32)
    # Eyes differ a little in gain: what is usual on this floor is not bright.
    usual = float(np.median(difference[inside])) if inside.any() else 0.0
    bright = (inside & (difference > usual + NOISY_GREY)).astype(np.float32)
    # Opening takes out the thin residues of floor lines.
    opened = cv2.morphologyEx(bright, cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
    share = cv2.blur(opened, (BRIGHT_WINDOW, BRIGHT_WINDOW))
    dense: Mask = share > BRIGHT_SHARE
    return dense


def match_along_rows(left: Image, right: Image, corners: Pixels, reach: int) -> tuple[Vector, Mask]:
    """Disparity of each corner (N, 2) by normalised correlation in a band of its row; and which to believe.

    Believed: correlation >= 0.85, no rival peak, and the right picture's patch finds its way back.
    """
    disparity, good = np.zeros(len(corners)), np.zeros(len(corners), np.bool_)
    for k, (u, v) in enumerate(np.rint(corners).astype(int).tolist()):
        forth = _correlate(left, right, u, v, u - reach, u)
        if forth is None:
            continue
        back = _correlate(right, left, round(forth), v, round(forth), round(forth) + reach)
        if back is not None and abs(back - u) <= 1.5:
            disparity[k], good[k] = u - forth, True
    return disparity, good


def _correlate(picture: Image, other: Image, u: int, v: int, low: int, high: int) -> float | None:
    """Column in low..high of row v where `other` looks like `picture` about (u, v); None with doubt."""
    height, width = picture.shape
    low, high = max(low, PATCH), min(high, width - 1 - PATCH)
    if not (PATCH <= u < width - PATCH and PATCH + 1 <= v < height - PATCH - 1) or high - low < 4:
        return None
    patch = picture[v - PATCH : v + PATCH + 1, u - PATCH : u + PATCH + 1]
    band = other[v - PATCH - 1 : v + PATCH + 2, low - PATCH : high + PATCH + 1]
    score = cv2.matchTemplate(band, patch, cv2.TM_CCOEFF_NORMED).max(axis=0)
    best = int(score.argmax())
    if score[best] < MIN_CORRELATION or best in (0, len(score) - 1):
        return None
    rivals = np.concatenate([score[: max(best - PATCH, 0)], score[best + PATCH + 1 :]])
    if len(rivals) and rivals.max() > MAX_RIVAL * score[best]:
        return None
    before, here, after = (float(s) for s in score[best - 1 : best + 2])
    bend = before - 2.0 * here + after
    return low + best + (0.5 * (before - after) / bend if bend < 0.0 else 0.0)


def _feet(rig: StereoRig, rotation: Matrix, eye: Vector, reach: float, height: int) -> Mask:
    """Rows (H, 1) where the feet of all that stands within `reach` appear: no corners for the far wall."""
    drop = -(rotation[2, 1] * (np.arange(height) - rig.left.cy) / rig.left.fy + rotation[2, 2])
    feet: Mask = drop[:, None] > eye[2] / reach
    return feet


def _corners(grey: Image, bright: Mask) -> Pixels:
    found = cv2.goodFeaturesToTrack(
        grey, MAX_CORNERS, 0.005, 4, mask=bright.astype(np.uint8), blockSize=5, useHarrisDetector=True, k=0.04
    )
    return np.zeros((0, 2)) if found is None else found.reshape(-1, 2).astype(np.float64)


def _standing(
    pixels: Pixels, depth: Vector, rig: StereoRig, rotation: Matrix, eye: Vector, limits: GroundLimits
) -> GroundObstacles:
    camera = rig.left
    rays = (
        np.column_stack(
            [
                (pixels[:, 0] - camera.cx) / camera.fx,
                (pixels[:, 1] - camera.cy) / camera.fy,
                np.ones(len(pixels)),
            ]
        )
        @ rotation.T
    )
    points = eye + depth[:, None] * rays
    sigma = depth**2 * MATCH_SIGMA_PX / (camera.fx * rig.baseline)
    away = np.hypot(points[:, 0], points[:, 1])
    gate = limits.step_height + limits.unnoticed_tilt * away + 2.5 * sigma * np.abs(rays[:, 2])
    below = (points[:, 2] < -gate) & (rays[:, 2] < -0.05)
    edge = eye + (eye[2] / np.maximum(-rays[:, 2], 0.05))[:, None] * rays
    points[below, :2] = edge[below, :2]
    keep = below | ((points[:, 2] > gate) & (points[:, 2] < limits.body_height))
    keep &= np.hypot(points[:, 0], points[:, 1]) < limits.max_range
    points, sigma, pixels = points[keep], sigma[keep], pixels[keep]
    apart = np.linalg.norm(points[:, None, :2] - points[None, :, :2], axis=2)
    company = (apart < limits.neighbour + 2.0 * sigma).sum(axis=1) >= 2
    return GroundObstacles(points[company], sigma[company], pixels[company])


def _grey(image: Image) -> Image:
    return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.uint8, copy=False)
