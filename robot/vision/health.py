"""Can the picture be trusted? Cheap checks of every picture, and whether the eyes are exchanged.

In a parallel pair everything lies further to the right in the left picture: u_l - u_r >= 0 from the
principal points. Exchanged eyes turn every sign. A range computed from such a pair is nonsense, so the test
comes first. `robot.vision.pair_check` has this test and the one of the rows in one look.
"""

from __future__ import annotations

import numpy as np

from calib.model import StereoRig
from robot.messages import Image, StereoFrame
from robot.vision.pair_check import check_pair

BLACK_BELOW = 8
"""Grey level (0..255) that a lens cap's picture nowhere exceeds by more than single hot pixels."""
GRID = 8
"""The cheap checks look at every eighth pixel in both directions."""


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


def eyes_swapped(left: Image, right: Image, rig: StereoRig | None = None) -> bool:
    """True if left and right eye are exchanged beyond doubt; False if they are not, or if it cannot be told.

    left, right: rectified (H, W, 3) BGR or (H, W) grey uint8, equal in size; rig: the parallel rig they are
    of, needed only if its principal points differ. Raises ValueError for pictures that are no such pair.
    """
    height, width = left.shape[:2]
    return check_pair(left, right, rig or StereoRig.parallel(width, height, float(width), 0.06)).swapped
