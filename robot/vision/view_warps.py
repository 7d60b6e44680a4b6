"""A training view as it might be met: slightly turned, nearer, moved, before another background."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Image
from robot.vision.windows import cut_out

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

TURN, STRETCH, SHIFT_PX = math.radians(6.0), 0.08, 1.5
"""Warps of a view: standard deviations of turn and of the logarithm of its size; of its place, px."""
INSIDE = 0.5
"""A pixel of a warped view belongs to the object if so much of it does."""
WHOLE = 255
"""A pixel of a plane that belongs wholly."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A BGR or grey uint8 picture and the target's box in it.

    mask: which pixels (H, W) are its own; None: all in the box.
    """

    image: Image
    box: Box
    mask: Mask | None = None

    @property
    def crop(self) -> Image:
        """What is in the box, at whole pixels."""
        return cut_out(self.image, self.box)


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A view at a chosen size: grey (H, W) uint8, middle (x, y) of the object's box in it, that box's width
    and height, all px; mask (H, W): its own pixels."""

    image: Image
    middle: tuple[float, float]
    extent: tuple[float, float]
    mask: Mask


@dataclass(frozen=True, slots=True)
class Warp:
    """How a view is brought to a place: turn (radians), factor on its size, middle (x, y) px of the place."""

    turn: float
    grow: float
    middle: tuple[float, float]


class ViewWarps:
    """One view, to be shown at `shrink` of its size in places of `size` (width, height) px.

    What lies outside its image, or outside its mask, is taken from a background, another one for each place:
    what is seen near the object's rim may be anything.
    """

    def __init__(self, view: View, shrink: float, size: tuple[int, int]) -> None:
        """Raises ValueError where the box lies outside the image, or is smaller than 4 px."""
        image, box, mask = view.image, view.box, view.mask
        inside = box.clipped(image.shape[1], image.shape[0])
        if min(inside.w, inside.h) < 4.0:
            raise ValueError(f"a sample's box must show at least 4 px of its image, got {box}")
        self._box, self._shrink, self._size = box, shrink, size
        own = _rectangle(image.shape[:2], inside) if mask is None else mask
        self._own = own.astype(np.uint8) * np.uint8(WHOLE)
        self._shown = np.full(image.shape[:2], WHOLE, np.uint8) if mask is None else self._own
        self._soft = _softened(grey_bytes(image), shrink)

    def straight(self) -> Warp:
        """The view as it is, its middle in the middle."""
        width, height = self._size
        return Warp(0.0, 1.0, (width / 2 - 0.5, height / 2 - 0.5))

    def drawn(self, rng: np.random.Generator) -> Warp:
        """A slight warp at random."""
        turn, grow = rng.normal(0.0, TURN), math.exp(rng.normal(0.0, STRETCH))
        x, y = np.array(self._size) / 2 - 0.5 + rng.normal(0.0, SHIFT_PX, 2)
        return Warp(float(turn), grow, (float(x), float(y)))

    def place(self, warp: Warp, backgrounds: Sequence[Image], rng: np.random.Generator) -> Place:
        """The view so warped, before one of the backgrounds; before its own if there are none."""
        box, shrink = self._box, self._shrink * warp.grow
        c, s = shrink * math.cos(warp.turn), shrink * math.sin(warp.turn)
        u, v = box.x + box.w / 2 - 0.5, box.y + box.h / 2 - 0.5
        x, y = warp.middle
        to_place = np.array([[c, -s, x - c * u + s * v], [s, c, y - s * u - c * v]])
        view, shown, belongs = (
            cv2.warpAffine(plane, to_place, self._size, flags=cv2.INTER_LINEAR, borderMode=border)
            for plane, border in (
                (self._soft, cv2.BORDER_REPLICATE),
                (self._shown, cv2.BORDER_CONSTANT),
                (self._own, cv2.BORDER_CONSTANT),
            )
        )
        behind = background_cut(backgrounds, self._size, rng) if backgrounds else view
        share = shown.astype(np.float32) / np.float32(WHOLE)
        mixed = np.asarray(np.rint(share * view + (1.0 - share) * behind), np.uint8)
        return Place(mixed, (x, y), (box.w * shrink, box.h * shrink), belongs > INSIDE * WHOLE)


def background_cut(images: Sequence[Image], size: tuple[int, int], rng: np.random.Generator) -> Image:
    """A cut of one of the images, grey uint8 (height, width) of `size`, at a scale between whole and own."""
    image = images[int(rng.integers(len(images)))]
    edges = image.shape[1], image.shape[0]
    least = max(size[0] / edges[0], size[1] / edges[1])
    shrink = max(least, math.exp(rng.uniform(math.log(min(least, 1.0)), 0.0)))
    wide, tall = (min(math.ceil(part / shrink), edge) for part, edge in zip(size, edges, strict=True))
    x, y = (int(rng.integers(edge - part + 1)) for part, edge in zip((wide, tall), edges, strict=True))
    part = grey_bytes(image[y : y + tall, x : x + wide])
    how = cv2.INTER_AREA if shrink < 1.0 else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(part, size, interpolation=how), np.uint8)


def grey_bytes(image: Image) -> Image:
    """A BGR or grey uint8 picture as grey uint8 (H, W)."""
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)


def _rectangle(shape: tuple[int, ...], box: Box) -> Mask:
    found = np.zeros(shape, np.bool_)
    found[round(box.y) : round(box.y + box.h), round(box.x) : round(box.x + box.w)] = True
    return found


def _softened(image: Image, shrink: float) -> Image:
    sigma = 0.4 / shrink
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma), np.uint8) if sigma > 0.5 else image
