"""The robot's own matcher as the benches run it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from bench.stereo_peers import Method
from robot.messages import Image
from robot.vision.stereo import AdaptiveWeightMatcher, Matcher

PRESETS = ("lite", "normal", "fine")


@cache
def matcher(preset: str, disparities: int) -> Matcher:
    """The matcher of one preset, made once as in the robot; a KeyError names an unknown preset."""
    makers: dict[str, Callable[[int], Matcher]] = {
        "lite": AdaptiveWeightMatcher.lite,
        "normal": AdaptiveWeightMatcher.normal,
        "fine": AdaptiveWeightMatcher.fine,
    }
    return makers[preset](disparities)


def ours() -> tuple[Method, ...]:
    """The three presets; the map is the matcher's own, filled one."""
    return tuple(_method(preset) for preset in PRESETS)


def _method(preset: str) -> Method:
    def run(left: Image, right: Image, disparities: int) -> NDArray[np.float32]:
        return matcher(preset, disparities)(left, right).values

    return Method(preset, run)
