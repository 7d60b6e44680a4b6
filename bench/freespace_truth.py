"""What truly stands in a simulated view, and whether a body that goes where it was told would touch it.

Plain geometry of what was drawn; nothing of the vision code takes part. Robot frame: x forward, y left, z up,
origin on the floor below the middle of the axle (base) or midway between the eyes (hand). Metres and radians.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bench.freespace_geometry import (
    Array,
    Edge,
    Plate,
    Point,
    before_edge,
    beside,
    footprint,
    radius_beside,
    radius_in_plate,
    ray_to_outline,
)
from robot.sim.solids import Solid
from robot.vision.section import BoxSection, RoundSection

STEP_M = 0.03
"""What stands up so much or falls away so much stops wheels."""
PLANE_HEIGHT_M = 0.35
"""What hangs higher than this above the floor does not end free floor (`FloorLimits.body_height`)."""
BASE_BEYOND_M, HAND_BEYOND_M = 0.13, 0.025
"""So far beyond the passage's plane a body goes on straight."""
SPARE = 1.15
"""A gap this much wider than the body must be called safe."""
SEEN_SPARE = 1.03
"""A passage can be called safe only if the picture shows this share of the body's height at its place."""
REACH_M = 1.0
"""Without a gap a body has a way if it can drive straight so far."""
BASE, HAND = BoxSection(0.26, 0.32), RoundSection(0.05)
"""What has to pass: the base with its wheels and mast; the hand's head."""


@dataclass(frozen=True, slots=True)
class Gap:
    """The opening that is meant: clear width (diameter) across it, centre at its mouth, clear height.

    height: of the opening, inf where nothing bounds it above. yaw: how far its plane is turned. slack: how
    far the centre of a circle of this width may lie off to the side and up and be as right (a long slot).
    """

    width: float
    centre: Point
    height: float = math.inf
    yaw: float = 0.0
    slack: tuple[float, float] = (0.0, math.inf)


@dataclass(frozen=True, slots=True)
class FloorTruth:
    """All that stands on the floor about a base, for a body that drives straight.

    gap: the passage that is meant, if the view shows one. open_to: so far ahead (metres) nothing stands in
    the way over all of the view; 0 where something does. seen_height: so high above the floor the picture
    shows the passage's place. view: bearings (right, left) between which the picture shows the floor.
    """

    solids: tuple[Solid, ...]
    edge: Edge | None = None
    gap: Gap | None = None
    open_to: float = 0.0
    seen_height: float = math.inf
    view: tuple[float, float] = (-0.4, 0.4)

    def touches(self, position: Point, section: BoxSection) -> bool:
        """Would a body of `section`, driving straight at `position` and 0.13 m beyond it, touch anything?

        The swept box is `section.width` wide about the line from the origin, from the step height to
        `section.height` high. Falling over an edge counts.

        Raises:
            ValueError: the position is not finite.

        >>> post = Solid("cylinder", 1.0, 0.14, 0.0, 0.02, 0.02, 0.0, 1.0)
        >>> there = FloorTruth((post,))
        >>> there.touches((0.9, 0.0, 0.2), BASE), there.touches((0.8, 0.0, 0.2), BASE)
        (True, False)
        """
        if not all(math.isfinite(c) for c in position):
            raise ValueError(f"a passage lies at a finite place, got {position}")
        bearing = math.atan2(position[1], position[0])
        length = math.hypot(position[0], position[1]) + BASE_BEYOND_M
        return self.corridor(bearing, length, section.height) < section.width

    def corridor(self, bearing: float, length: float, height: float) -> float:
        """Width of the widest body of this height that drives straight along `bearing` for `length` metres.

        inf where nothing stands to either side, 0 where something stands on the line itself.
        """
        clear = [
            beside(footprint(s), bearing, length)
            for s in self.solids
            if s.bottom < height and s.top >= STEP_M
        ]
        if self.edge is not None and self.edge.drop >= STEP_M:
            clear.append(before_edge(self.edge, bearing, length))
        return 2.0 * min(clear, default=math.inf)

    def may_pass(self, section: BoxSection) -> bool:
        """True if the body has any straight way in view at all: else no passage may be called safe."""
        if self.gap is not None and self.gap.width >= section.width:
            return True
        reach = self.open_to or REACH_M
        if self.gap is not None:
            reach = math.hypot(*self.gap.centre[:2]) + BASE_BEYOND_M
        bearings = np.linspace(*self.view, 41)
        return any(self.corridor(float(b), reach, section.height) >= section.width for b in bearings)

    def must_pass(self, section: BoxSection) -> bool:
        """True if it must be called safe: 15 % wider than the body, straight ahead, wholly in view."""
        if self.seen_height < SEEN_SPARE * section.height:
            return False
        if self.gap is None:
            return self.open_to > 0.0
        x, y, _ = self.gap.centre
        straight = self.corridor(math.atan2(y, x), math.hypot(x, y) + BASE_BEYOND_M, section.height)
        return min(self.gap.width, straight) >= SPARE * section.width

    def free_distances(self, bearings: Array) -> Array:
        """How far the floor is really free along each bearing (N,) from the origin, metres; inf: no end."""
        ends = np.full(len(bearings), np.inf)
        for solid in self.solids:
            if solid.bottom < PLANE_HEIGHT_M and solid.top >= STEP_M:
                ends = np.minimum(ends, ray_to_outline(bearings, footprint(solid)))
        if self.edge is not None and self.edge.drop >= STEP_M:
            towards = np.cos(bearings - self.edge.yaw)
            ends = np.where(
                towards > 1e-9, np.minimum(ends, self.edge.distance / np.maximum(towards, 1e-9)), ends
            )
        return ends

    def distance_to(self, points: Array) -> Array:
        """Distance on the floor from points (N, 2) to the nearest thing that ends free floor."""
        x, y = np.asarray(points, np.float64).reshape(-1, 2).T
        away = np.full(len(x), np.inf)
        for solid in self.solids:
            if solid.bottom < PLANE_HEIGHT_M and solid.top >= STEP_M:
                away = np.minimum(away, solid.distance(x, y))
        if self.edge is not None and self.edge.drop >= STEP_M:
            beyond = x * math.cos(self.edge.yaw) + y * math.sin(self.edge.yaw) - self.edge.distance
            away = np.minimum(away, np.maximum(-beyond, 0.0))
        return away


