"""What counts as measured: each check on maps made by hand, and all of them on a pair."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.vision import stereo_checks
from robot.vision.stereo_checks import HIDDEN_SLACK_PX, MAX_JUMP_PX, MAX_SIGMA_PX, SPECK_PX, measured

# -------------------------------------------------------------------------------------------------- torn


@settings(max_examples=60, deadline=None)
@given(width=st.integers(1, 14), seed=st.integers(0, 999))
def test_torn_is_where_left_and_right_neighbour_are_apart(width, seed):
    values = np.random.default_rng(seed).uniform(0, 4, (3, width)).astype(np.float32)
    torn = stereo_checks._torn(values)
    for row in range(3):
        for column in range(width):
            rim = column in (0, width - 1)
            apart = 0.0 if rim else abs(float(values[row, column + 1]) - float(values[row, column - 1]))
            assert torn[row, column] == (apart > MAX_JUMP_PX)


def test_a_jump_is_torn_on_both_sides_and_a_slope_is_not():
    step = np.array([[3.0, 3.0, 3.0, 9.0, 9.0, 9.0]], np.float32)
    assert stereo_checks._torn(step).tolist() == [[False, False, True, True, False, False]]
    assert not stereo_checks._torn(np.linspace(0, 20, 40, dtype=np.float32)[None]).any()


# ------------------------------------------------------------------------------------------------- specks


def on_surfaces(values, valid):
    return stereo_checks._on_surfaces(np.asarray(values, np.float32), valid)


@pytest.mark.parametrize(("side", "kept"), [(9, False), (10, False), (11, True), (14, True)])
def test_a_surface_counts_from_400_pixels_on(side, kept):
    """At half the size, as here, 100: 10 x 10 is still a speck, 11 x 11 none."""
    values, valid = np.full((40, 40), 8.0, np.float32), np.zeros((40, 40), bool)
    valid[5 : 5 + side, 7 : 7 + side] = True
    assert SPECK_PX == 400
    assert (on_surfaces(values, valid) == (valid & kept)).all()


def test_a_speck_on_a_surface_is_taken_out_and_the_surface_stays():
    values, valid = np.full((40, 40), 8.0, np.float32), np.ones((40, 40), bool)
    values[10:15, 10:15] = 14.0
    assert (on_surfaces(values, valid) == (values == 8.0)).all()


def test_a_slanted_surface_is_one_and_unmeasured_pixels_part_surfaces():
    slanted = np.tile(np.linspace(3, 30, 40), (40, 1))
    assert on_surfaces(slanted, np.ones((40, 40), bool)).all()
    parted = np.ones((40, 40), bool)
    parted[:, 2::3] = False  # stripes of 80 pixels
    assert not on_surfaces(slanted, parted).any()


def test_a_surface_at_disparity_zero_is_told_from_nothing():
    assert on_surfaces(np.zeros((20, 20)), np.ones((20, 20), bool)).all()
    assert not on_surfaces(np.zeros((20, 20)), np.zeros((20, 20), bool)).any()


def test_the_largest_disparities_are_told_apart_too():
    values = np.full((20, 40), 511.0)
    values[:, 20:] = 505.0
    assert on_surfaces(values, np.ones((20, 40), bool)).all()


# ------------------------------------------------------------------------------------------------- hidden


@settings(max_examples=80, deadline=None)
@given(width=st.integers(1, 14), seed=st.integers(0, 999))
def test_hidden_is_what_a_measured_pixel_farther_right_comes_to_lie_left_of(width, seed):
    rng = np.random.default_rng(seed)
    columns = (np.arange(width) - rng.uniform(0, 6, (2, width))).astype(np.float32)
    valid = rng.random((2, width)) < 0.7
    found = stereo_checks._hidden(columns, valid)
    for row in range(2):
        for here in range(width):
            before = [columns[row, x] for x in range(here, width) if valid[row, x]]
            assert found[row, here] == any(columns[row, here] > c + HIDDEN_SLACK_PX for c in before)


def test_what_stands_behind_a_near_things_left_rim_is_hidden():
    disparity = np.full((1, 40), 2.0, np.float32)
    disparity[:, 20:30] = 10.0
    columns = np.arange(40, dtype=np.float32) - disparity
    hidden = stereo_checks._hidden(columns, np.ones((1, 40), bool))
    # The thing's left rim lies in the right eye's column 10: the wall's columns 12 + 1 slack on to 19.
    assert np.flatnonzero(hidden[0]).tolist() == list(range(14, 20))
    unmeasured = disparity == 2.0
    assert not stereo_checks._hidden(columns, unmeasured).any()


# ---------------------------------------------------------------------------------------- all, on a pair


def scene(seed, shape=(120, 400)):
    rough = cv2.GaussianBlur(np.random.default_rng(seed).standard_normal(shape), (0, 0), 1.5)
    return np.clip(125 + 40 * rough / rough.std(), 0, 255).astype(np.uint8)


def thing_before_a_wall():
    """Wall at 6 px, thing at 20 px in columns 100..199 of rows 20..99: pair and true map."""
    wall, thing = scene(1), scene(2)
    left, right = wall[:, :280].copy(), wall[:, 6:286].copy()
    left[20:100, 100:200] = right[20:100, 80:180] = thing[20:100, 100:200]
    truth = np.full((120, 280), 6.0, np.float32)
    truth[20:100, 100:200] = 20.0
    return left, right, truth


EVERYWHERE = np.ones((120, 280), bool)


def test_both_surfaces_are_measured_and_what_is_hidden_or_torn_is_not():
    left, right, truth = thing_before_a_wall()
    found = measured(left, right, truth, EVERYWHERE)
    assert found.valid[30:90, 112:188].all()
    assert found.valid[:, 220:270].mean() > 0.99
    assert not found.valid[21:99, 99:101].any(), "the thing's rim"
    assert not found.valid[30:90, 90:99].any(), "the wall the thing hides from the right eye"
    assert not found.valid[:, :5].any(), "left of what the right eye sees"
    error = np.where(found.valid, np.abs(found.values - truth), 0.0)
    assert error.max() <= 1.0, "beside rims, where windows see two surfaces"
    assert error[35:85, 115:185].max() < 0.3
    assert (found.sigma_px[found.valid] <= MAX_SIGMA_PX).all()


def test_only_where_both_eyes_chose_it_is_it_measured():
    left, right, truth = thing_before_a_wall()
    stable = np.random.default_rng(0).random(truth.shape) < 0.9
    found = measured(left, right, truth, stable)
    assert not (found.valid & ~stable).any()
    assert found.valid.mean() > 0.5


def test_a_false_patch_is_not_measured_and_keeps_a_value_for_the_eye():
    left, right, truth = thing_before_a_wall()
    coarse = truth.copy()
    coarse[60:80, 220:240] = 25.0
    found = measured(left, right, coarse, EVERYWHERE)
    assert not found.valid[60:80, 220:240].any()
    assert np.isfinite(found.values).all()
    assert (found.values[62:78, 222:238] == 25.0).all()


def test_pictures_that_have_nothing_in_common_measure_nothing_whatever_the_eyes_chose():
    left, right = scene(1)[:, :280], scene(2)[:, :280]
    found = measured(left, right, np.full(left.shape, 9.0, np.float32), EVERYWHERE)
    assert found.valid.mean() < 0.001


def striped(amount):
    """Strong horizontal stripes, alike in every column, and `amount` of texture along the rows."""
    stripes = np.repeat(scene(4)[:, :1].astype(float), 400, axis=1)
    return np.clip(stripes + amount * (scene(5).astype(float) - 125), 0, 255).astype(np.uint8)


def test_stripes_along_the_rows_are_alike_everywhere_and_tell_no_disparity():
    left = striped(0.0)[:, :280]
    found = measured(left, left, np.full(left.shape, 9.0, np.float32), EVERYWHERE)
    assert not found.valid.any(), "alike, but too uncertain"
    assert (found.sigma_px > MAX_SIGMA_PX).all()


def test_where_windows_look_alike_all_the_same_the_pictures_rim_still_counts():
    wall = striped(0.1)
    found = measured(wall[:, :280], wall[:, 20:300], np.full((120, 280), 20.0, np.float32), EVERYWHERE)
    assert found.valid[:, 40:270].mean() > 0.9
    assert not (found.valid & (found.values > np.arange(280))).any()


def test_where_windows_look_alike_all_the_same_what_is_hidden_still_is():
    wall = striped(0.1)
    left, right = wall[:, :280].copy(), wall[:, 6:286].copy()
    left[:, 150:] = right[:, 130:260] = wall[:, 200:330]
    truth = np.where(np.arange(280) < 150, 6.0, 20.0) * np.ones((120, 1))
    found = measured(left, right, truth.astype(np.float32), EVERYWHERE)
    assert found.valid[:, 40:125].mean() > 0.9, "the wall beside it is measured"
    assert not found.valid[:, 140:149].any(), "behind the thing, measured from column 152 on, lies this wall"


def test_disparity_zero_is_infinitely_far_and_no_measurement():
    left = scene(3)[:, :280]
    found = measured(left, left, np.zeros(left.shape, np.float32), EVERYWHERE)
    assert (found.values >= 0).all()
    assert not (found.valid & (found.values == 0)).any()


@pytest.mark.parametrize("shape", [(119, 279), (1, 1), (1, 30), (30, 1), (2, 3)])
def test_odd_sizes_give_maps_of_their_own_size(shape):
    left, right, truth = (plane[: shape[0], : shape[1]] for plane in thing_before_a_wall())
    found = measured(left, right, truth, np.ones(shape, bool))
    assert found.values.shape == found.valid.shape == found.sigma_px.shape == shape
    assert (found.values.dtype, found.valid.dtype, found.sigma_px.dtype) == (np.float32, np.bool_, np.float32)
