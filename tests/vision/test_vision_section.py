"""What must pass: cross-sections against brute force, and sizes that are none."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.vision.section import BoxSection, RoundSection, blocked_distance, largest_circle_px


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


def test_the_published_corridor_and_its_step():
    # [T]: 25 mm are 43 px at 0.581 mm a pixel; the third region is a step that leaves less.
    corridor = np.zeros((120, 200), np.bool_)
    corridor[40:83] = True
    step = corridor.copy()
    step[62:83, 90:] = False
    assert largest_circle_px(corridor)[1] == pytest.approx(43.0)
    assert largest_circle_px(step[:, 90:])[1] == pytest.approx(21.0, abs=1.0)


@pytest.mark.parametrize("size", [0.0, -0.1, math.nan, math.inf, 5.1])
def test_sizes_that_are_none(size):
    for make in (lambda: RoundSection(size), lambda: BoxSection(size, 0.1), lambda: BoxSection(0.1, size)):
        with pytest.raises(ValueError, match=r"above 0 and at most 5 m"):
            make()


def test_an_empty_mask_holds_no_circle():
    assert largest_circle_px(np.zeros((0, 0), np.bool_))[1] == 0.0
    assert largest_circle_px(np.zeros((4, 4), np.bool_))[1] == 0.0
