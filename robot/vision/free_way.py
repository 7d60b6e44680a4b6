"""Where the robot may go by one look of both eyes: one object, one answer (`FreeSpace`).

`FreeWayFinder` is the base's, `HandWayFinder` the hand's, which has no floor. The base has several witnesses,
and these are the rules by which they agree:

1. Floor is free only where the dense map measured floor (`freespace`). No other witness makes floor free:
   what none of them sees stays unknown, and unknown is not free.
2. An obstacle of any witness ends the sector it stands in, whatever the others say: cells of the dense map
   (things, and edges where the floor's height jumps), corners off the ground plane (`ground`), and what ends
   several rays of one direction before they reach the floor (`plan.standing_points`: so a sill ends a sector
   before a cell has seen enough of it). Each asks for several pixels that agree before it speaks: that keeps
   floor lines and false matches from being obstacles. A sector ends too where most of its directions lose the
   floor: a post that nobody measured. Corners also bar the air behind them.
3. Only cells and corners are told as obstacle points: they are sure enough of a place to be kept in a map.
4. Floor that is first seen well beyond the picture's lower edge is not free: a step before it is not in view.
5. A passage is where the air is empty over the body's height (`opening`). It is safe only if the body's
   width, with a margin for what the measurement may be off, is measured to be empty there, from a little
   before it to half a body behind it, if the picture shows the body's height there, and if the free floor of
   rules 1 to 4 reaches it along the body's width. Where one side is seen less well the way keeps off it.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from calib.model import HeadMount, StereoRig
from robot.messages import FreeSpace, Image, Passage, Points
from robot.vision import freespace, hole, sectors
from robot.vision.both_eyes import BothEyes, plates_continued, see
from robot.vision.carving import Air, carve
from robot.vision.disparity import Disparity, Matcher
from robot.vision.floor_aligned import FloorAlignedMatcher
from robot.vision.freespace import FloorLimits
from robot.vision.ground import GroundLimits, find_obstacles
from robot.vision.opening import Needed, floor_reaches, way_through, widest_opening
from robot.vision.plan import Plan, barred_by, ends, outline, standing_points
from robot.vision.section import BoxSection, RoundSection

SIGMAS = 2.0
"""A section fits if it is smaller than the opening by so many standard deviations."""
RANGE_SIGMA_PX = 0.2
"""Of the disparity an opening's distance comes from."""
SEEN_HEIGHT_SHARE = 0.95
"""Of the body's height that the picture must show; the rest is what half a degree of pitch may hide."""
FIRST_FLOOR_M = 0.3
"""Free floor begins within so much of the picture's lower edge."""
FOOT_M = 0.45
"""What stands so near the eyes is told by the floor's cells: edges are sought where openings are."""
EDGE_SIGMA_PX, PROVEN_SIGMA_PX = 1.5, 0.5
"""Of where an opening's side is seen; of where the air before it ends to be proven, which is never beyond."""
HAND_REACH_M, HAND_BEHIND_M = 0.5, 0.03
"""What is farther does not block a hand; so much room must be free behind the mouth of an opening."""
RIM_SIGMA_PX, LEAST_RADIUS_PX = 1.0, 3.0
"""Of where an opening's rim is seen by a hand's eyes; smaller circles are no openings."""
HELD_SHARE = 0.4
"""Of what is beside a circle so much must be measured: amid nothing measured it may be smaller."""


