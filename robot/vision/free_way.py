"""One answer of both eyes to where the robot may go: the dense floor, the ground-plane test and the passage.

"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from calib.model import HeadMount, StereoRig
from robot.messages import FreeSpace, Image, Passage
from robot.vision import freespace
from robot.vision.carving import carve
from robot.vision.freespace import FloorLimits
from robot.vision.ground import find_obstacles
from robot.vision.levelling import FloorLevel
from robot.vision.opening import Opening, floor_reaches, widest_opening
from robot.vision.section import BoxSection
from robot.vision.stereo import Disparity, FloorAlignedMatcher, Matcher

SIGMAS = 2.0


@dataclass(frozen=True, slots=True)
class WayLimits:
    """What counts as floor, and how much room must be left."""

    floor: FloorLimits = FloorLimits()
    edge_sigma_px: float = 0.7


class FreeWayFinder:
    def __init__(self, rig: StereoRig, mount: HeadMount, section: BoxSection, matcher: Matcher, limits: WayLimits | None = None) -> None:
        self._rig, self._mount, self._section = rig, mount, section
        self._matcher = FloorAlignedMatcher(matcher, rig, mount)
        self._limits = limits or WayLimits()

    def __call__(self, left: Image, right: Image, pan: float, tilt: float) -> FreeSpace:
        disparity = self._matcher(left, right, pan, tilt)
        return self.joined(disparity, left, right, pan, tilt)

    def joined(self, disparity, left, right, pan, tilt):
        rig, mount = self._rig, self._mount
        level = freespace.floor_level(disparity, rig, mount, pan, tilt, self._limits.floor)
        floor = freespace.free_space(disparity, rig, mount, pan, tilt, self._limits.floor)
        floor = freespace.merge(floor, floor.obstacles)
        points = find_obstacles(left, right, rig, mount, pan, tilt).points
        floor = freespace.merge(floor, points)
        return replace(floor, passage=self._passage(disparity, floor, level, pan, tilt))

    def _passage(self, disparity, floor, level, pan, tilt):
        section = self._section
        plan = carve(disparity, self._rig, self._mount, pan, tilt, level, (self._limits.floor.step_height, section.height))
        found = widest_opening(plan, 0.5 * section.width)
        if found is None:
            return None
        rotation, eye = self._mount.left_eye(pan, tilt)
        position = np.array([*found.middle, 0.5 * section.height])
        x, y, z = rotation.T @ (position - eye)
        camera = self._rig.left
        centre = camera.cx + camera.fx * x / z, camera.cy + camera.fy * y / z
        edge = z / camera.fx * self._limits.edge_sigma_px * math.sqrt(2.0)
        d = camera.fx * self._rig.baseline / z
        sigma = math.hypot(edge, found.width * 0.2 / d)
        room = found.room >= section.width + SIGMAS * sigma
        high = found.top >= 0.95 * section.height
        reaches = floor_reaches(floor, found.bearing, found.distance, section.width)
        global DEBUG; DEBUG=f"room {found.room:.3f} high {found.top:.2f} reach {reaches}"
        return Passage(centre, 0.5 * found.width * camera.fx / z, found.width, (*found.middle, 0.5 * section.height), sigma, math.hypot(0.5 * sigma, z * 0.2 / d), bool(room and high and reaches))
