"""What ends the sectors of a free floor besides its own cells: points and directions of other witnesses."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from robot.messages import FreeSpace, Points


def merge(free: FreeSpace, obstacles: Points) -> FreeSpace:
    """The same look with more obstacle points (N, 2) or (N, 3), robot frame: they end their sectors too.

    >>> look = FreeSpace(np.array([0.0]), np.array([0.3]), np.array([2.0]), np.zeros((0, 2)))
    >>> float(merge(look, np.array([[1.0, 0.0]])).free[0])
    1.0
    """
    points = np.asarray(obstacles, dtype=np.float64)
    if points.size == 0:
        return free
    points = points.reshape(len(points), -1)[:, :2]
    return replace(ended_by(free, points), obstacles=np.vstack([free.obstacles, points]))


def ended_by(free: FreeSpace, points: Points) -> FreeSpace:
    """The same look with its sectors ended before points (N, 2), robot frame; obstacles stay as they are.

    >>> look = FreeSpace(np.array([0.0]), np.array([0.3]), np.array([2.0]), np.zeros((0, 2)))
    >>> float(ended_by(look, np.array([[0.1, 0.0]])).free[0])
    0.3
    """
    if not len(free.bearings) or not len(points):
        return free
    half = 0.5 * (float(np.median(np.diff(free.bearings))) if len(free.bearings) > 1 else math.radians(1.5))
    away = np.hypot(points[:, 0], points[:, 1])
    off = np.abs(np.arctan2(points[:, 1], points[:, 0])[:, None] - free.bearings)
    reach = np.where(off <= half, away[:, None], np.inf).min(axis=0)
    return replace(free, free=np.minimum(free.free, np.maximum(reach, free.near)))


def ended_for_most(free: FreeSpace, ends: Points) -> FreeSpace:
    """The same look with each sector ended where most of the directions in it end.

    ends (N, 2): robot frame, where each direction that was looked into ends. Sectors without any stay.

    >>> look = FreeSpace(np.array([0.0]), np.array([0.3]), np.array([2.0]), np.zeros((0, 2)))
    >>> float(ended_for_most(look, np.array([[0.8, 0.0], [1.0, 0.0], [5.0, 0.0]])).free[0])
    1.0
    """
    if len(free.bearings) < 1 or not len(ends):
        return free
    half = 0.5 * (float(np.median(np.diff(free.bearings))) if len(free.bearings) > 1 else math.radians(1.5))
    away, bearing = np.hypot(ends[:, 0], ends[:, 1]), np.arctan2(ends[:, 1], ends[:, 0])
    sector = np.rint((bearing - free.bearings[0]) / (2.0 * half)).astype(np.intp)
    order = np.lexsort((away, sector))
    count = np.bincount(np.clip(sector + 1, 0, len(free.bearings) + 1), minlength=len(free.bearings) + 2)
    first, count = np.cumsum(count)[:-2], count[1:-1]
    ranked = np.append(away[order], np.inf)
    lower, upper = first + np.maximum(count - 1, 0) // 2, first + count // 2
    median = 0.5 * (ranked[np.minimum(lower, len(away))] + ranked[np.minimum(upper, len(away))])
    most = np.where(count > 0, median, np.inf)
    return replace(free, free=np.minimum(free.free, np.maximum(most, free.near)))


def begun_near(free: FreeSpace, farthest: float) -> FreeSpace:
    """The same look without the sectors whose floor begins farther than `farthest` metres.

    What lies before it is not in view: a step there would be behind the body's edge before it was seen.

    >>> look = FreeSpace(np.array([0.0]), np.array([0.9]), np.array([2.0]), np.zeros((0, 2)))
    >>> float(begun_near(look, 0.65).free[0])
    0.9
    """
    return replace(free, free=np.where(free.near <= farthest, free.free, free.near))
