"""The floor in a disparity map of which nobody says how the camera hangs: found as its largest low plane."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.model import StereoRig
from robot.vision.disparity import Disparity

Rows = NDArray[np.float64]

SAMPLE, DRAWS, SEED = 3000, 200, 1
"""Pixels looked at; triples drawn: 200 miss a floor of 0.3 of the pixels once in 240 looks."""
TOLERANCE_PX = 0.5
"""How far a disparity may lie off the plane beside two of its standard deviations: floors are uneven."""
LEAST_SHARE = 0.3
"""Of what is measured in the lower half of the picture so much must lie on the plane."""
LEAST_MEASURED = 0.05
"""Of the lower half of the picture so much must be measured at all."""
MOST_ROLL, MOST_TILT = math.radians(10.0), math.radians(70.0)
HEIGHTS_M = (0.04, 2.5)
"""How a carried or mounted camera hangs over a floor; walls and tables lie otherwise."""


@dataclass(frozen=True, slots=True)
class FoundFloor:
    """How the left eye hangs over the floor: height in metres; tilt down and roll (clockwise) in radians."""

    height: float
    tilt: float
    roll: float


def find_floor(disparity: Disparity, rig: StereoRig) -> FoundFloor | None:
    """The floor's plane by RANSAC in the lower half of the picture; None if there is none to speak of.

    A plane n . X = h is a plane in disparity too: d = B / h (n_x u + n_y v + n_z f), u, v from the principal
    point. The same map gives the same floor.

    Args:
        disparity: of the rectified pair.
        rig: the parallel rig it is of.

    Raises:
        ValueError: a map that is not of the rig's size.

    >>> rig = StereoRig.parallel(352, 288, 305.0, 0.06)
    >>> rows = np.arange(288.0)[:, None] - rig.left.cy + 0.0 * np.arange(352.0)
    >>> values = (0.06 / 0.25 * (math.cos(0.3) * rows + math.sin(0.3) * 305.0)).astype(np.float32)
    >>> floor = find_floor(Disparity(values, values > 1.0, np.full_like(values, 0.1)), rig)
    >>> round(floor.height, 3), round(floor.tilt, 3)
    (0.25, 0.3)
    """
    if disparity.valid.shape != (rig.left.height, rig.left.width):
        raise ValueError(
            f"the disparities are {disparity.valid.shape[1]}x{disparity.valid.shape[0]}, "
            f"the rig {rig.left.width}x{rig.left.height}: give the rig of these pictures"
        )
    half = max(int(rig.left.cy), 0)
    rows, columns = np.nonzero(disparity.valid[half:])
    if len(rows) < max(LEAST_MEASURED * disparity.valid[half:].size, 3):
        return None
    random = np.random.default_rng(SEED)
    chosen = random.permutation(len(rows))[:SAMPLE]
    rows, columns = rows[chosen] + half, columns[chosen]
    places = np.column_stack([columns - rig.left.cx, rows - rig.left.cy, np.full(len(rows), rig.left.fx)])
    seen = disparity.values[rows, columns].astype(np.float64) + rig.doffs
    slack = TOLERANCE_PX + 2.0 * disparity.sigma_px[rows, columns]
    best = np.zeros(len(rows), np.bool_)
    for _ in range(DRAWS):
        three = random.choice(len(rows), 3, replace=False)
        plane = np.linalg.lstsq(places[three], seen[three], rcond=None)[0]
        if _floor(plane, rig) is None:
            continue
        near = np.abs(places @ plane - seen) < slack
        best = near if near.sum() > best.sum() else best
    if best.sum() < max(LEAST_SHARE * len(rows), 3):
        return None
    return _floor(np.linalg.lstsq(places[best], seen[best], rcond=None)[0], rig)


def _floor(plane: Rows, rig: StereoRig) -> FoundFloor | None:
    """The pose a plane of disparities means; None if no floor lies so."""
    length = float(np.linalg.norm(plane))
    if length <= 0.0:
        return None
    height, (across, down, ahead) = rig.baseline / length, plane / length
    roll, tilt = math.asin(float(across)), math.atan2(float(ahead), float(down))
    lies_so = HEIGHTS_M[0] <= height <= HEIGHTS_M[1] and abs(roll) <= MOST_ROLL and abs(tilt) <= MOST_TILT
    return FoundFloor(height, tilt, roll) if lies_so else None
