"""How unlike two eyes are: what matches, what does not, and what no eye can tell."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from layered_scenes import TEXTURED_SCENES, Layer, cast

from robot.vision.eye_pair import LARGEST, LEAST_ALIKE, MOST_ALIKE, EyePair, alike_limit, averaged

WALL = (Layer(6.0, (0, 0, 0, 0), 120, 1),)
INNER = np.s_[4:-4, 16:-4]
"""Pixels whose windows and matches lie in the picture."""


def seen(layers=WALL, row_step=1, noise=0.0):
    scene = cast(layers, noise=noise)
    return EyePair.of(scene.left, scene.right, row_step), scene


def level(value, shape=(48, 64)):
    return np.full(shape, value, np.float32)


def test_the_true_disparity_is_alike_and_others_are_not():
    pair, scene = seen(noise=1.0)
    true = averaged(pair.unlike(scene.truth.astype(np.float32)))[INNER]
    assert np.quantile(true, 0.98) < LEAST_ALIKE
    for wrong in (-4.0, -2.0, 2.0, 4.0):
        unlike = averaged(pair.unlike((scene.truth + wrong).astype(np.float32)))[INNER]
        assert np.median(unlike) > MOST_ALIKE


def test_a_match_a_third_of_a_pixel_off_is_still_alike_and_one_a_whole_pixel_off_is_not():
    pair, scene = seen()
    near, off = (pair.unlike((scene.truth + shift).astype(np.float32))[INNER] for shift in (1 / 3, 1.0))
    assert (averaged(near) <= LEAST_ALIKE).mean() > 0.99
    assert np.median(averaged(off)) > 2 * LEAST_ALIKE


def test_what_is_tolerated_is_three_tenths_of_the_gradient():
    ramp = np.tile(np.arange(0, 240, 4, dtype=np.uint8), (8, 1))
    pair = EyePair.of(ramp, ramp, 1)
    assert (pair.edges[:, 2:-2] == 4).all()
    # A disparity of 3 px makes 12 grey levels of difference, 1.2 of them tolerated (rounded to 1).
    assert (pair.unlike(level(3.0, ramp.shape))[:, 8:-4] == 11).all()


def test_unlikeness_between_columns_is_interpolated():
    ramp = np.tile(np.arange(0, 240, 4, dtype=np.uint8), (8, 1))
    flat = np.full_like(ramp, 100)
    unlike = EyePair.of(flat, ramp, 1).unlike(level(5.5, ramp.shape))
    # Column 32 is seen at 26.5, where the ramp is 106: 6 grey levels, and no edge to tolerate them.
    assert unlike[4, 32] == 6


def test_greys_more_unlike_than_the_largest_are_as_unlike_as_can_be():
    dark, bright = np.zeros((8, 40), np.uint8), np.full((8, 40), 255, np.uint8)
    assert (EyePair.of(dark, bright, 1).unlike(level(0.0, dark.shape)) == LARGEST).all()
    for one, other in ((100, 110), (110, 100)):
        eyes = (np.full((8, 40), grey, np.uint8) for grey in (one, other))
        assert (EyePair.of(*eyes, 1).unlike(level(0.0, dark.shape)) == 10).all()


def test_what_the_other_eye_has_not_in_view_is_as_unlike_as_can_be():
    grey = np.full((8, 40), 100, np.uint8)
    unlike = EyePair.of(grey, grey, 1).unlike(level(7.0, grey.shape))
    assert (unlike[:, :7] == LARGEST).all()
    assert (unlike[:, 7:] == 0).all()
    # The first column reaches half a pixel to its left.
    half = EyePair.of(grey, grey, 1).unlike(level(7.4, grey.shape))
    assert (half[:, 6], half[:, 7]) == (pytest.approx(LARGEST), pytest.approx(0))


def test_the_other_eye_s_pair_is_the_pair_taken_mirrored():
    scene = cast(TEXTURED_SCENES["box before a wall"])
    left, right = scene.left, scene.right
    pair = EyePair.of(left, right, 1)
    expected = EyePair.of(
        np.ascontiguousarray(right[:, ::-1]), np.ascontiguousarray(left[:, ::-1]), 1
    )  # what is seen in a mirror by the eye that is then the left one
    for name in ("own", "other", "edges", "steps"):
        assert (getattr(pair.mirrored, name) == getattr(expected, name)).all()
        assert (getattr(pair.mirrored.mirrored, name) == getattr(pair, name)).all()
    assert not (pair.mirrored.own == pair.own).all()


def test_the_right_eye_agrees_with_a_true_disparity_of_its_own():
    pair, _ = seen(noise=1.0)
    unlike = averaged(pair.mirrored.unlike(level(6.0)))
    assert np.quantile(unlike[INNER], 0.98) < LEAST_ALIKE  # its own left margin is out of the left eye's view
    assert (pair.mirrored.unlike(level(6.0))[:, :6] == LARGEST).all()


@pytest.mark.parametrize("row_step", [1, 2, 3])
def test_every_row_looked_at_is_smoothed_first(row_step):
    pair, scene = seen(row_step=row_step)
    every, _ = seen()
    assert pair.own.shape == (len(scene.left[::row_step]), 64)
    assert (pair.own == every.own[::row_step]).all()
    assert (pair.edges == every.edges[::row_step]).all()
    assert pair.own.std() < scene.left.std()


def test_edges_are_gradients_along_the_row_and_steps_across_rows():
    picture = np.full((20, 40), 60, np.uint8)
    picture[:, 20:] = 160
    upright = EyePair.of(picture, picture, 1)
    assert upright.edges[:, 19:21].min() >= 25  # smoothed, 100 grey levels rise over some columns
    assert upright.steps.max() == 0
    lying = EyePair.of(*[np.ascontiguousarray(picture.T)] * 2, 1)
    assert lying.edges.max() == 0
    assert lying.steps[19:21].min() >= 25
    assert lying.steps[:15].max() == lying.steps[25:].max() == 0


def test_an_average_is_over_three_rows_and_three_columns():
    single = np.zeros((9, 9), np.uint8)
    single[4, 4] = 18
    expected = np.zeros((9, 9))
    expected[3:6, 3:6] = 2.0
    assert averaged(single) == pytest.approx(expected)


@settings(deadline=None, max_examples=60)
@given(st.floats(0.0, 25.0), st.floats(0.0, 25.0), st.integers(0, 100))
def test_the_limit_of_what_is_alike_is_that_of_most_measured_pixels_within_bounds(matched, other, share):
    unlike = np.full((20, 50), other, np.float32)
    known = np.zeros((20, 50), np.bool_)
    known[:, :40] = True
    unlike[known] = matched
    limit = alike_limit(unlike, known)
    assert limit == pytest.approx(np.clip(np.float32(matched), LEAST_ALIKE, MOST_ALIKE))
    blocked = unlike.ravel()
    blocked[: share // 10] = 25.0  # less than two of a hundred are odd: they are not asked
    assert alike_limit(blocked.reshape(20, 50), known) == pytest.approx(limit)


def test_the_limit_follows_the_noise():
    rng = np.random.default_rng(0)
    unlike = rng.uniform(0.0, 5.0, (80, 80)).astype(np.float32)
    assert alike_limit(unlike, np.ones((80, 80), np.bool_)) == pytest.approx(4.9, abs=0.1)


def test_where_nothing_is_known_only_the_most_alike_is():
    assert alike_limit(level(20.0), np.zeros((48, 64), np.bool_)) == LEAST_ALIKE
