"""Can the picture be trusted? Cheap checks of every pair, and the sign test that finds exchanged eyes.

In a parallel pair everything lies further to the right in the left picture: u_l - u_r >= 0 from the
principal points. Exchanged eyes turn every sign. A range computed from such a pair is nonsense, so the test
comes first.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image, StereoFrame

BLACK_BELOW = 8
"""Grey level (0..255) that a lens cap's picture nowhere exceeds by more than single hot pixels."""
GRID = 8
"""The cheap checks look at every eighth pixel in both directions."""

CORNERS = 48
HALF_PX, REACH_PX = 5, 40
"""Half a corner's patch and the columns searched to each side, both in the half-size picture."""
LEAST_CORRELATION, RIVAL_MARGIN = 0.75, 0.12
LEAST_SHIFT_PX = 1
"""Shifts up to this say nothing about the sign (far things, a small error of the principal points)."""
LEAST_VOTES, MAJORITY = 8, 0.9
"""At least so many corners must say 'exchanged', and so large a share of those that say anything."""


def brightness(image: Image) -> float:
    """Mean grey level 0..255 of a picture (H, W) or (H, W, 3), from every eighth pixel.

    >>> brightness(np.full((32, 32, 3), 40, np.uint8))
    40.0
    """
    return float(image[::GRID, ::GRID].mean())


def picture_fault(frame: StereoFrame, previous: StereoFrame | None) -> str | None:
    """The first fault a pair shows: 'size', 'black', 'frozen' or None. previous: the pair before, if any."""
    if sizes_differ(frame.left, frame.right):
        return "size"
    if is_black(frame.left) or is_black(frame.right):
        return "black"
    if previous is not None and is_frozen(frame, previous):
        return "frozen"
    return None


def sizes_differ(left: Image, right: Image) -> bool:
    """True if the eyes' pictures differ in size or are empty."""
    return left.shape != right.shape or left.size == 0


def is_black(image: Image) -> bool:
    """True if an eye sees nothing at all (a cap, a dead sensor); a night picture still shows something."""
    return bool(np.percentile(image[::GRID, ::GRID], 99.5) < BLACK_BELOW)


def is_frozen(frame: StereoFrame, previous: StereoFrame) -> bool:
    """True if either eye gave the very bytes of the pair before: a live sensor's noise never does."""
    if frame.seq == previous.seq:
        return False  # the same pair looked at twice
    return _same(frame.left, previous.left) or _same(frame.right, previous.right)


def _same(one: Image, other: Image) -> bool:
    if one.shape != other.shape or not np.array_equal(one[::GRID, ::GRID], other[::GRID, ::GRID]):
        return False
    return np.array_equal(one, other)


# ------------------------------------------------------------------------------------- exchanged eyes


@dataclass(frozen=True, slots=True)
class SignVotes:
    """How many corners lie farther right in the left picture (as they must), how many farther left."""

    ordered: int
    exchanged: int


def eyes_swapped(left: Image, right: Image) -> bool:
    """True if left and right eye are exchanged beyond doubt; False if they are not, or if it cannot be told.

    left, right: rectified (H, W, 3) BGR or (H, W) grey uint8, equal in size.
    """
    votes = sign_votes(left, right)
    said = votes.ordered + votes.exchanged
    return votes.exchanged >= LEAST_VOTES and votes.exchanged >= MAJORITY * said


def sign_votes(left: Image, right: Image) -> SignVotes:
    """Match corners both ways along the rows, whichever way they moved, and count the signs."""
    grey_left, grey_right = _half_size(left), _half_size(right)
    shifts = [_shift(grey_left, grey_right, u, v) for u, v in _corners(grey_left)]
    told = np.array([shift for shift in shifts if shift is not None and abs(shift) > LEAST_SHIFT_PX])
    return SignVotes(int((told > 0).sum()), int((told < 0).sum()))


def _half_size(image: Image) -> Image:
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    size = max(grey.shape[1] // 2, 1), max(grey.shape[0] // 2, 1)
    return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _corners(grey: Image) -> NDArray[np.intp]:
    """(N, 2) columns and rows of strong corners, spread out."""
    found = cv2.goodFeaturesToTrack(grey, CORNERS, 0.02, 2 * HALF_PX)
    if found is None:
        return np.zeros((0, 2), np.intp)
    return np.rint(found.reshape(-1, 2)).astype(np.intp)


def _shift(left: Image, right: Image, u: int, v: int) -> int | None:
    """u_l - u_r of one corner; None if it does not match clearly, or not back again."""
    there = _match(left, right, u, v)
    if there is None:
        return None
    back = _match(right, left, there, v)
    return None if back is None or abs(back - u) > 1 else u - there


def _match(source: Image, target: Image, u: int, v: int) -> int | None:
    """Column in target of the patch of source about (u, v), searched to both sides alike."""
    height, width = source.shape
    reach = min(
        REACH_PX, u - HALF_PX, width - 1 - HALF_PX - u
    )  # no side may have more chances than the other
    if reach < 8 or not HALF_PX <= v < height - HALF_PX:
        return None
    rows = slice(v - HALF_PX, v + HALF_PX + 1)
    template = source[rows, u - HALF_PX : u + HALF_PX + 1]
    scores = cv2.matchTemplate(
        target[rows, u - reach - HALF_PX : u + reach + HALF_PX + 1], template, cv2.TM_CCOEFF_NORMED
    )[0]
    best = int(scores.argmax())
    peak = float(scores[best])
    if not LEAST_CORRELATION <= peak <= 1.001 or best in (0, len(scores) - 1):
        return None
    scores[max(best - 3, 0) : best + 4] = -1.0
    return None if float(scores.max()) > peak - RIVAL_MARGIN else u + best - reach
