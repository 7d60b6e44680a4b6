"""Pure pursuit: which point of a path to aim at, and on what arc. Pure geometry.

Source: R. C. Coulter, *Implementation of the Pure Pursuit Path Tracking Algorithm*, CMU-RI-TR-92-01: the arc
through the robot and a point at look-ahead distance L under bearing a has the curvature 2 sin(a) / L.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from robot.messages import Pose2, wrap

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Aim:
    """Where to drive now.

    bearing: of the point aimed at, robot frame. curvature: of the arc to it, 1/m, left positive. progress:
    metres of the path done; give it back next time. to_corner, to_end: metres along the path to the next
    sharp corner (or the end) and to the end; to_end is the distance as the crow flies once on the last piece.
    """

    bearing: float
    curvature: float
    progress: float
    to_corner: float
    to_end: float


def pursue(path: tuple[Point, ...], pose: Pose2, progress: float, look_ahead: float, corner: float) -> Aim:
    """What to aim at on a path.

    Args:
        path: one or more points, odometry frame.
        pose: of the robot.
        progress: metres done so far, 0 at first; it never goes back.
        look_ahead: metres, > 0.
        corner: radians; the path is not aimed at beyond a corner sharper than this before the corner is done.

    Returns:
        The aim; on a path without length, straight at its point.
    """
    marks = [0.0]
    for a, b in pairwise(path):
        marks.append(marks[-1] + math.dist(a, b))
    done = _nearest(path, marks, pose, progress, 2.0 * look_ahead)
    stop = _next_corner(path, marks, done, corner)
    # A corner all but reached is done: what follows is aimed at, and turned to on the spot.
    if stop < marks[-1] and stop - done < 0.15 * look_ahead:
        done = stop
        stop = _next_corner(path, marks, done, corner)
    x, y = _at(path, marks, min(done + look_ahead, stop))
    bearing = wrap(math.atan2(y - pose.y, x - pose.x) - pose.yaw)
    away = max(math.hypot(x - pose.x, y - pose.y), 0.5 * look_ahead)
    end = path[-1]
    crow = math.hypot(end[0] - pose.x, end[1] - pose.y)
    last = len(path) < 2 or done >= marks[-2]
    to_end = crow if last else marks[-1] - done
    return Aim(bearing, 2.0 * math.sin(bearing) / away, done, stop - done, to_end)


def _nearest(
    path: tuple[Point, ...], marks: list[float], pose: Pose2, progress: float, window: float
) -> float:
    """Metres along the path of its point nearest to the robot, between `progress` and `window` beyond."""
    best, best_away = min(progress, marks[-1]), math.inf
    for (a, b), (start, end) in zip(pairwise(path), pairwise(marks), strict=True):
        length = end - start
        if length == 0.0 or end < progress or start > progress + window:
            continue
        t = ((pose.x - a[0]) * (b[0] - a[0]) + (pose.y - a[1]) * (b[1] - a[1])) / length
        along = min(max(start + t, start, progress), end, progress + window)
        share = (along - start) / length
        away = math.hypot(a[0] + share * (b[0] - a[0]) - pose.x, a[1] + share * (b[1] - a[1]) - pose.y)
        if away < best_away - 1e-12:
            best, best_away = along, away
    return best


def _next_corner(path: tuple[Point, ...], marks: list[float], done: float, corner: float) -> float:
    """Metres along the path of the first corner sharper than `corner` beyond `done`; its end if none."""
    for i in range(1, len(path) - 1):
        if marks[i] > done + 1e-9 and abs(_bend(path, i)) > corner:
            return marks[i]
    return marks[-1]


def _bend(path: tuple[Point, ...], i: int) -> float:
    (ax, ay), (bx, by), (cx, cy) = path[i - 1], path[i], path[i + 1]
    return wrap(math.atan2(cy - by, cx - bx) - math.atan2(by - ay, bx - ax))


def _at(path: tuple[Point, ...], marks: list[float], along: float) -> Point:
    for (a, b), (start, end) in zip(pairwise(path), pairwise(marks), strict=True):
        if along <= end and end > start:
            share = (along - start) / (end - start)
            return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
    return path[-1]
