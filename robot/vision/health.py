"""Can the picture be trusted? Cheap checks of every picture.

Whether the eyes are exchanged or a camera was bumped needs matches: see `robot.vision.pair_check`.
"""

from __future__ import annotations

import numpy as np

from robot.messages import Image, StereoFrame

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
