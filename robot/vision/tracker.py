"""Following one target from frame to frame with the improved diamond search.

The target's box is one block. Every frame it is brought to one working size, so that the block always
fits the object whatever its range. The search starts where the last motion and the head's motion put the
target, coarse first; a fast target is caught by a bounded number of restarts. Neighbouring frames alone
drift: a slowly refreshed template follows the look, an anchor (the last confirmed look) holds the place.

Source: Wu & Snášel, *A Vision-based Navigation System of Mobile Tracking Robot*, SMC 2010, section IV;
prediction, pyramid, restarts and the anchor answer the loose ends named there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from robot.messages import Box, Image, Track
from robot.vision.diamond import BlockDistortion, Motion, improved_diamond_search, restarted_search
from robot.vision.windows import Floats, crop, grey_of, resize


@dataclass(frozen=True, slots=True)
class TrackerSettings:
    """How the tracker works.

    block_px: edge the box's geometric mean is brought to. reach_px: how far (in picture pixels) the target
    may be from its predicted place. lost_below / found_above: normalised correlation that ends / resumes
    the track. refresh_above, refresh_rate: how good a match must be to be learnt, and its share.
    anchor_above: how good the anchor's match must be to correct the place. scale_step: sizes tried are
    1 and 1 +- scale_step, every scale_every frames.
    """

    block_px: int = 32
    reach_px: float = 30.0
    lost_below: float = 0.45
    found_above: float = 0.6
    refresh_above: float = 0.65
    refresh_rate: float = 0.15
    anchor_above: float = 0.7
    scale_step: float = 0.04
    scale_every: int = 2


class _Match(NamedTuple):
    box: Box
    correlation: float
    block: Floats


# The coarse level's starts after the predicted one: eight directions, for targets that jumped.
_RESTARTS = ((0, 0), (0, -5), (-5, 0), (5, 0), (0, 5), (-5, -5), (5, -5), (-5, 5), (5, 5))
_COARSE = 3
_SMALLEST_BOX_PX = 6.0
# Mean absolute grey difference of a coarse match so good that no restart is tried.
_GOOD_DISTORTION = 9.0


class TemplateTracker:
    """Follows one box through frames given in order. Knows no clock: the same frames give the same track.

    >>> rng = np.random.default_rng(0)
    >>> scene = cv2.resize(rng.integers(0, 255, (24, 30, 3), np.uint8), (360, 288))
    >>> tracker = TemplateTracker()
    >>> tracker.start(scene, Box(150, 100, 50, 60))
    >>> track = tracker.update(np.roll(scene, (3, -7), (0, 1)))
    >>> track.lost, round(track.box.x), round(track.box.y)
    (False, 143, 103)
    """

    def __init__(self, settings: TrackerSettings | None = None) -> None:
        self._settings = settings or TrackerSettings()
        self._box: Box | None = None
        self._anchor: Floats = np.empty((0, 0), np.float32)
        self._template: Floats = self._anchor
        self._motion = (0.0, 0.0)
        self._lost = True
        self._frames = 0

    @property
    def box(self) -> Box | None:
        """Where the target was last seen or, while lost, is guessed; None before `start`."""
        return self._box

    def start(self, image: Image, box: Box) -> None:
        """Begin to follow what is in `box` (pixels, partly inside the picture) of a BGR uint8 picture.

        Raises ValueError for a box smaller than 6 px or wholly outside the picture.
        """
        inside = box.clipped(image.shape[1], image.shape[0])
        if min(inside.w, inside.h) < _SMALLEST_BOX_PX:
            raise ValueError(
                f"the box to track must show at least {_SMALLEST_BOX_PX:.0f} px of picture: {box}"
            )
        self._motion, self._frames = (0.0, 0.0), 0
        self.reanchor(image, box)

    def reanchor(self, image: Image, box: Box) -> None:
        """Take `box` as the confirmed place and its content as the new look; the motion is kept."""
        self._box, self._lost = box, False
        width, height = _block_size(box, self._settings.block_px)
        region = _Region.around(grey_of(image), box, (width, height), 0.0)
        self._anchor = self._template = region.block(0, 0)

    def update(self, image: Image, scale: float = 1.0, shift: tuple[float, float] = (0.0, 0.0)) -> Track:
        """Find the target in the next frame.

        scale: expected size over the last frame's size (range before / range now). shift: how far the
        head's own motion moves the picture's content, in px to the right and down. velocity_px of the
        result is the motion in the picture beyond that shift, px per frame. While lost the box stays
        where it was last (moved by shift), and the search goes on there.

        Raises RuntimeError before `start`.
        """
        if self._box is None:
            raise RuntimeError("start the tracker with a box before updating it")
        grey = grey_of(image)
        predicted = self._predicted(self._box, scale, shift)
        match = self._search(grey, predicted)
        self._frames += 1
        threshold = self._settings.found_above if self._lost else self._settings.lost_below
        seen = match.box.clipped(image.shape[1], image.shape[0]).area >= 0.25 * match.box.area
        self._lost = not (seen and match.correlation >= threshold)
        if self._lost:
            self._box, self._motion = _moved(_scaled(self._box, scale), *shift), (0.0, 0.0)
        else:
            self._accept(match, shift)
        return Track(self._box, self._motion, max(0.0, min(1.0, match.correlation)), self._lost)

    def _predicted(self, box: Box, scale: float, shift: tuple[float, float]) -> Box:
        return _moved(_scaled(box, scale), shift[0] + self._motion[0], shift[1] + self._motion[1])

    def _search(self, grey: Floats, predicted: Box) -> _Match:
        best = self._at_size(grey, predicted, self._settings.reach_px)
        if self._frames % self._settings.scale_every:
            return best
        step = self._settings.scale_step
        for factor in (1 - step, 1 + step):
            other = self._at_size(grey, _scaled(best.box, factor), 4.0)
            # A change of size must earn its place, or noise would make the box breathe.
            if other.correlation > best.correlation + 0.01:
                best = other
        return best

    def _at_size(self, grey: Floats, predicted: Box, reach_px: float) -> _Match:
        size = self._template.shape[1], self._template.shape[0]
        region = _Region.around(grey, predicted, size, reach_px)
        motion = region.search(self._template)
        correlation = _correlation(region.block(motion.dx, motion.dy), self._template)
        held = self._held_by_anchor(region, motion)
        if held is not None:
            motion = held
            correlation = max(correlation, _correlation(region.block(held.dx, held.dy), self._anchor))
        return _Match(region.box_at(motion), correlation, region.block(motion.dx, motion.dy))

    def _held_by_anchor(self, region: _Region, motion: Motion) -> Motion | None:
        """The anchor's own place next to the template's, if the target still looks like it."""
        held = region.near(self._anchor, (motion.dx, motion.dy))
        block = region.block(held.dx, held.dy)
        return held if _correlation(block, self._anchor) >= self._settings.anchor_above else None

    def _accept(self, match: _Match, shift: tuple[float, float]) -> None:
        assert self._box is not None
        (u0, v0), (u1, v1) = self._box.centre, match.box.centre
        self._motion = (u1 - u0 - shift[0], v1 - v0 - shift[1])
        self._box = match.box
        if match.correlation >= self._settings.refresh_above:
            rate = np.float32(self._settings.refresh_rate)
            self._template = (1 - rate) * self._template + rate * _like(match.block, self._template)


class _Region:
    """The part of a frame about a predicted box, at the working size, padded beyond the picture's rim."""

    def __init__(self, grey: Floats, box: Box, size: tuple[int, int], margin: tuple[int, int]) -> None:
        self._grey = grey
        self._box = box
        self._size = size
        self._left, self._top = margin

    @classmethod
    def around(cls, grey: Floats, box: Box, size: tuple[int, int], reach_px: float) -> _Region:
        fx, fy = size[0] / box.w, size[1] / box.h
        margin = math.ceil(reach_px * fx) + 2, math.ceil(reach_px * fy) + 2
        # Averaging k x k pixels first keeps the sampling of large boxes free of aliasing.
        k = max(1, round(min(1 / fx, 1 / fy)))
        if k > 1:
            grey = resize(grey, (max(grey.shape[1] // k, 1), max(grey.shape[0] // k, 1)))
        steps = 1 / (fx * k), 1 / (fy * k)
        first = [
            (edge + (0.5 - m) / f) / k - 0.5
            for edge, m, f in ((box.x, margin[0], fx), (box.y, margin[1], fy))
        ]
        sampling = np.array([[steps[0], 0.0, first[0]], [0.0, steps[1], first[1]]])
        extent = size[0] + 2 * margin[0], size[1] + 2 * margin[1]
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        sampled = cv2.warpAffine(grey, sampling, extent, flags=flags, borderMode=cv2.BORDER_REPLICATE)
        return cls(np.asarray(sampled, np.float32), box, size, margin)

    def search(self, template: Floats) -> Motion:
        """Coarse search over the whole region with restarts, then fine."""
        template = _like(template, self.block(0, 0))
        coarse_size = max(3, self._size[0] // _COARSE), max(3, self._size[1] // _COARSE)
        shape = self._grey.shape
        ratio = coarse_size[0] / self._size[0], coarse_size[1] / self._size[1]
        small = resize(self._grey, (round(shape[1] * ratio[0]), round(shape[0] * ratio[1])))
        distortion = BlockDistortion(
            resize(template, coarse_size), small, round(self._left * ratio[0]), round(self._top * ratio[1])
        )
        coarse = restarted_search(distortion, _RESTARTS, good_enough=_GOOD_DISTORTION)
        start = round(coarse.dx / ratio[0]), round(coarse.dy / ratio[1])
        return improved_diamond_search(self._distortion(template), start)

    def near(self, template: Floats, start: tuple[int, int]) -> Motion:
        """Fine search close to a displacement."""
        return improved_diamond_search(self._distortion(_like(template, self.block(*start))), start, 4)

    def _distortion(self, template: Floats) -> BlockDistortion:
        return BlockDistortion(template, self._grey, self._left, self._top)

    def block(self, dx: int, dy: int) -> Floats:
        return crop(self._grey, self._left + dx, self._top + dy, *self._size)

    def box_at(self, motion: Motion) -> Box:
        """The box in the picture after a motion, to a part of a pixel."""
        x = self._box.x + motion.sub_dx * self._box.w / self._size[0]
        y = self._box.y + motion.sub_dy * self._box.h / self._size[1]
        return Box(x, y, self._box.w, self._box.h)


def _block_size(box: Box, edge_px: int) -> tuple[int, int]:
    """(width, height) with the box's shape and about edge_px^2 pixels; very long boxes stay 8 px thin."""
    root = math.sqrt(box.w / box.h)
    return max(8, round(edge_px * root)), max(8, round(edge_px / root))


def _moved(box: Box, du: float, dv: float) -> Box:
    return Box(box.x + du, box.y + dv, box.w, box.h)


def _scaled(box: Box, factor: float) -> Box:
    (u, v), w, h = box.centre, box.w * factor, box.h * factor
    return Box(u - w / 2, v - h / 2, w, h)


def _like(block: Floats, model: Floats) -> Floats:
    """The block in the model's light: same mean and spread, so that differences are differences of look."""
    gain = float(model.std()) / max(float(block.std()), 1.0)
    gain = min(max(gain, 0.5), 2.0)
    return np.asarray((block - block.mean()) * np.float32(gain) + model.mean(), np.float32)


def _correlation(block: Floats, other: Floats) -> float:
    """Normalised correlation, -1..1; 0 where one of the two is flat."""
    return float(cv2.matchTemplate(block, other, cv2.TM_CCOEFF_NORMED)[0, 0]) if block.std() > 1.0 else 0.0
