"""Edges of the floor found by the jump of its height, however it leans."""

import math

import numpy as np
import pytest

from robot.vision.floor_edges import FARTHEST_M, REACH_M, height_jumps

SECTORS, STEP = 9, 0.03
INNER = np.s_[2:-2]
"""Sectors with two neighbours to each side: an outermost one is its own neighbour."""
RINGS = np.arange(0.4, 2.4, 0.04, dtype=np.float32)
MIDDLES = 0.5 * (RINGS[1:] + RINGS[:-1])
PIXELS = 20


def jumps(heights, sigma=0.001, count=PIXELS, step=STEP, rings=RINGS):
    """Cells found, heights (R,) or (S, R) over the floor; count a number or (S, R)."""
    heights = np.broadcast_to(heights, (SECTORS, len(rings) - 1)).astype(np.float32)
    counts = np.broadcast_to(count, heights.shape).astype(np.float32)
    return height_jumps(heights * counts, np.full_like(counts, sigma) * counts, counts, rings, step)


def edge(at, drop=-STEP, blurred=1):
    """Heights that change by `drop` behind ring `at`, linearly over so many cells."""
    return drop * np.clip((np.arange(len(MIDDLES)) - at) / blurred, 0.0, 1.0)


@pytest.mark.parametrize("drop", [-STEP, STEP], ids=["down", "up"])
def test_a_jump_is_found_in_the_cell_behind_it_and_nowhere_else(drop):
    found = jumps(edge(10, drop))
    assert found[:, 11].all()
    assert found.sum() == SECTORS


@pytest.mark.parametrize("lean", [-1.5, 0.0, 1.5], ids="{:+.1f} degrees".format)
@pytest.mark.parametrize("drop", [-STEP, STEP])
def test_a_step_blurred_over_three_cells_is_found_though_the_floor_leans(lean, drop):
    """A plane fitted across a step leans to hide it: by as much as half of the step on either side."""
    found = jumps(edge(12, drop, blurred=3) + math.tan(math.radians(lean)) * (MIDDLES - MIDDLES[12]))
    for sector in found:
        assert sector[12:17].any()
        assert not sector[:12].any()
        assert not sector[17:].any()


@pytest.mark.parametrize("lean", [-1.5, 1.5, 4.0])
def test_a_tipped_floor_has_no_edge(lean):
    """Five cells of a floor tipped by 4 degrees rise by 14 mm, less than the 18 that make a jump."""
    assert not jumps(math.tan(math.radians(lean)) * MIDDLES, sigma=0.0005).any()


def test_a_floor_of_errors_has_no_edge():
    rng = np.random.default_rng(3)
    heights = 0.006 * rng.standard_normal((SECTORS, len(MIDDLES)))
    assert not jumps(heights, sigma=0.006)[INNER].any()


@pytest.mark.parametrize(("share", "found"), [(0.5, False), (0.7, True), (1.0, True)])
def test_six_tenths_of_a_step_make_a_jump(share, found):
    for step in (0.03, 0.06):
        assert jumps(edge(10, -share * step), sigma=0.0005, step=step).any() == found


def test_what_is_measured_less_surely_must_jump_farther():
    assert jumps(edge(10), sigma=0.008).any()  # 30 mm against 18 + 11
    assert not jumps(edge(10), sigma=0.009).any()


def test_a_jump_in_one_sector_alone_is_none():
    heights = np.zeros((SECTORS, len(MIDDLES)))
    heights[4] = edge(10)
    assert not jumps(heights).any()
    heights[3:6] = edge(10)
    assert jumps(heights)[4, 11]


def test_an_edge_may_run_slantwise_by_a_ring_from_sector_to_sector():
    heights = np.stack([edge(10 + k) for k in range(SECTORS)])
    found = jumps(heights)
    rows, columns = np.nonzero(found)
    assert (columns == 11 + rows).all()
    assert found[1:-1].any(axis=1).all()


def test_jumps_scattered_over_rings_are_none():
    heights = np.stack([edge(ring) for ring in (4, 12, 7, 15, 5, 13, 8, 16, 6)])
    assert not jumps(heights)[INNER].any()


def test_what_the_edge_hides_is_bridged():
    """Behind a step down some cells are out of view: the floor is compared across them."""
    for hidden in (1, 2, 4):
        count = np.full((SECTORS, len(MIDDLES)), PIXELS)
        count[:, 11 : 11 + hidden] = 0
        found = jumps(edge(10), count=count)
        assert found[:, 11].all()
        assert found.sum() == SECTORS


@pytest.mark.parametrize(
    ("wide", "hidden", "found"),
    [(0.02, 4, True), (0.02, 5, False), (0.1, 2, True), (0.1, 3, False), (0.24, 1, True), (0.26, 1, False)],
)
def test_never_beyond_its_reach(wide, hidden, found):
    """Five cells on at most, and never across more than a quarter of a metre nobody sees."""
    assert REACH_M == 0.25
    rings = 0.4 + wide * np.arange(10, dtype=np.float32)
    count = np.full((SECTORS, 9), PIXELS)
    count[:, 2 : 2 + hidden] = 0
    heights = np.where(np.arange(9) < 2, 0.0, -STEP)
    assert jumps(heights, count=count, rings=rings)[:, 2].all() == found
    assert jumps(heights, count=count, rings=rings).any() == found


def test_never_beyond_the_farthest():
    for ring in range(len(MIDDLES) - 1):
        nearer = float(RINGS[ring + 1])  # where the cell behind the edge begins
        if abs(nearer - FARTHEST_M) > 0.001:
            assert jumps(edge(ring)).any() == (nearer < FARTHEST_M), nearer


@pytest.mark.parametrize("side", [np.s_[:11], np.s_[11:]])
def test_cells_of_too_few_pixels_say_nothing(side):
    count = np.full((SECTORS, len(MIDDLES)), PIXELS)
    count[:, side] = 5
    assert not jumps(edge(10), count=count).any()
    count[:, side] = 6
    assert jumps(edge(10), count=count)[:, 11].all()


def test_nothing_measured_has_no_edge_and_a_single_ring_neither():
    assert not jumps(np.zeros(len(MIDDLES)), count=0).any()
    assert jumps(np.zeros(1), rings=RINGS[:2]).shape == (SECTORS, 1)
