"""Obstacles by the ground-plane homography: what the warped eyes disagree on does not lie on the floor.

The floor's homography takes left pixels to right ones; the right picture warped by it agrees with the left
one on the floor, whatever is painted there. Corners in regions that disagree are matched along their epipolar
lines, triangulated, and kept if they stand up from the floor or lie below it.
Source: [B], METHODS 4 first paragraph; how the floor really lies (`ground_level`), the sigmas, the gates, the
neighbour rule and mirror images (`ground_reflection`) are ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.model import HeadMount, Matrix, StereoRig, Vector
from robot.messages import Image, Points
from robot.vision.ground_corners import harris_corners, spread, upright_edges
from robot.vision.ground_level import SeenGround, SeenLevel, floor_matches, level_of, see_ground
from robot.vision.ground_matching import (
    EyePictures,
    alikeness,
    fundamental_matrix,
    match_in_bands,
)
from robot.vision.ground_plane import (
    GroundPlane,
    ground_homography,
    homography_from_matches,
    plane_from_homography,
)
from robot.vision.ground_points import SeenPoints, seen_points
from robot.vision.ground_reflection import DEEP_PX, FLOOR_LIKENESS, amid_floor, mirrored
from robot.vision.pair_input import grey_pair

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Pixels = NDArray[np.float64]

CORNERS, EDGES, CORNERS_A_TILE = 120, 40, 6
NOISY_GREY = 5.0
"""Grey levels by which a smoothed difference must exceed its own median to be bright."""
BRIGHT_SHARE, BRIGHT_WINDOW = 0.15, 15
FLOOR_MARGIN = 0.4
"""By so much (Fisher's z of both correlations: 2 standard deviations at some 50 independent pixels) a match
must beat floor at the same place: what looks nearly as well like floor is nothing one can tell from it."""
SIGMAS = 3.0
STEP_SHARE = 0.5
"""Of the step height: a step is matched at its edges, halfway up its front, and a little blurred."""
STANDING_OTHERS, FALLING_OTHERS, OTHER_PX = 1, 3, 7.0
"""So many more of a kind must be near, so far apart in the picture. An edge shows dozens below
it; what a glossy floor mirrors mixes with the floor and shows odd single ones."""
FLATTEST_RAY = 0.05
"""A ray that drops less per metre of depth tells no edge."""


@dataclass(frozen=True, slots=True)
class GroundLimits:
    """What stands up. Metres.

    step_height: what is as high must be found. body_height: what hangs higher may be driven under.
    """

    step_height: float = 0.03
    body_height: float = 0.35
    max_range: float = 2.0
    min_depth: float = 0.15
    """How near to the lens is searched; nearer things are not seen here."""
    neighbour: float = 0.12
    """A feature with no other one so near is taken for a false match."""


@dataclass(frozen=True, slots=True, eq=False)
class GroundObstacles:
    """points (N, 3) robot frame, metres; sigma (N,) metres along the line of sight; pixels (N, 2) left u, v.

    falls (N,) bool: the floor falls away there; else something stands up. heights (N,), height_sigmas (N,):
    over the floor as it was seen to lie, metres, negative below it.
    A point below the floor stands where its ray meets the floor's level: the edge one would fall over; its
    third coordinate stays that of what was seen.
    """

    points: Points
    sigma: Vector
    pixels: Pixels
    falls: Mask
    heights: Vector
    height_sigmas: Vector


def obstacle_points(
    left: Image, right: Image, rig: StereoRig, mount: HeadMount, pan: float, tilt: float
) -> Points:
    """Points (N, 3) in the robot frame that stand up from the floor, or where it falls away."""
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

    The floor's own tilt and height are first read off the picture, within 1.5 degrees and 15 mm.

    Args:
        left, right: BGR or grey uint8 pair, undistorted; rectified or not.
        rig: the pair's geometry.
        mount: where the head sits.
        pan, tilt: of the head, radians.
        limits: what stands up.

    Raises:
        ValueError: pictures that are no pair, or not of the rig's size.

    >>> rig, grey = StereoRig.parallel(352, 288, 305.0, 0.06), np.full((288, 352), 90, np.uint8)
    >>> len(find_obstacles(grey, grey, rig, HeadMount(), 0.0, 0.35).points)
    0
    """
    limits = limits or GroundLimits()
    stand = mount.left_eye(pan, tilt)
    greys = grey_pair(left, right)
    if greys[0].shape != (rig.left.height, rig.left.width):
        raise ValueError(
            f"the pictures are {greys[0].shape[::-1]}, the rig {rig.left.width}x{rig.left.height}: "
            "calibrate at this size"
        )
    scene = _look_at_floor(greys, rig, stand)
    features = _features(scene, rig, stand, limits)
    heights, floor_sigma = scene.level.heights(features.seen.points(stand[1]))
    height_sigma = np.hypot(features.seen.sigma * np.abs(features.seen.rays[:, 2]), floor_sigma)
    gate = np.maximum(STEP_SHARE * limits.step_height, SIGMAS * height_sigma)
    stands = features.seen.before & (heights > gate) & (heights < limits.body_height)
    falls = (
        features.corner
        & features.seen.before
        & (heights < -gate)
        & (features.seen.rays[:, 2] < -FLATTEST_RAY)
    )
    falls[falls] = ~_mirror_images(scene, features, np.flatnonzero(falls), rig)
    return _obstacles(features, stands, falls, heights, height_sigma, stand[1], limits)


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    """A pair and its floor: all corners (N, 2) of the left picture; the right one warped over the floor."""

    pictures: EyePictures
    bright: Mask
    corners: Pixels
    level: SeenLevel
    plane: GroundPlane
    homography: Matrix
    warped: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Features:
    """Matched corners that do not look like floor: pixels of both eyes (N, 2), where they are,
    and which (N,) are corners; the others are upright edges."""

    left: Pixels
    right: Pixels
    seen: SeenPoints
    corner: Mask


def _look_at_floor(greys: tuple[Image, Image], rig: StereoRig, stand: tuple[Matrix, Vector]) -> _Scene:
    pictures = EyePictures.of(*greys)
    corners = harris_corners(pictures.half_left)
    level = level_of(floor_matches(pictures, rig, *stand, corners), rig, *stand)
    plane = level.plane(*stand)
    homography = plane.homography(rig)
    warped = warp_to_left(greys[1], homography)
    bright = bright_regions(greys[0], warped)
    return _Scene(pictures, bright, corners, level, plane, homography, np.asarray(warped, np.float32))


def _features(scene: _Scene, rig: StereoRig, stand: tuple[Matrix, Vector], limits: GroundLimits) -> _Features:
    """The corners in bright regions, matched; without those that look as well like floor."""
    each = [
        _off_the_floor(places, most, scene.bright, rig, *stand, limits.max_range)
        for places, most in ((scene.corners, CORNERS), (upright_edges(scene.pictures.half_left), EDGES))
    ]
    corners = np.vstack(each)
    low, high = _band(corners, rig, limits.min_depth)
    found = match_in_bands(scene.pictures, corners, fundamental_matrix(rig), low, high)
    like_floor = alikeness(scene.pictures.left, scene.warped, corners)
    ahead = _fisher(found.correlation) - _fisher(like_floor)
    rows = np.flatnonzero(found.sure & (ahead > FLOOR_MARGIN))
    left, right = corners[rows], found.right[rows]
    return _Features(
        left, right, seen_points(left, right, found.sigma_px[rows], rig, stand[0]), rows < len(each[0])
    )


def _fisher(correlation: Vector | Floats) -> Vector:
    """Correlations (N,) made comparable: atanh, which noise scatters evenly."""
    return np.asarray(np.arctanh(np.clip(correlation, -0.99, 0.99)), np.float64)


def _mirror_images(scene: _Scene, features: _Features, rows: NDArray[np.intp], rig: StereoRig) -> Mask:
    """Which of the features `rows`, all below the floor, the floor only mirrors; (len(rows),) bool."""
    seen, pixels = features.seen, features.left[rows]
    image = mirrored(scene.pictures.left, rig.left, scene.plane, pixels, seen.depth[rows], seen.sigma[rows])
    floor = np.column_stack([pixels, np.ones(len(rows))]) @ scene.homography.T
    parallax = np.hypot(*(floor[:, :2] / floor[:, 2:] - features.right[rows]).T)
    deep = np.flatnonzero(~image & (parallax > DEEP_PX))
    if len(deep):
        like = alikeness(scene.pictures.left, scene.warped, scene.corners) >= FLOOR_LIKENESS
        image[deep] = amid_floor(pixels[deep], scene.corners, like)
    return image


def warp_to_left(right: Image, homography: Matrix) -> Image:
    """The right picture as the left eye would see it if all lay on the floor; black elsewhere."""
    size = (right.shape[1], right.shape[0])
    warped = cv2.warpPerspective(right, homography, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    return np.asarray(warped, np.uint8)


def bright_regions(left: Image, warped: Image) -> Mask:
    """Where many pixels of the left picture differ from the right one warped onto it over the floor.

    left, warped: grey uint8 (H, W). Returns (H, W) bool.
    """
    smooth_left, smooth_warped = (cv2.GaussianBlur(g, (5, 5), 1.0) for g in (left, warped))
    difference = cv2.absdiff(smooth_left, smooth_warped)
    # Eyes differ a little in gain: what is usual on this floor is not bright.
    usual = float(np.median(difference[::4, ::4]))
    _, bright = cv2.threshold(difference, usual + NOISY_GREY, 1.0, cv2.THRESH_BINARY)
    # Opening takes out the thin residues of floor lines.
    opened = cv2.morphologyEx(bright, cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
    many = cv2.boxFilter(opened, cv2.CV_16U, (BRIGHT_WINDOW, BRIGHT_WINDOW), normalize=False)
    dense: Mask = many > BRIGHT_SHARE * BRIGHT_WINDOW**2
    return dense


def _off_the_floor(
    corners: Pixels, most: int, bright: Mask, rig: StereoRig, rotation: Matrix, eye: Vector, reach: float
) -> Pixels:
    """Corners in bright regions, in rows where feet of things within `reach` appear: none of a far wall."""
    camera = rig.left
    drop = -(rotation[2, 1] * (corners[:, 1] - camera.cy) / camera.fy + rotation[2, 2])
    u, v = corners.astype(np.intp).T
    chosen: Pixels = corners[bright[v, u] & (drop > eye[2] / reach)]
    return np.asarray(chosen[spread(chosen, most, CORNERS_A_TILE)])


def _band(corners: Pixels, rig: StereoRig, min_depth: float) -> tuple[Vector, Vector]:
    """Columns of the right picture between which what is at least so far away appears, a little more."""
    rays = np.column_stack([corners, np.ones(len(corners))]) @ np.linalg.inv(rig.left.matrix).T @ rig.R.T
    near = rays * min_depth + np.asarray(rig.translation)
    ends = [rig.right.cx + rig.right.fx * p[:, 0] / np.maximum(p[:, 2], 1e-6) for p in (near, rays)]
    low, high = np.minimum(*ends), np.maximum(*ends) + 2.0
    return np.asarray(low), np.asarray(high)


def _obstacles(
    features: _Features, stands: Mask, falls: Mask, heights: Vector, height_sigma: Vector, eye: Vector,
    limits: GroundLimits,
) -> GroundObstacles:  # fmt: skip
    """Those within reach and in company, at their place on the floor."""
    rays, points = features.seen.rays, features.seen.points(eye)
    # What lies below is seen over the edge: there the ray passes the floor's level.
    edge = eye + ((points[:, 2] - heights - eye[2]) / np.minimum(rays[:, 2], -FLATTEST_RAY))[:, None] * rays
    points[falls, :2] = edge[falls, :2]
    sigma = features.seen.sigma * np.linalg.norm(rays, axis=1)
    away = np.hypot(points[:, 0], points[:, 1])
    keep = np.flatnonzero((falls | stands) & (away < limits.max_range))
    keep = keep[_in_company(points[keep], sigma[keep], falls[keep], features.left[keep], limits.neighbour)]
    return GroundObstacles(
        points[keep], sigma[keep], features.left[keep], falls[keep], heights[keep], height_sigma[keep]
    )


def _in_company(points: Matrix, sigma: Vector, falls: Mask, pixels: Pixels, reach: float) -> Mask:
    """Which points have others of their kind near by, seen in other pixels: two of one patch err alike."""
    apart = np.linalg.norm(points[:, None, :2] - points[None, :, :2], axis=2)
    apart_px = np.linalg.norm(pixels[:, None] - pixels[None], axis=2)
    near = (apart < reach + 2.0 * sigma[:, None]) & (falls[:, None] == falls[None, :])
    near &= apart_px >= OTHER_PX
    return np.asarray(near.sum(axis=1) >= np.where(falls, FALLING_OTHERS, STANDING_OTHERS))


__all__ = [
    "GroundLimits",
    "GroundObstacles",
    "GroundPlane",
    "SeenGround",
    "SeenLevel",
    "bright_regions",
    "find_obstacles",
    "ground_homography",
    "homography_from_matches",
    "obstacle_points",
    "plane_from_homography",
    "see_ground",
    "warp_to_left",
]
