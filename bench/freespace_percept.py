"""The percept under test, made as the robot makes it: one finder for the base, one for the hand."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from bench.freespace_hand_worlds import HAND_KINDS
from bench.freespace_truth import BASE, HAND
from bench.freespace_views import BASE_MOUNT, BASE_RIG, HAND_MOUNT, HAND_RIG
from robot.messages import FreeSpace, Image
from robot.vision import free_way
from robot.vision.stereo import AdaptiveWeightMatcher

Finder = Callable[[Image, Image, float, float], FreeSpace]
BASE_DISPARITIES, HAND_DISPARITIES = 64, 176


def finder_for(kind: str) -> Finder:
    """The finder that looks at views of this kind."""
    return _hand() if kind in HAND_KINDS else _base()


@cache
def _base() -> Finder:
    return free_way.FreeWayFinder(BASE_RIG, BASE_MOUNT, BASE, AdaptiveWeightMatcher.floors(BASE_DISPARITIES))


@cache
def _hand() -> Finder:
    return free_way.HandWayFinder(HAND_RIG, HAND_MOUNT, HAND, AdaptiveWeightMatcher.normal(HAND_DISPARITIES))
