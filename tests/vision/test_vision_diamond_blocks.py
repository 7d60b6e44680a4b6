"""Block motion: the full search and numpy as oracles, predictions, fast motion, sub-pixel, confidence."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.vision.block_motion import confidence, find_block, predicted_search, predictions
from robot.vision.diamond import (
    BlockDistortion,
    Motion,
    equiangular_vertex,
    full_search,
    parabola_vertex,
)
from robot.vision.reduced_search import reduced_search


def textured(seed: int, blur: float = 2.0, shape: tuple[int, int] = (140, 180)) -> np.ndarray:
    """Noise of about `blur` px, spread over all grey values."""
    noise = np.random.default_rng(seed).random(shape, np.float32)
    picture = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), blur), None, 0, 255, cv2.NORM_MINMAX)
    return picture.astype(np.uint8)


def found_at(motion: Motion) -> tuple[int, int]:
    return motion.dx, motion.dy


@given(
    seed=st.integers(0, 99),
    dx=st.integers(-28, 28),
    dy=st.integers(-28, 28),
    kind=st.sampled_from([np.uint8, np.float32]),
)
@settings(max_examples=60, deadline=None)
def test_a_fast_motion_is_found_exactly_with_no_prediction(seed, dx, dy, kind) -> None:
    picture = textured(seed, blur=3.0).astype(kind)
    block = picture[46 + dy : 94 + dy, 66 + dx : 114 + dx]
    motion = find_block(block, picture, 66, 46, window=28)
    assert (found_at(motion), motion.distortion) == ((dx, dy), 0.0)
    assert motion.points <= 40  # of 3249


@given(seed=st.integers(0, 9999), noise=st.floats(0, 30), window=st.integers(1, 14))
@settings(max_examples=50, deadline=None)
def test_what_it_tells_is_what_numpy_measures_and_a_bottom(seed, noise, window) -> None:
    rng = np.random.default_rng(seed)
    first = textured(seed, blur=float(rng.uniform(1, 6)))
    second = np.clip(
        np.roll(first, rng.integers(-9, 10, 2), (0, 1)) + rng.normal(0, noise, first.shape), 0, 255
    )
    second = second.astype(np.uint8)
    left, top = int(rng.integers(0, 180 - 48)), int(rng.integers(0, 140 - 48))
    block = first[top : top + 48, left : left + 48]
    motion = find_block(block, second, left, top, [(0, 0), (40, -40)], window)
    assert max(abs(motion.dx), abs(motion.dy)) <= window

    def measured(dx: int, dy: int) -> float:
        part = second[top + dy : top + dy + 48, left + dx : left + dx + 48].astype(float)
        return float(np.abs(part - block).mean()) if part.shape == (48, 48) else math.inf

    assert motion.distortion == pytest.approx(measured(motion.dx, motion.dy))
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        x, y = motion.dx + dx, motion.dy + dy
        inside = max(abs(x), abs(y)) <= window and left + x >= 0 and top + y >= 0
        assert not inside or motion.distortion <= measured(x, y)
    full = full_search(BlockDistortion(block, second, left, top), window=window)
    assert motion.distortion >= full.distortion - 1e-9


def test_of_noisy_blocks_nearly_all_have_the_full_searchs_vector() -> None:
    rng, same, points = np.random.default_rng(3), 0, []
    for seed in range(100):
        first = textured(seed, blur=float(rng.uniform(2, 5)))
        shift = tuple(int(step) for step in rng.integers(-12, 13, 2))
        second = np.clip(np.roll(first, shift, (1, 0)) + rng.normal(0, 12, first.shape), 0, 255).astype(
            np.uint8
        )
        block = first[46:94, 66:114]
        motion = find_block(block, second, 66, 46, window=14)
        full = full_search(BlockDistortion(block, second, 66, 46), window=14)
        same += found_at(motion) == found_at(full)
        points.append(motion.points)
    assert same >= 97
    assert np.mean(points) <= 30  # of 841, with no prediction


def test_points_are_all_places_and_a_right_prediction_saves_the_reduced_search(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    picture = textured(5)
    block = picture[50:98, 75:123]
    asked, norm = [], cv2.norm

    def counting(*words: object) -> float:
        asked.append(words)
        return norm(*words)

    monkeypatch.setattr(cv2, "norm", counting)
    told = find_block(block, picture, 66, 46, [(0, 0), (9, 4)], window=14)
    assert (found_at(told), told.points) == ((9, 4), len(asked))
    noise = np.random.default_rng(0).normal(0, 5, picture.shape)
    noisy = np.clip(picture + noise, 0, 255).astype(np.uint8)
    asked.clear()
    assert find_block(block, noisy, 66, 46, [(9, 4)], window=14).points == len(asked)
    asked.clear()
    alone = find_block(block, picture, 66, 46, window=14)
    reduced = reduced_search(block, picture, 66, 46, 14)
    assert reduced is not None
    assert (found_at(alone), alone.points) == ((9, 4), len(asked) + reduced.points)
    # 7 x 7 placements of 8 x 8 cells, as many pixels as 1.4 blocks of 48 x 48.
    assert (reduced.surface.shape, reduced.points) == ((7, 7), 2)


@given(x=st.integers(-7, 7), y=st.integers(-7, 7))
@settings(max_examples=30, deadline=None)
def test_on_a_bowl_the_walk_from_the_best_prediction_ends_at_its_bottom(x: int, y: int) -> None:
    tested = []

    def bowl(dx: int, dy: int) -> float:
        tested.append((dx, dy))
        return math.hypot(dx - x, dy - y)

    motion = predicted_search(bowl, [(0, 0), (7, 7), (-50, 3)], 7)
    assert found_at(motion) == (x, y)
    assert motion.points == len(tested) == len(set(tested))
    assert max(max(abs(dx), abs(dy)) for dx, dy in tested) <= 7


def test_a_valley_along_a_slanting_edge_is_walked_by_its_corners() -> None:
    # Sides are all higher than the place the walk is at: the four-point pattern alone would stay at (0, 0).
    motion = predicted_search(lambda dx, dy: 9.0 * (dx - dy) ** 2 + 0.5 * (dx + dy - 8) ** 2, window=7)
    assert found_at(motion) == (4, 4)


def test_predictions_are_no_motion_the_last_and_the_neighbours_median() -> None:
    assert predictions((2, 1)) == ((0, 0), (2, 1))
    assert predictions((2, 1), [(9, -4), (8, -5), (-30, 30)]) == ((0, 0), (2, 1), (8, -4))
    assert predictions((2, 1), [(1, 1), (3, 5)])[2] == (3, 5)


def test_the_equiangular_fit_is_exact_on_a_v_and_the_parabola_is_not() -> None:
    for place in (-0.5, -0.3, 0.0, 0.2, 0.45):
        line = [3 + 2 * abs(step - place) for step in (-1, 0, 1)]
        assert equiangular_vertex(*line) == pytest.approx(place)
    assert parabola_vertex(*(abs(step - 0.25) for step in (-1, 0, 1))) == pytest.approx(1 / 6)
    for no_valley in ((1.0, 1.0, 1.0), (math.inf, 0.0, 1.0), (0.0, 1.0, 2.0), (1.0, math.nan, 1.0)):
        assert equiangular_vertex(*no_valley) == 0.0


def test_a_part_of_a_pixel_is_found_with_little_bias() -> None:
    fine = cv2.resize(
        textured(8, blur=3.0, shape=(160, 200)), None, fx=4, fy=4, interpolation=cv2.INTER_CUBIC
    )
    for right, down in ((0, 0), (1, 3), (2, 1), (3, 2)):
        still, moved = (
            cv2.resize(part, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
            for part in (fine[:600, :720], fine[down : 600 + down, right : 720 + right])
        )
        motion = find_block(still[40:88, 60:108], moved, 60, 40)
        assert motion.sub_dx == pytest.approx(-right / 4, abs=0.06)
        assert motion.sub_dy == pytest.approx(-down / 4, abs=0.06)


def test_confidence_is_one_for_a_perfect_match_and_falls_with_noise() -> None:
    picture, rng = textured(2), np.random.default_rng(0)
    block, noise = picture[46:94, 66:114], rng.normal(0, 1, picture.shape)
    told = []
    for amount in (0, 5, 15, 40, 120):
        seen = np.clip(picture + amount * noise, 0, 255).astype(np.uint8)
        motion = find_block(block, seen, 66, 46)
        told.append(confidence(block, seen, 66, 46, motion))
    assert told[0] == 1.0
    assert told == sorted(told, reverse=True)
    assert 0.0 <= told[-1] < 0.2


def test_confidence_is_low_on_a_repeated_surface_and_for_a_wrong_motion() -> None:
    noise = np.random.default_rng(1).normal(0, 6, (140, 180))
    once = textured(4)
    repeated = np.tile(once[:10, :12], (14, 15))
    told = []
    for picture in (once, repeated):
        seen = np.clip(picture + noise, 0, 255).astype(np.uint8)
        block = picture[46:94, 66:114]
        told.append(confidence(block, seen, 66, 46, find_block(block, seen, 66, 46, window=14), 14))
    assert told[0] > 0.8
    assert told[1] < 0.1
    block = once[46:94, 66:114]
    wrong = Motion(6, 6, BlockDistortion(block, once, 66, 46)(6, 6), 1, 6.0, 6.0)
    assert confidence(block, once, 66, 46, wrong, 14) == 0.0


@given(seed=st.integers(0, 9999), noise=st.floats(0, 60))
@settings(max_examples=25, deadline=None)
def test_confidence_is_never_below_the_whole_windows_and_seldom_above(seed: int, noise: float) -> None:
    first = textured(seed, blur=3.0)
    rng = np.random.default_rng(seed)
    second = np.clip(first + rng.normal(0, noise, first.shape), 0, 255).astype(np.uint8)
    block = first[46:94, 66:114]
    motion = find_block(block, second, 66, 46)
    distortion = BlockDistortion(block, second, 66, 46)
    around = [(dx, dy) for dx in range(-7, 8) for dy in range(-7, 8)]
    far = [distortion(*at) for at in around if max(abs(at[0] - motion.dx), abs(at[1] - motion.dy)) > 4]
    exact = max(0.0, 1 - motion.distortion / min(far))
    told = confidence(block, second, 66, 46, motion)
    assert exact - 1e-9 <= told <= exact + 0.1


def test_a_bare_wall_has_no_motion_and_no_confidence() -> None:
    wall = np.full((140, 180), 90, np.uint8)
    motion = find_block(wall[46:94, 66:114], wall, 66, 46, window=14)
    assert (found_at(motion), motion.sub_dx, motion.sub_dy) == ((0, 0), 0.0, 0.0)
    assert confidence(wall[46:94, 66:114], wall, 66, 46, motion, 14) == 0.0


@pytest.mark.parametrize("size", [(4, 4), (5, 9), (7, 60), (17, 23), (48, 48)])
@pytest.mark.parametrize(("left", "top"), [(0, 0), (-3, 2), (70, 50)])
def test_any_block_at_any_rim_is_found(size: tuple[int, int], left: int, top: int) -> None:
    picture = textured(6, blur=1.0, shape=(110, 140))
    height, width = size
    x, y = max(left + 2, 0), max(top - 1, 0)
    motion = find_block(picture[y : y + height, x : x + width], picture, left, top, window=10)
    assert found_at(motion) == (x - left, y - top)


def test_where_there_is_no_elsewhere_confidence_is_zero() -> None:
    picture = textured(6, shape=(50, 50))
    block = picture[1:49, 1:49]
    motion = find_block(block, picture, 1, 1)
    assert found_at(motion) == (0, 0)
    assert confidence(block, picture, 1, 1, motion) == 0.0


def test_unfit_arguments_are_refused() -> None:
    picture = textured(0)
    block = picture[:48, :48]
    with pytest.raises(ValueError, match="dtype"):
        find_block(block.astype(np.float32), picture, 0, 0)
    with pytest.raises(ValueError, match="4 x 4"):
        find_block(block[:3], picture, 0, 0)
    with pytest.raises(ValueError, match="window"):
        find_block(block, picture, 0, 0, window=0)
    with pytest.raises(ValueError, match="inside the picture"):
        find_block(block, picture, 170, 0)
    with pytest.raises(ValueError, match="prediction"):
        find_block(block, picture, 0, 0, [])
    with pytest.raises(ValueError, match="window"):
        predicted_search(lambda dx, dy: 0.0, window=0)
    with pytest.raises(ValueError, match="elsewhere"):
        confidence(block, picture, 0, 0, Motion(0, 0, 0.0, 1, 0.0, 0.0), window=4)
