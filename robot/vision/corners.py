"""Corners of a picture, and where they are in another: the sparse half of what the eyes know of motion."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Image

Array = NDArray[np.float64]
Pixels = NDArray[np.float32]
Grey = NDArray[np.uint8]

CORNERS, CORNER_QUALITY, CORNER_APART_PX, CORNER_BLOCK_PX = 90, 0.01, 6, 3
"""Corners are looked for in the picture of half size, at a sixth of the cost."""
LEVELS, WAY_BACK_LEVELS, WINDOW_PX = 3, 1, 15
BORDER_PX = 8
WAY_BACK_PX = 0.7
"""A corner followed there and back must come home within this."""
CELL_COLUMNS, CELL_ROWS = 4, 3
"""The points that move alike must lie in so many of these cells of the picture, or one thing may be all."""
TARGET_RIM = 0.15
"""Share of its size by which a thing that may move by itself is cut out larger than its box."""


def grey(image: Image) -> Grey:
    """A BGR picture in grey; a grey one as it is."""
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image, np.uint8)


def corners(picture: Grey, moving: Box | None) -> Pixels:
    """Corners (N, 2), not at the picture's rim and not on what may move by itself."""
    half = cv2.pyrDown(picture)
    mask = np.zeros(half.shape, np.uint8)
    rim = BORDER_PX // 2
    mask[rim:-rim, rim:-rim] = 255
    if moving is not None:
        rim_x, rim_y = TARGET_RIM * moving.w, TARGET_RIM * moving.h
        left, right = (max(round(0.5 * u), 0) for u in (moving.x - rim_x, moving.x + moving.w + rim_x))
        top, bottom = (max(round(0.5 * v), 0) for v in (moving.y - rim_y, moving.y + moving.h + rim_y))
        mask[top:bottom, left:right] = 0
    found = cv2.goodFeaturesToTrack(
        half, CORNERS, CORNER_QUALITY, CORNER_APART_PX, mask=mask, blockSize=CORNER_BLOCK_PX
    )
    return np.zeros((0, 2), np.float32) if found is None else 2.0 * found.reshape(-1, 2).astype(np.float32)


def follow(source: Grey, target: Grey, pixels: Pixels, guess: Pixels) -> tuple[Pixels, NDArray[np.bool_]]:
    """Where pixels (N, 2) of one picture are in another, searched about `guess`; True where it is sure.

    Sure is what leads back to where it came from: another thing that only looks alike does not.
    """
    there, found = _flow(source, target, pixels, guess, LEVELS)
    back, found_back = _flow(target, source, there, pixels, WAY_BACK_LEVELS)
    home = np.hypot(*(back - pixels).T) <= WAY_BACK_PX
    return there, found & found_back & home


def _flow(
    source: Grey, target: Grey, pixels: Pixels, guess: Pixels, levels: int
) -> tuple[Pixels, NDArray[np.bool_]]:
    """Sparse optical flow (Lucas-Kanade in a pyramid) from `pixels`, begun at `guess`."""
    moved, status, _ = cv2.calcOpticalFlowPyrLK(
        source, target, pixels.reshape(-1, 1, 2), guess.reshape(-1, 1, 2).copy(),
        winSize=(WINDOW_PX, WINDOW_PX), maxLevel=levels, flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 10, 0.03), minEigThreshold=1e-3,
    )  # fmt: skip
    return np.asarray(moved, np.float32).reshape(-1, 2), status.ravel() > 0


def inside(pixels: Pixels, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """True where pixels (N, 2) lie in a picture of this shape and off its rim."""
    height, width = shape
    x, y = pixels.T
    return np.asarray(
        (x >= BORDER_PX) & (x <= width - BORDER_PX) & (y >= BORDER_PX) & (y <= height - BORDER_PX)
    )


def cells(pixels: Array, shape: tuple[int, ...]) -> int:
    """In how many cells of the picture there are points."""
    height, width = shape
    columns = np.clip(pixels[:, 0] * CELL_COLUMNS // width, 0, CELL_COLUMNS - 1)
    rows = np.clip(pixels[:, 1] * CELL_ROWS // height, 0, CELL_ROWS - 1)
    return len(np.unique(rows * CELL_COLUMNS + columns))
