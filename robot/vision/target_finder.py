"""Finding one taught target: ferns propose places, NMF views confirm them, whole or by a half.

Ferns vote with every small part that shows, so they point at a target of which half is hidden; what they
point at is held against the taught views (`Recognizer`), and where a whole view does not fit, half of one
(`robot.vision.half_views`). `robot.vision.finder_training` fits it. Methods 1 and 8 in one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Detection, Image
from robot.vision.ferns import FernDetector, HoughDetection
from robot.vision.half_views import HalfViews, best_half
from robot.vision.named_arrays import below
from robot.vision.recognizer import HEIGHTS_PX, Recognizer
from robot.vision.view_matching import Judge, Picture, one_for_each_place
from robot.vision.windows import Floats, with_surroundings

PROPOSALS = 8
"""Places the ferns may propose in a picture."""
LEAST_VOTES = 0.1
"""Score of the ferns below which a place is not looked at."""
HALVES_ASKED = 4
"""Places, those with most votes, at which halves are asked where no whole view fits."""
GLANCED = 2
"""Places looked at in a glance."""
SAME_PLACE = 0.4
"""Overlap from which votes are for what is in a box."""
ABOUT = 0.75
"""Of a box's edges: how far around it votes are counted when a single place is judged."""
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
        judged, asked = [], 0
        for one in self.proposals(image, HEIGHTS_PX if heights_px is None else heights_px):
            found = self.recognizer.judged(picture, one.box)
            if found.score < SURE and asked < HALVES_ASKED:
                found = self._by_half(picture, one.box, one.score)
                asked += 1
            judged.append(found)
        return one_for_each_place([one for one in judged if one.score >= SURE])

    def glance(self, image: Image, heights_px: Sequence[float]) -> list[Detection]:
        """Places where the whole target surely seems to be, best first: the likeliest few, no halves."""
        picture = Picture.of(image)
        few = self.proposals(image, heights_px)[:GLANCED]
        judged = [self.recognizer.judged(picture, one.box) for one in few]
        return one_for_each_place([one for one in judged if one.score >= SURE])

    def score(self, image: Image, box: Box) -> float:
        """How surely the target is at (or a little beside) a box, 0..1; 0.5 is the threshold."""
        return self.refine(image, box).score

    def refine(self, image: Image, box: Box) -> Detection:
        """The best place at or near a box, with its score (which may be below 0.5)."""
        picture = Picture.of(image)
        whole = self.recognizer.detection(self.recognizer.locate(picture, box))
        if whole.score >= SURE:
            return whole
        half = self._by_half(picture, box, self.votes(image, box))
        return max(whole, half, key=lambda one: one.score)

    def proposals(self, image: Image, heights_px: Sequence[float]) -> list[HoughDetection]:
        """Places the ferns vote for, most votes first; at most `PROPOSALS`."""
        extent = self.ferns.classes[self.label].extent[1]
        scales = [height / extent for height in sorted(heights_px)]
        return self.ferns.predict(image, scales, least_score=LEAST_VOTES, most=PROPOSALS)

    def votes(self, image: Image, box: Box) -> float:
        """Score of the ferns for what is in a box, 0 if they vote for nothing there."""
        near = with_surroundings(image, box, ABOUT)
        if near is None:
            return 0.0
        part, moved = near
        size = box.h / self.ferns.classes[self.label].extent[1]
        found = self.ferns.predict(part, [size * step for step in NEAR_SCALES], least_score=LEAST_VOTES)
        return max((one.score for one in found if one.box.iou(moved) >= SAME_PLACE), default=0.0)

    def _by_half(self, picture: Picture, box: Box, votes: float) -> Detection:
        half = best_half(picture, box, self.halves())
        return Detection(half.box, self.half_judge.score((half.merit, half.colour, votes)), self.label)

    def halves(self) -> list[HalfViews]:
        """Halves of the views, for each shape."""
        pairs = zip(self.recognizer.groups, self.common, strict=True)
        return [HalfViews(group, common) for group, common in pairs]

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Everything learnt as plain arrays, keyed 'half_judge', 'common.0', 'nmf.…', 'ferns.…'."""
        arrays: dict[str, NDArray[np.generic]] = {"half_judge": self.half_judge.values()}
        arrays |= {f"common.{index}": common for index, common in enumerate(self.common)}
        arrays |= {f"nmf.{key}": value for key, value in self.recognizer.arrays().items()}
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
        return cls(recognizer, ferns, common, Judge.of_values(arrays["half_judge"]))
