"""OpenCV's dense matchers as one would use them, each made dense by the same fill.

A `Method` turns a rectified BGR pair into a disparity at every pixel. All peers get grey pictures (on colour
they do worse) and a margin on the left, replicated: without it OpenCV leaves the first `disparities`
columns empty, which costs SGBM four points on teddy. Their time includes grey conversion, margin and fill.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Run = Callable[[Image, Image, int], Floats]
Pair = tuple[Image, Image]

MEDIAN_PX = 5
BM_BLOCK_PX = 15


@dataclass(frozen=True, slots=True)
class Method:
    """A named way to match: run(left, right, disparities) -> (H, W) float32 px, a value at every pixel.

    left, right: (H, W, 3) uint8 BGR, rectified; disparities: columns to search, any number above 0.
    """

    name: str
    run: Run


@dataclass(frozen=True, slots=True)
class SemiGlobalSettings:
    """What cv2.StereoSGBM is created with; penalties of neighbours that differ by one step and by more."""

    block_px: int
    mode: int
    uniqueness_percent: int = 0
    speckle_px: int = 0
    speckle_range: int = 0

    def matcher(self, disparities: int) -> cv2.StereoSGBM:
        """The matcher; P1 = 8 b^2 and P2 = 32 b^2 as OpenCV's documentation has it for one channel."""
        area = self.block_px**2
        return cv2.StereoSGBM.create(
            minDisparity=0, numDisparities=disparities, blockSize=self.block_px, P1=8 * area, P2=32 * area,
            disp12MaxDiff=1, uniquenessRatio=self.uniqueness_percent, speckleWindowSize=self.speckle_px,
            speckleRange=self.speckle_range, mode=self.mode,
        )  # fmt: skip


SGBM = SemiGlobalSettings(5, cv2.STEREO_SGBM_MODE_SGBM)
THREE_WAY = SemiGlobalSettings(5, cv2.STEREO_SGBM_MODE_SGBM_3WAY)
HH4 = SemiGlobalSettings(5, cv2.STEREO_SGBM_MODE_HH4)
THREE_WAY_FILTERED = SemiGlobalSettings(3, cv2.STEREO_SGBM_MODE_SGBM_3WAY, 10, 100, 2)
SGBM_FILTERED = SemiGlobalSettings(5, cv2.STEREO_SGBM_MODE_SGBM, 10, 100, 2)


def peers() -> tuple[Method, ...]:
    """The peers that time and error are compared with; `3way_filtered` is the strongest of them."""
    return (
        Method("bm", match_blocks),
        Method("sgbm", semi_global(SGBM)),
        Method("3way", semi_global(THREE_WAY)),
        Method("hh4", semi_global(HH4)),
        Method("3way_filtered", smoothed(semi_global(THREE_WAY_FILTERED))),
    )


def side_peers() -> tuple[Method, ...]:
    """Further forms for the reader, held to no bar: filtered BM and SGBM, and SGBM without the margin."""
    return (
        Method("bm_filtered", match_blocks_filtered),
        Method("sgbm_filtered", smoothed(semi_global(SGBM_FILTERED))),
        Method("sgbm_no_margin", semi_global_without_margin),
    )


def semi_global(settings: SemiGlobalSettings) -> Run:
    """Semi-global matching with the margin, filled."""

    def run(left: Image, right: Image, disparities: int) -> Floats:
        columns = multiple_of_16(disparities)
        pair = with_margin(grey_pair(left, right), columns, 0)
        return _filled(settings.matcher(columns).compute(*pair)[:, columns:])

    return run


def semi_global_without_margin(left: Image, right: Image, disparities: int) -> Floats:
    """SGBM as it comes: it neither searches nor measures the first `disparities` columns."""
    return _filled(SGBM.matcher(multiple_of_16(disparities)).compute(*grey_pair(left, right)))


def smoothed(run: Run) -> Run:
    """The same, and a median filter over the filled map."""

    def smooth(left: Image, right: Image, disparities: int) -> Floats:
        return np.asarray(cv2.medianBlur(run(left, right, disparities), MEDIAN_PX), np.float32)

    return smooth


