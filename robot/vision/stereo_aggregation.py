"""Adaptive-weight aggregation of matching costs with K clustered intensities, METHODS 7 equations (2)-(6).

A pixel's cost is the mean of its neighbours' costs, weighted by nearness and by likeness of grey value. The
weight of likeness is written through K sample intensities m_n: pixels share themselves out among the
samples nearest to their grey value (h_n, g_n), costs are gathered for each sample on a grid of cells, the
spatial weight S smooths that grid, and every pixel reads its own mixture of samples:

    C = sum_n g_n S(h_n M) / sum_n g_n S(h_n)

so the cost of a disparity does not depend on the window's size. Two departures from [T]: samples are
clustered over the picture instead of each neighbourhood, and S has a heavy tail, which carries over blank
surfaces what their rims know.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image

Floats = NDArray[np.float32]
Planes = NDArray[np.uint8]

EMPTY = np.float32(1e-6)
MOST_AT_ONCE = 32
"""Levels aggregated together: more do not fit into the processor's cache."""


@dataclass(frozen=True, slots=True)
class Support:
    """Whose costs count for a pixel. Lengths in pixels of the cost planes (half the picture's).

    clusters: K, a power of two from 2 to 32. cell: side of a grid cell. sigma, tail_sigma: standard
    deviations of the spatial weight's core and tail; tail: the tail's height, the core's being 1.
    """

    clusters: int = 8
    cell: int = 3
    sigma: float = 1.5
    tail: float = 0.03
    tail_sigma: float = 24.0

    def __post_init__(self) -> None:
        if self.clusters not in (2, 4, 8, 16, 32):
            raise ValueError(f"clusters must be 2, 4, 8, 16 or 32, got {self.clusters}")
        if self.cell < 1 or self.sigma <= 0.0 or self.tail_sigma <= 0.0 or self.tail < 0.0:
            raise ValueError(
                "cell, sigma and tail_sigma must be positive, tail not negative, "
                f"got {self.cell}, {self.sigma}, {self.tail_sigma}, {self.tail}"
            )


def sample_intensities(grey: Image, count: int) -> Floats:
    """(count,) ascending sample intensities m_n: means of halves of halves of the grey values.

    Hierarchical clustering as METHODS 7 reads [T]: split at the mean, take each side's mean, repeat.

    >>> [float(m) for m in sample_intensities(np.array([[0, 10, 100, 120]], np.uint8), 4)]
    [0.0, 10.0, 100.0, 120.0]
    """
    histogram = np.bincount(grey.ravel(), minlength=256).astype(np.float64)
    first = np.concatenate([[0.0], np.cumsum(histogram)])
    moment = np.concatenate([[0.0], np.cumsum(histogram * np.arange(256))])
    spans = [(0, 256)]
    while len(spans) < count:
        halves = []
        for low, high in spans:
            split = int(np.ceil(_mean(first, moment, low, high)))
            halves += [(low, split), (split, high)]
        spans = halves
    return np.array([_mean(first, moment, low, high) for low, high in spans], np.float32)


def _mean(first: NDArray[np.float64], moment: NDArray[np.float64], low: int, high: int) -> float:
    """Mean grey value of the pixels in low..high - 1; where there are none, the middle between."""
    count = float(first[high] - first[low])
    return float(moment[high] - moment[low]) / count if count else 0.5 * (low + high)


def shares(samples: Floats) -> Floats:
    """(256, K) float32: how each grey value is shared out among its two nearest samples."""
    grey = np.arange(256, dtype=np.float32)
    knots = np.maximum.accumulate(samples + np.float32(1e-3) * np.arange(len(samples), dtype=np.float32))
    return np.stack(
        [np.interp(grey, knots, unit) for unit in np.eye(len(samples), dtype=np.float32)], axis=1
    ).astype(np.float32)


def aggregate(levels: Planes, guide: Image, support: Support) -> Floats:
    """Adaptive-weight means of the cost planes.

    Args:
        levels: (L, h, w) uint8, h and w multiples of the support's cell.
        guide: (h, w) uint8, the left picture at the planes' size.
        support: whose costs count.

    Returns:
        (L, h, w) float32.

    >>> flat = aggregate(np.full((2, 6, 6), 7, np.uint8), np.zeros((6, 6), np.uint8), Support())
    >>> bool(np.allclose(flat, 7.0))
    True
    """
    count, height, width = levels.shape
    cell = support.cell
    share = by_cells(np.take(shares(sample_intensities(guide, support.clusters)), guide, axis=0), cell)
    weights = np.ascontiguousarray(share.transpose(0, 1, 3, 2))
    out, done = np.empty((count, height, width), np.float32), 0
    flat = out.reshape(count, height * width)
    # (einsum sums short axes ten times as fast as sum.)
    gathered = smoothed(np.einsum("yxnp->yxn", weights)[..., None], support)
    share = share / np.maximum(np.matmul(share, gathered), EMPTY)
    for piece in np.array_split(levels, math.ceil(count / MOST_AT_ONCE)):
        costs = by_cells(cv2.transpose(piece.reshape(len(piece), -1)).reshape(height, width, -1), cell)
        mixed = np.matmul(share, smoothed(np.matmul(weights, costs), support))
        cv2.transpose(by_rows(mixed, cell).reshape(height * width, -1), dst=flat[done : done + len(piece)])
        done += len(piece)
    return out


def smoothed(nodes: Floats, support: Support) -> Floats:
    """S over the grid: one dense product along each axis."""
    rows, columns, clusters, width = nodes.shape
    along = np.matmul(_spatial(columns, support), nodes.reshape(rows, columns, clusters * width))
    across = _spatial(rows, support) @ along.reshape(rows, -1)
    return np.asarray(across, np.float32).reshape(nodes.shape)


@lru_cache(maxsize=16)
def _spatial(cells: int, support: Support) -> Floats:
    away = support.cell * (np.arange(cells)[:, None] - np.arange(cells)[None, :])
    core = np.exp(-(away**2) / (2.0 * support.sigma**2))
    return (core + support.tail * np.exp(-(away**2) / (2.0 * support.tail_sigma**2))).astype(np.float32)


def by_cells(picture: NDArray[np.generic], cell: int) -> Floats:
    """(h, w, n) to (h / cell, w / cell, cell * cell, n) float32."""
    height, width, depth = picture.shape
    blocks = picture.reshape(height // cell, cell, width // cell, cell, depth).transpose(0, 2, 1, 3, 4)
    out = np.empty(blocks.shape, np.float32)
    out[...] = blocks
    return out.reshape(height // cell, width // cell, cell * cell, depth)


def by_rows(blocks: Floats, cell: int) -> Floats:
    """The way back from `by_cells`."""
    rows, columns, _, depth = blocks.shape
    split = blocks.reshape(rows, columns, cell, cell, depth).transpose(0, 2, 1, 3, 4)
    return np.ascontiguousarray(split).reshape(rows * cell, columns * cell, depth)
