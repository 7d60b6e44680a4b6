"""What every stage that takes a pair of pictures asks of it, refused in one line if it is not so."""

from __future__ import annotations

import cv2
import numpy as np

from calib.model import StereoRig
from robot.messages import Image


def grey_pair(left: Image, right: Image) -> tuple[Image, Image]:
    """Both pictures in grey, (H, W) uint8; grey ones are given back as they are.

    left, right: (H, W), (H, W, 1) or (H, W, 3) BGR uint8, equal in height and width; one may be grey and the
    other not.

    Raises:
        ValueError: not uint8, not a picture of 1 or 3 channels, empty, or eyes of different size.

    >>> one, other = grey_pair(np.zeros((4, 6, 3), np.uint8), np.zeros((4, 6), np.uint8))
    >>> one.shape == other.shape == (4, 6)
    True
    """
    if left.shape[:2] != right.shape[:2]:
        raise ValueError(f"eyes of different size: left {left.shape[:2]}, right {right.shape[:2]}")
    return _grey("left", left), _grey("right", right)


def refuse_other_size(picture: Image, rig: StereoRig) -> None:
    """A picture (H, W, ...) must be of the size its rig is calibrated at.

    Raises:
        ValueError: it is not.
    """
    height, width = picture.shape[:2]
    if (width, height) != (rig.left.width, rig.left.height):
        raise ValueError(
            f"the pictures are {width}x{height}, the rig {rig.left.width}x{rig.left.height}: "
            "calibrate at this size"
        )


def _grey(name: str, image: Image) -> Image:
    if image.dtype != np.uint8:
        raise ValueError(f"the {name} picture is {image.dtype}: give 8-bit pictures (uint8, 0..255)")
    channels = {2: 1, 3: image.shape[-1]}.get(image.ndim, 0)
    if channels not in (1, 3):
        raise ValueError(f"the {name} picture has shape {image.shape}: give (H, W) grey or (H, W, 3) BGR")
    if image.size == 0:
        raise ValueError(f"the {name} picture is empty: {image.shape[1]}x{image.shape[0]} pixels")
    if channels == 1:
        return image.reshape(image.shape[:2])
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
