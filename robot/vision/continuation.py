"""Surfaces continued along the rows to where they really end: an edge lies where the eyes begin to disagree.

A matcher's windows measure a surface well inside it, but near an edge they see two surfaces, and over a bare
spot nothing at all: they answer with a fringe of nothing, or with the neighbour's disparity. What surrounds
such a run of pixels leaves few disparities to choose from, and between few the grey values of single pixels
decide: those of a column some pixels high are as good as a window, and sharp across an edge.

Three rules, for the eye in which a near thing hides nothing of what lies to its right (the other eye is the
same mirrored, see `both_eyes`):

1. Between two ends of one surface the surface goes on, if the eyes agree on all of it. Whatever else stood
   there would show an edge that moves otherwise.
2. Between a near surface and a far one to its right the run is cut where that explains both eyes best.
3. A far surface goes on towards what is nearer or unknown until the eyes disagree, a window's reach at most.

Rule 2 is scan-line stereo between known ends (Ohta and Kanade, "Stereo by intra- and inter-scanline search",
PAMI 1985), costs summed over a few rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.vision.eye_pair import EyePair, alike_limit, averaged
from robot.vision.row_runs import Runs, at

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

ONE_SURFACE_PX = 2.0
"""Disparities of two ends nearer to each other than this are of one surface."""
SHORT_PX, EDGE_GREY = 24, 12
"""A longer run with an edge in it may as well be a bare room seen through a gap: it stays unknown."""
TELLING_PX = 9
"""So wide about a pixel some gradient along the row must show whether the eyes agree."""
MARGIN_PX = 6
"""So far beside a run a window may already have answered with the other surface."""
WIDEST_CUT_PX, REACH_PX = 90, 30
"""A run is cut if it is no wider; a surface goes on as far into the unknown."""
TALL = 5
"""Rows looked at whose costs are summed where a run is cut."""
SURE = 60.0
"""Grey levels, summed over a run and `TALL` rows, by which a cut must explain the eyes better than none."""


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """Disparities (H, W) float32 px of the rows looked at, and where they are known, (H, W) bool."""

    values: Floats
    known: Mask

    @property
    def mirrored(self) -> Surfaces:
        """Left and right exchanged."""
        return Surfaces(np.ascontiguousarray(self.values[:, ::-1]), np.ascontiguousarray(self.known[:, ::-1]))


def bridged(surfaces: Surfaces, pair: EyePair) -> Surfaces:
    """The surfaces with every run filled that lies between two ends of one surface (rule 1).

    >>> wood = np.random.default_rng(1).integers(0, 255, (20, 120), np.uint8)
    >>> pair = EyePair.of(wood[:, 8:108], wood[:, 16:116], 1)
    >>> known = np.ones((20, 100), np.bool_)
    >>> known[5:15, 40:60] = False
    >>> found = bridged(Surfaces(np.full((20, 100), 8.0, np.float32), known), pair)
    >>> bool(found.known[:, 20:].all())
    True
    """
    runs = Runs.of(surfaces.known)
    left, right = _ends(surfaces.values, runs)
    one = runs.between & (np.abs(left - right) < ONE_SURFACE_PX)
    between = _between(left, right, runs)
    unlike = averaged(pair.unlike(np.where(one, between, surfaces.values)))
    limit = alike_limit(unlike, surfaces.known)
    agreed = one & (runs.total(unlike > limit) == 0)
    agreed &= (runs.length <= SHORT_PX) | (runs.total(pair.edges > EDGE_GREY) == 0)
    return Surfaces(np.where(agreed, between, surfaces.values), surfaces.known | agreed)


def to_the_rims(surfaces: Surfaces, pair: EyePair) -> Surfaces:
    """The surfaces with every far one continued up to the near one that ends it (rules 2 and 3).

    >>> rng = np.random.default_rng(2)
    >>> wall, post = rng.integers(0, 255, (20, 120), np.uint8), rng.integers(0, 255, (20, 30), np.uint8)
    >>> left, right = wall[:, 4:104].copy(), wall[:, 8:108].copy()
    >>> left[:, 30:60], right[:, 14:44] = post, post
    >>> values = np.full((20, 100), 4.0, np.float32)
    >>> values[:, 30:66] = 16.0
    >>> known = np.ones((20, 100), np.bool_)
    >>> known[:, 20:38] = known[:, 54:68] = False
    >>> found = to_the_rims(Surfaces(values, known), EyePair.of(left, right, 1))
    >>> found.values[10, [58, 62]].tolist()
    [16.0, 4.0]
    """
    runs = Runs.of(surfaces.known & ~_beside(~surfaces.known))
    left, right = _ends(surfaces.values, runs)
    falls = runs.between & (left - right >= ONE_SURFACE_PX) & (runs.length <= WIDEST_CUT_PX)
    left, right = (
        np.where(has, end, np.float32(0.0)) for has, end in ((runs.has_before, left), (runs.has_after, right))
    )
    by_left, by_right = pair.unlike(left), pair.unlike(right)
    mean_left, mean_right = averaged(by_left), averaged(by_right)
    limit = alike_limit(np.where(runs.has_after, mean_right, mean_left), surfaces.known)

    cut, far = _cut(runs, falls, by_left, by_right)
    far &= mean_right <= limit
    one = runs.between & (np.abs(left - right) < ONE_SURFACE_PX)
    unknown = runs.inside & ~surfaces.known & ~one & ~cut
    back = unknown & runs.has_after & (~runs.has_before | (right <= left))
    back &= _until(runs, mean_right <= limit, backwards=True)
    on = unknown & runs.has_before & (~runs.has_after | (left <= right)) & ~back
    on &= _until(runs, mean_left <= limit, backwards=False)
    values = np.where(far | back, right, np.where(on, left, surfaces.values))
    return Surfaces(values, surfaces.known | far | back | on)


def up_and_down(surfaces: Surfaces, pair: EyePair) -> Surfaces:
    """The surfaces continued upwards and downwards too, where the eyes agree and no edge is crossed.

    For what does not change its disparity with the row: walls, plates, not floors. An edge along a row says
    nothing to eyes side by side, so it stops the surface unless there is texture about it that does.
    """
    runs = Runs.of(np.ascontiguousarray(surfaces.known.T))
    values = np.ascontiguousarray(surfaces.values.T)
    above, below = (np.ascontiguousarray(end.T) for end in _ends(values, runs))
    telling = cv2.dilate(pair.edges, np.ones((1, TELLING_PX), np.uint8)) >= EDGE_GREY // 2
    steep = ((pair.steps >= EDGE_GREY // 2) & ~telling).T
    found, known = surfaces.values, surfaces.known
    for end, has, backwards in ((below, runs.has_after, True), (above, runs.has_before, False)):
        alike = averaged(pair.unlike(end))
        limit = alike_limit(alike, surfaces.known)
        goes_on = _until(runs, np.ascontiguousarray((alike <= limit).T) & ~steep, backwards=backwards)
        filled = np.ascontiguousarray((goes_on & runs.inside & has).T) & ~known
        found, known = np.where(filled, end, found), known | filled
    return Surfaces(found, known)


def _beside(unknown: Mask) -> Mask:
    return cv2.dilate(unknown.view(np.uint8), np.ones((1, 2 * MARGIN_PX + 1), np.uint8)) > 0


def _ends(values: Floats, runs: Runs) -> tuple[Floats, Floats]:
    return at(values, runs.before), at(values, runs.after)


def _between(left: Floats, right: Floats, runs: Runs) -> Floats:
    """Disparities from one end of each run to the other."""
    column = np.arange(left.shape[1], dtype=np.int32)
    share = (column - runs.before).astype(np.float32) / np.maximum(runs.length, 1).astype(np.float32)
    return np.asarray(left + (right - left) * share, np.float32)


def _cut(runs: Runs, falls: Mask, by_near: NDArray[np.uint8], by_far: NDArray[np.uint8]) -> tuple[Mask, Mask]:
    """The runs that are surely cut in two, and of them what lies behind the cut, on the far side."""
    gain = np.where(falls, by_near.astype(np.float32) - by_far, np.float32(0.0))
    gain = cv2.boxFilter(gain, -1, (1, TALL), normalize=False)
    sure, behind = np.zeros(falls.shape, np.bool_), np.zeros(falls.shape, np.bool_)
    rows = np.flatnonzero(falls.any(axis=1))
    if len(rows):
        falling = falls[rows]
        cut, least, total = runs.of_rows(rows).cheapest_cut(np.where(falling, gain[rows], np.float32(0.0)))
        sure[rows] = falling & (total - least >= SURE)
        behind[rows] = sure[rows] & (np.arange(falls.shape[1], dtype=np.int32) > cut)
    return sure, behind


def _until(runs: Runs, alike: Mask, *, backwards: bool) -> Mask:
    """Pixels up to the first that is not alike, from a run's end back or from its beginning on."""
    column = np.arange(alike.shape[1], dtype=np.int32)
    breaks = runs.inside & ~alike
    if backwards:
        last = np.maximum.accumulate(np.where(breaks, column, np.int32(-1)), axis=1)
        return np.asarray((column > at(last, runs.after - 1)) & (runs.after - column <= REACH_PX), np.bool_)
    first = np.minimum.accumulate(np.where(breaks, column, np.int32(len(column)))[:, ::-1], axis=1)[:, ::-1]
    return np.asarray((column < at(first, runs.before + 1)) & (column - runs.before <= REACH_PX), np.bool_)
