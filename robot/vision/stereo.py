"""Dense disparity of a rectified pair: [T]'s local matcher with adaptive weights, METHODS 7, in presets.

    lite    on pictures of half the size: a third of the time of OpenCV's semi-global matching
    normal  no slower than semi-global matching, and more accurate
    fine    finer intensities, and the second disparity-space volume
    floors  normal for webcams' noise and floors' little texture: what the robot on wheels uses

Three stages, each in its own file: matching cost (`stereo_cost`), aggregation with K clustered intensities
(`stereo_aggregation`), selection with left-right check (`stereo_selection`). Then gaps are filled
(`stereo_refinement`), neighbours vote where the eyes disagree (`stereo_voting`), and every disparity is
fitted to the grey values and checked (`stereo_refinement`, `stereo_checks`).
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from robot.messages import Image
from robot.vision.disparity import Disparity, Floats, Mask, Matcher
from robot.vision.floor_aligned import FloorAlignedMatcher
from robot.vision.pair_input import grey_pair
from robot.vision.stereo_aggregation import Support, aggregate
from robot.vision.stereo_checks import measured
from robot.vision.stereo_cost import MatchingCost, pooled_cost, row_pooled_cost
from robot.vision.stereo_refinement import WINDOW, Window, doubled, enlarge, fill_rows, median
from robot.vision.stereo_selection import Winners, select
from robot.vision.stereo_voting import Voting, vote

__all__ = [
    "AdaptiveWeightMatcher",
    "Disparity",
    "FloorAlignedMatcher",
    "HalvedMatcher",
    "Matcher",
]

COST = MatchingCost()
NORMAL, FINE, HALVED = Support(), Support(clusters=16), Support(clusters=4)
EVEN, WIDE_WINDOW = Support(clusters=4, sigma=2.5), Window(11, 2, 0.7, noise_correlation=20.0)
MOST_SMOOTHING_PX = 3.0
LAST_LEVELS = 1.5
"""What is matched to the search's very end may well lie beyond it."""
HALVED_WINDOW = Window(half_side_px=5, steps=1)
LEAST_DISPARITIES, MOST_DISPARITIES = 8, 512
BUSY_BYTES = 31 << 20


