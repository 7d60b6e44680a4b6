"""How the floor really lies, from features matched on it in one pair of pictures.

A base that brakes tips by a degree; by calibration alone a rug would then stand up and a low step lie down.
Floor features are matched in the right picture warped by the expected homography, where they look alike and
are near; those that obey one plane are the floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.model import HeadMount, Matrix, StereoRig, Vector
from robot.messages import Image
from robot.vision.ground_corners import harris_corners, spread
from robot.vision.ground_matching import EyePictures, fundamental_matrix, match_near
from robot.vision.ground_plane import (
    GroundPlane,
    ground_homography,
    homography_from_matches,
    plane_from_homography,
    plane_from_matches,
)
from robot.vision.ground_points import rays_of, seen_points
from robot.vision.levelling import REST_SIGMA, FloorLevel
from robot.vision.pair_input import grey_pair

Mask = NDArray[np.bool_]
Pixels = NDArray[np.float64]

CORNERS, CORNERS_A_TILE = 50, 1
"""Three numbers are sought: fifty matches all over the floor tell them as well as more."""
FARTHEST_FLOOR_M = 2.4
"""Farther floor, a third of a pixel a decimetre, tells nothing of its slope that nearer floor does not."""
REACH_PX = 8.0
"""A base tipped by 1.5 degrees shifts the floor by 2 px, one lifted by 15 mm by at most 4."""
FEWEST = 8
"""Matches: fewer may all lie on one thing."""
BOUND_SIGMAS = 3.0
"""Standard deviations of where a base stands beyond which no floor is believed: that is a ramp or a table."""
ROUGH_PX = 0.15
"""How far good floor matches scatter beside their own sigma: no floor is a plane."""
CUT_SIGMAS = 3.0
"""A match farther off the plane than so many standard deviations has no say."""
GROWING = (0.35, 0.55, 0.8, 1.0, 1.0)
"""Share of the matches, nearest first, that each round of the fit looks at: the robot stands on floor, and
from there it is followed outward."""
SHARED_ERROR = 4.0
"""Neighbouring matches err together: so many weigh as one."""


@dataclass(frozen=True, slots=True, eq=False)
class FloorMatches:
    """Matches that may lie on the floor: left, right (N, 2) px; sigma_px (N,)."""

    left: Pixels
    right: Pixels
    sigma_px: Vector


@dataclass(frozen=True, slots=True, eq=False)
class SeenLevel:
    """The floor as it lies, with the doubt: covariance (3, 3) of lift (m), ahead, aside (slopes).

    obeyed (N,) bool: which of the matches it was read from lie on it.
    """

    level: FloorLevel
    covariance: Matrix
    obeyed: Mask

    @classmethod
    def nominal(cls, matches: int) -> SeenLevel:
        """What one knows without looking."""
        return cls(FloorLevel(), np.diag(np.square(REST_SIGMA)), np.zeros(matches, np.bool_))

    def heights(self, points: Matrix) -> tuple[Vector, Vector]:
        """Heights (N,) over the floor of points (N, 3), robot frame, and the floor's own sigma there."""
        basis = np.column_stack([np.ones(len(points)), points[:, :2]])
        floor = basis @ (self.level.lift, self.level.ahead, self.level.aside)
        sigma = np.sqrt(np.einsum("ni,ij,nj->n", basis, self.covariance, basis))
        return points[:, 2] - floor, sigma

    def plane(self, rotation: Matrix, eye: Vector) -> GroundPlane:
        """The same as the left eye sees it; rotation, eye: its nominal stand, see `HeadMount.left_eye`."""
        down = np.array([self.level.ahead, self.level.aside, -1.0])
        size = float(np.linalg.norm(down))
        height = (float(eye[2]) - self.level.at(float(eye[0]), float(eye[1]))) / size
        x, y, z = (rotation.T @ down / size).tolist()
        return GroundPlane((x, y, z), height)


@dataclass(frozen=True, slots=True, eq=False)
class SeenGround:
    """The floor of a picture found without trusting the tilt: homography (3, 3) left to right pixels, plane
    (normal, height, and the tilt and roll they imply), and how many of how many matches obey it."""

    homography: Matrix
    plane: GroundPlane
    inliers: int
    matches: int