def match_blocks(left: Image, right: Image, disparities: int) -> Floats:
    """Block matching, OpenCV's defaults at its best block, filled."""
    return _blocks(left, right, cv2.StereoBM.create(multiple_of_16(disparities), BM_BLOCK_PX))


def match_blocks_filtered(left: Image, right: Image, disparities: int) -> Floats:
    """Block matching with a left-right check and a speckle filter, block 9, filled."""
    matcher = cv2.StereoBM.create(multiple_of_16(disparities), 9)
    matcher.setSpeckleWindowSize(100)
    matcher.setSpeckleRange(2)
    matcher.setDisp12MaxDiff(1)
    return _blocks(left, right, matcher)


def fill_rows(values: Floats, valid: Mask) -> Floats:
    """Fill from the farther side, as is usual on Middlebury: what is missing is mostly hidden background.

    Each invalid pixel takes the smaller of the nearest valid values to its left and right in its row; a row
    without any takes the nearest filled row; a map without any becomes 0.

    >>> row = np.array([[0, 7, 0, 0, 3, 0]], np.float32)
    >>> fill_rows(row, row > 0)[0].tolist()
    [7.0, 7.0, 3.0, 3.0, 3.0, 3.0]
    """
    width = values.shape[1]
    columns = np.arange(width, dtype=np.intp)
    before = np.maximum.accumulate(np.where(valid, columns, -1), axis=1)
    after = np.minimum.accumulate(np.where(valid, columns, width)[:, ::-1], axis=1)[:, ::-1]
    # One column of infinity on either side stands for "no neighbour there".
    bordered = np.pad(values, ((0, 0), (1, 1)), constant_values=np.inf)
    farther = np.minimum(
        np.take_along_axis(bordered, before + 1, 1), np.take_along_axis(bordered, after + 1, 1)
    )
    filled = np.where(valid, values, farther).astype(np.float32, copy=False)
    measured = np.flatnonzero(valid.any(axis=1))
    if len(measured) == len(values):
        return filled
    if not len(measured):
        return np.zeros_like(filled)
    distance = np.abs(np.arange(len(values))[:, None] - measured)
    return np.asarray(filled[measured[distance.argmin(axis=1)]], np.float32)


def multiple_of_16(disparities: int) -> int:
    """The least search OpenCV offers that covers `disparities`.

    >>> multiple_of_16(16), multiple_of_16(60)
    (16, 64)
    """
    if disparities <= 0:
        raise ValueError(f"disparities must be above 0, got {disparities}")
    return -(-disparities // 16) * 16


def grey_pair(left: Image, right: Image) -> Pair:
    """Both eyes in grey."""
    grey_left, grey_right = (
        eye if eye.ndim == 2 else np.asarray(cv2.cvtColor(eye, cv2.COLOR_BGR2GRAY), np.uint8)
        for eye in (left, right)
    )
    return grey_left, grey_right


def with_margin(pair: Pair, left_px: int, around_px: int) -> Pair:
    """Both eyes with their borders repeated: `around_px` on every side, `left_px` more on the left."""
    wide_left, wide_right = (
        np.asarray(
            cv2.copyMakeBorder(
                eye, around_px, around_px, left_px + around_px, around_px, cv2.BORDER_REPLICATE
            ),
            np.uint8,
        )
        for eye in pair
    )
    return wide_left, wide_right


def _blocks(left: Image, right: Image, matcher: cv2.StereoBM) -> Floats:
    # A block that reaches out of the picture measures nothing either.
    half, columns = matcher.getBlockSize() // 2, matcher.getNumDisparities()
    wide = matcher.compute(*with_margin(grey_pair(left, right), columns, half))
    height, width = left.shape[:2]
    return _filled(wide[half : half + height, half + columns : half + columns + width])


def _filled(sixteenths: cv2.typing.MatLike) -> Floats:
    """OpenCV's 16-bit disparities, negative where invalid, as dense float32 pixels."""
    return fill_rows(sixteenths.astype(np.float32) * np.float32(1 / 16), np.asarray(sixteenths >= 0))
