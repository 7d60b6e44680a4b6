"""Geometry of the free-space bench's truth: upright boxes and cylinders, a pierced plate, a floor's edge.

Metres and radians, robot frame: x forward, y left, z up. Bearings are positive to the left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot.sim.solids import Solid

Array = NDArray[np.float64]
Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Edge:
    """The floor ends where x cos(yaw) + y sin(yaw) reaches `distance`; behind it lies `drop` metres lower."""

    distance: float
    yaw: float
    drop: float


@dataclass(frozen=True, slots=True)
class Plate:
    """An upright plate with one round opening. `centre`: of the opening in the face towards the robot.

    The plate's normal points away from the robot, turned by `yaw`; `half` is half the side of the square.
    """

    centre: Point
    yaw: float
    radius: float
    thickness: float
    half: float


# ------------------------------------------------------------------------------------ seen from above


def footprint(solid: Solid) -> Array:
    """Corners (N, 2) seen from above; a cylinder as the polygon of 64 sides about it."""
    if solid.kind == "box":
        return np.array(solid.outline)
    angles = np.arange(64) * (math.tau / 64)
    radius = solid.half_x / math.cos(math.pi / 64)
    return np.column_stack([solid.x + radius * np.cos(angles), solid.y + radius * np.sin(angles)])


def beside(corners: Array, bearing: float, length: float) -> float:
    """How near a convex outline comes sideways to the line of `length` along `bearing`; inf: never."""
    c, s = math.cos(bearing), math.sin(bearing)
    local = np.column_stack([c * corners[:, 0] + s * corners[:, 1], c * corners[:, 1] - s * corners[:, 0]])
    within = _clip(_clip(local, 0.0, 1.0), length, -1.0)
    if not len(within):
        return math.inf
    low, high = float(within[:, 1].min()), float(within[:, 1].max())
    return max(low, -high, 0.0)


def _clip(polygon: Array, bound: float, sign: float) -> Array:
    """The part of a convex polygon (N, 2) where sign (first coordinate - bound) >= 0 (Sutherland-Hodgman)."""
    kept = []
    for here, there in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        a, b = sign * (here[0] - bound), sign * (there[0] - bound)
        if a >= 0.0:
            kept.append(here)
        if (a >= 0.0) != (b >= 0.0):
            kept.append(here + a / (a - b) * (there - here))
    return np.array(kept).reshape(-1, 2)


def before_edge(edge: Edge, bearing: float, length: float) -> float:
    """Half the width of a body that drives along `bearing` for `length` and stays before the edge."""
    ahead = length * math.cos(bearing - edge.yaw)
    aside = abs(math.sin(bearing - edge.yaw))
    spare = edge.distance - max(ahead, 0.0)
    if spare <= 0.0:
        return 0.0
    return spare / aside if aside > 1e-12 else math.inf


def ray_to_outline(bearings: Array, corners: Array) -> Array:
    """Distance from the origin along each bearing to a convex outline; inf: missed, 0: inside it."""
    x, y = corners.T
    next_x, next_y = np.roll(corners, -1, axis=0).T
    if (x * next_y - y * next_x >= 0.0).all():
        return np.zeros(len(bearings))
    far = np.full(len(bearings), np.inf)
    dx, dy = np.cos(bearings), np.sin(bearings)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        e = b - a
        cross = dx * e[1] - dy * e[0]
        safe = np.where(np.abs(cross) > 1e-12, cross, np.inf)
        along, share = (a[0] * e[1] - a[1] * e[0]) / safe, (a[0] * dy - a[1] * dx) / safe
        hit = np.isfinite(safe) & (along >= 0.0) & (share >= 0.0) & (share <= 1.0)
        far = np.where(hit, np.minimum(far, along), far)
    return far


# --------------------------------------------------------------------------------- along a hand's way


def radius_beside(solid: Solid, direction: Array, length: float) -> float:
    """Smallest distance from the axis to the part of the solid that lies beside it; inf: no such part.

    The part between the cylinder's two ends is a convex body; seen along the axis it is the hull of its
    corners, and the distance from the axis is that of a point from a convex polygon: exact for boxes.
    """
    floor = footprint(solid)
    count = len(floor)
    corners = np.vstack([np.column_stack([floor, np.full(count, z)]) for z in (solid.bottom, solid.top)])
    along = corners @ direction
    ring = np.arange(count)
    edges = np.vstack(
        [
            np.column_stack([ring, np.roll(ring, -1)]),
            np.column_stack([ring, np.roll(ring, -1)]) + count,
            np.column_stack([ring, ring + count]),
        ]
    )
    kept = [corners[(along >= 0.0) & (along <= length)]]
    for end in (0.0, length):
        a, b = along[edges[:, 0]] - end, along[edges[:, 1]] - end
        cut = (a * b) < 0.0
        share = (a[cut] / (a[cut] - b[cut]))[:, None]
        kept.append(corners[edges[cut, 0]] * (1.0 - share) + corners[edges[cut, 1]] * share)
    points = np.vstack(kept)
    if not len(points):
        return math.inf
    right = np.cross(direction, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    flat = np.column_stack([points @ right, points @ np.cross(right, direction)])
    return _origin_to_hull(flat)


def _origin_to_hull(points: Array) -> float:
    """Distance from (0, 0) to the convex hull of points (N, 2), 0 inside.

    The farthest any line can separate the origin from the points: the largest, over directions, of the
    smallest projection. It is reached towards a point or across an edge between two points.
    """
    towards = [points]
    first, second = np.triu_indices(len(points), 1)
    across = points[second] - points[first]
    normal = np.column_stack([-across[:, 1], across[:, 0]])
    towards += [normal, -normal]
    directions = np.vstack(towards)
    size = np.linalg.norm(directions, axis=1)
    directions = directions[size > 1e-12] / size[size > 1e-12, None]
    if not len(directions):
        return float(np.linalg.norm(points, axis=1).min())
    return max(float((directions @ points.T).min(axis=1).max()), 0.0)


def radius_in_plate(plate: Plate, direction: Array, length: float) -> float:
    """Radius of the cylinder that goes through the plate's round opening; inf if it ends before the plate.

    Where the way slants by a, the section is an ellipse of half axis r / cos a, here taken as a circle.
    """
    normal = np.array([math.cos(plate.yaw), math.sin(plate.yaw), 0.0])
    slant = float(direction @ normal)
    centre = np.array(plate.centre)
    if slant <= 1e-9:
        return 0.0
    face = float(centre @ normal)
    # A slanting disc reaches the face before its middle does.
    tilted = math.sqrt(max(1.0 - slant * slant, 0.0)) * plate.radius
    if length * slant + tilted <= face:
        return math.inf
    off = []
    for depth in (face, face + plate.thickness):
        at = direction * (depth / slant) - (centre + (depth - face) * normal)
        off.append(float(np.linalg.norm(at)))
    return max((plate.radius - max(off)) * slant, 0.0)
