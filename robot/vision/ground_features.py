"""Features off the floor: corners and upright edges where the eyes disagree, matched and triangulated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.model import Matrix, StereoRig, Vector
from robot.messages import Image
from robot.vision.ground_bright import bright_regions
from robot.vision.ground_corners import harris_corners, spread, upright_edges
from robot.vision.ground_level import SeenLevel, floor_matches, floor_within, level_of
from robot.vision.ground_matching import (
    COARSE_HALF,
    EyePictures,
    fundamental_matrix,
    leads_back,
    match_in_bands,
)
from robot.vision.ground_patches import alikeness, bilinear, patches_at, through_squares
from robot.vision.ground_plane import GroundPlane, through, warp_to_left
from robot.vision.ground_points import SeenPoints, rays_of, seen_points
from robot.vision.ground_reflection import FLOOR_LIKENESS, amid_floor, mirrored, near_any
from robot.vision.ground_subpixel import FINE_HALF
from robot.vision.half_size import half_camera, homography_to_half, to_half

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Pixels = NDArray[np.float64]
Rows = NDArray[np.intp]
Stand = tuple[Matrix, Vector]
"""Of the left eye, rotation (3, 3) and place (3,): see `HeadMount.left_eye`."""

CORNERS, EDGES, CORNERS_A_TILE = 80, 30, 6
"""Most corners and upright edges that are matched, and most of either in one tile of the picture."""
FLOOR_MARGIN = 0.4
"""By so much (Fisher's z of both correlations: 2 standard deviations at some 50 independent pixels) a match
must beat floor at the same place: what looks nearly as well like floor is nothing one can tell from it."""
SURELY_FLOOR = 0.95
"""A half-size patch as like floor as this is hardly ever more like anything else by that margin."""
BEYOND_PX = 2.0
"""A band ends so far beyond where an infinitely far thing appears: calibrations err."""
DEEP_PX = 8.0
"""So far from where floor would be matched, a patch is like floor by chance alone."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A pair and its floor.

    pictures: of both eyes. corners (N, 2): all of the left picture, px, strongest first. level: how the floor
    lies; plane: the same before the left eye; homography (3, 3): its pixels, left to right.
    """

    pictures: EyePictures
    corners: Pixels
    level: SeenLevel
    plane: GroundPlane
    homography: Matrix

    def like_floor(self, pixels: Pixels) -> Floats:
        """Correlation (N,) of both eyes' patches about left pixels (N, 2) if what they show were floor."""
        there = through_squares(self.homography, pixels, FINE_HALF)
        here = patches_at(self.pictures.left, pixels, FINE_HALF)
        return alikeness(here, bilinear(self.pictures.right, *there))


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """Matched features: pixels of both eyes (N, 2), where they are, and which (N,) bool are corners; the
    others are upright edges."""

    left: Pixels
    right: Pixels
    seen: SeenPoints
    corner: Mask

    def some(self, rows: Rows) -> Features:
        """Those of these rows."""
        return Features(self.left[rows], self.right[rows], self.seen.some(rows), self.corner[rows])


def look_at_floor(greys: tuple[Image, Image], rig: StereoRig, stand: Stand) -> Scene:
    """Both eyes' pictures with the floor as it is seen to lie."""
    pictures = EyePictures.of(*greys)
    corners = harris_corners(pictures.half_left)
    level = level_of(floor_matches(pictures, rig, *stand, corners), rig, *stand)
    plane = level.plane(*stand)
    return Scene(pictures, corners, level, plane, plane.homography(rig))


def candidates(scene: Scene, rig: StereoRig, stand: Stand, reach: float) -> tuple[Pixels, Mask]:
    """Places (N, 2) px where the eyes disagree about floor within `reach` metres; and which are corners.

    Where no floor could be so near no feet of near things can be: a far wall has no such places.
    """
    half = scene.pictures.half_left
    warped = warp_to_left(scene.pictures.half_right, homography_to_half(scene.homography))
    bright = bright_regions(half, warped)
    each = []
    for places, most in ((scene.corners, CORNERS), (upright_edges(half), EDGES)):
        u, v = to_half(places).astype(np.intp).T
        chosen = places[bright[v, u]]
        chosen = chosen[floor_within(chosen, rig, *stand, reach)]
        chosen = chosen[
            _unlike_floor(half, warped, to_half(chosen)) & _in_view(scene.homography, chosen, rig)
        ]
        each.append(chosen[spread(chosen, most, CORNERS_A_TILE)])
    return np.vstack(each), np.arange(len(each[0]) + len(each[1])) < len(each[0])


def _unlike_floor(half: Floats, warped: Floats, places: Pixels) -> Mask:
    """Which places (N, 2) of the half-size picture do not look like floor already there."""
    like = alikeness(*(patches_at(picture, places, COARSE_HALF) for picture in (half, warped)))
    return np.asarray(like < SURELY_FLOOR)


def _in_view(homography: Matrix, places: Pixels, rig: StereoRig) -> Mask:
    """Which left places (N, 2) the right eye has in view if they are floor: nearer things lie farther out."""
    u = through(homography, places)[:, 0]
    return np.asarray((u >= 0.0) & (u <= rig.right.width - 1))


def matched(
    scene: Scene, places: Pixels, corner: Mask, rig: StereoRig, rotation: Matrix, min_depth: float
) -> Features:
    """Those of the places that are matched for sure and do not look as well like floor."""
    found = match_in_bands(scene.pictures, places, fundamental_matrix(rig), *_band(places, rig, min_depth))
    rows = np.flatnonzero(found.sure)
    ahead = _fisher(found.correlation[rows]) - _fisher(scene.like_floor(places[rows]))
    rows = rows[ahead > FLOOR_MARGIN]
    left, right = places[rows], found.right[rows]
    return Features(left, right, seen_points(left, right, found.sigma_px[rows], rig, rotation), corner[rows])


def leading_back(scene: Scene, features: Features, rig: StereoRig, min_depth: float) -> Mask:
    """Which features (N,) the right eye finds again in the left picture."""
    low, high = _band(features.left, rig, min_depth)
    return leads_back(scene.pictures, features.left, features.right, fundamental_matrix(rig), low, high)


def mirror_images(scene: Scene, features: Features, rig: StereoRig) -> Mask:
    """Which of the features (N,), all below the floor, the floor only mirrors."""
    seen, pixels = features.seen, features.left
    half = scene.pictures.half_left, half_camera(rig.left)
    image = mirrored(*half, scene.plane, to_half(pixels), seen.depth, seen.sigma)
    parallax = np.hypot(*(through(scene.homography, pixels) - features.right).T)
    deep = np.flatnonzero(~image & (parallax > DEEP_PX))
    if len(deep):
        about = scene.corners[near_any(pixels[deep], scene.corners)]
        image[deep] = amid_floor(pixels[deep], about, scene.like_floor(about) >= FLOOR_LIKENESS)
    return image


def _fisher(correlation: Vector | Floats) -> Vector:
    """Correlations (N,) made comparable: atanh, which noise scatters evenly."""
    return np.asarray(np.arctanh(np.clip(correlation, -0.99, 0.99)), np.float64)


def _band(places: Pixels, rig: StereoRig, min_depth: float) -> tuple[Vector, Vector]:
    """Columns of the right picture between which what is at least so far away appears, a little more."""
    rays = rays_of(places, rig.left) @ rig.R.T
    near = rays * min_depth + np.asarray(rig.translation)
    ends = [rig.right.cx + rig.right.fx * p[:, 0] / np.maximum(p[:, 2], 1e-6) for p in (near, rays)]
    return np.asarray(np.minimum(*ends)), np.asarray(np.maximum(*ends) + BEYOND_PX)
