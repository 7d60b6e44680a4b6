"""Binary features of small places in a picture, grouped to ferns: METHODS 8.

A test compares two pixels of one channel (grey, strength of the horizontal or of the vertical gradient) near
a place; S tests make a fern, their bits its leaf, 0 .. 2^S - 1. Grey tests answer alike under every change of
brightness that keeps the order of grey values, gradient tests under every change of gain and offset.

Source: Ozuysal, Calonder, Lepetit, Fua, "Fast keypoint recognition using random ferns" (PAMI 2010).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image
from robot.vision.windows import grey_of

Leaves = NDArray[np.uint16]
Planes = NDArray[np.uint8]

CHANNELS = 3
"""Grey, |dx|, |dy|."""
SMOOTHING_PX = 0.8


@dataclass(frozen=True, slots=True, eq=False)
class Ferns:
    """The tests of F ferns of S bits: integer arrays (F, S).

    channel: 0 .. CHANNELS - 1; first, second (F, S, 2): row and column of the two pixels compared, away from
    the place, at most `reach` px.
    """

    channel: NDArray[np.int8]
    first: NDArray[np.int8]
    second: NDArray[np.int8]
    reach: int

    @classmethod
    def random(cls, ferns: int, bits: int, reach: int, rng: np.random.Generator) -> Ferns:
        """Tests drawn anew: pixels uniformly from a square, channels in turn.

        Raises:
            ValueError: ferns below 1, bits out of 1 .. 12, reach out of 1 .. 32.
        """
        if ferns < 1 or not 1 <= bits <= 12 or not 1 <= reach <= 32:
            raise ValueError(f"needs ferns >= 1, bits 1 to 12, reach 1 to 32, got {ferns}, {bits}, {reach}")
        pixels = rng.integers(-reach, reach + 1, (2, ferns, bits, 2)).astype(np.int8)
        same = (pixels[0] == pixels[1]).all(axis=-1)
        pixels[1][same] = -pixels[0][same]
        pixels[1][same & (pixels[0] == 0).all(axis=-1)] = reach
        channel = np.arange(ferns * bits).reshape(ferns, bits) % CHANNELS
        return cls(rng.permuted(channel, axis=1).astype(np.int8), pixels[0], pixels[1], reach)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The tests as plain arrays."""
        return {
            "channel": self.channel.astype(np.int32),
            "first": self.first.astype(np.int32),
            "second": self.second.astype(np.int32),
            "reach": np.array(self.reach, np.int32),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[np.generic]]) -> Ferns:
        """The inverse of `arrays`. Raises KeyError or ValueError where they do not fit together."""
        channel, first, second = (
            np.asarray(arrays[name], np.int32) for name in ("channel", "first", "second")
        )
        reach = int(np.asarray(arrays["reach"]).item())
        if channel.ndim != 2 or not 1 <= channel.shape[1] <= 12 or not len(channel) or not 1 <= reach <= 32:
            raise ValueError("the ferns' tests have an unknown form")
        if any(
            pixels.shape != (*channel.shape, 2) or np.abs(pixels).max() > reach for pixels in (first, second)
        ):
            raise ValueError("the ferns' tests do not fit together")
        if channel.min() < 0 or channel.max() >= CHANNELS:
            raise ValueError("the ferns ask for a channel that is not there")
        return cls(channel.astype(np.int8), first.astype(np.int8), second.astype(np.int8), reach)

    @property
    def count(self) -> int:
        """How many ferns."""
        return len(self.channel)

    @property
    def leaf_count(self) -> int:
        """Leaves of each fern."""
        return 1 << int(self.channel.shape[1])

    def leaves(self, planes: Planes, step: int) -> Leaves:
        """Leaf of every fern (F, rows, columns) at every `step`-th pixel, beginning at the first.

        planes: what `channels` gave, (CHANNELS, H, W). Pixels outside the picture take the rim's values.

        >>> ferns = Ferns.random(2, 8, 6, np.random.default_rng(0))
        >>> picture = np.random.default_rng(1).integers(0, 120, (30, 40), np.uint8)
        >>> ferns.leaves(channels(picture), 5).shape
        (2, 6, 8)
        """
        reach, (height, width) = self.reach, planes.shape[1:]
        rows, columns = -(-height // step), -(-width // step)
        thinned = [_thinned(plane, reach, step) for plane in planes]
        small = np.uint8 if self.channel.shape[1] <= 8 else np.uint16
        found = np.zeros((self.count, rows, columns), small)
        bit = np.empty((rows, columns), np.bool_)
        for fern in range(self.count):
            for test in range(self.channel.shape[1]):
                plane = thinned[self.channel[fern, test]]
                (y0, x0), (y1, x1) = (
                    (int(p[0]) + reach, int(p[1]) + reach)
                    for p in (self.first[fern, test], self.second[fern, test])
                )
                first, second = plane[y0 % step][x0 % step], plane[y1 % step][x1 % step]
                y0, x0, y1, x1 = (edge // step for edge in (y0, x0, y1, x1))
                np.greater(
                    first[y0 : y0 + rows, x0 : x0 + columns],
                    second[y1 : y1 + rows, x1 : x1 + columns],
                    out=bit,
                )
                np.add(found[fern], found[fern], out=found[fern])
                np.bitwise_or(found[fern], bit.view(np.uint8), out=found[fern])
        return found.astype(np.uint16, copy=False)


def _thinned(plane: NDArray[np.uint8], reach: int, step: int) -> list[list[NDArray[np.uint8]]]:
    """Every `step`-th row and column of a plane with a rim, for each first row and column.

    Tests then read neighbouring bytes, which is several times as fast as reading every `step`-th.
    """
    far = reach + step
    wide = cv2.copyMakeBorder(plane, reach, far, reach, far, cv2.BORDER_REPLICATE)
    return [[np.ascontiguousarray(wide[y::step, x::step]) for x in range(step)] for y in range(step)]


def channels(image: Image) -> Planes:
    """(CHANNELS, H, W) uint8: smoothed grey and the strengths of its gradients.

    image: (H, W[, 3]) uint8, BGR or grey.
    """
    grey = image if image.ndim == 2 else np.asarray(grey_of(image), np.uint8)
    smooth = cv2.GaussianBlur(grey, (0, 0), SMOOTHING_PX)
    across, down = (
        cv2.convertScaleAbs(cv2.Sobel(smooth, cv2.CV_16S, *order, ksize=3), alpha=0.25)
        for order in ((1, 0), (0, 1))
    )
    return np.stack([smooth, across, down]).astype(np.uint8, copy=False)
