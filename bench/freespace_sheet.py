"""A contact sheet of judged views for the eye: what was found, drawn into the left picture, worst first."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.freespace_judge import Verdict
from bench.freespace_truth import FloorTruth
from bench.freespace_views import FreeSpaceView
from robot.messages import FreeSpace, Image

COLUMNS = 5
CAPTION_PX = 34
SAFE, UNSAFE, FREE, OBSTACLE, TRUE_END, INK = (
    (70, 220, 60), (60, 60, 240), (230, 190, 40), (40, 150, 255), (240, 80, 240), (235, 235, 235),
)  # fmt: skip
Colour = tuple[int, int, int]
Array = NDArray[np.float64]


def sheet(shown: Sequence[tuple[FreeSpaceView, FreeSpace, Verdict]], columns: int = COLUMNS) -> Image:
    """All tiles as one BGR picture.

    Raises:
        ValueError: nothing to show.
    """
    if not shown:
        raise ValueError("no views to show: ask for at least one")
    tiles = [tile(*one) for one in shown]
    tiles += [np.zeros_like(tiles[0])] * (-len(tiles) % min(columns, len(tiles)))
    wide = min(columns, len(shown))
    lines = [np.hstack(tiles[k : k + wide]) for k in range(0, len(tiles), wide)]
    return np.vstack(lines)


def tile(view: FreeSpaceView, look: FreeSpace, verdict: Verdict) -> Image:
    """One view: passage (green safe, red not), free floor's end, obstacles, where the floor truly ends."""
    picture = view.left.copy()
    if isinstance(view.truth, FloorTruth):
        _ends(picture, view, look.bearings, look.free, look.free > look.near, FREE)
        bearings = np.linspace(*view.truth.view, 200)
        ends = view.truth.free_distances(bearings)
        _ends(picture, view, bearings, ends, ends < 2.5, TRUE_END)
        points = np.asarray(look.obstacles, np.float64).reshape(-1, 2)
        _dots(picture, view, np.column_stack([points, np.zeros(len(points))]), OBSTACLE, 2)
    if look.passage is not None:
        passage, ink = look.passage, SAFE if look.passage.safe else UNSAFE
        centre = round(passage.centre[0]), round(passage.centre[1])
        cv2.circle(picture, centre, max(1, round(passage.radius_px)), ink, 2, cv2.LINE_AA)
    return np.vstack([picture, _caption(view, look, verdict)])


def _ends(
    picture: Image, view: FreeSpaceView, bearings: Array, away: Array, chosen: NDArray[np.bool_], ink: Colour
) -> None:
    ends = np.where(np.isfinite(away), away, 0.0)[chosen]
    points = np.column_stack(
        [ends * np.cos(bearings[chosen]), ends * np.sin(bearings[chosen]), np.zeros(len(ends))]
    )
    _dots(picture, view, points, ink, 1)


def _dots(picture: Image, view: FreeSpaceView, points: Array, ink: Colour, radius: int) -> None:
    """Points (N, 3) of the robot frame, as the robot believes it stands."""
    rotation, position = view.mount.left_eye(view.pan, view.tilt)
    camera = view.rig.left
    for x, y, z in (points - position) @ rotation:
        if z > 0.05:
            u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
            if abs(u) < 1e4 and abs(v) < 1e4:
                cv2.circle(picture, (round(u), round(v)), radius, ink, -1, cv2.LINE_AA)


def _caption(view: FreeSpaceView, look: FreeSpace, verdict: Verdict) -> Image:
    strip = np.zeros((CAPTION_PX, view.left.shape[1], 3), np.uint8)
    words = [
        name
        for name, told in (
            ("VIOLATION", verdict.violation), ("TOUCHES", verdict.touched), ("missed", verdict.missed),
            (f"floor +{1000 * verdict.overreach:.0f} mm", verdict.overreach > 0),
            ("unreported", verdict.reported is False), ("phantom", verdict.phantom),
        )
        if told
    ]  # fmt: skip
    gap = view.truth.gap
    first = f"{view.kind} {view.seed}: {' '.join(words) or 'good'}"
    found = "no passage" if look.passage is None else f"found {1000 * look.passage.diameter:.0f} mm"
    true = "" if gap is None else f", true {1000 * gap.width:.0f} at {math.hypot(*gap.centre):.2f} m"
    ink = UNSAFE if words and words[0] in ("VIOLATION", "TOUCHES") else INK
    cv2.putText(strip, first, (4, 13), cv2.FONT_HERSHEY_SIMPLEX, 0.42, ink, 1, cv2.LINE_AA)
    cv2.putText(strip, found + true, (4, 29), cv2.FONT_HERSHEY_SIMPLEX, 0.42, INK, 1, cv2.LINE_AA)
    return strip