def see_ground(
    left: Image, right: Image, rig: StereoRig, mount: HeadMount, pan: float, tilt: float
) -> SeenGround:
    """Homography and plane of the floor from matches that the pictures give by themselves.

    Args:
        left, right: BGR or grey uint8 pair, undistorted.
        rig: the pair's geometry.
        mount, pan, tilt: how the eyes are believed to stand; true within about 2 degrees and 15 mm.

    Returns:
        The plane's `tilt` less the believed one is the error of the tilt; `height` is the left lens's.

    Raises:
        ValueError: too little floor with texture is seen to tell its plane.
    """
    rotation, eye = mount.left_eye(pan, tilt)
    found = floor_matches(EyePictures.of(*grey_pair(left, right)), rig, rotation, eye)
    if len(found.left) < FEWEST:
        raise ValueError(
            f"{len(found.left)} floor matches are too few for a plane: look at floor that has texture"
        )
    homography, obeys = homography_from_matches(found.left, found.right, 1.0)
    first = plane_from_homography(homography, rig)
    plane = plane_from_matches(found.left[obeys], found.right[obeys], rig, first)
    return SeenGround(homography, plane, int(obeys.sum()), len(obeys))


def floor_matches(
    pictures: EyePictures, rig: StereoRig, rotation: Matrix, eye: Vector, corners: Pixels | None = None
) -> FloorMatches:
    """Corners where floor is expected, matched near to where floor would be.

    rotation, eye: of the left lens, see `HeadMount.left_eye`; corners (N, 2): of the left picture, strongest
    first, if they are known already.
    """
    corners = harris_corners(pictures.half_left) if corners is None else corners
    corners = corners[floor_within(corners, rig, rotation, eye, FARTHEST_FLOOR_M)]
    corners = corners[spread(corners, CORNERS, CORNERS_A_TILE)]
    nominal = ground_homography(rig, rotation, float(eye[2]))
    found = match_near(pictures, corners, fundamental_matrix(rig), nominal, REACH_PX)
    return FloorMatches(corners[found.sure], found.right[found.sure], found.sigma_px[found.sure])


def floor_within(pixels: Pixels, rig: StereoRig, rotation: Matrix, eye: Vector, reach: float) -> Mask:
    """Which left pixels (N, 2) would see floor less than `reach` metres of depth away."""
    drop = -rays_of(pixels, rig.left) @ rotation[2]
    return np.asarray(drop > eye[2] / reach)


def level_of(matches: FloorMatches, rig: StereoRig, rotation: Matrix, eye: Vector) -> SeenLevel:
    """The floor through most of the matches, starting from and held by where a base can stand.

    Iteratively reweighted least squares (Tukey's biweight) in inverse depth, which a match gives evenly:
    w (e_z - lift - ahead e_x - aside e_y) = ahead r_x + aside r_y - r_z for a ray r from the eye e. Near
    matches come first, and what then lies too far off never pulls: a low step stays a step.
    """
    seen = seen_points(matches.left, matches.right, np.hypot(matches.sigma_px, ROUGH_PX), rig, rotation)
    rows = np.flatnonzero(seen.before)
    prior = np.diag(np.square(REST_SIGMA))
    if len(rows) < FEWEST:
        return SeenLevel.nominal(len(matches.left))
    rays, inverse = seen.rays[rows], 1.0 / seen.depth[rows]
    sigma = eye[2] * seen.sigma[rows] * inverse**2
    basis = np.column_stack([inverse, inverse[:, None] * eye[:2] + rays[:, :2]])
    high = inverse * eye[2] + rays[:, 2]
    held = np.diag(1.0 / np.square(REST_SIGMA))
    plane, covariance = np.zeros(3), prior
    rank = np.argsort(np.argsort(-inverse)) / len(rows)
    for share in GROWING:
        doubt = np.einsum("ni,ij,nj->n", basis, covariance, basis)
        off = (high - basis @ plane) / (CUT_SIGMAS * np.sqrt(sigma**2 + doubt))
        counts = (np.abs(off) < 1.0) & (rank <= share)
        weight = np.where(counts, (1.0 - off * off) ** 2, 0.0) / sigma**2 / SHARED_ERROR
        weighted = basis * weight[:, None]
        covariance = np.linalg.inv(weighted.T @ basis + held)
        plane = covariance @ (weighted.T @ high)
    bound = BOUND_SIGMAS * np.asarray(REST_SIGMA)
    lift, ahead, aside = np.clip(plane, -bound, bound).tolist()
    obeyed = np.zeros(len(matches.left), np.bool_)
    obeyed[rows] = np.abs(off) < 1.0
    return SeenLevel(FloorLevel(lift, ahead, aside), covariance, obeyed)
