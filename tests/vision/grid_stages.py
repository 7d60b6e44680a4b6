"""The fast matcher's stages without the checks a camera's picture needs: to be held against the oracle."""

from __future__ import annotations

import numpy as np

from robot.vision.stereo import Disparity, halved, padded
from robot.vision.stereo_aggregation import Support, aggregate
from robot.vision.stereo_cost import MatchingCost, pooled_cost
from robot.vision.stereo_refinement import enlarge
from robot.vision.stereo_selection import select


class GridStages:
    """The stages of `AdaptiveWeightMatcher` as it joins them; valid are the pixels both eyes agree on.

    The fit (windows of 14 px) and the rule for specks (400 px) are for a camera's pictures, not for stamps.
    """

    def __init__(self, support: Support, disparities: int) -> None:
        self._support, self._disparities = support, disparities

    def __call__(self, left: np.ndarray, right: np.ndarray) -> Disparity:
        wide_left, wide_right = (padded(eye, 2 * self._support.cell) for eye in (left, right))
        guide = halved(wide_left)
        costs = pooled_cost(wide_left, wide_right, self._disparities, MatchingCost())
        won = select(aggregate(costs, guide, self._support))
        index = enlarge(won.level, guide, wide_left)[: left.shape[0], : left.shape[1]]
        values = np.take(2.0 * won.level + np.float32(0.5), index)
        return Disparity(values, np.take(won.stable, index), np.ones_like(values))
