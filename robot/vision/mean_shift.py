"""Maxima of votes in (x, y, scale) by mean shift: Comaniciu and Meer (PAMI 2002), METHODS 8."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

WINDOW = 0.15
"""Half the window's edge, of the object's extent."""
STEPS, STILL_PX = 4, 0.2
NEIGHBOURS = 1
"""Levels to both sides that a window holds."""
FINER = 1.6
"""A finer level shows more places of an object, and so more votes for it: where its size is sought they count
less, by this power of the level's size."""
APART = 0.5
"""Two maxima whose middles lie nearer, of the extent, are of one object."""


@dataclass(frozen=True, slots=True)
class Peak:
    """A maximum: middle (u, v) in pixels of the full picture, scale over the reference's size, its score."""

    u: float
    v: float
    scale: float
    score: float


def peaks(
    maps: Sequence[Floats],
    shrinks: Sequence[float],
    margin: tuple[int, int],
    step_px: int,
    extent: tuple[float, float],
    least: float,
    most: int,
) -> list[Peak]:
    """The highest maxima, best first.

    Args:
        maps: votes of each level of a pyramid on its grid, finest level first.
        shrinks: size of each level over the full picture's.
        margin: columns and rows of places before the picture's first pixel.
        step_px: pixels of the level from place to place.
        extent: (width, height) of the object at reference size, px.
        least: lower ones do not count. most: of so many starts at most.
    """
    window = [max(round(WINDOW * edge / step_px), 1) for edge in extent]
    starts = []
    for level, votes in enumerate(maps):
        highest = cv2.dilate(votes, np.ones((2 * window[1] + 1, 2 * window[0] + 1), np.uint8))
        rows, columns = np.nonzero((votes >= highest) & (votes >= least))
        starts += [(float(votes[r, c]), level, int(r), int(c)) for r, c in zip(rows, columns, strict=True)]
    starts.sort(reverse=True)
    found: list[Peak] = []
    for score, level, row, column in starts[: 3 * most]:
        shrink = shrinks[level]
        start = Peak(
            (column - margin[0]) * step_px / shrink, (row - margin[1]) * step_px / shrink, 1.0 / shrink, score
        )
        if any(_same(start, other, extent) for other in found):
            continue
        found.append(_climbed(start, maps, shrinks, margin, step_px, window))
        if len(found) == most:
            break
    return sorted(found, key=lambda p: -p.score)


def _same(one: Peak, other: Peak, extent: tuple[float, float]) -> bool:
    scale = max(one.scale, other.scale)
    return math.hypot((one.u - other.u) / extent[0], (one.v - other.v) / extent[1]) < APART * scale


def _climbed(
    peak: Peak,
    maps: Sequence[Floats],
    shrinks: Sequence[float],
    margin: tuple[int, int],
    step_px: int,
    window: Sequence[int],
) -> Peak:
    """Mean shift from a start: to the votes' centre of gravity in a window about it, until it stands."""
    for _ in range(STEPS):
        nearest = int(np.argmin([abs(math.log(s * peak.scale)) for s in shrinks]))
        total, moments = 0.0, np.zeros(3)
        for level in range(max(nearest - NEIGHBOURS, 0), min(nearest + NEIGHBOURS + 1, len(maps))):
            per_px = shrinks[level] / step_px
            column, row = peak.u * per_px + margin[0], peak.v * per_px + margin[1]
            votes = maps[level]
            x0, y0 = (max(round(c) - w, 0) for c, w in zip((column, row), window, strict=True))
            part = votes[y0 : round(row) + window[1] + 1, x0 : round(column) + window[0] + 1]
            if not part.size:
                continue
            weights = (part.astype(np.float64) / shrinks[level] ** FINER) ** 2
            weight = float(weights.sum())
            x = (
                weights.sum(axis=0) @ np.arange(x0, x0 + part.shape[1]) / max(weight, 1e-9) - margin[0]
            ) / per_px
            y = (
                weights.sum(axis=1) @ np.arange(y0, y0 + part.shape[0]) / max(weight, 1e-9) - margin[1]
            ) / per_px
            total += weight
            moments += weight * np.array([x, y, -math.log(shrinks[level])])
        if total <= 0.0:
            return peak
        u, v, log_scale = moments / total
        moved = math.hypot(u - peak.u, v - peak.v)
        peak = Peak(float(u), float(v), math.exp(log_scale), peak.score)
        if moved < STILL_PX * peak.scale:
            break
    return peak
