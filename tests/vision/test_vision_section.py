"""What must pass: cross-sections against brute force, and sizes that are none."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.vision.section import BoxSection, RoundSection, blocked_distance, largest_circle_px, longest_run


def blobs(seed, shape=(18, 24), count=4):
    rng = np.random.default_rng(seed)
    free = np.ones(shape, np.bool_)
    for _ in range(count):
        v, u = rng.integers(0, shape[0]), rng.integers(0, shape[1])
        free[v : v + 4, u : u + 4] = False
    return free


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_the_largest_circle_against_brute_force(seed):
    free = blobs(seed)
    padded = np.pad(free, 1)
    blocked, opened = np.argwhere(~padded), np.argwhere(padded)
    nearest = np.sqrt(((opened[:, None] - blocked[None]) ** 2).sum(axis=2)).min(axis=1)
    (u, v), diameter = largest_circle_px(free)
    assert diameter == pytest.approx(2 * nearest.max() - 1, abs=1e-4)
    assert blocked_distance(free)[v, u] == pytest.approx(nearest.max(), abs=1e-4)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), width=st.integers(1, 12), height=st.integers(1, 12))
def test_a_box_fits_where_a_rectangle_of_free_pixels_stands_on_the_last_row(seed, width, height):
    free = blobs(seed)
    stands = any(free[18 - height :, u : u + width].all() for u in range(24 - width + 1))
    assert BoxSection(0.01 * width, 0.01 * height).fits_into(free, 0.01) == stands


def test_a_box_does_not_hang_over_what_blocks_the_floor():
    free = np.ones((40, 60), np.bool_)
    free[39, ::10] = False
    assert not BoxSection(0.2, 0.1).fits_into(free, 0.01)
    assert RoundSection(0.2).fits_into(free, 0.01)


def test_the_margin_widens_what_must_pass():
    free = np.ones((40, 31), np.bool_)
    for section in (BoxSection(0.29, 0.3), RoundSection(0.29)):
        assert section.fits_into(free, 0.01, 0.019)
        assert not section.fits_into(free, 0.01, 0.021)


def test_higher_than_the_mask_never_fits():
    assert not BoxSection(0.1, 0.41).fits_into(np.ones((40, 60), np.bool_), 0.01)


def test_the_published_corridor_and_its_step():
    # [T]: 25 mm are 43 px at 0.581 mm a pixel; the third region is a step that leaves less.
    corridor = np.zeros((120, 200), np.bool_)
    corridor[40:83] = True
    step = corridor.copy()
    step[62:83, 90:] = False
    assert RoundSection(0.0245).fits_into(corridor, 0.000581)
    assert not RoundSection(0.0245).fits_into(step[:, 90:], 0.000581)


def test_a_rectangle_needs_less_than_the_circle_about_it():
    assert BoxSection(0.26, 0.32).diagonal == pytest.approx(math.hypot(0.26, 0.32))


def test_runs():
    assert longest_run(np.zeros(5, np.bool_)) == 0
    assert longest_run(np.ones(5, np.bool_)) == 5
    assert longest_run(np.zeros(0, np.bool_)) == 0


@pytest.mark.parametrize("size", [0.0, -0.1, math.nan, math.inf, 5.1])
def test_sizes_that_are_none(size):
    for make in (lambda: RoundSection(size), lambda: BoxSection(size, 0.1), lambda: BoxSection(0.1, size)):
        with pytest.raises(ValueError, match=r"above 0 and at most 5 m"):
            make()


@pytest.mark.parametrize("scale", [0.0, -1.0, math.nan, math.inf])
def test_scales_that_are_none(scale):
    for section in (RoundSection(0.1), BoxSection(0.1, 0.1)):
        with pytest.raises(ValueError, match="metres per pixel"):
            section.fits_into(np.ones((5, 5), np.bool_), scale)


def test_an_empty_mask_lets_nothing_through():
    nothing = np.zeros((0, 0), np.bool_)
    assert not RoundSection(0.1).fits_into(nothing, 0.01)
    assert not BoxSection(0.1, 0.1).fits_into(nothing, 0.01)
