"""Votes of ferns' leaves for an object's centre, and back: METHODS 8.

Every place of a picture's grid casts, for each fern, the votes its leaf has learnt: how likely the place
belongs to the object, spread over where the object's centre then lies. Centres are counted in cells of
`CELL_STEPS` grid steps.

Source: Leibe, Leonardis, Schiele, "Robust object detection with interleaved categorization and segmentation"
(IJCV 2008); Gall and Lempitsky, "Class-specific Hough forests" (CVPR 2009).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Box
from robot.vision.fern_features import Leaves

Floats = NDArray[np.float32]
Votes = NDArray[np.int16]
Mask = NDArray[np.bool_]

CELL_STEPS = 3
"""Grid steps of a cell, to which offsets are rounded."""
PART = 2048
"""Places whose votes are gathered together: more leave the processor's cache."""
MOST_VOTES = 1000
"""Of a leaf for one cell: those of 32 ferns together stay within 16 bits."""
SUPPORT_SHARE = 0.5
"""A place belongs to the object if it voted for it more than this share of the mean of those near it."""
BLUR_STEPS = 1.2
"""Standard deviation by which votes are smoothed, grid steps: rounding, and parts that move a little."""


@dataclass(frozen=True, slots=True, eq=False)
class Codebook:
    """What the leaves of F ferns with L leaves vote for: table (F, L, cells) int16, `unit` votes the most.

    up, aside: cells from the middle to the farthest offset in rows and columns;
    cells = (2 up + 1) (2 aside + 1), row by row.
    """

    table: Votes
    up: int
    aside: int

    def cast(self, leaves: Leaves) -> Votes:
        """Votes (places, cells) of leaves (F, rows, columns), places row by row."""
        total = np.empty((leaves[0].size, self.table.shape[2]), np.int16)
        for _ in self._parts(leaves, total):
            pass
        return total

    def counted(self, leaves: Leaves) -> Floats:
        """Votes for a centre at each grid place, padded by `margin` places on every side, not smoothed.

        The votes of a place for a centre count by their square, over 2 ** `square_shift`: where many ferns
        agree on it they say more than as many votes of places where each fern says something else.
        """
        rows, columns = leaves.shape[1:]
        votes = np.empty((rows * columns, self.table.shape[2]), np.int16)
        squares = np.empty((min(PART, len(votes)), votes.shape[1]), np.int32)
        for part in self._parts(leaves, votes):
            wide = np.multiply(part, part, dtype=np.int32, out=squares[: len(part)])
            np.right_shift(wide, self.square_shift, out=part, casting="unsafe")
        by_cell = cv2.transpose(votes).reshape(-1, rows, columns)
        (above, beside) = self.margin
        found = np.zeros((rows + 2 * above, columns + 2 * beside), np.int32)
        for cell, plane in enumerate(by_cell):
            y, x = divmod(cell, 2 * self.aside + 1)
            found[CELL_STEPS * y : CELL_STEPS * y + rows, CELL_STEPS * x : CELL_STEPS * x + columns] += plane
        return found.astype(np.float32)

    def _parts(self, leaves: Leaves, total: Votes) -> Iterator[Votes]:
        """Part after part of `total` (places, cells) as it is filled with the votes of these leaves."""
        flat = leaves.reshape(len(leaves), -1)
        count = flat.shape[1]
        buffer = np.empty((min(PART, count), self.table.shape[2]), np.int16)
        for start in range(0, count, PART):
            part = total[start : start + PART]
            np.take(self.table[0], flat[0, start : start + PART], axis=0, out=part, mode="clip")
            for fern in range(1, len(flat)):
                more = buffer[: len(part)]
                np.take(self.table[fern], flat[fern, start : start + PART], axis=0, out=more, mode="clip")
                np.add(part, more, out=part)
            yield part

    @property
    def square_shift(self) -> int:
        """Bits dropped from squares of votes, so that the largest there can be fit into 16 bits."""
        return max(math.ceil(2.0 * math.log2(len(self.table) * MOST_VOTES)) - 15, 0)

    @property
    def margin(self) -> tuple[int, int]:
        """Rows and columns of grid places by which the farthest votes leave the picture."""
        return CELL_STEPS * self.up, CELL_STEPS * self.aside

    def voters(self, leaves: Leaves, centre: tuple[float, float], reach: float) -> Floats:
        """How much each place (rows, columns) voted for a centre (row, column of the grid, not padded).

        reach: standard deviation, grid steps, within which a vote is for it.
        """
        rows, columns = leaves.shape[1:]
        votes = self.cast(leaves).reshape(rows, columns, 2 * self.up + 1, 2 * self.aside + 1)
        row = np.arange(rows, dtype=np.float32)[:, None] - centre[0]
        column = np.arange(columns, dtype=np.float32)[:, None] - centre[1]
        down = row + CELL_STEPS * np.arange(-self.up, self.up + 1, dtype=np.float32)
        right = column + CELL_STEPS * np.arange(-self.aside, self.aside + 1, dtype=np.float32)
        near_down, near_right = (np.exp(-0.5 * (off / reach) ** 2) for off in (down, right))
        return np.asarray(np.einsum("yxab,ya,xb->yx", votes, near_down, near_right), np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class Voters:
    """How much each place of a grid voted for a spot: votes (rows, columns); the first place lies at
    `corner` (x, y) of the picture, the next ones `pitch` px apart."""

    votes: Floats
    corner: tuple[float, float]
    pitch: float

    def outside(self, boxes: Sequence[Box]) -> float:
        """Share of the votes, 0..1, that come from outside these boxes."""
        if not boxes or not self.votes.size:
            return 1.0
        y, x = (
            corner + self.pitch * np.arange(count)
            for corner, count in zip(reversed(self.corner), self.votes.shape, strict=True)
        )
        free = np.ones(self.votes.shape, np.bool_)
        for box in boxes:
            across, down = (x >= box.x) & (x <= box.x + box.w), (y >= box.y) & (y <= box.y + box.h)
            free &= ~(down[:, None] & across[None, :])
        total = float(self.votes.sum())
        return float(self.votes[free].sum()) / total if total > 0.0 else 1.0

    def support(self, shape: tuple[int, ...]) -> Mask:
        """Pixels (H, W) of the picture that voted: more than a share of the mean of their surroundings."""
        if not self.votes.any():
            return np.zeros(shape[:2], np.bool_)
        votes = smoothed(self.votes)
        mine = votes > SUPPORT_SHARE * votes[votes > 0.0].mean()
        to_picture = np.array([[self.pitch, 0.0, self.corner[0]], [0.0, self.pitch, self.corner[1]]])
        drawn = cv2.warpAffine(mine.astype(np.float32), to_picture, (shape[1], shape[0]))
        return np.asarray(drawn > 0.5, np.bool_)


def smoothed(votes: Floats) -> Floats:
    """Votes (rows, columns) smoothed over `BLUR_STEPS`."""
    return np.asarray(cv2.GaussianBlur(votes, (0, 0), BLUR_STEPS, borderType=cv2.BORDER_CONSTANT), np.float32)


def peak_of(votes: float, places: float, square_shift: int) -> float:
    """Height of the maximum about which so many votes of so many places for one centre leave once they are
    squared and smoothed; at least 1."""
    squares = votes**2 / max(places, 1.0) / 2.0**square_shift
    return max(squares / (2.0 * math.pi * BLUR_STEPS**2), 1.0)