class FreeWayFinder:
    """Free floor, obstacles and passage for a base of a given cross-section.

    Args:
        rig: parallel pair.
        mount: where the head sits.
        section: what must pass.
        matcher: finds disparities of a rectified pair; see `robot.vision.disparity`.
        step_height: metres; what stands up or falls away so much is an obstacle, to every witness;
            a corner counts from half of it on.

    >>> from robot.vision.stereo import AdaptiveWeightMatcher
    >>> rig, section = StereoRig.parallel(352, 288, 305.0, 0.06), BoxSection(0.26, 0.32)
    >>> finder = FreeWayFinder(rig, HeadMount(), section, AdaptiveWeightMatcher.lite())
    >>> dark = np.zeros((288, 352, 3), np.uint8)
    >>> seen = finder(dark, dark, 0.0, 0.35)
    >>> seen.passage, bool((seen.free > seen.near).any())
    (None, False)
    """

    def __init__(
        self,
        rig: StereoRig,
        mount: HeadMount,
        section: BoxSection,
        matcher: Matcher,
        step_height: float = 0.03,
    ) -> None:
        self._rig, self._mount, self._section = rig, mount, section
        self._floor = FloorLimits(step_height, section.height)
        self._ground = GroundLimits(step_height, section.height)
        self._matcher = FloorAlignedMatcher(matcher, rig, mount)

    def __call__(self, left: Image, right: Image, pan: float, tilt: float) -> FreeSpace:
        """One look: rectified BGR or grey uint8 pictures (H, W[, 3]), the head at pan, tilt (radians).

        Raises:
            ValueError: pictures that are no pair, or not of the rig's size.
        """
        corners = find_obstacles(left, right, self._rig, self._mount, pan, tilt, self._ground).points
        disparity = self._matcher(left, right, pan, tilt)
        eyes = see(disparity, left, right, self._rows_of_air(tilt))
        return self.joined(disparity, eyes, corners, pan, tilt)

    def joined(
        self, disparity: Disparity, eyes: BothEyes, corners: Points, pan: float, tilt: float
    ) -> FreeSpace:
        """The answer from what was measured.

        disparity: the left picture's, for the floor; eyes: its surfaces continued to their edges, for the
        air; corners: points (N, 3) off the ground, robot frame.
        """
        rig, mount, floor_limits = self._rig, self._mount, self._floor
        look = freespace.looked(disparity, rig, mount, pan, tilt, floor_limits)
        floor = freespace.from_look(look, rig, mount, floor_limits)
        floor = sectors.merge(sectors.merge(floor, floor.obstacles), corners)
        heights = (floor_limits.step_height, self._section.height)
        air = carve(eyes, rig, mount, pan, tilt, look.level, heights)
        plan = barred_by(outline(air), corners)
        floor = sectors.ended_for_most(sectors.ended_by(floor, standing_points(air)), ends(plan))
        floor = sectors.begun_near(floor, self._first_seen(tilt) + FIRST_FLOOR_M)
        return replace(floor, passage=self._passage(air, plan, floor, pan, tilt))

    def _rows_of_air(self, tilt: float) -> int:
        """Rows of the picture from the top that look at something `FOOT_M` before the eyes or farther."""
        _, eye = self._mount.left_eye(0.0, tilt)
        camera = self._rig.left
        down = math.tan(math.atan2(float(eye[2]), FOOT_M) - tilt)
        return int(np.clip(camera.cy + camera.fy * down, 1, camera.height))

    def _first_seen(self, tilt: float) -> float:
        """Where the floor straight before the head comes into the picture, metres from the origin."""
        rotation, eye = self._mount.left_eye(0.0, tilt)
        camera = self._rig.left
        ray = rotation @ np.array([0.0, (camera.height - 1 - camera.cy) / camera.fy, 1.0])
        return float(eye[0] + eye[2] / max(-ray[2], 0.05) * ray[0])

    def _passage(self, air: Air, plan: Plan, floor: FreeSpace, pan: float, tilt: float) -> Passage | None:
        width, height = self._section.width, self._section.height
        found = widest_opening(plan, width)
        if found is None:
            return None
        forward = found.distance - float(plan.eye[0])
        scale = RANGE_SIGMA_PX * forward / (self._rig.left.fx * self._rig.baseline)
        both_edges = math.sqrt(2.0) * forward / self._rig.left.fx
        across = math.hypot(EDGE_SIGMA_PX * both_edges, found.width * scale)
        slack = SIGMAS * math.hypot(PROVEN_SIGMA_PX * both_edges, width * scale)
        needed = Needed(width, width + slack, width + SIGMAS * across, 0.5 * width)
        way = way_through(air, plan, found, needed)
        x, y = way.place if way is not None else found.middle
        z, camera = 0.5 * height, self._rig.left
        rotation, eye = self._mount.left_eye(pan, tilt)
        right, down, depth = (float(c) for c in rotation.T @ (np.array([x, y, z]) - eye))
        centre = camera.cx + camera.fx * right / depth, camera.cy + camera.fy * down / depth
        safe = (
            way is not None
            and found.top >= SEEN_HEIGHT_SHARE * height
            and floor_reaches(floor, way.bearing, way.distance + 0.5 * width, width)
        )
        radius_px = 0.5 * found.width * camera.fx / depth
        sigma = math.hypot(0.5 * across, scale * depth)
        return Passage(centre, radius_px, found.width, (x, y, z), across, sigma, safe)


