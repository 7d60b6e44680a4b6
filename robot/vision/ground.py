"""Obstacles by the ground-plane homography: what the warped eyes disagree on does not lie on the floor.

The floor's homography takes left pixels to right ones; the right picture warped by it agrees with the left
one on the floor, whatever is painted there. Corners in regions that disagree are matched along their epipolar
lines, triangulated, and kept if they stand up from the floor or lie below it.
Source: [B], METHODS 4 first paragraph; how the floor really lies (`ground_level`), the sigmas, the gates, the
neighbour rule and mirror images (`ground_reflection`) are ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.model import HeadMount, Matrix, StereoRig, Vector
from robot.messages import Image, Points
from robot.vision.ground_features import (
    Features,
    Scene,
    candidates,
    leading_back,
    look_at_floor,
    matched,
    mirror_images,
)
from robot.vision.ground_level import SeenGround, see_ground
from robot.vision.ground_plane import (
    GroundPlane,
    ground_homography,
    homography_from_matches,
    plane_from_homography,
)
from robot.vision.pair_input import grey_pair, refuse_other_size

Mask = NDArray[np.bool_]
Pixels = NDArray[np.float64]

SIGMAS = 3.0
"""Standard deviations of its height by which a feature must lie off the floor."""
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


@dataclass(frozen=True, slots=True, eq=False)
class _Heights:
    """Over the floor as it lies, metres, and their standard deviations (N,); negative below it."""

    metres: Vector
    sigma: Vector


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
    refuse_other_size(greys[0], rig)
    scene = look_at_floor(greys, rig, stand)
    places, corner = candidates(scene, rig, stand, limits.max_range)
    features = matched(scene, places, corner, rig, stand[0], limits.min_depth)
    heights = _heights(scene, features, stand[1])
    off = _standing(features, heights, limits) | _falling(features, heights, limits)
    rows = np.flatnonzero(off)
    # The dear checks come last: on a free floor hardly anything is left for them.
    rows = rows[leading_back(scene, features.some(rows), rig, limits.min_depth)]
    features, heights = features.some(rows), _Heights(heights.metres[rows], heights.sigma[rows])
    falls = heights.metres < 0.0
    real = np.ones(len(rows), np.bool_)
    real[falls] = ~mirror_images(scene, features.some(np.flatnonzero(falls)), rig)
    return _obstacles(features, real, falls, heights, stand[1], limits)


def _heights(scene: Scene, features: Features, eye: Vector) -> _Heights:
    metres, floor_sigma = scene.level.heights(features.seen.points(eye))
    seen_sigma = features.seen.sigma * np.abs(features.seen.rays[:, 2])
    return _Heights(metres, np.hypot(seen_sigma, floor_sigma))


def _gate(heights: _Heights, limits: GroundLimits) -> Vector:
    """How far off the floor a feature must lie (N,), metres."""
    return np.maximum(STEP_SHARE * limits.step_height, SIGMAS * heights.sigma)


def _standing(features: Features, heights: _Heights, limits: GroundLimits) -> Mask:
    high = (heights.metres > _gate(heights, limits)) & (heights.metres < limits.body_height)
    return features.seen.before & high


def _falling(features: Features, heights: _Heights, limits: GroundLimits) -> Mask:
    """Corners alone: an upright edge below the floor is a thing's mirror image more often than not."""
    low = (heights.metres < -_gate(heights, limits)) & (features.seen.rays[:, 2] < -FLATTEST_RAY)
    return features.corner & features.seen.before & low


def _obstacles(
    features: Features, real: Mask, falls: Mask, heights: _Heights, eye: Vector, limits: GroundLimits
) -> GroundObstacles:
    """Those within reach and in company, at their place on the floor."""
    rays, points = features.seen.rays, features.seen.points(eye)
    # What lies below is seen over the edge: there the ray passes the floor's level.
    edge = (
        eye
        + ((points[:, 2] - heights.metres - eye[2]) / np.minimum(rays[:, 2], -FLATTEST_RAY))[:, None] * rays
    )
    points[falls, :2] = edge[falls, :2]
    sigma = features.seen.sigma * np.linalg.norm(rays, axis=1)
    away = np.hypot(points[:, 0], points[:, 1])
    keep = np.flatnonzero(real & (away < limits.max_range))
    keep = keep[_in_company(points[keep], sigma[keep], falls[keep], features.left[keep], limits.neighbour)]
    return GroundObstacles(
        points[keep], sigma[keep], features.left[keep], falls[keep], heights.metres[keep], heights.sigma[keep]
    )


def _in_company(points: Matrix, sigma: Vector, falls: Mask, pixels: Pixels, reach: float) -> Mask:
    """Which points have others of their kind near by, seen in other pixels: two of one patch err alike."""
    apart = np.hypot(*(points[:, None, k] - points[:, k] for k in (0, 1)))
    apart_px = np.hypot(*(pixels[:, None, k] - pixels[:, k] for k in (0, 1)))
    near = (apart < reach + 2.0 * sigma[:, None]) & (falls[:, None] == falls[None, :])
    near &= apart_px >= OTHER_PX
    return np.asarray(near.sum(axis=1) >= np.where(falls, FALLING_OTHERS, STANDING_OTHERS))


__all__ = [
    "GroundLimits",
    "GroundObstacles",
    "GroundPlane",
    "SeenGround",
    "find_obstacles",
    "ground_homography",
    "homography_from_matches",
    "obstacle_points",
    "plane_from_homography",
    "see_ground",
]
