"""Whether it is still the target: ferns that learn it while it is followed, and find it again when lost.

The ferns know two heights: what the target itself usually scores, and what the best of the rest of the
picture scores, its rivals. What stands clearly above the rivals is the target; how clearly is asked
differently of what was seen a frame ago (`holds`) and of what turns up anywhere (`proposals`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robot.messages import Box, Image
from robot.vision.ferns import FernDetector, FernSettings, HoughDetection, Sample
from robot.vision.windows import with_surroundings

LABEL = "target"
OCTAVE_STEPS = (2.0**-0.25, 1.0, 2.0**0.25)
"""Sizes looked for, over the last one."""
FIRST_WARPS, LATER_WARPS = 10, 3
LEAST_SCORE = 0.1
SAME, OTHER = 0.3, 0.1
"""Overlaps with the target's box above which a detection is of it, and below which of a rival."""
PROPOSALS = 3
"""Places proposed at a time."""
HOLDS = 0.15
"""Of the way from the rivals' height to the target's own: from there on a place is still the target's."""
LEAST_GAP = 0.1
"""The target's own height counts as at least so much above the rivals'."""
SHARE = 0.3
"""Of a new scan in the heights."""
ABOUT = 0.5
"""Of the box's edges: how far around the target's place is looked, to each side."""
HARDEST = 2
"""Rivals learnt from at a time."""
LEAST_STRIP_PX = 16


@dataclass(frozen=True, slots=True, eq=False)
class TargetMemory:
    """Ferns and the two heights; never changes, `and_met` gives the next one."""

    detector: FernDetector
    own: float
    rivals: float

    @classmethod
    def learnt(cls, image: Image, box: Box, seed: int) -> TargetMemory:
        """From the first box in a BGR or grey uint8 picture; everything else in it is background."""
        detector = FernDetector.fit(
            [Sample(image, box, LABEL)],
            _strips_beside(image, box),
            settings=FernSettings(warps=FIRST_WARPS),
            seed=seed,
        )
        later = replace(detector, settings=replace(detector.settings, warps=LATER_WARPS))
        own, rivals = _told_apart(_found(later, image, box), box)
        return cls(later, own, max((one.score for one in rivals), default=0.0))

    def and_met(self, image: Image, box: Box, seed: int) -> TargetMemory:
        """The memory after a look that surely shows the target in the box, and the rivals elsewhere."""
        own, rivals = _told_apart(_found(self.detector, image, box), box)
        highest = max((one.score for one in rivals), default=0.0)
        parts = [with_surroundings(image, one.box, 0.0) for one in rivals[:HARDEST]]
        hardest = [part[0] for part in parts if part is not None]
        return TargetMemory(
            self.detector.partial_fit([Sample(image, box, LABEL)], hardest, seed=seed),
            self.own + SHARE * (own - self.own),
            self.rivals + SHARE * (highest - self.rivals),
        )

    def holds(self, image: Image, box: Box) -> bool:
        """Whether what is in the box still looks more like the target than its rivals do."""
        near = with_surroundings(image, box, ABOUT)
        if near is None:
            return False
        own, _ = _told_apart(_found(self.detector, *near), near[1])
        return own >= self._height(HOLDS)

    def proposals(self, image: Image, box: Box) -> list[tuple[Box, float]]:
        """Places anywhere in the picture, about as large as a box, that are like the target: best first.

        Each with how much: 0 as its rivals usually are, 1 as the target itself.
        """
        span = max(self.own - self.rivals, LEAST_GAP)
        told = [(one.box, (one.score - self.rivals) / span) for one in _found(self.detector, image, box)]
        return [(place, known) for place, known in told if known > 0.0][:PROPOSALS]

    def _height(self, share: float) -> float:
        return self.rivals + share * max(self.own - self.rivals, LEAST_GAP)


def _found(detector: FernDetector, image: Image, box: Box) -> list[HoughDetection]:
    size = max(box.w, box.h) / detector.settings.reference_px
    return detector.predict(image, [size * step for step in OCTAVE_STEPS], least_score=LEAST_SCORE, most=4)


def _told_apart(found: Sequence[HoughDetection], box: Box) -> tuple[float, list[HoughDetection]]:
    """The score of what is in the box, 0 if nothing is, and what is elsewhere, best first."""
    own = max((one.score for one in found if one.box.iou(box) > SAME), default=0.0)
    return own, [one for one in found if one.box.iou(box) < OTHER]


def _strips_beside(image: Image, box: Box) -> list[Image]:
    """The picture without the box: what lies left, right, above and below of it."""
    x0, y0, x1, y1 = int(box.x) - 4, int(box.y) - 4, int(box.x + box.w) + 4, int(box.y + box.h) + 4
    strips = image[:, : max(x0, 0)], image[:, max(x1, 0) :], image[: max(y0, 0)], image[max(y1, 0) :]
    wide = [np.ascontiguousarray(strip) for strip in strips if min(strip.shape[:2]) >= LEAST_STRIP_PX]
    return wide or [np.zeros((LEAST_STRIP_PX, LEAST_STRIP_PX), np.uint8)]
