"""The hand's passage: the largest circle of the plane before the hand that both eyes prove open.

The plane is fitted to what stands nearest (a plate, a frame, boxes' fronts); in disparities it is affine,
d = a u + b v + c. A point of it is open if the ray of the left eye or of the right eye through it is measured
to end well behind it (see `carving`). What no eye measures stays blocked: a hole in the map is none in the
plate. Source: [T] by METHODS 10; the plane, the second eye and the sigmas are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.model import StereoRig
from robot.vision.both_eyes import BothEyes
from robot.vision.disparity import Disparity
from robot.vision.passage import Circle, inscribed_circle

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

MOUTH_SHARE = 0.2
"""Of the room that must be free behind a plane: what lies behind it by so much is not of its mouth's rim."""
RIM_SHARE = 1.0 / 3.0
"""Of the opening's radius: so wide a strip before a measured rim may stay unmeasured."""
RIM_PX = 8
"""Beside an edge a window measures nothing."""
CRACK_PX = 9
"""Unmeasured cracks narrower than this in what is proven open: 5 mm at 0.25 m."""
MOST_PIXELS, FEWEST_PIXELS = 4000, 300
ROUNDS = 4
NEARER_SHARE = 1.05
"""What stands so little before the plane still belongs to the rim."""
PLANE_PX = 1.5
"""Disparities so near to the plane belong to it."""


@dataclass(frozen=True, slots=True)
class Plane:
    """A plane in disparities: along u + down v + constant, px from the principal points; u, v left pixels."""

    along: float
    down: float
    constant: float

    def at(self, u: float, v: float) -> float:
        """Disparity of the plane at a pixel."""
        return self.along * u + self.down * v + self.constant

    def over(self, shape: tuple[int, ...]) -> Floats:
        """Disparities of all pixels (H, W)."""
        v, u = np.ogrid[: shape[0], : shape[1]]
        return (self.along * u + self.down * v + self.constant).astype(np.float32)


@dataclass(frozen=True, slots=True)
class Hole:
    """The largest circle open in depth and the plane it lies in; sigma_px: of the plane's disparity.

    mouth_px: diameter of the opening in the plane itself; bounded: the plane was measured, else it lies where
    nothing blocks any more.
    """

    circle: Circle
    mouth_px: float
    plane: Plane
    sigma_px: float
    bounded: bool


@dataclass(frozen=True, slots=True)
class Measured:
    """A hole in metres: diameter and centre (left camera: x right, y down, z forward), and their sigmas.

    clear: the diameter that is open in depth, behind the mouth too.
    """

    diameter: float
    clear: float
    sigma_diameter: float
    centre: tuple[float, float, float]
    sigma_centre: float


def largest_hole(
    eyes: BothEyes, rig: StereoRig, reach: float, behind: float, about: BothEyes | None = None
) -> Hole | None:
    """The largest circle of the nearest plane that is proven open; None if there is none.

    Args:
        eyes: disparities by either eye's pixels.
        rig: parallel pair.
        reach: metres of depth; what is farther does not block. Where nothing is nearer, the plane lies there.
        behind: metres of room that must be free behind the plane.
        about: surfaces continued more boldly, by which the rim is seen better; they prove nothing open.
    """
    disparity, focal_baseline = eyes.left, rig.left.fx * rig.baseline
    values = disparity.values + np.float32(rig.doffs)
    plane = nearest_plane(values, disparity.valid & (values > focal_baseline / reach))
    flat = plane or Plane(0.0, 0.0, focal_baseline / reach)
    front = open_in_plane(eyes, rig, flat, behind)
    circle = inscribed_circle(front & _seen_through(eyes, rig, flat, behind))
    if circle is None:
        return None
    mouth = _mouth(about or eyes, rig, flat, MOUTH_SHARE * behind)
    same = mouth is not None and math.dist(mouth.centre, circle.centre) < circle.radius_px
    mouth_px = mouth.diameter_px if mouth is not None and same else circle.diameter_px
    return Hole(circle, mouth_px, flat, _plane_sigma(disparity), plane is not None)


