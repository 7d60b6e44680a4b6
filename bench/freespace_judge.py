"""Holds what was found in one view against what was truly there. Pure: view and percept in, verdict out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.freespace_geometry import Point
from bench.freespace_truth import BASE, HAND, FloorTruth, Gap, HandTruth
from bench.freespace_views import FreeSpaceView
from robot.messages import FreeSpace, Passage

Array = NDArray[np.float64]

CELL_M = 0.08
"""Free floor may reach so far beyond a true obstacle's front, not farther."""
FLOOR_WITHIN_M = 1.5
"""Free floor is judged so far: beyond, half a degree of tilt moves the floor by more than a cell."""
WITHIN_SECTOR = math.radians(0.375)
"""An obstacle ends a bearing only if it fills so much to both sides: half a sector of 1.5 degrees."""
HAZARD_WITHIN_M = 1.2
"""Obstacles in view this near must be reported."""
REPORTED_M, PHANTOM_M = 0.1, 0.15
"""An obstacle point tells of what stands so near; farther from all that stands it is false."""
BASE_AT_M, HAND_AT_M = (0.85, 1.15), (0.2, 0.3)
"""Accuracy is held to its bars at these distances of the gap."""
HAND_SQUARE = math.radians(6.0)
"""A circle in a plate turned by more is an ellipse to the eye: its diameter is not held to the bar."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """One judged view.

    may, must: by the truth. found: a passage was reported; safe: and called safe. violation: safe where
    nothing may pass; touched: safe, and the body that goes there touches. missed: had to be safe and was not.
    diameter_error: relative; centre_error: metres over `away`, the gap's distance; None where not judged.
    overreach: metres free floor reaches beyond the truth at worst, 0 for none (cell not counted); floor: free
    floor seen at the median bearing. reported: None where nothing stands near; phantom: a false obstacle.
    """

    kind: str
    seed: int
    may: bool
    must: bool
    found: bool
    safe: bool
    violation: bool
    touched: bool
    missed: bool
    diameter_error: float | None = None
    centre_error: float | None = None
    away: float = math.nan
    overreach: float = 0.0
    floor: float = math.nan
    reported: bool | None = None
    phantom: bool = False


def judge(view: FreeSpaceView, look: FreeSpace) -> Verdict:
    """The verdict on one view.

    Raises:
        ValueError: a passage called safe lies nowhere (not finite).
    """
    passage, truth = look.passage, view.truth
    safe = passage is not None and passage.safe
    if isinstance(truth, FloorTruth):
        may, must = truth.may_pass(BASE), truth.must_pass(BASE)
        touched = passage is not None and safe and truth.touches(passage.position, BASE)
    else:
        may, must = truth.may_pass(HAND), truth.must_pass(HAND)
        touched = passage is not None and safe and truth.touches(passage.position, HAND)
    diameter, centre, away = accuracy(truth, passage)
    common = (
        view.kind,
        view.seed,
        may,
        must,
        passage is not None,
        safe,
        safe and not may,
        touched,
        must and not safe,
    )
    if isinstance(truth, HandTruth):
        return Verdict(*common, diameter, centre, away)
    seen = look.free > look.near
    floor = float(np.median(np.where(seen, look.free, 0.0))) if len(look.free) else 0.0
    reported, phantom = obstacles(truth, look)
    return Verdict(*common, diameter, centre, away, overreach(truth, look), floor, reported, phantom)


# ------------------------------------------------------------------------------------------- the passage


def accuracy(
    truth: FloorTruth | HandTruth, passage: Passage | None
) -> tuple[float | None, float | None, float]:
    """Relative error of the diameter, error of the centre in metres, and the gap's distance.

    None where there is no gap, no passage was found in it, or (hand) the plate is turned too much. Along a
    slot the centre may lie anywhere its width reaches; a base's height does not count.
    """
    gap = truth.gap
    if gap is None or passage is None:
        return None, None, math.nan
    hand = isinstance(truth, HandTruth)
    away = math.hypot(*gap.centre)
    off = _off_centre(gap, passage.position, hand)
    within = abs(off[1]) < 0.5 * gap.width + gap.slack[0] and abs(off[0]) < 0.3 * away
    if not within or (hand and abs(gap.yaw) > HAND_SQUARE):
        return None, None, away
    error = math.sqrt(
        off[0] ** 2 + max(abs(off[1]) - gap.slack[0], 0.0) ** 2 + max(abs(off[2]) - gap.slack[1], 0.0) ** 2
    )
    return abs(passage.diameter / gap.width - 1.0), error, away


def _off_centre(gap: Gap, position: Point, hand: bool) -> Point:
    """From the gap's centre to the position: ahead, aside, up; ahead is away from the robot."""
    bearing = 0.0 if hand else math.atan2(gap.centre[1], gap.centre[0])
    x, y, z = (p - g for p, g in zip(position, gap.centre, strict=True))
    c, s = math.cos(bearing), math.sin(bearing)
    return c * x + s * y, c * y - s * x, z


# --------------------------------------------------------------------------------------------- the floor


def overreach(truth: FloorTruth, look: FreeSpace) -> float:
    """How far free floor reaches beyond one cell behind a true obstacle or edge, metres; 0: nowhere."""
    seen = look.free > look.near
    if not seen.any():
        return 0.0
    ends = clear_ends(truth, look.bearings)
    beyond = np.where(seen & (ends <= FLOOR_WITHIN_M), look.free - ends - CELL_M, 0.0)
    return max(float(beyond.max()), 0.0)


def clear_ends(truth: FloorTruth, bearings: Array) -> Array:
    """Where the floor truly ends along each bearing (N,) for all of half a sector to both sides, metres."""
    spread = [truth.free_distances(bearings + off) for off in (-WITHIN_SECTOR, 0.0, WITHIN_SECTOR)]
    ends: Array = np.max(spread, axis=0)
    return ends


def obstacles(truth: FloorTruth, look: FreeSpace) -> tuple[bool | None, bool]:
    """Whether what stands near in view was reported (None: nothing does), and whether a false one was."""
    ends = clear_ends(truth, np.linspace(*truth.view, 81))
    points = np.asarray(look.obstacles, np.float64).reshape(-1, 2)
    near = points[np.hypot(points[:, 0], points[:, 1]) < FLOOR_WITHIN_M]
    off = truth.distance_to(near)
    phantom = bool((off > PHANTOM_M).any())
    if float(ends.min()) > HAZARD_WITHIN_M:
        return None, phantom
    return bool((off < REPORTED_M).any()), phantom
