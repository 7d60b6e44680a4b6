"""The second disparity-space volume, METHODS 7 equation (8): neighbours vote where the eyes disagree.

DSV(u, v, d) = |d - D(u, v)| on stable pixels, aggregated with the same adaptive weights as the costs, and
the level of the least sum wins. With distances cut off at `REACH` levels (a neighbour on another surface
shall not pull) that is the level of the most votes, a vote counting for its own level and, less, for those
beside it. So the grid is filled with votes straight away and the volume is never built. Pixels that were
filled in before vote with a small weight, which decides where no stable one is near.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image
from robot.vision.stereo_aggregation import (
    Support,
    by_cells,
    by_rows,
    sample_intensities,
    shares,
    smoothed,
)
from robot.vision.stereo_selection import greatest

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

SUPPORT = Support()
REACH = 2
"""Levels from which on a vote no longer counts."""


@dataclass(frozen=True, slots=True)
class Voting:
    """support: whose votes count. filled_weight: the vote of a pixel filled in, a stable one's being 1."""

    support: Support = SUPPORT
    filled_weight: float = 0.1

    def __post_init__(self) -> None:
        if not 0.0 <= self.filled_weight <= 1.0:
            raise ValueError(f"filled_weight must be 0 to 1, got {self.filled_weight}")


def vote(levels: Floats, stable: Mask, guide: Image, count: int, voting: Voting) -> Floats:
    """Levels (h, w) float32 most voted for among each pixel's neighbours.

    Args:
        levels: (h, w) float32 in 0..count - 1, filled everywhere.
        stable: (h, w), which of them the right eye agrees with.
        guide: (h, w) uint8, the left picture at that size; h and w multiples of the support's cell.
        count: number of levels, at least 4.
        voting: how neighbours vote.

    >>> speck = np.full((12, 12), 5.0, np.float32)
    >>> speck[6, 6] = 9.0
    >>> float(vote(speck, np.ones((12, 12), np.bool_), np.zeros((12, 12), np.uint8), 16, Voting())[6, 6])
    5.0
    """
    support = voting.support
    height, width = guide.shape
    share = shares(sample_intensities(guide, support.clusters))
    weight = np.where(stable, np.float32(1.0), np.float32(voting.filled_weight))
    votes = _ballots(np.clip(levels, 0.0, count - 1.0), weight, guide, share, count, support)
    mixed = np.matmul(by_cells(np.take(share, guide, axis=0), support.cell), smoothed(votes, support))
    sums = cv2.transpose(by_rows(mixed, support.cell).reshape(height * width, count))
    return greatest(np.asarray(sums, np.float32).reshape(count, height, width))


def _ballots(
    levels: Floats, weight: Floats, guide: Image, share: Floats, count: int, support: Support
) -> Floats:
    """Votes for each cell, sample and level: a pixel's vote is split between two samples."""
    height, width = guide.shape
    rows, columns = height // support.cell, width // support.cell
    lower = np.minimum((share > 0).argmax(axis=1), support.clusters - 2)
    upper_share = share[np.arange(256), lower + 1]
    cell = (np.arange(height) // support.cell)[:, None] * columns + (np.arange(width) // support.cell)
    level = np.clip(levels.astype(np.int64), 1, count - REACH - 1)
    part = (levels - level).astype(np.float32)
    first = (cell * support.clusters + lower[guide]) * count + level
    above = upper_share[guide]
    places, counts = [], []
    for sample, sample_share in ((0, 1.0 - above), (1, above)):
        for step in range(1 - REACH, REACH + 1):
            places.append((first + sample * count + step).ravel())
            pull = np.maximum(REACH - np.abs(step - part), np.float32(0.0))
            counts.append((weight * sample_share * pull).ravel())
    size = rows * columns * support.clusters * count
    ballots = np.bincount(np.concatenate(places), np.concatenate(counts), minlength=size)
    return ballots.astype(np.float32).reshape(rows, columns, support.clusters, count)
