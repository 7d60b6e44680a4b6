"""Diamond search: published point counts, the full search as oracle, pictures with a distractor."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.vision.diamond import (
    BlockDistortion,
    Distortion,
    diamond_search,
    full_search,
    improved_diamond_search,
    parabola_vertex,
    restarted_search,
)

SEARCHES = [diamond_search, improved_diamond_search]
inside = st.integers(-7, 7)


def euclidean(x: float, y: float) -> Distortion:
    return lambda dx, dy: math.hypot(dx - x, dy - y)


def manhattan(x: float, y: float) -> Distortion:
    return lambda dx, dy: abs(dx - x) + abs(dy - y)


@pytest.mark.parametrize(
    ("search", "bowl", "target", "points"),
    [
        (diamond_search, euclidean, (-4, -2), 24),
        (diamond_search, manhattan, (-4, -2), 27),
        (improved_diamond_search, euclidean, (-2, 0), 21),
        (improved_diamond_search, manhattan, (-2, 0), 21),
        (diamond_search, euclidean, (0, 0), 13),
        (improved_diamond_search, euclidean, (0, 0), 13),
    ],
)
def test_published_point_counts(search, bowl, target, points) -> None:
    tested = []

    def counting(dx: int, dy: int) -> float:
        tested.append((dx, dy))
        return bowl(*target)(dx, dy)

    motion = search(counting)
    assert (motion.dx, motion.dy) == target
    assert motion.points == points == len(tested) == len(set(tested))


@pytest.mark.parametrize("search", SEARCHES)
@given(x=inside, y=inside, start_x=st.integers(-3, 3), start_y=st.integers(-3, 3))
@settings(max_examples=40, deadline=None)
def test_on_a_bowl_it_finds_what_the_full_search_finds(search, x, y, start_x, start_y) -> None:
    bowl = euclidean(x, y)
    fast, full = (s(bowl, (start_x, start_y), 10) for s in (search, full_search))
    assert (fast.dx, fast.dy) == (full.dx, full.dy) == (x, y)
    assert full.points == 21 * 21 > 5 * fast.points


@pytest.mark.parametrize("search", [*SEARCHES, full_search])
@given(seed=st.integers(0, 1000), window=st.integers(1, 8))
@settings(max_examples=25, deadline=None)
def test_on_any_ground_it_stays_in_the_window_and_ends_in_a_valley(search, seed, window) -> None:
    ground = np.random.default_rng(seed).random((41, 41))
    tested = set()

    def distortion(dx: int, dy: int) -> float:
        assert (dx, dy) not in tested
        tested.add((dx, dy))
        return float(ground[dy + 20, dx + 20])

    motion = search(distortion, (3, -2), window)
    assert all(abs(dx - 3) <= window and abs(dy + 2) <= window for dx, dy in tested)
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        neighbour = (motion.dx + dx, motion.dy + dy)
        if neighbour in tested:
            assert motion.distortion <= ground[neighbour[1] + 20, neighbour[0] + 20]
    assert max(abs(motion.sub_dx - motion.dx), abs(motion.sub_dy - motion.dy)) <= 0.5


@pytest.mark.parametrize("search", [*SEARCHES, full_search])
def test_ties_keep_the_centre(search) -> None:
    motion = search(lambda dx, dy: 1.0, (2, 3))
    assert (motion.dx, motion.dy) == (2, 3)


@given(x=st.floats(-3, 3), y=st.floats(-3, 3))
@settings(max_examples=30, deadline=None)
def test_a_quadratic_valley_is_found_to_a_part_of_a_pixel(x: float, y: float) -> None:
    motion = improved_diamond_search(lambda dx, dy: (dx - x) ** 2 + 2 * (dy - y) ** 2)
    assert motion.sub_dx == pytest.approx(x, abs=1e-6)
    assert motion.sub_dy == pytest.approx(y, abs=1e-6)


def test_no_valley_no_sub_pixel() -> None:
    assert parabola_vertex(1.0, 1.0, 1.0) == 0.0
    assert parabola_vertex(math.inf, 0.0, 1.0) == 0.0
    assert parabola_vertex(3.0, 1.0, 1.0) == 0.5


def test_a_restart_leaves_the_wrong_valley() -> None:
    def two_valleys(dx: int, dy: int) -> float:
        return min(3 + math.hypot(dx, dy), math.hypot(dx - 20, dy))

    assert improved_diamond_search(two_valleys, window=30).dx == 0
    found = restarted_search(two_valleys, [(0, 0), (18, 2), (-18, 0)], good_enough=1.0)
    assert (found.dx, found.dy, found.distortion) == (20, 0, 0.0)
    # The third start was not needed: two searches' points at most.
    assert found.points <= 13 + improved_diamond_search(two_valleys, (18, 2)).points
    with pytest.raises(ValueError, match="start"):
        restarted_search(two_valleys, [], good_enough=1.0)


def scene(step: int) -> np.ndarray:
    """A square target moving right and up, a round distractor moving left past it."""
    rng = np.random.default_rng(7)
    picture = cv2.GaussianBlur(rng.integers(60, 120, (120, 160), np.uint8), (0, 0), 3)
    cv2.rectangle(picture, (40 + 4 * step, 60 - 2 * step), (63 + 4 * step, 83 - 2 * step), 220, -1)
    cv2.circle(picture, (130 - 5 * step, 40), 13, 220, -1)
    return picture


@pytest.mark.parametrize("search", SEARCHES)
def test_the_square_is_followed_past_the_round_distractor(search) -> None:
    x, y, velocity = 40, 60, (0, 0)
    for step in range(1, 11):
        block = scene(step - 1)[y - 4 : y + 28, x - 4 : x + 28]
        motion = search(BlockDistortion(block, scene(step), x - 4, y - 4), velocity)
        velocity = (motion.dx, motion.dy)
        x, y = x + motion.dx, y + motion.dy
        assert (x, y) == (40 + 4 * step, 60 - 2 * step)


def test_block_distortion_is_the_mean_absolute_difference() -> None:
    rng = np.random.default_rng(0)
    picture, block = rng.integers(0, 255, (30, 40), np.uint8), rng.integers(0, 255, (5, 8), np.uint8)
    part = picture[12:17, 9:17].astype(float)
    assert BlockDistortion(block, picture, 10, 10)(-1, 2) == pytest.approx(np.abs(part - block).mean())
    assert BlockDistortion(block, picture, 0, 0)(-1, 0) == math.inf
    assert BlockDistortion(block, picture, 32, 25)(0, 1) == math.inf


def test_unfit_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="window"):
        diamond_search(euclidean(0, 0), window=0)
    with pytest.raises(ValueError, match="dtype"):
        BlockDistortion(np.zeros((3, 3), np.uint8), np.zeros((9, 9), np.float32), 0, 0)
