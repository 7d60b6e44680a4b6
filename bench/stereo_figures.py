"""Error and time of dense matchers: bad-2.0 and interleaved timing."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.stereo_data import StereoCase
from bench.stereo_peers import Method
from robot.messages import Image

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

BAD_PX = 2.0
TIMED_SIZE = (352, 288)
"""Width and height of a picture of the robot's eyes."""


def bad_2(truth: Floats, found: Floats, mask: Mask) -> float:
    """Percent of the known pixels of `mask` whose disparity is off by more than 2 px; not finite is off.

    truth (H, W) float32 px, NaN unknown; found (H, W) float32 px; mask (H, W) bool. NaN if no pixel counts.

    >>> truth = np.array([[4, 4, np.nan, 4]], np.float32)
    >>> bad_2(truth, np.array([[4, 7, 0, np.nan]], np.float32), np.ones((1, 4), bool))
    66.66666666666667
    """
    counted = mask & np.isfinite(truth)
    if not counted.any():
        return float("nan")
    good = np.abs(found[counted].astype(np.float64) - truth[counted]) <= BAD_PX
    return 100.0 * (1.0 - float(np.count_nonzero(good)) / good.size)


def interleaved_seconds(
    methods: Sequence[Method], left: Image, right: Image, disparities: int, rounds: int
) -> dict[str, NDArray[np.float64]]:
    """Wall times of `rounds` runs of every method, (rounds,) seconds each, after one run to warm up.

    In each round every method runs once, so that a slower moment of the machine meets all of them; each
    round begins with another one, so that none always follows the same.

    Raises:
        ValueError: rounds below 1.
    """
    if rounds < 1:
        raise ValueError(f"rounds must be at least 1, got {rounds}")
    seconds = {method.name: np.empty(rounds) for method in methods}
    for method in methods:
        method.run(left, right, disparities)
    for turn in range(rounds):
        first = turn % len(methods)
        for method in (*methods[first:], *methods[:first]):
            start = time.perf_counter()
            method.run(left, right, disparities)
            seconds[method.name][turn] = time.perf_counter() - start
    return seconds


def ratios(seconds: Mapping[str, NDArray[np.float64]], to: str) -> dict[str, float]:
    """Median time of each method over the median time of method `to` in the same rounds.

    >>> ratios({"a": np.array([1.0, 2.0, 9.0]), "b": np.array([4.0, 4.0, 4.0])}, "b")
    {'a': 0.5, 'b': 1.0}
    """
    reference = float(np.median(seconds[to]))
    return {name: float(np.median(times)) / reference for name, times in seconds.items()}


def timed_pair(case: StereoCase) -> tuple[Image, Image]:
    """The case's pictures as large as the robot's: shrunk or enlarged to cover 352 x 288, middle cut out."""
    return _cut(case.left), _cut(case.right)


def _cut(picture: Image) -> Image:
    width, height = TIMED_SIZE
    scale = max(width / picture.shape[1], height / picture.shape[0])
    size = max(round(picture.shape[1] * scale), width), max(round(picture.shape[0] * scale), height)
    covering = cv2.resize(picture, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    top, left = (size[1] - height) // 2, (size[0] - width) // 2
    return np.ascontiguousarray(covering[top : top + height, left : left + width], np.uint8)
