"""Aggregation on the grid is equations (5)-(6) written out cell by cell."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.vision.stereo_aggregation import (
    MOST_AT_ONCE,
    Support,
    aggregate,
    by_cells,
    by_rows,
    sample_intensities,
    shares,
    smoothed,
)

CLUSTERS = st.sampled_from([2, 4, 8, 16])
SUPPORTS = st.builds(
    Support,
    clusters=CLUSTERS,
    cell=st.integers(2, 4),
    sigma=st.floats(0.8, 6.0),
    tail=st.floats(0.0, 0.2),
    tail_sigma=st.floats(6.0, 30.0),
)


def spatial(cells_apart, support):
    """S of cells so many apart along one axis; the plane's S is the product of both axes'."""
    away = support.cell * cells_apart
    core = math.exp(-(away**2) / (2 * support.sigma**2))
    return core + support.tail * math.exp(-(away**2) / (2 * support.tail_sigma**2))


def mixture(grey, samples):
    """Shares of the two samples a grey value lies between, by their nearness; all of one beyond the ends."""
    share = [0.0] * len(samples)
    if grey <= samples[0]:
        share[0] = 1.0
        return share
    for n in range(len(samples) - 1):
        low, high = samples[n], samples[n + 1]
        if low < grey <= high:
            share[n], share[n + 1] = (high - grey) / (high - low), (grey - low) / (high - low)
            return share
    share[-1] = 1.0
    return share


def literally(levels, guide, support):
    """(5)-(6): for each pixel sum over samples and cells, then divide."""
    count, height, width = levels.shape
    # Parted by a thousandth each, lest equal ones be one.
    samples = [float(m) + 0.001 * n for n, m in enumerate(sample_intensities(guide, support.clusters))]
    of_grey = {int(grey): mixture(int(grey), samples) for grey in np.unique(guide)}
    cell = support.cell
    nodes = {}
    for row in range(height):
        for column in range(width):
            at = row // cell, column // cell
            for n, h in enumerate(of_grey[int(guide[row, column])]):
                cost, weight = nodes.get((*at, n), (np.zeros(count), 0.0))
                nodes[*at, n] = cost + h * levels[:, row, column], weight + h
    out = np.zeros(levels.shape)
    for row in range(height):
        for column in range(width):
            total, weights = np.zeros(count), 0.0
            for (r, c, n), (cost, weight) in nodes.items():
                g = of_grey[int(guide[row, column])][n]
                near = spatial(r - row // cell, support) * spatial(c - column // cell, support)
                total += g * near * cost
                weights += g * near * weight
            out[:, row, column] = total / weights
    return out


def volume(count, rows, columns, cell, seed):
    rng = np.random.default_rng(seed)
    guide = np.clip(110 + rng.choice([3, 60]) * rng.standard_normal((rows * cell, columns * cell)), 0, 255)
    return rng.integers(0, 46, (count, rows * cell, columns * cell)).astype(np.uint8), guide.astype(np.uint8)


# -------------------------------------------------------------------------------------------- aggregate


@settings(max_examples=10, deadline=None)
@given(support=SUPPORTS, rows=st.integers(1, 3), columns=st.integers(1, 4), seed=st.integers(0, 999))
def test_the_grid_form_is_the_sum_over_all_cells(support, rows, columns, seed):
    levels, guide = volume(3, rows, columns, support.cell, seed)
    found = aggregate(levels, guide, support)
    assert found.dtype == np.float32
    assert found == pytest.approx(literally(levels, guide, support), abs=5e-3)


def test_the_product_of_the_defaults_is_the_literal_form_on_well_parted_greys():
    levels, guide = volume(4, 4, 5, 3, 6)
    assert aggregate(levels, guide, Support(clusters=4)) == pytest.approx(
        literally(levels, guide, Support(clusters=4)), abs=1e-3
    )


def test_cells_of_a_single_pixel_are_cells_too():
    levels, guide = volume(3, 6, 7, 1, 4)
    assert aggregate(levels, guide, Support(cell=1)) == pytest.approx(
        literally(levels, guide, Support(cell=1)), abs=5e-3
    )


@settings(max_examples=15, deadline=None)
@given(support=SUPPORTS, value=st.integers(0, 255), seed=st.integers(0, 999))
def test_a_constant_volume_stays_constant_whatever_the_picture(support, value, seed):
    levels, guide = volume(2, 3, 3, support.cell, seed)
    found = aggregate(np.full_like(levels, value), guide, support)
    assert found == pytest.approx(np.full(levels.shape, value), rel=1e-4)


@settings(max_examples=15, deadline=None)
@given(support=SUPPORTS, seed=st.integers(0, 999))
def test_a_mean_lies_between_the_least_and_the_greatest(support, seed):
    levels, guide = volume(2, 3, 4, support.cell, seed)
    found = aggregate(levels, guide, support)
    assert (found >= levels.min(axis=(1, 2), keepdims=True) - 1e-3).all()
    assert (found <= levels.max(axis=(1, 2), keepdims=True) + 1e-3).all()


def test_weights_sum_to_one_the_mean_of_a_sum_is_the_sum_of_the_means():
    one, guide = volume(2, 4, 4, 3, 3)
    other, _ = volume(2, 4, 4, 3, 4)
    both = aggregate(one + other, guide, Support())
    assert both == pytest.approx(
        aggregate(one, guide, Support()) + aggregate(other, guide, Support()), abs=1e-3
    )


@pytest.mark.parametrize("count", [1, MOST_AT_ONCE, MOST_AT_ONCE + 1, 2 * MOST_AT_ONCE + 5])
def test_levels_do_not_mix_however_many_are_taken_at_once(count):
    levels, guide = volume(count, 3, 4, 3, 8)
    together = aggregate(levels, guide, Support())
    for level in {0, count // 2, count - 1}:
        alone = aggregate(levels[level : level + 1], guide, Support())
        assert together[level] == pytest.approx(alone[0], rel=1e-4)


def test_across_an_edge_of_the_picture_no_cost_leaks():
    guide = np.full((12, 12), 20, np.uint8)
    guide[:, 7:] = 200
    levels = np.where(guide == 20, 10, 40).astype(np.uint8)[None]
    assert aggregate(levels, guide, Support()) == pytest.approx(levels, abs=0.02)


def test_over_a_blank_surface_what_the_rim_knows_is_carried_far():
    guide = np.full((9, 90), 90, np.uint8)
    levels = np.full((2, 9, 90), 20, np.uint8)
    levels[0, :, :6] = 0
    found = aggregate(levels, guide, Support())
    assert (found[0, :, 45] < 20 - 0.05).all(), "the tail reaches 40 pixels"
    without = aggregate(levels, guide, Support(tail=0.0))
    assert without[0, :, 45] == pytest.approx(np.full(9, 20.0), abs=1e-4)


def test_costs_and_guide_are_left_as_they_were():
    levels, guide = volume(3, 3, 3, 3, 1)
    before = levels.tobytes(), guide.tobytes()
    aggregate(levels, guide, Support())
    assert (levels.tobytes(), guide.tobytes()) == before


# ------------------------------------------------------------------------------------ sample intensities


def halves_of_halves(pixels, low, high, depth):
    """Split at the mean, those not below it going up; take each side's mean; in an empty span its middle."""
    mean = float(np.mean(pixels)) if len(pixels) else (low + high) / 2
    if depth == 0:
        return [mean]
    split = math.ceil(mean)
    below, above = [p for p in pixels if p < mean], [p for p in pixels if p >= mean]
    return halves_of_halves(below, low, split, depth - 1) + halves_of_halves(above, split, high, depth - 1)


