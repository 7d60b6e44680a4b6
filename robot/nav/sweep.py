"""How far a round body may drive along a line or an arc until it touches one of many points."""

from __future__ import annotations

import math

import numpy as np

from robot.messages import Points, Pose2, Twist

_STRAIGHT = 1e-4
"""Curvature in 1/m below which an arc is a line: 1e-4 strays by under half a millimetre in 3 m."""

GRAZE = 0.02
"""Metres by which the circle shrinks for points it holds already: half a map cell."""


def first_contact(points: Points, twist: Twist, radius: float) -> float:
    """Metres of way until a circle about the robot's origin touches the first of the points.

    Points that lie in the circle already are tested against a circle smaller by `GRAZE`, so that a wall just
    beside the robot does not hold it for ever; the way away from them is always open.

    Args:
        points: (N, 2), robot frame.
        twist: gives the direction and the curvature of the way; its speed does not matter.
        radius: of the circle in metres.

    Returns:
        0 if a point lies in the circle already and the way leads towards it; inf if none is ever touched
        (or v is 0).

    >>> first_contact(np.array([[1.0, 0.0]]), Twist(0.2, 0.0), 0.13)
    0.87
    """
    if twist.v == 0.0 or len(points) == 0:
        return math.inf
    # Driving backwards is driving forwards in the picture mirrored front to back: x and w change sign.
    x = points[:, 0] if twist.v > 0 else -points[:, 0]
    y = points[:, 1]
    inside = x * x + y * y < radius * radius
    reach = np.where(inside, max(radius - GRAZE, 0.0), radius)
    curvature = twist.w / twist.v
    if abs(curvature) < _STRAIGHT:
        return _line_contact(x, y, reach)
    # Turning right is turning left in the picture mirrored left to right.
    return _arc_contact(x, y if curvature > 0 else -y, 1.0 / abs(curvature), reach)


def arc_points(pose: Pose2, twist: Twist, length: float) -> Points:
    """Points (N, 2), odometry frame, about every 2 cm of the way of the body's middle, `length` metres."""
    s = np.linspace(0.0, length, max(2, math.ceil(length / 0.02)))
    direction = math.copysign(1.0, twist.v)
    angle = s * twist.w / abs(twist.v)
    # sin(a)/a and (1 - cos(a))/a without trouble at a = 0.
    ahead = direction * s * np.sinc(angle / np.pi)
    aside = direction * s * np.sin(angle / 2) * np.sinc(angle / (2 * np.pi))
    return pose.to_world(np.column_stack([ahead, aside]))


def _line_contact(x: Points, y: Points, reach: Points) -> float:
    touched = (x > 0.0) & (np.abs(y) < reach)
    if not touched.any():
        return math.inf
    x, y, reach = x[touched], y[touched], reach[touched]
    return float(max((x - np.sqrt(reach * reach - y * y)).min(), 0.0))


def _arc_contact(x: Points, y: Points, turn: float, reach: Points) -> float:
    """Way along a left-hand circle of radius `turn` about (0, turn)."""
    distance = np.hypot(x, y - turn)
    # The second condition: points a tight turn never leaves are contact now, not ahead.
    touched = (np.abs(distance - turn) < reach) & (distance + turn > reach)
    if not touched.any():
        return math.inf
    x, y, distance, reach = x[touched], y[touched], distance[touched], reach[touched]
    ahead = np.arctan2(x, turn - y) % math.tau
    cosine = (turn * turn + distance * distance - reach * reach) / (2.0 * turn * distance)
    before = np.arccos(np.clip(cosine, -1.0, 1.0))
    # A point just behind is met again only after almost a full turn: ahead - before is large there.
    return float(turn * np.maximum(ahead - before, 0.0).min())
