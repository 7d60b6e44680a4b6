"""What a matcher leaves unmeasured that may be known all the same: specks, and the fringes of edges.

A window that sees two surfaces measures neither, so a matcher leaves a fringe at every edge, as wide as its
window, besides the strip that one eye alone sees. Taken for blocked, fringes close openings that are there.
Maps here are distances, (R, K) float32 metres, 0 where nothing was measured.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Index = NDArray[np.int32]
Mask = NDArray[np.bool_]

EDGE_PX = 2.0
"""Disparities that tell two surfaces apart."""
GUESS_SIGMA_PX, PLATEAU_PX = 1.0, 4
"""A guess less certain than this tells of no surface; so far behind an edge it must still tell of it."""
WINDOW_REACH_PX = 15.0
"""So far from an edge a window may fail to measure."""
SPECK_WINDOW, SPECK_SHARE = (5, 5), 0.6
"""Rows and columns about an unmeasured pixel, and how many of them must be measured to close it."""


def specks_closed(surface: Floats) -> Floats:
    """The surfaces with specks of unmeasured pixels closed: no farther than the nearest thing about them.

    Only where most of the neighbourhood is measured: a hole of some size stays one, and so does whatever
    is as wide as a post.

    >>> wall = np.full((9, 9), 2.0, np.float32)
    >>> wall[4, 4] = 0.0
    >>> float(specks_closed(wall)[4, 4])
    2.0
    """
    measured = surface > 0.0
    share = cv2.blur(measured.astype(np.float32), SPECK_WINDOW[::-1], borderType=cv2.BORDER_CONSTANT)
    known = np.where(measured, surface, np.float32(1e9))
    nearest = cv2.erode(known, np.ones(SPECK_WINDOW, np.uint8), borderType=cv2.BORDER_REPLICATE)
    return np.where(~measured & (share >= SPECK_SHARE), nearest, surface).astype(np.float32, copy=False)


def continued(surface: Floats, guess: Floats, sure: Mask, widest: int) -> Floats:
    """Far surfaces continued to both sides of each row, up to the nearer surfaces that end them.

    The matcher's guess tells where in a fringe the edge lies. It counts only between what is measured far and
    what is near by a `sure` guess: so the fringe of a hole in the map stays unknown.

    Args:
        surface: what was measured.
        guess: the matcher's disparities, px, measured or not.
        sure: where a guess is certain enough to tell of a surface.
        widest: pixels a fringe spans at most.
    """

    def to_right(surface: Floats, guess: Floats, sure: Mask) -> Floats:
        last = _last_measured(surface)
        own = _at(guess, last)
        run = _Run.of(surface, last, np.abs(guess - own) >= EDGE_PX)
        near = [_at(guess, at) - own >= EDGE_PX for at in (run.end, run.further)]
        joined = run.joined(widest) & near[0] & near[1] & _at(sure, run.further)
        return np.where(joined, _at(surface, last), surface)

    return np.maximum(to_right(surface, guess, sure), _mirrored(to_right, surface, guess, sure))


def continued_behind(surface: Floats, guess: Floats, near: Mask, sure: Mask, hidden: Floats) -> Floats:
    """Like `continued` before one known surface: all that is not `near` (R, K) lies behind it.

    There a fringe may show several far things: each keeps the distance guessed for it, `guess` in metres. A
    fringe is as wide as a window reaches; to the left of a near thing also by what that hides from the right
    eye, `hidden` (R, K) pixels: by how much its disparity exceeds that of what is guessed behind it.
    """

    def to_right(surface: Floats, guess: Floats, near: Mask, sure: Mask, widest: Floats) -> Floats:
        last = _last_measured(surface)
        run = _Run.of(surface, last, near)
        ended = _at(near, run.end) & _at(near, run.further)
        joined = run.inside & (run.end - last <= widest) & ended & ~_at(near, last)
        joined &= _at(sure, run.further)
        return np.where(joined, guess, surface)

    reach = np.full_like(hidden, WINDOW_REACH_PX)
    return np.maximum(
        to_right(surface, guess, near, sure, reach + hidden),
        _mirrored(to_right, surface, guess, near, sure, reach),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """The unmeasured run a pixel is inside of: the measured pixel before it, its end, a bit further on."""

    inside: Mask
    last: Index
    end: Index
    further: Index

    @classmethod
    def of(cls, surface: Floats, last: Index, leaves: Mask) -> _Run:
        """Runs of pixels after a measured one that do not leave its surface."""
        width = surface.shape[1]
        columns = np.arange(width, dtype=np.int32)
        measured = surface > 0.0
        left_at = np.maximum.accumulate(np.where(leaves & ~measured, columns, np.int32(-1)), axis=1)
        inside = ~measured & (left_at < last) & _at(measured, last)
        end = np.minimum.accumulate(np.where(inside, np.int32(width - 1), columns)[:, ::-1], axis=1)[:, ::-1]
        return cls(inside, last, end, np.minimum(end + PLATEAU_PX, width - 1))

    def joined(self, widest: int) -> Mask:
        """Pixels of runs no longer than this."""
        short: Mask = self.inside & (self.end - self.last <= widest)
        return short


def _last_measured(surface: Floats) -> Index:
    columns = np.arange(surface.shape[1], dtype=np.int32)
    return np.maximum.accumulate(np.where(surface > 0.0, columns, np.int32(0)), axis=1)


def _at(plane: NDArray[Any], columns: Index) -> NDArray[Any]:
    """Values of a plane (R, K) at one column for every pixel."""
    height, width = plane.shape
    rows = np.arange(0, height * width, width, dtype=np.int32)[:, None]
    return np.take(np.ascontiguousarray(plane), columns + rows)


def _mirrored(function: Callable[..., Floats], *maps: NDArray[Any]) -> Floats:
    return function(*(plane[:, ::-1] for plane in maps))[:, ::-1]
