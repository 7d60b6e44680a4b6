"""A floor plan of walls for tests: perfect looks at it, true distances, a body that does as told."""

from __future__ import annotations

import math

import numpy as np

from robot.messages import FreeSpace, Points, Pose2, Twist
from robot.nav.grid import ObstacleMap

Wall = tuple[float, float, float, float]
FAR = 2.8


def box(x0: float, y0: float, x1: float, y1: float) -> list[Wall]:
    """The four sides of a rectangle."""
    return [(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)]


def ray(walls: list[Wall], x: float, y: float, angle: float) -> float:
    """Metres from (x, y) to the first wall in that direction, inf if none."""
    c, s = math.cos(angle), math.sin(angle)
    best = math.inf
    for x0, y0, x1, y1 in walls:
        ex, ey = x1 - x0, y1 - y0
        across = c * ey - s * ex
        if abs(across) < 1e-12:
            continue
        t = ((x0 - x) * ey - (y0 - y) * ex) / across
        u = ((x0 - x) * s - (y0 - y) * c) / across
        if t > 0 and 0 <= u <= 1:
            best = min(best, t)
    return best


def distance(walls: list[Wall], x: float, y: float) -> float:
    """Metres from (x, y) to the nearest wall."""
    best = math.inf
    for x0, y0, x1, y1 in walls:
        ex, ey = x1 - x0, y1 - y0
        t = min(max(((x - x0) * ex + (y - y0) * ey) / (ex * ex + ey * ey), 0.0), 1.0)
        best = min(best, math.hypot(x0 + t * ex - x, y0 + t * ey - y))
    return best


def look(walls: list[Wall], pose: Pose2, pan: float = 0.0, near: float = 0.31) -> FreeSpace:
    """What a perfect eye would see: 41 sectors of 1.5 degrees about the pan, free to 3 cm before walls."""
    bearings = pan + np.radians(np.arange(-30.0, 30.1, 1.5))
    hits = np.array([ray(walls, pose.x, pose.y, pose.yaw + b) for b in bearings])
    seen = hits < FAR
    obstacles = np.column_stack([hits[seen] * np.cos(bearings[seen]), hits[seen] * np.sin(bearings[seen])])
    return FreeSpace(bearings, np.full(len(bearings), near), np.minimum(hits - 0.03, FAR), obstacles)


def seen_room(walls: list[Wall], free: Wall) -> ObstacleMap:
    """A map in which the rectangle `free` was seen and the walls stand where they are."""
    floor = ObstacleMap()
    x0, y0, x1, y1 = free
    for x in np.arange(x0, x1 + 0.01, 0.1):
        for y in np.arange(y0, y1 + 0.01, 0.1):
            floor.start_disc(Pose2(float(x), float(y)), 0.08)
    far_away = Pose2(-5.0, -5.0)
    for at in (0.0, 0.1, 0.2):
        floor.update(only_points(far_away.to_local(wall_points(walls))), far_away, at)
    return floor


def wall_points(walls: list[Wall]) -> Points:
    """Points every centimetre along the walls."""
    pieces = []
    for x0, y0, x1, y1 in walls:
        n = max(2, int(math.hypot(x1 - x0, y1 - y0) / 0.01))
        t = np.linspace(0.0, 1.0, n)[:, None]
        pieces.append((1 - t) * (x0, y0) + t * (x1, y1))
    return np.concatenate(pieces) if pieces else np.zeros((0, 2))


def only_points(points: Points) -> FreeSpace:
    """A look that shows obstacle points and no free floor."""
    none = np.zeros(0)
    return FreeSpace(none, none, none, points)


def driven(pose: Pose2, twist: Twist, seconds: float) -> Pose2:
    """Where a body gets that does exactly what it is told."""
    angle = twist.w * seconds
    length = twist.v * seconds
    ahead = length * float(np.sinc(angle / np.pi))
    aside = length * math.sin(angle / 2) * float(np.sinc(angle / (2 * np.pi)))
    return pose.compose(Pose2(ahead, aside, angle))
