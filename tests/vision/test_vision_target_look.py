"""What a followed target looks like: patches, gradient histograms, filters, colours, and all joined."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.messages import Box
from robot.vision.colour_model import ColourModel, box_means
from robot.vision.correlation_filter import LEAST_SECOND, CorrelationFilter, second_peak
from robot.vision.gradient_histograms import CHANNELS, MOST, UNSIGNED, gradient_histograms
from robot.vision.motion_prior import motion_prior
from robot.vision.picture_patch import bgr_of, patch_of
from robot.vision.scale_filter import ScaleFilter
from robot.vision.support import support_of
from robot.vision.target_look import Rates, TargetLook
from robot.vision.textures import texture

WALL = texture((352, 288), np.random.default_rng(1))


def colour_wall(seed: int) -> np.ndarray:
    return cv2.resize(np.random.default_rng(seed).integers(0, 255, (24, 30, 3), np.uint8), (360, 288))


def slow_histograms(grey: np.ndarray) -> np.ndarray:
    """Pixel by pixel: strength shared between the two nearest of 18 directions, mean over cells."""
    wide = np.pad(grey.astype(float), 1, mode="reflect")
    rows, columns = grey.shape[0] // 4, grey.shape[1] // 4
    signed = np.zeros((2 * UNSIGNED, rows, columns))
    for y in range(grey.shape[0]):
        for x in range(grey.shape[1]):
            across = wide[y + 1, x + 2] - wide[y + 1, x]
            down = wide[y + 2, x + 1] - wide[y, x + 1]
            place = np.arctan2(down, across) % (2 * np.pi) * UNSIGNED / np.pi
            first, part = int(place) % 18, place - int(place)
            signed[first, y // 4, x // 4] += np.hypot(across, down) * (1 - part) / 16
            signed[(first + 1) % 18, y // 4, x // 4] += np.hypot(across, down) * part / 16
    unsigned = signed[:UNSIGNED] + signed[UNSIGNED:]
    energy = cv2.blur((unsigned**2).sum(axis=0), (3, 3), borderType=cv2.BORDER_REFLECT)
    return np.minimum(np.concatenate([signed, unsigned]) / np.sqrt(energy + 0.1), MOST)


def test_histograms_are_those_counted_pixel_by_pixel():
    grey = (
        np.ascontiguousarray(WALL[40:72, 60:100]) if WALL.ndim == 2 else cv2.cvtColor(WALL, 6)[40:72, 60:100]
    )
    np.testing.assert_allclose(gradient_histograms(grey), slow_histograms(grey), atol=2e-3)


@given(gain=st.floats(0.4, 1.0), offset=st.integers(0, 60), seed=st.integers(0, 50))
@settings(max_examples=15, deadline=None)
def test_light_changes_little_of_histograms(gain, offset, seed):
    grey = cv2.resize(np.random.default_rng(seed).integers(0, 190, (8, 8), np.uint8), (48, 48))
    other = np.clip(gain * grey + offset, 0, 255).astype(np.uint8)
    assert np.abs(gradient_histograms(grey) - gradient_histograms(other)).mean() < 0.02


def test_a_bare_patch_has_no_directions():
    assert gradient_histograms(np.full((16, 24), 90, np.uint8)).shape == (CHANNELS, 4, 6)
    assert not gradient_histograms(np.full((16, 24), 90, np.uint8)).any()


@pytest.mark.parametrize("shape", [(20, 24), (15, 21)])
def test_the_filter_answers_one_where_its_target_is_and_nowhere_else(shape):
    look = np.random.default_rng(0).random((4, *shape), dtype=np.float32) - 0.5
    learnt = CorrelationFilter.learnt(look, 1.0)
    for shift in [(0, 0), (3, -2), (-4, 5)]:
        answer = learnt.response(np.roll(look, shift, (1, 2)))
        row, column = np.unravel_index(answer.argmax(), shape)
        assert (row - shape[0] // 2, column - shape[1] // 2) == shift
        assert answer.max() == pytest.approx(1.0, abs=0.02)
        assert second_peak(answer, int(row), int(column)) == pytest.approx(LEAST_SECOND, abs=0.05)


def test_the_filter_forgets_at_its_rate():
    rng = np.random.default_rng(2)
    old, new = (rng.random((4, 20, 24), dtype=np.float32) - 0.5 for _ in range(2))
    learnt = CorrelationFilter.learnt(old, 1.0)
    assert learnt.and_met(new, 0.0).response(old).max() == pytest.approx(learnt.response(old).max(), abs=1e-5)
    for _ in range(30):
        learnt = learnt.and_met(new, 0.2)
    assert learnt.response(new).max() > 0.9
    assert learnt.response(old).max() < 0.3


@pytest.mark.parametrize("factor", [0.85, 0.94, 1.0, 1.06, 1.2])
def test_a_size_is_told_to_a_step(factor):
    wall = colour_wall(1)
    learnt = ScaleFilter.learnt(wall, (180.0, 144.0), (60.0, 80.0))
    zoom = np.array([[factor, 0, 180 * (1 - factor)], [0, factor, 144 * (1 - factor)]])
    shown = cv2.warpAffine(wall, zoom, (360, 288), flags=cv2.INTER_LINEAR)
    assert learnt.factor(shown, (180.0, 144.0), (60.0, 80.0)) == pytest.approx(factor, rel=0.025)


def test_colours_tell_the_target_from_its_surroundings():
    patch = np.full((40, 40, 3), (200, 120, 30), np.uint8)
    patch[10:30, 12:28] = (20, 30, 220)
    model = ColourModel.learnt(patch, (16.0, 20.0))
    likely = model.likelihood(patch)
    assert likely[20, 20] == pytest.approx(1.0)
    assert likely[2, 2] == 0.0
    assert model.likelihood(np.full((4, 4, 3), 99, np.uint8)) == pytest.approx(0.5)
    means = box_means(likely, (16.0, 20.0))
    assert np.unravel_index(means.argmax(), means.shape) == pytest.approx((20, 20), abs=3)


@pytest.mark.parametrize(("across", "down"), [(0, 0), (17, -9), (-30, 21), (40, 3)])
def test_a_block_s_motion_is_told_at_any_size(across, down):
    wall = colour_wall(3)
    for edge in (55, 90):
        told = motion_prior(wall, np.roll(wall, (down, across), (0, 1)), Box(130, 100, edge, edge))
        assert told == pytest.approx((across, down), abs=1.0)


def test_a_bare_block_tells_no_motion():
    bare = np.full((288, 352, 3), 80, np.uint8)
    assert motion_prior(bare, bare, Box(100, 100, 50, 50)) == (0.0, 0.0)


def test_looks_find_a_target_that_moved_and_grew():
    wall = colour_wall(4)
    look = TargetLook.learnt(wall, Box(150, 110, 50, 60))
    zoom = np.array([[1.08, 0, -1.0], [0, 1.08, -20.0]])
    shown = cv2.warpAffine(wall, zoom, (360, 288))
    found = look.find(shown, Box(150, 110, 50, 60))
    assert found.box.iou(Box(1.08 * 150 - 1.0, 1.08 * 110 - 20.0, 54.0, 64.8)) > 0.85
    assert found.ratio > 2.0


def test_a_look_that_is_met_at_rate_0_changes_nothing():
    wall, other = colour_wall(5), colour_wall(6)
    look = TargetLook.learnt(wall, Box(150, 110, 50, 60))
    same = look.and_met(other, Box(100, 90, 50, 60), Rates(0.0, 0.0, 0.0))
    assert same.find(wall, Box(146, 112, 50, 60)) == look.find(wall, Box(146, 112, 50, 60))


def test_a_patch_is_the_picture_s_part_and_repeats_its_rim():
    picture = np.arange(100, dtype=np.uint8).reshape(10, 10)
    np.testing.assert_array_equal(patch_of(picture, (5.0, 4.0), (4.0, 6.0), (4, 6)), picture[1:7, 3:7])
    outside = patch_of(picture, (-20.0, 5.0), (4.0, 4.0), (4, 4))
    np.testing.assert_array_equal(outside, np.repeat(picture[3:7, :1], 4, axis=1))


def test_pictures_are_checked():
    assert bgr_of(np.zeros((9, 9), np.uint8)).shape == (9, 9, 3)
    for bad in (np.zeros((9, 9), np.float32), np.zeros((9, 9, 4), np.uint8), np.zeros((5, 9), np.uint8)):
        with pytest.raises(ValueError, match="picture"):
            bgr_of(bad)


@pytest.mark.parametrize("centre", [(80, 60), (20, 60), (150, 110)])
def test_the_support_is_the_target_without_the_corners_of_its_box(centre):
    picture = cv2.resize(np.random.default_rng(7).integers(60, 120, (12, 16, 3), np.uint8), (160, 120))
    picture[..., 2] //= 3
    disc = np.zeros((120, 160), np.uint8)
    cv2.circle(disc, centre, 20, 1, -1)
    picture[disc > 0] = (20, 30, 220)
    box = Box(centre[0] - 20, centre[1] - 20, 41, 41)
    around = patch_of(picture, box.centre, (90.0, 90.0), (90, 90))
    found = support_of(picture, box, ColourModel.learnt(around, (41.0, 41.0)))
    assert found.shape == (120, 160)
    assert (found & (disc > 0)).sum() / (found | (disc > 0)).sum() > 0.9


def test_where_colours_tell_nothing_the_support_is_the_box():
    grey = np.full((120, 160, 3), 128, np.uint8)
    colours = ColourModel.learnt(grey, (40.0, 40.0))
    found = support_of(grey, Box(60, 40, 40, 40), colours)
    expected = np.zeros((120, 160), np.bool_)
    expected[40:80, 60:100] = True
    assert (found ^ expected).sum() < 0.1 * expected.sum()