class AdaptiveWeightMatcher:
    """Local matching with adaptive weights, costs pooled to half the picture's size.

    `values` are filled everywhere; `valid` marks what was measured. Calls do not influence each other.

    Args:
        disparities: columns searched, 0 .. disparities - 1; even, 8 to 512.
        cost: limits of the comparison of two pixels.
        support: whose costs count for a pixel.
        voting: how neighbours vote where the eyes disagree; None: the row's farther neighbour fills.
        smoothing_px: standard deviation of the Gaussian that takes a camera's noise out of both pictures
            first, at most 3; 0: clean pictures, every detail counts.
        window: of the least-squares fit.

    Raises:
        ValueError: disparities out of range; pictures that are no pair (see `grey_pair`).

    >>> noise = np.random.default_rng(1).integers(0, 255, (64, 160), np.uint8)
    >>> scene = cv2.GaussianBlur(noise, (0, 0), 1.5)
    >>> found = AdaptiveWeightMatcher.normal(32)(scene[:, :120], scene[:, 8:128])
    >>> round(float(np.median(found.values[found.valid])), 1)
    8.0
    """

    def __init__(
        self,
        disparities: int = 64,
        *,
        cost: MatchingCost = COST,
        support: Support = NORMAL,
        voting: Voting | None = None,
        smoothing_px: float = 0.0,
        window: Window = WINDOW,
    ) -> None:
        if not 0.0 <= smoothing_px <= MOST_SMOOTHING_PX:
            raise ValueError(f"smoothing_px must be 0 to {MOST_SMOOTHING_PX:g}, got {smoothing_px}")
        self.disparities = checked(disparities)
        self.cost, self.support, self.voting = cost, support, voting
        self.smoothing_px, self.window = smoothing_px, window
        cell = support.cell if voting is None else math.lcm(support.cell, voting.support.cell)
        self._multiple = 2 * cell

    @staticmethod
    def lite(disparities: int = 64) -> HalvedMatcher:
        """The quickest: a third of the time of OpenCV's semi-global matching, for the smallest boards."""
        return HalvedMatcher(disparities)

    @classmethod
    def normal(cls, disparities: int = 64) -> AdaptiveWeightMatcher:
        """No slower than semi-global matching and more accurate."""
        return cls(disparities)

    @classmethod
    def fine(cls, disparities: int = 64) -> AdaptiveWeightMatcher:
        """Finer intensities, and the second disparity-space volume fills what only one eye saw."""
        return cls(disparities, support=FINE, voting=Voting())

    @classmethod
    def floors(cls, disparities: int = 64) -> AdaptiveWeightMatcher:
        """`normal` for webcams that look at floors: little texture, much noise, large even surfaces.

        In simulated rooms it measures 74 to 82 % of the floor where `normal` measures 26 to 41 %.
        """
        return cls(disparities, support=EVEN, smoothing_px=1.3, window=WIDE_WINDOW)

    def __call__(self, left: Image, right: Image) -> Disparity:
        """Match left (H, W[, 3]) with right. See the class."""
        eyes = grey_pair(left, right)
        if self.smoothing_px > 0.0:
            eyes = _smoothed(eyes[0], self.smoothing_px), _smoothed(eyes[1], self.smoothing_px)
        height, width = eyes[0].shape
        wide_left, wide_right = (padded(eye, self._multiple) for eye in eyes)
        guide = halved(wide_left)
        costs = pooled_cost(wide_left, wide_right, self.disparities, self.cost)
        levels, stable = self._chosen(select(aggregate(costs, guide, self.support)), guide)
        # Level k holds disparities 2k and 2k + 1.
        index = enlarge(levels, guide, wide_left)[:height, :width]
        stable &= levels < self.disparities // 2 - LAST_LEVELS
        coarse = np.take(2.0 * levels + np.float32(0.5), index)
        return measured(*eyes, coarse, np.take(stable, index), self.window)

    def _chosen(self, winners: Winners, guide: Image) -> tuple[Floats, Mask]:
        """Levels (h, w) with gaps filled, and which of them are the winners' own, agreed on by both eyes."""
        levels = median(fill_rows(winners.level, winners.stable))
        if self.voting is not None:
            voted = vote(levels, winners.stable, guide, self.disparities // 2, self.voting)
            levels = median(np.where(winners.stable, levels, voted))
        return levels, own(winners, levels)


class HalvedMatcher:
    """The same three stages on the pictures at half their size, rows pooled once more.

    What is finer than two pixels (four along columns) is lost, and values and sigma are half
    as good. Arguments, result and errors as of `AdaptiveWeightMatcher`.
    """

    def __init__(
        self,
        disparities: int = 64,
        *,
        cost: MatchingCost = COST,
        support: Support = HALVED,
    ) -> None:
        self.disparities = checked(disparities)
        self.cost, self.support = cost, support

    def __call__(self, left: Image, right: Image) -> Disparity:
        """Match left (H, W[, 3]) with right. See the class."""
        eyes = grey_pair(left, right)
        height, width = eyes[0].shape
        half_left, half_right = (halved(padded(eye, 4 * self.support.cell)) for eye in eyes)
        size = half_left.shape[1], half_left.shape[0]
        guide = cv2.resize(half_left, (size[0], size[1] // 2), interpolation=cv2.INTER_AREA)
        costs = row_pooled_cost(half_left, half_right, self.disparities // 2, self.cost)
        winners = select(aggregate(costs, guide.astype(np.uint8, copy=False), self.support))
        levels = median(fill_rows(winners.level, winners.stable))
        stable = own(winners, levels) & (levels < self.disparities // 2 - LAST_LEVELS)
        coarse = cv2.resize(levels, size, interpolation=cv2.INTER_NEAREST)
        trusted = cv2.resize(stable.view(np.uint8), size, interpolation=cv2.INTER_NEAREST).view(np.bool_)
        half = measured(half_left, half_right, np.asarray(coarse, np.float32), trusted, HALVED_WINDOW)
        return Disparity(
            np.ascontiguousarray(doubled(2.0 * half.values)[:height, :width]),
            doubled(half.valid.view(np.uint8)).view(np.bool_)[:height, :width],
            doubled(2.0 * half.sigma_px)[:height, :width],
        )


def checked(disparities: int) -> int:
    """The number of disparities. Raises ValueError if it is odd or out of range."""
    if not isinstance(disparities, int):
        raise ValueError(f"disparities must be a whole number, got {disparities!r}")
    if disparities % 2 or not LEAST_DISPARITIES <= disparities <= MOST_DISPARITIES:
        raise ValueError(
            f"disparities must be even, {LEAST_DISPARITIES} to {MOST_DISPARITIES}, got {disparities}"
        )
    # Freed once, a block of this size tells the allocator (glibc) to keep what matching frees and needs
    # again: without it, a quarter of the time goes into fetching pages from the kernel.
    np.empty(BUSY_BYTES, np.uint8)
    return disparities


def own(winners: Winners, levels: Floats) -> Mask:
    """Pixels whose final level is the one both eyes found themselves."""
    unchanged: Mask = np.abs(levels - winners.level) <= 1.0
    return unchanged & winners.stable


def _smoothed(grey: Image, sigma: float) -> Image:
    return cv2.GaussianBlur(grey, (0, 0), sigma).astype(np.uint8, copy=False)


def padded(grey: Image, multiple: int) -> Image:
    """The picture with rims repeated so that height and width are multiples."""
    height, width = grey.shape
    bottom, right = -height % multiple, -width % multiple
    return cv2.copyMakeBorder(grey, 0, bottom, 0, right, cv2.BORDER_REPLICATE).astype(np.uint8, copy=False)


def halved(grey: Image) -> Image:
    """Half the size, each pixel the mean of four."""
    return cv2.resize(grey, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
