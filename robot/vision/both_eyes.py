"""What each of two eyes sees, from the one map a matcher gives.

A matcher looks from the left eye. Beside everything near lies a strip that one eye alone sees: left of it in
the left picture, right of it in the right one. So an opening's left side is seen best by the left eye and its
right side by the right one; from there the surfaces are continued to the edge (`continuation`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot.messages import Image
from robot.vision.continuation import Surfaces, bridged, to_the_rims, up_and_down
from robot.vision.disparity import Disparity
from robot.vision.eye_pair import EyePair
from robot.vision.own_texture import may_be_boards, own_texture
from robot.vision.pair_input import grey_pair

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

ROW_STEP = 2
"""Every second row is looked at: neighbouring rows of a matcher's map say the same."""
CONTINUED_SIGMA_PX = 0.3
"""Of a disparity taken from the surface beside it, or seen by the other eye."""


@dataclass(frozen=True, slots=True, eq=False)
class BothEyes:
    """Disparities by the left eye's pixels and by the right eye's, (H, W) each."""

    left: Disparity
    right: Disparity

    @classmethod
    def of(cls, disparity: Disparity) -> BothEyes:
        """Both eyes by the left eye's map alone, nothing continued."""
        seen = moved_to_right(Surfaces(disparity.values, disparity.valid))
        return cls(disparity, _as_disparity(seen))


def see(disparity: Disparity, left: Image, right: Image, rows: int | None = None) -> BothEyes:
    """What both eyes see: the measured surfaces continued to where they really end.

    What was measured without texture of its own counts only if the surfaces beside it agree.

    Args:
        disparity: of the left picture, by any matcher.
        left, right: the rectified pair it was measured in, (H, W[, 3]) uint8.
        rows: so many from the top are looked at, the others left as they were measured; None: all.

    Raises:
        ValueError: pictures that are no pair, or not of the map's size.

    >>> wood = np.random.default_rng(1).integers(0, 255, (40, 120), np.uint8)
    >>> valid = np.ones((40, 100), np.bool_)
    >>> valid[10:30, 40:60] = False
    >>> flat = Disparity(np.full((40, 100), 8.0, np.float32), valid, np.full((40, 100), 0.1, np.float32))
    >>> eyes = see(flat, wood[:, 8:108], wood[:, 16:116])
    >>> bool(eyes.left.valid[20, 20:90].all()), bool(eyes.right.valid[20, 20:80].all())
    (True, True)
    """
    pair, measured, boards = _looked_at(disparity, left, right, rows)
    whole = bridged(measured, pair)
    by_left = to_the_rims(Surfaces(whole.values, whole.known & ~boards), pair)
    by_right = to_the_rims(moved_to_right(by_left).mirrored, pair.mirrored).mirrored
    return _joined(disparity, by_left, by_right)


def plates_continued(eyes: BothEyes, left: Image, right: Image) -> BothEyes:
    """The same with surfaces continued upwards and downwards too, where no floor is in view.

    Good for finding a rim, not for proof: where texture above a bare thing's edge tells, the surface behind
    goes on over the edge and down the thing.

    Args:
        eyes: what `see` gave for all rows of this pair.
        left, right: the pair, (H, W[, 3]) uint8.
    """
    pair = EyePair.of(*grey_pair(left, right), ROW_STEP)
    by_left, by_right = (Surfaces(e.values[::ROW_STEP], e.valid[::ROW_STEP]) for e in (eyes.left, eyes.right))
    return _joined(
        eyes.left, up_and_down(by_left, pair), up_and_down(by_right.mirrored, pair.mirrored).mirrored
    )


def _looked_at(
    disparity: Disparity, left: Image, right: Image, rows: int | None
) -> tuple[EyePair, Surfaces, Mask]:
    """Every `ROW_STEP`-th row: the pair, what was measured by texture of its own, what may be a board."""
    greys = grey_pair(left, right)
    if greys[0].shape != disparity.values.shape:
        raise ValueError(f"the disparity map is {disparity.values.shape}, its pictures are {greys[0].shape}")
    pair = EyePair.of(greys[0][:rows], greys[1][:rows], ROW_STEP)
    values, answered = disparity.values[:rows], disparity.valid[:rows:ROW_STEP]
    textured = own_texture(values, *(grey[:rows] for grey in greys))[::ROW_STEP]
    measured = Surfaces(values[::ROW_STEP], answered & textured)
    return pair, measured, may_be_boards(answered & ~textured, measured.known, pair.own)


def _joined(disparity: Disparity, by_left: Surfaces, by_right: Surfaces) -> BothEyes:
    """Maps of all rows: those looked at for themselves and the next, the others as they were measured."""
    values, valid = disparity.values[::ROW_STEP], disparity.valid[::ROW_STEP]
    below = Surfaces(values[len(by_left.values) :], valid[len(by_left.values) :])
    left, right = _over(by_left, below), _over(by_right, moved_to_right(below))
    measured, height = valid & (left.values == values), len(disparity.values)
    sigma = np.where(measured, disparity.sigma_px[::ROW_STEP], np.float32(CONTINUED_SIGMA_PX))
    return BothEyes(_all_rows(_as_disparity(left, sigma), height), _all_rows(_as_disparity(right), height))


def _over(above: Surfaces, below: Surfaces) -> Surfaces:
    return Surfaces(np.vstack([above.values, below.values]), np.vstack([above.known, below.known]))


def moved_to_right(surfaces: Surfaces) -> Surfaces:
    """The same surfaces by the right eye's columns; of two at one column the nearer one."""
    width = surfaces.values.shape[1]
    row, column = np.nonzero(surfaces.known)
    disparity = surfaces.values[row, column]
    other = column - np.rint(disparity).astype(np.intp)
    inside = (other >= 0) & (other < width)
    values, known = np.zeros_like(surfaces.values), np.zeros_like(surfaces.known)
    # Of what falls on one column the nearer thing lies farther to the right: it is written last.
    values[row[inside], other[inside]] = disparity[inside]
    known[row[inside], other[inside]] = True
    # A surface seen wider by the right eye leaves holes of a column: the nearer neighbour bounds them.
    hole = ~known[:, 1:-1] & known[:, :-2] & known[:, 2:]
    values[:, 1:-1][hole] = np.maximum(values[:, :-2], values[:, 2:])[hole]
    known[:, 1:-1] |= hole
    return Surfaces(values, known)


def _as_disparity(surfaces: Surfaces, sigma: Floats | None = None) -> Disparity:
    sigma = np.full_like(surfaces.values, CONTINUED_SIGMA_PX) if sigma is None else sigma
    return Disparity(surfaces.values, surfaces.known, np.where(surfaces.known, sigma, np.float32(np.inf)))


def _all_rows(looked: Disparity, height: int) -> Disparity:
    """A map of all rows, each of those looked at for itself and the next."""
    row = np.arange(height) // ROW_STEP
    return Disparity(looked.values[row], looked.valid[row], looked.sigma_px[row])
