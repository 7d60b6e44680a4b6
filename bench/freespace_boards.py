"""Bare boards across gaps that are wide enough: the hardest thing to see for eyes side by side.

A board 2 to 8 cm high hangs across the gap (or 0.8 m of open floor), of one colour but for the camera's
noise. Its long edges lie along the rows, so neither eye tells how far away it is. It is painted into both
pictures of a view by exact projection, hidden by what stands nearer. No way may be called safe then.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.freespace_percept import finder_for
from bench.freespace_truth import BASE, FloorTruth
from bench.freespace_views import FreeSpaceView, view
from bench.report import Bar
from robot.messages import Image

Array = NDArray[np.float64]

BOARD_KINDS = ("open", "narrow", "dark")
HIGH_M, IN_FRONT_M = (0.02, 0.03, 0.05, 0.08), (0.0, 0.1, 0.2)
LOWEST_M, HIGHEST_M = 0.06, 0.29
"""Above the floor: lower ones are steps, higher ones hang above the body."""
OVERLAP_M, OPEN_WIDTH_M, OPEN_AT_M = 0.06, 0.8, 1.0
"""A board is so much wider than its gap; on open floor so wide, so far ahead."""
EDGE_BLUR_PX = 0.6


@dataclass(frozen=True, slots=True)
class Board:
    """An upright board: the middle of its foot line (x, y), its direction (unit), extents in metres."""

    middle: Array
    ahead: Array
    width: float
    low: float
    high: float


def boarded(given: FreeSpaceView, rng: np.random.Generator) -> FreeSpaceView:
    """The view with a board across its gap."""
    board = _draw(given, rng)
    level = float(np.median(given.left))
    colour = np.clip(level * rng.uniform(0.5, 1.2) * rng.uniform(0.8, 1.2, 3), 15.0, 235.0)
    rotation, left_eye = given.mount.left_eye(given.pan, given.tilt)
    right_eye = left_eye + rotation @ np.array([given.rig.baseline, 0.0, 0.0])
    pictures = []
    for picture, eye, depth in (
        (given.left, left_eye, given.depth),
        (given.right, right_eye, _by_right_eye(given)),
    ):
        share = _covers(board, given, rotation, eye, depth)
        paint = colour + rng.normal(0.0, _noise(picture), picture.shape)
        mixed = picture * (1.0 - share) + paint * share
        pictures.append(np.clip(np.rint(mixed), 0, 255).astype(np.uint8))
    return replace(given, left=pictures[0], right=pictures[1])


def passed(task: tuple[str, int, Path | None]) -> bool | None:
    """Whether a way is called safe in a boarded view; None if none has to be without the board either."""
    kind, seed, cache = task
    given = view(kind, seed, cache)
    if not (isinstance(given.truth, FloorTruth) and given.truth.must_pass(BASE)):
        return None
    shown = boarded(given, np.random.default_rng([seed, *b"board"]))
    passage = finder_for(kind)(shown.left, shown.right, shown.pan, shown.tilt).passage
    return passage is not None and passage.safe


def board_rows(kinds: Sequence[str], answers: Sequence[tuple[str, bool | None]]) -> list[dict[str, Any]]:
    """A row for each of the kinds that was boarded."""
    told = {kind: [answer for of, answer in answers if of == kind and answer is not None] for kind in kinds}
    return [{"kind": f"board, {k}", "views": len(t), "passed": sum(t)} for k, t in told.items() if t]


def board_bars(rows: Sequence[dict[str, Any]]) -> list[Bar]:
    """No bare board may be passed."""
    return [Bar(f"{row['kind']}: passed", row["passed"], 0) for row in rows]


def _draw(given: FreeSpaceView, rng: np.random.Generator) -> Board:
    truth = given.truth
    assert isinstance(truth, FloorTruth)
    if truth.gap is not None:
        middle, width = np.array(truth.gap.centre[:2]), truth.gap.width + OVERLAP_M
    else:
        bearing = float(np.mean(truth.view))
        middle, width = OPEN_AT_M * np.array([math.cos(bearing), math.sin(bearing)]), OPEN_WIDTH_M
    ahead = middle / np.linalg.norm(middle)
    thick = float(rng.choice(HIGH_M))
    low = float(rng.uniform(LOWEST_M, HIGHEST_M - thick))
    return Board(middle - float(rng.choice(IN_FRONT_M)) * ahead, ahead, width, low, low + thick)


def _covers(
    board: Board, given: FreeSpaceView, rotation: Array, eye: Array, depth: NDArray[np.float32]
) -> Array:
    """(H, W, 1) share of each pixel that the board covers, seen from the eye."""
    camera = given.rig.left
    column, row = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = np.stack(
        [(column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy, np.ones(row.shape)], axis=-1
    )
    rays = rays @ rotation.T
    away = ((board.middle - eye[:2]) @ board.ahead) / (rays[..., :2] @ board.ahead)
    points = eye + rays * away[..., None]
    aside = (points[..., :2] - board.middle) @ np.array([-board.ahead[1], board.ahead[0]])
    inside = (away > 0.0) & (away < depth) & (np.abs(aside) < 0.5 * board.width)
    inside &= (points[..., 2] > board.low) & (points[..., 2] < board.high)
    share: Array = cv2.GaussianBlur(inside.astype(np.float64), (0, 0), EDGE_BLUR_PX)
    return share[..., None]


def _by_right_eye(given: FreeSpaceView) -> NDArray[np.float32]:
    """True depth (H, W) by the right eye's pixels; where the left eye saw nothing, the nearest beside."""
    height, width = given.depth.shape
    row, column = np.nonzero(np.isfinite(given.depth))
    away = given.depth[row, column]
    other = np.rint(column - given.rig.left.fx * given.rig.baseline / away).astype(np.intp)
    inside = (other >= 0) & (other < width)
    order = np.argsort(-away[inside])
    depth = np.full((height, width), np.inf, np.float32)
    depth[row[inside][order], other[inside][order]] = away[inside][order]
    beside = cv2.erode(depth, np.ones((1, 9), np.uint8))
    return np.where(np.isfinite(depth), depth, beside).astype(np.float32)


def _noise(picture: Image) -> float:
    """Standard deviation of the camera's noise: what is rough even where the picture is smoothest."""
    rough = cv2.filter2D(picture[..., 0].astype(np.float32), -1, ROUGH)
    return float(np.sqrt(np.percentile(cv2.blur(rough * rough, (9, 9)), 10)))


ROUGH = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6.0
"""Answers to noise of one standard deviation with one, to planes with none."""
