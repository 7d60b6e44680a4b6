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
from robot.vision.view_warps import Mask, Place, View, ViewWarps

Floats = NDArray[np.float32]

MARGIN_PX = 8
"""Seen around an object at reference size: tests reach beyond its rim."""
PRIOR = 1.0
"""Places each leaf is thought to have met beforehand on either side: a single one proves little."""
LEAST_POSTERIOR = 0.3
"""Below this a leaf does not vote: it tells of the background."""


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
    shrink = reference_px / max(box.w, box.h, 1.0)
    size = math.ceil(box.w * shrink) + 2 * MARGIN_PX, math.ceil(box.h * shrink) + 2 * MARGIN_PX
    warped = ViewWarps(View(image, box, mask), shrink, size)
    found = [warped.place(warped.straight(), backgrounds, rng)]
    for _ in range(warps):
        found.append(warped.place(warped.drawn(rng), backgrounds, rng))
    return found


def places_without(image: Image, reference_px: int, rng: np.random.Generator) -> Iterator[Image]:
    """A picture without the objects at a few sizes, as a pyramid would show it."""
    longest = max(image.shape[:2])
    least = min(1.0, reference_px / longest)
    sizes = {1.0, least, math.sqrt(least), least**0.75, least**0.25} if least < 0.9 else {least}
    for shrink in sorted(sizes):
        yield np.asarray(
            cv2.resize(image, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA), np.uint8
        )
