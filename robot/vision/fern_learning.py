"""What ferns learn from: places of training views at reference size, how often each leaf was met there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Image
from robot.vision.fern_features import Ferns, channels
from robot.vision.hough import CELL_STEPS, MOST_VOTES, Codebook

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

MARGIN_PX = 8
"""Seen around an object at reference size: tests reach beyond its rim."""
TURN, STRETCH, SHIFT_PX = math.radians(6.0), 0.08, 1.5
"""Warps of a view: standard deviations of turn and of the logarithm of its size; of its place, px."""
PRIOR = 1.0
"""Places each leaf is thought to have met beforehand on either side: a single one proves little."""
LEAST_POSTERIOR = 0.3
"""Below this a leaf does not vote: it tells of the background."""
INSIDE = 0.5
"""A pixel of a warped view belongs to the object if so much of it does."""


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A view at reference size: grey (H, W) uint8, middle (x, y) of the object in it, mask (H, W) of it."""

    image: Image
    middle: tuple[float, float]
    mask: Mask


@dataclass(frozen=True, slots=True, eq=False)
class Experience:
    """What was met of one class. extent: (width, height) px at reference size; met (F, L): places in each
    leaf; offsets (F, L, cells): of them, where the middle lay; up, aside: cells to the farthest offset;
    views: how many were met."""

    extent: tuple[float, float]
    met: Floats
    offsets: Floats
    up: int
    aside: int
    views: int

    @classmethod
    def none(cls, ferns: Ferns, aspect: float, reference_px: int, step_px: int) -> Experience:
        """Nothing met yet, of an object of this width over height."""
        extent = (
            (float(reference_px), reference_px / aspect)
            if aspect >= 1.0
            else (reference_px * aspect, float(reference_px))
        )
        aside, up = (math.ceil(edge / 2 / (step_px * CELL_STEPS)) for edge in extent)
        cells = (2 * up + 1) * (2 * aside + 1)
        empty = np.zeros((ferns.count, ferns.leaf_count), np.float32)
        return cls(extent, empty, np.zeros((*empty.shape, cells), np.float32), up, aside, 0)

    def and_met(self, ferns: Ferns, places: Sequence[Place], step_px: int) -> Experience:
        """The same and these places."""
        met, offsets = self.met.copy(), self.offsets.copy()
        cells = offsets.shape[2]
        for place in places:
            leaves = ferns.leaves(channels(place.image), step_px)
            rows, columns = leaves.shape[1:]
            mine = place.mask[::step_px, ::step_px]
            away = [
                np.rint((middle / step_px - np.arange(count)) / CELL_STEPS).astype(np.intp)
                for middle, count in ((place.middle[1], rows), (place.middle[0], columns))
            ]
            inside = mine & (np.abs(away[0]) <= self.up)[:, None] & (np.abs(away[1]) <= self.aside)
            cell = (away[0] + self.up)[:, None] * (2 * self.aside + 1) + away[1] + self.aside
            for fern, of_fern in enumerate(leaves):
                chosen = of_fern[inside].astype(np.intp)
                met[fern] += np.bincount(chosen, minlength=ferns.leaf_count)
                flat = np.bincount(chosen * cells + cell[inside], minlength=ferns.leaf_count * cells)
                offsets[fern] += flat.reshape(-1, cells)
        return replace(self, met=met, offsets=offsets, views=self.views + len(places))

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """All of it as plain arrays."""
        return {
            "extent": np.array(self.extent, np.float64),
            "met": self.met,
            "offsets": self.offsets,
            "counts": np.array([self.up, self.aside, self.views], np.int32),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[np.generic]]) -> Experience:
        """The inverse of `arrays`. Raises KeyError or ValueError where they do not fit together."""
        width, height = (float(edge) for edge in arrays["extent"])
        up, aside, views = (int(count) for count in arrays["counts"])
        met, offsets = (np.asarray(arrays[name], np.float32) for name in ("met", "offsets"))
        cells = (2 * up + 1) * (2 * aside + 1)
        if min(up, aside, views) < 0 or met.ndim != 2 or offsets.shape != (*met.shape, cells):
            raise ValueError("what the ferns learnt does not fit together")
        if not (0.0 < width < math.inf and 0.0 < height < math.inf) or not np.isfinite(offsets).all():
            raise ValueError("what the ferns learnt holds impossible numbers")
        if not np.isfinite(met).all() or min(met.min(initial=0.0), offsets.min(initial=0.0)) < 0.0:
            raise ValueError("what the ferns learnt holds impossible numbers")
        if (offsets.sum(axis=2) > 1.001 * met + 1e-3).any():
            raise ValueError("the ferns learnt more offsets than places")
        return cls((width, height), met, offsets, up, aside, views)

    def codebook(self, background: Floats) -> Codebook:
        """Votes of each leaf: posterior of the object, spread over the offsets met.

        background (F, L): how often each leaf was met elsewhere.
        """
        own, other = (np.maximum(m.sum(axis=1, keepdims=True), 1.0) for m in (self.met, background))
        leaves = self.met.shape[1]
        here = (self.met + PRIOR) / (own + PRIOR * leaves)
        there = (background + PRIOR) / (other + PRIOR * leaves)
        posterior = here / (here + there)
        spread = self.offsets / np.maximum(self.met, 1.0)[..., None]
        sure = np.maximum(posterior - LEAST_POSTERIOR, 0.0) / (1.0 - LEAST_POSTERIOR)
        # What was met once has a sharp offset by chance.
        votes = (sure * self.met / (self.met + PRIOR))[..., None] * spread
        return Codebook((MOST_VOTES * votes).astype(np.int16), self.up, self.aside)

    @property
    def places_of_a_view(self) -> float:
        """Places of the object met in a view, on average."""
        return float(self.met.sum()) / len(self.met) / max(self.views, 1)

    def votes_of_a_view(self, codebook: Codebook) -> float:
        """Votes that a view of those met casts for its own middle, on average."""
        own = np.einsum("flc,flc->", self.offsets, codebook.table.astype(np.float32))
        return float(own) / max(self.views, 1)


