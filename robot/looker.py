"""Looking for the target from picture to picture: what one look misses the next one may see.

A single look proposes places by a coarse scan and can miss the target although the recogniser would know
it there. So the scan's sizes alternate from look to look, and where a candidate was seen a moment ago is
judged again whatever the scan proposes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from calib.model import StereoRig
from robot.messages import Box, Detection, Image, View, wrap
from robot.target_range import TargetRanger

SMALLEST_PX, STEP, SIZES = 18.0, 1.25, 11
REMEMBERED = 1.0  # seconds for which a candidate's place is judged again


class Recognizes(Protocol):
    """What a taught model can do."""

    def predict(self, image: Image, heights_px: Sequence[float] | None = None) -> list[Detection]:
        """All places in the picture that look like the target, best first."""
        ...

    def glance(self, image: Image, heights_px: Sequence[float]) -> list[Detection]:
        """Places that surely look like the target at one of a few sizes, best first; quick."""
        ...

    def refine(self, image: Image, box: Box) -> Detection:
        """The best place at or near a box, with its score."""
        ...

    def score(self, image: Image, box: Box) -> float:
        """How surely the box holds the target, 0..1; 0.5 is the threshold."""
        ...


class Looker:
    """Searches views for the target; remembers the last candidate's direction and size."""

    def __init__(self, rig: StereoRig, recognizer: Recognizes, ranger: TargetRanger) -> None:
        self._eye = rig.left
        self._recognizer = recognizer
        self._ranger = ranger
        self._looks = 0
        self._last: tuple[float, View, Detection] | None = None

    def look(self, view: View) -> tuple[Detection, ...]:
        """Detections of this view, best first, each with the azimuth it was seen in."""
        self._looks += 1
        image = view.frame.left
        phase = STEP ** (0.5 * (self._looks % 2))
        found = self._recognizer.predict(image, [SMALLEST_PX * phase * STEP**k for k in range(SIZES)])
        again = self._again(view)
        if again is not None and all(again.box.iou(other.box) < 0.1 for other in found):
            found.append(again)
        found = [detection for detection in found if self._ranger.plausible(view, detection.box)]
        found.sort(key=lambda detection: -detection.score)
        ahead = view.base.yaw + view.head.pan
        placed = tuple(
            replace(one, azimuth=wrap(ahead + self._eye.bearing(one.box.centre[0]))) for one in found
        )
        if placed:
            self._last = (view.frame.captured_at, view, placed[0])
        return placed

    def _again(self, view: View) -> Detection | None:
        """The last candidate judged anew where it must be now, if that is in the picture."""
        if self._last is None or view.frame.captured_at - self._last[0] > REMEMBERED:
            return None
        _, before, detection = self._last
        turned = wrap(view.head.pan - before.head.pan + view.base.yaw - before.base.yaw)
        nodded = view.head.tilt - before.head.tilt
        if abs(turned) > math.pi / 4:
            return None
        box = detection.box
        moved = Box(
            box.x + self._eye.fx * math.tan(turned), box.y - self._eye.fy * math.tan(nodded), box.w, box.h
        )
        if moved.clipped(self._eye.width, self._eye.height).area < 0.9 * moved.area:
            return None
        judged = self._recognizer.refine(view.frame.left, moved)
        return judged if judged.score >= 0.5 else None
