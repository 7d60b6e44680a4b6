"""Upright rays over a flat floor and the air along them, made by hand: no pictures, no matcher."""

from __future__ import annotations

import numpy as np

from robot.vision.carving import Air, Rays

FOCAL, BASELINE = 300.0, 0.06
HEIGHT, HEIGHTS = 0.25, (0.03, 0.32)
COLUMNS, ROWS = 241, 100
MIDDLE = COLUMNS // 2
TANGENTS = (np.arange(COLUMNS) - MIDDLE) / FOCAL
WALL = 2.0


def rays():
    """Rays of eyes 0.25 m above the floor, from 13 degrees up to 27 down, some two px apart."""
    drop = np.linspace(-0.23, 0.51, ROWS)
    drop[np.abs(drop) < 1e-4] = 1e-4
    to_low, to_high = (HEIGHT - HEIGHTS[0]) / drop, (HEIGHT - HEIGHTS[1]) / drop
    enters, leaves = np.maximum(np.minimum(to_low, to_high), 0.0), np.maximum(to_low, to_high)
    seen = np.ones((ROWS, COLUMNS), np.bool_)
    return Rays(TANGENTS, drop, enters, leaves, seen, np.array([0.08, 0.03, HEIGHT]), HEIGHT, 0.0)


RAYS = rays()


def air(left, right=None, foot=0.0):
    """left, right: distances (ROWS, COLUMNS) or one of all; the right eye measured nothing unless told."""
    planes = [
        np.broadcast_to(np.float32(p), (ROWS, COLUMNS)).copy()
        for p in (left, 0.0 if right is None else right)
    ]
    return Air(RAYS, *planes, np.full(COLUMNS, foot, np.float32), FOCAL * BASELINE)