def places_of(
    image: Image,
    box: Box,
    mask: Mask | None,
    backgrounds: Sequence[Image],
    reference_px: int,
    warps: int,
    rng: np.random.Generator,
) -> list[Place]:
    """A sample at reference size, and so many slightly warped views of it more.

    What lies outside its image, or outside its mask, is taken from a background, another one for each view:
    tests near the rim of the object look beyond it, and there anything may be.

    Raises:
        ValueError: the box lies outside the image, or is smaller than 4 px.
    """
    inside = box.clipped(image.shape[1], image.shape[0])
    if min(inside.w, inside.h) < 4.0:
        raise ValueError(f"a sample's box must show at least 4 px of its image, got {box}")
    shrink = reference_px / max(box.w, box.h)
    size = math.ceil(box.w * shrink) + 2 * MARGIN_PX, math.ceil(box.h * shrink) + 2 * MARGIN_PX
    own = _rectangle(image.shape[:2], inside) if mask is None else mask
    shown = np.ones(image.shape[:2], np.bool_) if mask is None else mask
    soft = _soft(_grey(image), shrink)
    found = []
    for warp in range(warps + 1):
        turn, grow = (rng.normal(0.0, TURN), math.exp(rng.normal(0.0, STRETCH))) if warp else (0.0, 1.0)
        x, y = np.array(size) / 2 - 0.5 + (rng.normal(0.0, SHIFT_PX, 2) if warp else 0.0)
        c, s = shrink * grow * math.cos(turn), shrink * grow * math.sin(turn)
        u, v = box.x + box.w / 2 - 0.5, box.y + box.h / 2 - 0.5
        to_place = np.array([[c, -s, x - c * u + s * v], [s, c, y - s * u - c * v]])
        view, share, belongs = (
            cv2.warpAffine(plane, to_place, size, flags=cv2.INTER_LINEAR, borderMode=border)
            for plane, border in (
                (soft.astype(np.float32), cv2.BORDER_REPLICATE),
                (shown.astype(np.float32), cv2.BORDER_CONSTANT),
                (own.astype(np.float32), cv2.BORDER_CONSTANT),
            )
        )
        behind = _background(backgrounds, size, rng) if backgrounds else view
        mixed = np.rint(share * view + (1.0 - share) * behind)
        found.append(Place(np.asarray(mixed, np.uint8), (float(x), float(y)), belongs > INSIDE))
    return found


def _rectangle(shape: tuple[int, ...], box: Box) -> Mask:
    found = np.zeros(shape, np.bool_)
    found[round(box.y) : round(box.y + box.h), round(box.x) : round(box.x + box.w)] = True
    return found


def _background(images: Sequence[Image], size: tuple[int, int], rng: np.random.Generator) -> Floats:
    """A cut of one of the images, (height, width) of `size`, at a scale between whole and own."""
    image = _grey(images[int(rng.integers(len(images)))])
    least = max(size[0] / image.shape[1], size[1] / image.shape[0])
    shrink = max(least, math.exp(rng.uniform(math.log(min(least, 1.0)), 0.0)))
    wide = max(round(image.shape[1] * shrink), size[0]), max(round(image.shape[0] * shrink), size[1])
    scaled = cv2.resize(image, wide, interpolation=cv2.INTER_AREA if shrink < 1.0 else cv2.INTER_LINEAR)
    x, y = (int(rng.integers(whole - part + 1)) for whole, part in zip(wide, size, strict=True))
    return np.asarray(scaled[y : y + size[1], x : x + size[0]], np.float32)


def _grey(image: Image) -> Image:
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)


def places_without(image: Image, reference_px: int, rng: np.random.Generator) -> Iterator[Image]:
    """A picture without the objects at a few sizes, as a pyramid would show it."""
    longest = max(image.shape[:2])
    least = min(1.0, reference_px / longest)
    sizes = {1.0, least, math.sqrt(least), least**0.75, least**0.25} if least < 0.9 else {least}
    for shrink in sorted(sizes):
        yield np.asarray(
            cv2.resize(image, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA), np.uint8
        )


def _soft(image: Image, shrink: float) -> Image:
    sigma = 0.4 / shrink
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma), np.uint8) if sigma > 0.5 else image
