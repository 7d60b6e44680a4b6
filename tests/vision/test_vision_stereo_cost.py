"""The matching cost is equation (1), pixel by pixel; pooling is the mean of the better of two disparities."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.vision.stereo_cost import MatchingCost, pooled_cost, row_pooled_cost

EVEN = st.integers(1, 6).map(lambda half: 2 * half)
COSTS = st.builds(
    MatchingCost,
    intensity_limit=st.integers(1, 60),
    gradient_limit=st.integers(1, 60),
    gradient_gain=st.sampled_from([1.0, 2.0, 6.0, 9.0]),
)


def gradient(grey, row, column, down, right, gain):
    """Half the difference of a pixel's two neighbours times gain, about 128; nothing across the rim."""
    height, width = grey.shape
    if not (row - down >= 0 and row + down < height and column - right >= 0 and column + right < width):
        return 128.0
    behind, before = int(grey[row + down, column + right]), int(grey[row - down, column - right])
    return float(np.clip(np.rint(128.0 + gain * (behind - before) / 2), 0, 255))


def equation_1(left, right, disparities, cost):
    """(disparities, H, W) by loops; left of the right picture its first column goes on."""
    height, width = left.shape
    volume = np.zeros((disparities, height, width))
    for d in range(disparities):
        for row in range(height):
            for column in range(width):
                other = max(column - d, 0)
                intensity = abs(int(left[row, column]) - int(right[row, other]))
                total = min(intensity, cost.intensity_limit)
                for down, along in ((0, 1), (1, 0)):
                    one = gradient(left, row, column, down, along, cost.gradient_gain)
                    two = gradient(right, row, other, down, along, cost.gradient_gain)
                    total += min(abs(one - two), cost.gradient_limit)
                volume[d, row, column] = total
    return volume


def random_pair(height, width, seed):
    """Rough in parts and smooth in others, so that limits are met and are not."""
    rng = np.random.default_rng(seed)
    spread = rng.choice([2.0, 8.0, 90.0])
    return (
        np.clip(np.rint(120 + spread * rng.standard_normal((height, width))), 0, 255).astype(np.uint8)
        for _ in range(2)
    )


def rows_by_twos(volume):
    return (volume[:, ::2] + volume[:, 1::2]) / 2


@settings(max_examples=20, deadline=None)
@given(height=EVEN, width=EVEN, disparities=EVEN, cost=COSTS, seed=st.integers(0, 999))
def test_pooled_costs_are_equation_1_pooled(height, width, disparities, cost, seed):
    left, right = random_pair(height, width, seed)
    whole = equation_1(left, right, disparities, cost)
    better = rows_by_twos(np.minimum(whole[::2], whole[1::2]))
    expected = (better[:, :, ::2] + better[:, :, 1::2]) / 2
    found = pooled_cost(left, right, disparities, cost)
    assert found.dtype == np.uint8
    assert found.shape == (disparities // 2, height // 2, width // 2)
    assert np.abs(found - expected).max() <= 0.5, "rounded to whole numbers, no more"


@settings(max_examples=20, deadline=None)
@given(height=EVEN, width=st.integers(1, 12), disparities=EVEN, cost=COSTS, seed=st.integers(0, 999))
def test_row_pooled_costs_are_equation_1_with_rows_pooled(height, width, disparities, cost, seed):
    left, right = random_pair(height, width, seed)
    found = row_pooled_cost(left, right, disparities, cost)
    assert found.dtype == np.uint8
    assert found.shape == (disparities, height // 2, width)
    assert np.abs(found - rows_by_twos(equation_1(left, right, disparities, cost))).max() <= 0.5


@pytest.mark.parametrize("shift", [0, 3, 8, 13])
def test_a_shifted_picture_costs_nothing_at_its_shift_and_only_there(shift):
    scene = np.random.default_rng(shift).integers(0, 256, (24, 80)).astype(np.uint8)
    left, right = scene[:, :60], scene[:, shift : shift + 60]
    seen = slice(shift + 1, 59)  # at the pictures' rims there is no gradient
    whole = row_pooled_cost(left, right, 16, MatchingCost())[:, :, seen]
    assert whole.mean(axis=(1, 2)).argmin() == shift
    assert not whole[shift].any()
    assert np.delete(whole, shift, axis=0).mean() > 20
    pooled = pooled_cost(left, right, 16, MatchingCost())[:, :, shift // 2 + 1 : 29]
    assert not pooled[shift // 2].any()
    assert np.delete(pooled, shift // 2, axis=0).mean() > 15


def test_what_has_nothing_in_common_costs_the_largest_and_never_more():
    slope = np.add.outer(20 * np.arange(6), 20 * np.arange(6)).astype(np.uint8)
    cost = MatchingCost(intensity_limit=11, gradient_limit=17)
    found = row_pooled_cost(slope, 255 - slope, 2, cost)[0]
    assert cost.largest == 11 + 17 + 17
    assert found.max() == cost.largest
    assert (found[1, 1:-1] >= 2 * 17).all(), "both gradients point the other way"


def test_intensity_and_gradient_are_cut_off_at_their_own_limits():
    left, right = np.full((4, 8), 100, np.uint8), np.full((4, 8), 107, np.uint8)
    assert (pooled_cost(left, right, 4, MatchingCost(intensity_limit=15)) == 7).all()
    assert (pooled_cost(left, right, 4, MatchingCost(intensity_limit=5)) == 5).all()
    step = np.repeat(np.array([[100, 100, 100, 100, 110, 110, 110, 110]], np.uint8), 4, axis=0)
    flat = np.full((4, 8), 100, np.uint8)
    found = row_pooled_cost(
        step, flat, 2, MatchingCost(intensity_limit=0, gradient_limit=15, gradient_gain=2.0)
    )
    assert found[0, 0].tolist() == [0, 0, 0, 10, 10, 0, 0, 0]
    found = row_pooled_cost(
        step, flat, 2, MatchingCost(intensity_limit=0, gradient_limit=4, gradient_gain=2.0)
    )
    assert found[0, 0].tolist() == [0, 0, 0, 4, 4, 0, 0, 0]


def test_a_vertical_gradient_counts_as_a_horizontal_one_does():
    step = np.repeat(np.array([[100, 100, 100, 104, 104, 104]], np.uint8), 6, axis=0)
    flat = np.full((6, 6), 100, np.uint8)
    only_gradient = MatchingCost(intensity_limit=0, gradient_limit=100, gradient_gain=2.0)
    across = row_pooled_cost(step, flat, 2, only_gradient)[0]
    down = row_pooled_cost(np.ascontiguousarray(step.T), flat, 2, only_gradient)[0]
    assert across[1].tolist() == [0, 0, 4, 4, 0, 0]
    assert down.tolist() == [[0] * 6, [4] * 6, [0] * 6]


def test_the_search_may_be_wider_than_the_picture():
    left, right = random_pair(4, 6, 1)
    found = pooled_cost(left, right, 20, MatchingCost())
    expected = equation_1(left, right, 20, MatchingCost())
    better = rows_by_twos(np.minimum(expected[::2], expected[1::2]))
    assert np.abs(found - (better[:, :, ::2] + better[:, :, 1::2]) / 2).max() <= 0.5


def test_the_pictures_are_left_as_they_were():
    left, right = random_pair(8, 8, 2)
    before = left.tobytes(), right.tobytes()
    pooled_cost(left, right, 4, MatchingCost())
    row_pooled_cost(left, right, 4, MatchingCost())
    assert (left.tobytes(), right.tobytes()) == before
