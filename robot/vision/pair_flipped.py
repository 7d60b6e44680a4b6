"""Eyes that show no pair at all, and why: a picture mirrored or upside down, or one eye given twice.

`pair_check` judges pairs that are nearly right. Where it finds nothing that matches, a setting of a camera's
driver is the usual cause; trying what such settings do names it. This costs several looks: it is for a person
who asks (`robot look`), not for every picture.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from calib.model import StereoRig
from robot.messages import Image
from robot.vision.pair_check import check_pair

Flip = Callable[[Image], Image]

FLIPS: tuple[tuple[str, Flip], ...] = (
    ("mirrored", lambda image: image[:, ::-1]),
    ("upside down and mirrored", lambda image: image[::-1]),
    ("upside down", lambda image: image[::-1, ::-1]),
)
"""What a driver may do to a picture. Turned by 180 degrees is what people call upside down."""


def flipped(left: Image, right: Image, rig: StereoRig) -> str | None:
    """One line that says how one eye's picture lies to the other's, None if no such thing is for sure.

    Args:
        left, right: (H, W, 3) BGR or (H, W) grey uint8, of the rig's size.
        rig: the parallel rig whose pair this is meant to be.

    Raises:
        ValueError: pictures that are no pair, or not of the rig's size.

    >>> import cv2
    >>> rig = StereoRig.parallel(240, 120, 210.0, 0.06)
    >>> noise = np.random.default_rng(1).integers(0, 255, (120, 260), np.uint8)
    >>> scene = cv2.GaussianBlur(noise, (0, 0), 2.0)
    >>> flipped(scene[:, :240], scene[:, 251:11:-1], rig)[:51]
    'the right picture is mirrored against the left one:'
    """
    check = check_pair(left, right, rig)
    if check.matches and np.array_equal(left, right):
        return "both pictures are the same: one camera is given as both eyes, name the other one"
    if check.tells:
        return None
    for how, flip in FLIPS:
        if check_pair(left, np.ascontiguousarray(flip(right)), rig).tells:
            return (
                f"the right picture is {how} against the left one: check this camera's flip setting, and how "
                "it is mounted"
            )
    return None
