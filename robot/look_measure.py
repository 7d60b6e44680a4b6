"""What `robot look` measures on one pair of pictures. Pure: pictures in, values out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from calib.model import HeadMount, StereoRig
from calib.rectify import Rectifier, rectifier
from robot.config import Base
from robot.errors import UserError
from robot.messages import Box, Detection, FreeSpace, Image, Passage
from robot.vision import passage
from robot.vision.found_floor import FoundFloor, find_floor
from robot.vision.free_way import FreeWayFinder
from robot.vision.pair_check import check_pair, complaint
from robot.vision.pair_flipped import flipped
from robot.vision.ranging import range_box
from robot.vision.section import BoxSection
from robot.vision.stereo import AdaptiveWeightMatcher, Disparity

SEARCHED_SHARE = 0.25
"""Disparities searched, as a share of the picture's width."""
NEAREST_M = 0.2
PASSAGE_BEYOND_M = 1.5
"""What is farther is free to go, as far as the picture can tell; raised where everything is farther."""
CALIBRATION_SIGMA_PX = 0.15
"""What the calibration of a real pair leaves in the disparities; no single match can see it."""
BODY = BoxSection(2.0 * Base().radius_m, Base().body_height_m)
"""What is asked to pass: the robot on wheels as its config describes it by default."""
MOST_ROLL = math.radians(4.0)
"""A camera held more aslant would take the floor's one side for a step."""
FOREGROUND_DEPTH = 1.3
"""What lies within this factor of the nearest surface belongs to the foreground."""

Depths = NDArray[np.float64]


class Finds(Protocol):
    """What a taught target can do for us."""

    def predict(self, image: Image) -> Sequence[Detection]:
        """All places in the picture that look like the target, best first."""
        ...


@dataclass(frozen=True, slots=True)
class Sight:
    """One box and how far its middle is.

    distance, sigma in metres along the optical axis, None where it cannot be told; dense is the second
    opinion, the median of the dense map about the middle; bearing in radians, positive to the left.
    """

    box: Box
    label: str
    bearing: float
    distance: float | None
    sigma: float | None
    dense: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """Everything measured on a pair: rectified left picture, disparity, boxes, and where there is room to go.

    rig is the rectified pair's. floor: how the camera hangs over the floor, where one was found; ways: what
    stands on it and where a base would pass, positions from the point of the floor under the middle of both
    eyes. passage: only where there are no ways, the largest hole beyond `beyond` metres; its position is in
    the left camera's axes turned to x forward, y left, z up. complaint: what is wrong with the pair, in one
    line.
    """

    picture: Image
    disparity: Disparity
    rig: StereoRig
    sights: tuple[Sight, ...]
    passage: Passage | None
    beyond: float
    floor: FoundFloor | None = None
    ways: FreeSpace | None = None
    complaint: str | None = None


def look(
    left: Image, right: Image, rig: StereoRig, box: Box | None = None, target: Finds | None = None
) -> Look:
    """Measure a pair: the box if one is given, else every place the target is found at, and the way ahead.

    left, right: (H, W, 3) BGR uint8 of the rig's size, as the cameras gave them; box in pixels of that left
    picture. Raises UserError for a box whose middle is outside, and for exchanged, mirrored, turned or
    doubled pictures.
    """
    straight = rectifier(rig)
    flat_left, flat_right = straight(left, right)
    check = check_pair(flat_left, flat_right, straight.rig)
    wrong = complaint(check)
    no_pair = wrong if check.swapped else flipped(flat_left, flat_right, straight.rig)
    if no_pair is not None:
        raise UserError(no_pair)
    marked = () if box is None else (Detection(_moved(box, straight), 1.0, ""),)
    found = marked if target is None else tuple(target.predict(flat_left))
    matcher = AdaptiveWeightMatcher.fine(searched_disparities(straight.rig))
    disparity = matcher(flat_left, flat_right)
    sights = tuple(
        _sight(flat_left, flat_right, place, straight.rig, disparity, matcher.disparities) for place in found
    )
    beyond = _beyond(disparity, straight.rig)
    wide = AdaptiveWeightMatcher.floors(matcher.disparities)
    floor = find_floor(wide(flat_left, flat_right), straight.rig)
    ways = None if floor is None else _ways(flat_left, flat_right, straight.rig, floor, wide)
    hole = free_passage(disparity, straight.rig, beyond) if ways is None else None
    return Look(flat_left, disparity, straight.rig, sights, hole, beyond, floor, ways, wrong)