PIXELS = st.lists(st.integers(0, 255), min_size=1, max_size=60)


@settings(max_examples=60, deadline=None)
@given(pixels=PIXELS, depth=st.integers(1, 5))
def test_samples_are_the_hierarchical_means(pixels, depth):
    found = sample_intensities(np.array([pixels], np.uint8), 2**depth)
    assert found.dtype == np.float32
    assert found == pytest.approx(np.array(halves_of_halves(pixels, 0, 256, depth)), abs=1e-3)
    assert (np.diff(found) >= 0).all()


def test_samples_of_three_groups_by_hand():
    grey = np.array([[10, 10, 12, 100, 104, 200]], np.uint8)
    # Mean 72.67: 10.67 below, 134.67 above; then 10 | 12 and 102 | 200.
    assert sample_intensities(grey, 2).tolist() == pytest.approx([32 / 3, 404 / 3])
    assert sample_intensities(grey, 4).tolist() == pytest.approx([10.0, 12.0, 102.0, 200.0])


# ------------------------------------------------------------------------------------------------ shares


@settings(max_examples=60, deadline=None)
@given(pixels=PIXELS, clusters=CLUSTERS)
def test_every_grey_value_is_shared_out_whole_among_its_two_neighbours(pixels, clusters):
    samples = sample_intensities(np.array([pixels], np.uint8), clusters)
    share = shares(samples)
    assert share.shape == (256, clusters)
    assert share.dtype == np.float32
    assert (share >= 0).all()
    assert share.sum(axis=1) == pytest.approx(np.ones(256), abs=1e-5)
    assert ((share > 0).sum(axis=1) <= 2).all()
    grey = np.arange(256)
    assert share @ samples == pytest.approx(np.clip(grey, samples[0], samples[-1]), abs=0.04)


def test_shares_by_hand():
    share = shares(np.array([10.0, 20.0, 100.0], np.float32))
    assert share[5].tolist() == [1.0, 0.0, 0.0]
    assert share[15] == pytest.approx([0.5, 0.5, 0.0], abs=1e-3)
    assert share[80] == pytest.approx([0.0, 0.25, 0.75], abs=1e-3)
    assert share[255].tolist() == [0.0, 0.0, 1.0]


# -------------------------------------------------------------------------------------------------- grid


def test_smoothing_adds_each_cell_to_each_weighted_by_distance():
    support = Support(cell=2, sigma=3.0, tail=0.1, tail_sigma=9.0)
    nodes = np.random.default_rng(2).random((3, 4, 2, 5)).astype(np.float32)
    expected = np.zeros(nodes.shape)
    for r in range(3):
        for c in range(4):
            for there_r in range(3):
                for there_c in range(4):
                    near = spatial(r - there_r, support) * spatial(c - there_c, support)
                    expected[r, c] += near * nodes[there_r, there_c]
    assert smoothed(nodes, support) == pytest.approx(expected, rel=1e-4)


@settings(max_examples=15, deadline=None)
@given(cell=st.integers(1, 4), rows=st.integers(1, 3), columns=st.integers(1, 3), depth=st.integers(1, 3))
def test_cells_hold_their_pixels_row_by_row_and_give_them_back(cell, rows, columns, depth):
    picture = np.arange(rows * cell * columns * cell * depth).reshape(rows * cell, columns * cell, depth)
    blocks = by_cells(picture, cell)
    assert blocks.shape == (rows, columns, cell * cell, depth)
    for r in range(rows):
        for c in range(columns):
            inside = picture[r * cell : (r + 1) * cell, c * cell : (c + 1) * cell].reshape(-1, depth)
            assert (blocks[r, c] == inside).all()
    assert (by_rows(blocks, cell) == picture).all()