def _mouth(eyes: BothEyes, rig: StereoRig, plane: Plane, behind: float) -> Circle | None:
    """The circle of the plane within the opening's rim, whatever lies behind the middle of it.

    Of a small opening before a far background the left eye proves the left end of each row and the right eye
    the right end; what lies between is seen by one eye alone, and no thing of the plane. Nor is what nobody
    measured between what is proven and a measured rim: a rim is seen best on the plane's side.
    """
    proven = open_in_plane(eyes, rig, plane, behind)
    on_plane = _on_plane(eyes, rig, plane, behind)
    here = plane.over(proven.shape)
    far = np.where(eyes.left.valid & proven, eyes.left.values + np.float32(rig.doffs), np.float32(np.inf))
    hidden = float(np.max(here - np.minimum(far.min(), here.min())))
    mouth = proven | (_closed(proven, 1, math.ceil(max(hidden, 0.0)) + 1) & ~on_plane)
    circle = inscribed_circle(mouth)
    if circle is None:
        return None
    width = round(RIM_SHARE * circle.radius_px)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * width + 1, 2 * width + 1))
    about, beside = (cv2.dilate(mask.view(np.uint8), disc) > 0 for mask in (mouth, on_plane))
    return inscribed_circle(mouth | (about & beside & ~on_plane))


def _seen_through(eyes: BothEyes, rig: StereoRig, plane: Plane, behind: float) -> Mask:
    """Left pixels (H, W) of the plane straight behind which the air is open too: a hole has depth.

    Straight is away from the middle between the eyes: a plane's point moves by half of what its disparity
    loses, as in the eye that is not there.
    """
    middle = max(plane.at(rig.left.cx, rig.left.cy), 0.5)
    z = rig.left.fx * rig.baseline / middle
    share = z / (z + behind)
    back = Plane(plane.along * share, plane.down * share, plane.constant * share)
    opened = open_in_plane(eyes, rig, back, MOUTH_SHARE * behind).astype(np.float32)
    v, u = np.mgrid[: opened.shape[0], : opened.shape[1]].astype(np.float32)
    shifted = u - np.float32(0.5 * (1.0 - share)) * plane.over(opened.shape)
    found: Mask = cv2.remap(opened, shifted, v, cv2.INTER_NEAREST, borderValue=0.0) > 0.5
    return found