def mount_over(floor: FoundFloor, rig: StereoRig) -> HeadMount:
    """A head that holds the eyes where the floor was found; the origin is under the middle of both eyes."""
    return HeadMount(0.0, floor.height, 0.0, rig.baseline)


def _ways(
    left: Image, right: Image, rig: StereoRig, floor: FoundFloor, matcher: AdaptiveWeightMatcher
) -> FreeSpace | None:
    """What stands on the floor and where the base would pass; None for a camera held aslant."""
    if abs(floor.roll) > MOST_ROLL:
        return None
    return FreeWayFinder(rig, mount_over(floor, rig), BODY, matcher)(left, right, 0.0, floor.tilt)


def searched_disparities(rig: StereoRig) -> int:
    """A multiple of 16: a quarter of the width, but no nearer than `NEAREST_M`.

    >>> searched_disparities(StereoRig.parallel(352, 288, 305.0, 0.06))
    96
    """
    most = min(SEARCHED_SHARE * rig.left.width, rig.left.fx * rig.baseline / NEAREST_M - rig.doffs)
    return 16 * max(math.ceil(most / 16), 1)


def depths(disparity: Disparity, rig: StereoRig) -> Depths:
    """Z in metres of every pixel (H, W); NaN where nothing was measured."""
    z = rig.depth(disparity.values.astype(np.float64))
    return np.where(disparity.valid & np.isfinite(z), z, np.nan)


def free_passage(disparity: Disparity, rig: StereoRig, beyond: float) -> Passage | None:
    """The largest circle of pixels measured farther than `beyond` metres; None if there is none to speak of.

    [T] (METHODS 10): what was not measured is not free, and the picture's border blocks. Where the camera
    hangs is not known here, so the floor counts like anything else.
    """
    free = passage.doubts_opened(passage.farther_than(disparity, rig, beyond), disparity.valid)
    circle = passage.inscribed_circle(free)
    if circle is None or circle.radius_px < passage.MIN_RADIUS_PX:
        return None
    rim = passage.rim_disparity(circle, disparity, rig, free)
    if rim is None:
        return None
    right, down, forward = passage.centre_in_camera(circle, rim, rig)
    diameter = passage.metric_diameter(circle, rim, rig)
    return Passage(circle.centre, circle.radius_px, diameter, (forward, -right, -down))


def _sight(
    left: Image, right: Image, place: Detection, rig: StereoRig, disparity: Disparity, searched: int
) -> Sight:
    nearest = rig.left.fx * rig.baseline / (searched + rig.doffs)
    measured = range_box(left, right, place.box, rig, HeadMount(), 0.0, 0.0, nearest, CALIBRATION_SIGMA_PX)
    bearing = rig.left.bearing(place.box.centre[0])
    dense = _dense(depths(disparity, rig), place.box)
    if measured is None:
        return Sight(place.box, place.label, bearing, None, None, dense)
    return Sight(place.box, place.label, bearing, measured.distance, measured.sigma, dense)


def _dense(z: Depths, box: Box) -> float | None:
    """Median depth about the box's middle, if at least a fifth of it was measured."""
    u, v = box.centre
    half_u, half_v = max(0.15 * box.w, 2.0), max(0.15 * box.h, 2.0)
    window = z[max(int(v - half_v), 0) : int(v + half_v) + 1, max(int(u - half_u), 0) : int(u + half_u) + 1]
    known = window[np.isfinite(window)]
    return float(np.median(known)) if len(known) > window.size / 5 else None


def _beyond(disparity: Disparity, rig: StereoRig) -> float:
    """From where on is free: `PASSAGE_BEYOND_M`, or behind the foreground where all is farther than that."""
    z = depths(disparity, rig)
    known = z[np.isfinite(z)]
    nearest = float(np.percentile(known, 5.0)) if len(known) else 0.0
    return FOREGROUND_DEPTH * nearest if nearest > PASSAGE_BEYOND_M else PASSAGE_BEYOND_M


def _moved(box: Box, straight: Rectifier) -> Box:
    """The box in the rectified picture. Raises UserError if its middle is not in the picture."""
    eye = straight.source.left
    u, v = box.centre
    if not (0 <= u < eye.width and 0 <= v < eye.height):
        raise UserError(
            f"--box {box.x:g},{box.y:g},{box.w:g},{box.h:g}: its middle is outside the picture; "
            f"give a box inside {eye.width}x{eye.height} pixels"
        )
    corners = straight.left_points(np.array([[box.x, box.y], [box.x + box.w, box.y + box.h]]))
    (x0, y0), (x1, y1) = corners
    return Box(float(x0), float(y0), float(x1 - x0), float(y1 - y0))
