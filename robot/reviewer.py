"""While the target is followed: is there something in the picture that looks more like it?

A tracker holds on to what it was started with, be it wrong, or a look-alike it slid onto. So the picture
is gone through now and then, a quarter of the sizes at a time; what is more like the target than what is
followed, twice in the same direction, is told.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from calib.model import StereoRig
from robot.looker import SIZES, SMALLEST_PX, STEP
from robot.messages import Box, Detection, Image, View, wrap
from robot.target_range import TargetRanger

PARTS = 4
"""Reviews that together go through all sizes."""
BETTER = 0.2
"""By which something must score higher than what is followed."""
AGREE = math.radians(6.0)
"""Two sightings of the same thing lie nearer than this."""
REMEMBERED = 3.0
"""Seconds within which it must be seen twice."""
SAME_PLACE = 0.2
"""Overlap with the tracked box from which it is what is followed."""


class Glances(Protocol):
    """What a taught model can do at a glance."""

    def glance(self, image: Image, heights_px: Sequence[float]) -> list[Detection]:
        """Places that surely look like the target at one of a few sizes, best first; quick."""
        ...

    def score(self, image: Image, box: Box) -> float:
        """How surely the box holds the target, 0..1; 0.5 is the threshold."""
        ...


class Reviewer:
    """Goes through the picture while something is followed; remembers the last rival's direction."""

    def __init__(self, rig: StereoRig, recognizer: Glances, ranger: TargetRanger) -> None:
        self._eye = rig.left
        self._recognizer = recognizer
        self._ranger = ranger
        self._part = 0
        self._rival: tuple[float, float] | None = None  # (azimuth, when)

    def review(self, view: View, followed: Box) -> Detection | None:
        """What looks more like the target than what is followed, once it was seen twice; else None."""
        image, now = view.frame.left, view.frame.captured_at
        heights = [SMALLEST_PX * STEP**k for k in range(self._part, SIZES, PARTS)]
        found = self._recognizer.glance(image, heights)
        rival = next((one for one in found if self._is_rival(view, one, followed)), None)
        if rival is None or rival.score < self._recognizer.score(image, followed) + BETTER:
            self._part = (self._part + 1) % PARTS
            return None
        rival = replace(rival, azimuth=self._azimuth(view, rival.box))
        before, self._rival = self._rival, (rival.azimuth, now)
        seen = before is not None and now - before[1] <= REMEMBERED
        if not seen or before is None or abs(wrap(rival.azimuth - before[0])) > AGREE:
            return None  # the same sizes are gone through again next time
        self._rival = None
        return rival

    def _is_rival(self, view: View, one: Detection, followed: Box) -> bool:
        return one.box.iou(followed) < SAME_PLACE and self._ranger.plausible(view, one.box)

    def _azimuth(self, view: View, box: Box) -> float:
        return wrap(view.base.yaw + view.head.pan + self._eye.bearing(box.centre[0]))