@dataclass(frozen=True, slots=True)
class HandTruth:
    """All that stands before a hand that looks along its approach, for a head that moves straight.

    whole: the picture shows all of the opening. open_to: see `FloorTruth`.
    """

    solids: tuple[Solid, ...]
    plate: Plate | None = None
    gap: Gap | None = None
    open_to: float = 0.0
    whole: bool = True

    def touches(self, position: Point, section: RoundSection) -> bool:
        """Would a cylinder of the section, moving straight at `position` and 25 mm beyond, touch anything?

        The cylinder's axis runs from the middle between the eyes (the origin) through the position.

        Raises:
            ValueError: the position is not finite or is the origin.
        """
        way = np.asarray(position, np.float64)
        away = float(np.linalg.norm(way))
        if not math.isfinite(away) or away == 0.0:
            raise ValueError(f"a passage lies at a finite place away from the eyes, got {position}")
        return self.clear_diameter(way / away, away + HAND_BEYOND_M) < section.diameter

    def clear_diameter(self, direction: Array, length: float) -> float:
        """Diameter of the widest cylinder that moves from the origin along the unit vector for `length`."""
        radius = min((radius_beside(s, direction, length) for s in self.solids), default=math.inf)
        if self.plate is not None:
            radius = min(radius, radius_in_plate(self.plate, direction, length))
        return 2.0 * radius

    def may_pass(self, section: RoundSection) -> bool:
        """True if the opening is as wide as the head."""
        return self.gap.width >= section.diameter if self.gap is not None else self.open_to > 0.0

    def must_pass(self, section: RoundSection) -> bool:
        """True if it must be called safe: 15 % wider than the head, straight ahead, wholly in view."""
        if self.gap is None:
            return self.open_to > 0.0
        centre = np.array(self.gap.centre)
        away = float(np.linalg.norm(centre))
        straight = self.clear_diameter(centre / away, away + HAND_BEYOND_M)
        return self.whole and min(self.gap.width, straight) >= SPARE * section.diameter


Truth = FloorTruth | HandTruth