def nearest_plane(values: Floats, near: Mask) -> Plane | None:
    """The plane through most of the near pixels (H, W), robustly; None if there are too few.

    Starts from the level plane through the near pixels' median and keeps what lies ever closer to the fit.
    """
    rows, columns = np.nonzero(near)
    if len(rows) < FEWEST_PIXELS:
        return None
    step = max(1, len(rows) // MOST_PIXELS)
    rows, columns = rows[::step], columns[::step]
    d = values[rows, columns].astype(np.float64)
    basis = np.column_stack([columns, rows, np.ones(len(rows))])
    fit = np.array([0.0, 0.0, float(np.median(d))])
    for scale in np.geomspace(max(0.25 * fit[2], 4.0 * PLANE_PX), PLANE_PX, ROUNDS + 1):
        kept = np.abs(d - basis @ fit) < scale
        if kept.sum() < 30:
            return None
        fit = np.linalg.lstsq(basis[kept], d[kept], rcond=None)[0]
    return Plane(*(float(c) for c in fit))


def open_in_plane(eyes: BothEyes, rig: StereoRig, plane: Plane, behind: float) -> Mask:
    """Left pixels (H, W) at which the plane is proven open by a ray of either eye."""
    surface = _distance(eyes.left, rig)
    here = _distance_of(plane, rig, surface.shape)
    proven = (surface > here + np.float32(behind)) | _open_to_right_eye(eyes.right, rig, plane, behind)
    # Cracks between what one eye and what the other proves: narrower than anything that could stand there.
    return proven | (_closed(proven, CRACK_PX, CRACK_PX) & ~_on_plane(eyes, rig, plane, behind))


def _open_to_right_eye(right: Disparity, rig: StereoRig, plane: Plane, behind: float) -> Mask:
    """The same by the right eye's rays: each crosses the plane at another left pixel than its own column."""
    surface = _distance(right, rig)
    v, u = np.nonzero(surface > 0.0)
    # On the plane a left column u' is seen at u' - d(u', v) by the right eye.
    crossing = (u + plane.down * v + plane.constant - rig.doffs) / (1.0 - plane.along)
    column = np.rint(crossing).astype(np.intp)
    depth = np.maximum(plane.along * crossing + plane.down * v + plane.constant, 0.5)
    far = surface[v, u] > rig.left.fx * rig.baseline / depth + behind
    inside = (column >= 0) & (column < surface.shape[1])
    opened = np.zeros(surface.shape, np.bool_)
    opened[v[far & inside], column[far & inside]] = True
    # What hides a far surface from the right eye bars its ray.
    opened[v[~far & inside], column[~far & inside]] = False
    # Rays a column apart leave no room for a thing between them.
    return _closed(opened, 1, 3)


def _distance(disparity: Disparity, rig: StereoRig) -> Floats:
    """Metres of depth (H, W), 0 where nothing was measured."""
    values = np.maximum(disparity.values + np.float32(rig.doffs), np.float32(0.5))
    return np.where(disparity.valid, np.float32(rig.left.fx * rig.baseline) / values, np.float32(0.0))


def _distance_of(plane: Plane, rig: StereoRig, shape: tuple[int, ...]) -> Floats:
    """Metres of depth (H, W) of the plane at each left pixel."""
    here = np.maximum(plane.over(shape), np.float32(0.5))
    return np.asarray(rig.left.fx * rig.baseline / here, np.float32)


def _on_plane(eyes: BothEyes, rig: StereoRig, plane: Plane, behind: float) -> Mask:
    """Left pixels (H, W) measured at the plane, or before it."""
    surface = _distance(eyes.left, rig)
    found: Mask = eyes.left.valid & (surface < _distance_of(plane, rig, surface.shape) + np.float32(behind))
    return found


def _closed(opened: Mask, rows: int, columns: int) -> Mask:
    square = np.ones((rows, columns), np.uint8)
    return np.asarray(cv2.morphologyEx(opened.view(np.uint8), cv2.MORPH_CLOSE, square) > 0, np.bool_)


def surroundings(disparity: Disparity, rig: StereoRig, hole: Hole) -> float:
    """Share 0..1 of the pixels about the circle that are measured at its plane or behind it.

    A circle in the middle of nothing measured may be a window in a bare board nearer than any plane found.
    """
    (u, v), radius = hole.circle.centre, hole.circle.radius_px
    rows, columns = np.ogrid[: disparity.valid.shape[0], : disparity.valid.shape[1]]
    away = np.hypot(columns - u, rows - v) - radius - RIM_PX
    about = (away > 0.0) & (away < max(radius, RIM_PX))
    if not about.any():
        return 0.0
    values, bound = disparity.values + np.float32(rig.doffs), hole.plane.over(disparity.valid.shape)
    held = disparity.valid & (values < bound * NEARER_SHARE + PLANE_PX)
    return float(held[about].mean())


def _plane_sigma(disparity: Disparity) -> float:
    """Neighbouring pixels err together, so a plane is hardly surer than one of them."""
    if not disparity.valid.any():
        return float("inf")
    return float(np.median(disparity.sigma_px[disparity.valid]))


def measured_in_metres(hole: Hole, rig: StereoRig, edge_sigma_px: float) -> Measured:
    """Diameter and centre at the plane's distance; edge_sigma_px: of where one side of the rim is seen.

    Both follow from pixels times B / d (METHODS 10), so their sigmas join the rim's and the disparity's.

    >>> rig = StereoRig.parallel(352, 288, 408.0, 0.04)
    >>> plane = Plane(0.0, 0.0, 408.0 * 0.04 / 0.25)
    >>> found = measured_in_metres(Hole(Circle((176.0, 144.0), 81.6), 81.6, plane, 0.2, True), rig, 1.0)
    >>> round(found.diameter, 4), round(found.centre[2], 4)
    (0.05, 0.25)
    """
    u, v = hole.circle.centre
    d = max(hole.plane.at(u, v), 0.5)
    pixel, share = rig.baseline / d, hole.sigma_px / d
    z, diameter = rig.left.fx * pixel, hole.mouth_px * pixel
    centre = z * (u - rig.left.cx) / rig.left.fx, z * (v - rig.left.cy) / rig.left.fy, z
    sigma = math.hypot(math.sqrt(2.0) * edge_sigma_px * pixel, diameter * share)
    return Measured(
        diameter, hole.circle.diameter_px * pixel, sigma, centre, math.hypot(edge_sigma_px * pixel, z * share)
    )
