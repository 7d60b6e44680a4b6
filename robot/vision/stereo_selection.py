"""Which disparity wins at each pixel, METHODS 7 equation (7), and whether the right eye agrees.

Costs are compared packed with their level in the lowest bits of the mantissa, so that one running minimum
yields winner and cost together; costs equal to about one part in 2^15 count as equal, the smaller level wins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Levels = NDArray[np.int32]

MAX_LEVELS = 256
OUTSIDE = np.int32(np.iinfo(np.int32).max)
TINY = np.float32(1e-6)


@dataclass(frozen=True, slots=True, eq=False)
class Winners:
    """Per pixel (h, w): winning level with its fraction (float32), and what speaks for it.

    stable: the right eye's own winner for the pixel matched is the same level, give or take one.
    """

    level: Floats
    stable: Mask


def select(costs: Floats) -> Winners:
    """Winners of (L, h, w) non-negative float32 costs, 2 <= L <= 256.

    Only levels that lie inside the right picture compete; the fraction is that of two lines of equal slope
    through the winner's neighbours (truncated absolute differences make V-shaped valleys).

    >>> costs = np.ones((4, 1, 9), np.float32)
    >>> costs[2] = 0.0
    >>> won = select(costs)
    >>> float(won.level[0, 5]), bool(won.stable[0, 5])
    (2.0, True)
    """
    count, height, width = costs.shape
    if not 2 <= count <= MAX_LEVELS:
        raise ValueError(f"2 to {MAX_LEVELS} levels can be told apart, got {count}")
    packed, low_bits = _packed(costs)
    flat = packed.reshape(count, -1)
    for level in range(1, count):
        packed[level, :, :level] = OUTSIDE
    winner: Levels = np.minimum.reduce(packed, axis=0) & low_bits
    # The right eye's pixel x is the left one's x + level; what runs over a row's end meets only OUTSIDE.
    right = flat[0].copy()
    for level in range(1, min(count, width)):
        np.minimum(right[:-level], flat[level, level:], out=right[:-level])
    pixel = np.arange(height * width, dtype=np.int32).reshape(height, width)
    theirs = np.take(right, pixel - winner) & low_bits
    stable = np.abs(theirs - winner) <= 1
    found = winner.astype(np.float32) + _valley(*_around(costs, winner, pixel))
    return Winners(found, stable)


def greatest(scores: Floats) -> Floats:
    """Levels (h, w) with fraction of the greatest of (L, h, w) non-negative float32 scores, 2 <= L <= 256."""
    height, width = scores.shape[1:]
    packed, low_bits = _packed(scores)
    winner: Levels = np.maximum.reduce(packed, axis=0) & low_bits
    pixel = np.arange(height * width, dtype=np.int32).reshape(height, width)
    before, here, behind = _around(scores, winner, pixel)
    return winner.astype(np.float32) + _valley(-before, -here, -behind)


def _packed(costs: Floats) -> tuple[NDArray[np.int32], np.int32]:
    """Costs as integers of the same order with their level in the lowest bits, and the mask of those bits."""
    count = len(costs)
    low_bits = np.int32((1 << (count - 1).bit_length()) - 1)
    packed = costs.reshape(count, -1).view(np.int32) & ~low_bits
    for level in range(count):
        packed[level] |= np.int32(level)
    return packed.reshape(costs.shape), low_bits


def _around(volume: Floats, winner: Levels, pixel: Levels) -> tuple[Floats, Floats, Floats]:
    """The volume's values one level before the winner, at it and behind it; at the rims thrice its own."""
    pixels = volume[0].size
    step = np.where((winner > 0) & (winner < len(volume) - 1), pixels, 0)
    at, flat = winner.astype(np.intp) * pixels + pixel, volume.reshape(-1)
    return np.take(flat, at - step), np.take(flat, at), np.take(flat, at + step)


def _valley(before: Floats, here: Floats, behind: Floats) -> Floats:
    """Offset of a valley's floor from its middle sample, -0.5..0.5: that of two lines of equal slope."""
    depth = np.maximum(np.maximum(before, behind) - here, TINY)
    return np.clip(np.float32(0.5) * (before - behind) / depth, np.float32(-0.5), np.float32(0.5))
