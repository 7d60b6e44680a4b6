"""Rectangles of a picture at a wanted size, smoothed where they shrink; pictures checked at the door."""

from __future__ import annotations

import cv2
import numpy as np

from robot.messages import Image

LEAST_PX = 8
"""A smaller picture shows nothing."""


def bgr_of(image: Image) -> Image:
    """A colour picture (H, W, 3) uint8 of a colour or grey one.

    Raises:
        ValueError: it is not uint8, has an alpha channel, or is smaller than 8 px.
    """
    if min(checked(image).shape[:2]) < LEAST_PX:
        raise ValueError(f"a picture of at least {LEAST_PX} px is needed, got shape {image.shape}")
    return coloured(image)


def checked(image: Image) -> Image:
    """The picture itself. Raises ValueError if it is empty, not uint8, or neither grey nor BGR."""
    if image.dtype != np.uint8:
        raise ValueError(f"a uint8 picture is needed, got {image.dtype}: scale it to 0..255 first")
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
        raise ValueError(f"a grey (H, W) or BGR (H, W, 3) picture is needed, got shape {image.shape}")
    if image.size == 0:
        raise ValueError(f"a picture with pixels is needed, got shape {image.shape}")
    return image


def coloured(image: Image) -> Image:
    """A colour picture (H, W, 3) uint8 of a colour or grey one of any size; raises as `checked` does."""
    grey = checked(image).ndim == 2
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), np.uint8) if grey else image


def patch_of(
    image: Image, centre: tuple[float, float], size: tuple[float, float], out: tuple[int, int]
) -> Image:
    """What lies in a rectangle, brought to `out` (columns, rows); beyond the rim the rim's colour.

    Args:
        image: (H, W[, 3]) uint8.
        centre: (u, v) of the rectangle's middle, px, the picture's corner at (0, 0).
        size: (width, height) of the rectangle, px.
        out: (columns, rows) wanted.

    >>> picture = np.arange(100, dtype=np.uint8).reshape(10, 10)
    >>> patch_of(picture, (5.0, 5.0), (2.0, 2.0), (2, 2)).tolist()
    [[44, 45], [54, 55]]
    """
    step = size[0] / out[0], size[1] / out[1]
    left, top = centre[0] - size[0] / 2, centre[1] - size[1] / 2
    source, (x0, y0) = _about(image, left, top, size)
    if max(step) >= 1.5:
        source = np.asarray(cv2.blur(source, (max(round(step[0]), 1), max(round(step[1]), 1))), np.uint8)
    sampling = np.array(
        [[step[0], 0.0, left - x0 + 0.5 * step[0] - 0.5], [0.0, step[1], top - y0 + 0.5 * step[1] - 0.5]]
    )
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(
        cv2.warpAffine(source, sampling, out, flags=flags, borderMode=cv2.BORDER_REPLICATE), np.uint8
    )


def _about(image: Image, left: float, top: float, size: tuple[float, float]) -> tuple[Image, tuple[int, int]]:
    """The part of the picture that the rectangle touches and a little more, and where it begins."""
    height, width = image.shape[:2]
    (x0, x1), (y0, y1) = (
        (min(max(int(start) - 4, 0), whole - 2), min(max(int(start + length) + 5, 2), whole))
        for start, length, whole in ((left, size[0], width), (top, size[1], height))
    )
    return image[y0:y1, x0:x1], (x0, y0)
