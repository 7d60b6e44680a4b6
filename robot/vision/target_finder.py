"""Finding one taught target: a window net proposes places, NMF views and ferns confirm them.

What looks like the target as a whole, or as a target of which a side is hidden (`WindowDetector`), is held
against the taught views (`Recognizer`); where a whole view does not fit, half of one (`half_views`), with
what the ferns vote for the place. `robot.vision.finder_training` fits it. Methods 1 and 8 in one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Detection, Image
from robot.vision.ferns import FernDetector
from robot.vision.half_views import HalfViews, best_half
from robot.vision.named_arrays import below
from robot.vision.recognizer import HEIGHTS_PX, Recognizer
from robot.vision.view_matching import Judge, Picture, one_for_each_place
from robot.vision.window_detector import WindowDetection, WindowDetector
from robot.vision.windows import Floats, cut_out, with_surroundings

PROPOSALS = 5
"""Places that may be proposed in a picture."""
LEAST_PROPOSED = 0.1
"""Score of the windows below which a place is not looked at: whoever proposes must not be the judge."""
LEAST_SCALE = 0.8
"""Of the size at which windows are learnt: no picture is enlarged more, smaller targets show in it too."""
HALVES_ASKED = 3
"""Places, the likeliest, at which halves are asked where no whole view fits."""
LEAST_HALF_PX = 32.0
"""Height of a place from which a half of it is asked: half of less is like too much else."""
LEAST_INSIDE = 0.85
"""Of a place that must lie in the picture: beyond its rim nothing is seen."""
GLANCED = 2
"""Places looked at in a glance."""
ABOUT = 0.75
"""Of a box's edges: how far around it one looks for votes."""
OFF = 0.2
"""Of a box's edges: how far from its middle votes are for what is in it."""
NEAR_SCALES = (2.0**-0.25, 1.0, 2.0**0.25)
"""Sizes over the box's at which they are counted."""
SURE = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class TargetFinder:
    """Finds one taught target in pictures. Make it with `finder_training.fit` or `from_arrays`.

    common: for each shape of the recognizer, how common each half of each view is (`half_views.HalfViews`).
    half_judge: makes a score of a half's merit, its colour agreement and the ferns' votes.
    """

    recognizer: Recognizer
    windows: WindowDetector
    ferns: FernDetector
    common: tuple[Floats, ...]
    half_judge: Judge

    @property
    def label(self) -> str:
        """What the target is called."""
        return self.recognizer.label

    def predict(self, image: Image, heights_px: Sequence[float] | None = None) -> list[Detection]:
        """All places where the target seems to be, best first, at most one for each place.

        image: BGR uint8 (H, W, 3). heights_px: heights of target to look for, in pixels; None searches
        18 to 170 px. Scores lie between 0.5 (the threshold learnt on negatives) and 1.
        """
        picture = Picture.of(image)
        proposed = self.proposals(image, HEIGHTS_PX if heights_px is None else heights_px)
        whole = [self.recognizer.judged(picture, one.box) for one in proposed]
        sure = _sure(whole, image)
        if not sure:
            large = [one.box for one in proposed if one.box.h >= LEAST_HALF_PX]
            halves = [self._by_half(image, picture, box) for box in large[:HALVES_ASKED]]
            sure = _sure(halves, image)
        return one_for_each_place(sure)

    def glance(self, image: Image, heights_px: Sequence[float]) -> list[Detection]:
        """Places where the whole target surely seems to be, best first: the likeliest few, no halves."""
        picture = Picture.of(image)
        few = self.proposals(image, heights_px)[:GLANCED]
        return one_for_each_place(_sure([self.recognizer.judged(picture, one.box) for one in few], image))

    def score(self, image: Image, box: Box) -> float:
        """How surely the target is at (or a little beside) a box, 0..1; 0.5 is the threshold."""
        return self.refine(image, box).score

    def refine(self, image: Image, box: Box) -> Detection:
        """The best place at or near a box, with its score (which may be below 0.5)."""
        picture = Picture.of(image)
        whole = self.recognizer.detection(self.recognizer.locate(picture, box))
        if whole.score >= SURE or box.h < LEAST_HALF_PX:
            return whole
        half = self._by_half(image, picture, box)
        return max(whole, half, key=lambda one: one.score)

    def proposals(self, image: Image, heights_px: Sequence[float]) -> list[WindowDetection]:
        """Places that look like the target, the likeliest first; at most `PROPOSALS`."""
        own = self.windows.shape.extent[1]
        scales = sorted({max(height / own, LEAST_SCALE) for height in heights_px})
        return self.windows.predict(image, scales, least_score=LEAST_PROPOSED, most=PROPOSALS)

    def votes(self, image: Image, box: Box) -> float:
        """What the ferns vote for a target in a box, 0..1: most for views like those learnt, 0 for nothing.

        More than 1 tells no more: bold prints of all kinds get it.
        """
        near = with_surroundings(image, box, ABOUT)
        if near is None:
            return 0.0
        part, moved = near
        size = box.h / self.ferns.classes[self.label].extent[1]
        votes = self.ferns.vote_map(part, self.label, [size * step for step in NEAR_SCALES])
        (u, v), beside, below = moved.centre, OFF * box.w, OFF * box.h
        middle = Box(u - beside, v - below, 2.0 * beside, 2.0 * below)
        return min(float(cut_out(votes, middle).max(initial=0.0)), 1.0)

    def _by_half(self, image: Image, picture: Picture, box: Box) -> Detection:
        half = best_half(picture, box, self.halves())
        evidence = half.merit, half.colour, self.votes(image, box)
        return Detection(half.box, self.half_judge.score(evidence), self.label)

    def halves(self) -> list[HalfViews]:
        """Halves of the views, for each shape."""
        pairs = zip(self.recognizer.groups, self.common, strict=True)
        return [HalfViews(group, common) for group, common in pairs]

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Everything learnt as plain arrays, keyed 'half_judge', 'common.0', 'nmf.…', 'windows.…', …"""
        arrays: dict[str, NDArray[np.generic]] = {"half_judge": self.half_judge.values()}
        arrays |= {f"common.{index}": common for index, common in enumerate(self.common)}
        arrays |= {f"nmf.{key}": value for key, value in self.recognizer.arrays().items()}
        arrays |= {f"windows.{key}": value for key, value in self.windows.arrays().items()}
        arrays |= {f"ferns.{key}": value for key, value in self.ferns.arrays().items()}
        return arrays

    @classmethod
    def from_arrays(cls, label: str, arrays: Mapping[str, NDArray[np.generic]]) -> TargetFinder:
        """The inverse of `arrays`. Raises KeyError or ValueError where they do not fit together."""
        recognizer = Recognizer.from_arrays(label, below("nmf.", arrays))
        indices = range(len(recognizer.groups))
        common = tuple(np.asarray(arrays[f"common.{index}"], np.float32) for index in indices)
        for group, one in zip(recognizer.groups, common, strict=True):
            if one.shape != (len(group.layouts), 4) or not np.isfinite(one).all():
                raise ValueError("how common the halves are does not fit the views")
        ferns = FernDetector.from_arrays([label], below("ferns.", arrays))
        windows = WindowDetector.from_arrays(below("windows.", arrays))
        return cls(recognizer, windows, ferns, common, Judge.of_values(arrays["half_judge"]))


def _sure(judged: Sequence[Detection], image: Image) -> list[Detection]:
    """Those that score enough and lie in the picture."""
    height, width = image.shape[:2]
    return [
        one
        for one in judged
        if one.score >= SURE and one.box.clipped(width, height).area >= LEAST_INSIDE * one.box.area
    ]