class HandWayFinder:
    """The passage before a hand that carries the eyes: the largest open circle of the plane before it.

    There is no floor: bearings are empty, obstacles too. `Passage.position` is in the frame of the mount.

    Args:
        rig: parallel pair.
        mount: how the eyes hang on the hand.
        section: what must pass.
        matcher: finds disparities; it must search as far as the nearest thing the hand can meet.

    >>> from robot.vision.stereo import AdaptiveWeightMatcher
    >>> rig, mount = StereoRig.parallel(352, 288, 408.0, 0.04), HeadMount(0.0, 0.0, 0.0, 0.04)
    >>> finder = HandWayFinder(rig, mount, RoundSection(0.05), AdaptiveWeightMatcher.lite(176))
    >>> grey = np.full((288, 352), 120, np.uint8)
    >>> finder(grey, grey, 0.0, 0.0).passage is None
    True
    """

    def __init__(self, rig: StereoRig, mount: HeadMount, section: RoundSection, matcher: Matcher) -> None:
        self._rig, self._mount, self._section, self._matcher = rig, mount, section, matcher

    def __call__(self, left: Image, right: Image, pan: float, tilt: float) -> FreeSpace:
        """One look: rectified BGR or grey uint8 pictures (H, W[, 3]), the head at pan, tilt (radians).

        Raises:
            ValueError: pictures that are no pair, or not of the rig's size.
        """
        eyes = see(self._matcher(left, right), left, right)
        return self.joined(eyes, pan, tilt, plates_continued(eyes, left, right))

    def joined(self, eyes: BothEyes, pan: float, tilt: float, about: BothEyes | None = None) -> FreeSpace:
        """The answer from what both eyes see; about: the same, continued upwards and downwards, for the rim.

        Raises:
            ValueError: the disparity maps have not the rig's size.
        """
        freespace.check_size(eyes.left, self._rig)
        none = np.zeros(0)
        passage = self._passage(eyes, about, pan, tilt)
        return FreeSpace(none, none, none, np.zeros((0, 2)), passage)

    def _passage(self, eyes: BothEyes, about: BothEyes | None, pan: float, tilt: float) -> Passage | None:
        found = hole.largest_hole(eyes, self._rig, HAND_REACH_M, HAND_BEHIND_M, about)
        if found is None or found.circle.radius_px < LEAST_RADIUS_PX:
            return None
        held = hole.surroundings(eyes.left, self._rig, found) >= HELD_SHARE
        if not held and not found.bounded:
            return None  # nothing tells how far away the circle is, and so how large
        measured = hole.measured_in_metres(found, self._rig, RIM_SIGMA_PX)
        rotation, eye = self._mount.left_eye(pan, tilt)
        x, y, z = (float(c) for c in eye + rotation @ np.array(measured.centre))
        needed = self._section.diameter + SIGMAS * measured.sigma_diameter
        return Passage(
            found.circle.centre, 0.5 * found.mouth_px, measured.diameter, (x, y, z),
            measured.sigma_diameter, measured.sigma_centre, held and measured.clear >= needed,
        )  # fmt: skip
