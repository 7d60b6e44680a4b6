"""Figures are what their definitions say, on maps whose errors are known."""

import math

import numpy as np
import pytest

from bench.stereo_data import stereo_case
from bench.stereo_figures import bad_2, interleaved_seconds, ratios, timed_pair
from bench.stereo_peers import Method
from bench.stereo_subpixel import Samples, figures, fraction_amplitude, joined, locking_curve, take

EVERYWHERE = np.ones((2, 5), bool)


def test_bad_2_counts_known_pixels_of_the_mask_only():
    truth = np.full((2, 5), 10.0, np.float32)
    truth[0, 0] = np.nan
    found = truth.copy()
    found[0, 0] = 99.0  # unknown: no error
    found[0, 1], found[0, 2], found[0, 3] = 12.0, 12.01, 7.5
    found[1, 4] = np.nan
    assert bad_2(truth, found, EVERYWHERE) == pytest.approx(100 * 3 / 9)
    mask = EVERYWHERE.copy()
    mask[0, 2] = False
    assert bad_2(truth, found, mask) == pytest.approx(100 * 2 / 8)


def test_bad_2_of_nothing_known_is_no_number():
    assert math.isnan(bad_2(np.full((2, 5), np.nan, np.float32), np.zeros((2, 5), np.float32), EVERYWHERE))


def test_rounds_are_interleaved_and_begin_in_turn():
    called = []

    def method(name):
        return Method(name, lambda left, right, disparities: called.append((name, disparities)))

    eye = np.zeros((4, 4, 3), np.uint8)
    seconds = interleaved_seconds([method("a"), method("b")], eye, eye, 32, 3)
    assert [name for name, _ in called] == ["a", "b", "a", "b", "b", "a", "a", "b"]
    assert {disparities for _, disparities in called} == {32}
    assert all(len(times) == 3 and (times >= 0).all() for times in seconds.values())
    with pytest.raises(ValueError, match="at least 1"):
        interleaved_seconds([method("a")], eye, eye, 32, 0)


def test_ratios_are_of_medians_not_of_means():
    seconds = {"ours": np.array([1.0, 1.0, 50.0]), "sgbm": np.array([2.0, 4.0, 4.0])}
    assert ratios(seconds, "sgbm") == {"ours": 0.25, "sgbm": 1.0}


@pytest.mark.parametrize("shape", [(500, 741), (100, 90), (288, 352)])
def test_timed_pictures_have_the_robots_size_and_keep_their_middle(shape):
    eye = np.zeros((*shape, 3), np.uint8)
    eye[shape[0] // 2 - 8 : shape[0] // 2 + 8, shape[1] // 2 - 8 : shape[1] // 2 + 8] = 255
    left, _ = timed_pair(stereo_case("x", eye, eye, np.ones(shape, np.float32), 16))
    assert left.shape == (288, 352, 3)
    rows, columns = np.nonzero(left[..., 0] > 128)
    assert rows.mean() == pytest.approx(143.5, abs=2)
    assert columns.mean() == pytest.approx(175.5, abs=2)


def samples_with(error, true=None, sigma=1.0, grid=None):
    true = np.linspace(5, 25, 40001) if true is None else true
    true = true.astype(np.float32)
    grid = np.zeros_like(true) if grid is None else grid
    return Samples(
        true, (true + error(true)).astype(np.float32), np.full_like(true, sigma), grid, 2 * len(true)
    )


def test_honest_gaussian_errors_come_out_as_such():
    random = np.random.default_rng(3)
    found = figures(samples_with(lambda t: random.normal(0.0, 0.1, t.shape), sigma=0.1))
    assert found.within_1_sigma == pytest.approx(0.683, abs=0.01)
    assert found.within_2_sigma == pytest.approx(0.954, abs=0.01)
    assert found.median_error_px == pytest.approx(0.0674, abs=0.002)
    assert found.valid == 0.5
    assert found.gross == 0.0
    assert found.locking_px < 0.005
    assert found.fraction_amplitude < 0.02


def test_locking_is_measured_at_its_amplitude():
    # Drawn towards whole pixels by 0.08 px at most.
    found = figures(samples_with(lambda t: -0.08 * np.sin(2 * np.pi * t)))
    assert found.locking_px == pytest.approx(0.08, abs=0.002)
    assert found.locking_span_px == pytest.approx(0.16, abs=0.005)
    assert found.fraction_amplitude > 0.3 > found.true_fraction_amplitude


def test_locking_is_measured_on_the_matchers_own_grid():
    true = np.linspace(5, 25, 40001)
    grid = (0.37 * np.arange(40001) % 1).astype(np.float32)
    locked = samples_with(lambda t: -0.08 * np.sin(2 * np.pi * (t - grid)), true, grid=grid)
    assert figures(locked).locking_px == pytest.approx(0.08, abs=0.002)
    unaware = Samples(locked.true, locked.found, locked.sigma, np.zeros_like(grid), locked.known)
    assert figures(unaware).locking_px < 0.01


def test_an_offset_is_bias_not_locking_and_mismatches_are_gross():
    offset = figures(samples_with(lambda t: np.full(t.shape, 0.3)))
    assert (round(offset.bias_px, 3), round(offset.locking_px, 3)) == (0.3, 0.0)
    every_tenth = figures(samples_with(lambda t: np.where(np.arange(len(t)) % 10 == 0, 5.0, 0.0)))
    assert every_tenth.gross == pytest.approx(0.1, abs=1e-3)
    assert every_tenth.locking_px == pytest.approx(0.0, abs=1e-6)


def test_fractions_all_alike_have_amplitude_two_and_even_ones_none():
    assert fraction_amplitude(np.full(50, 7.3, np.float32)) == pytest.approx(2.0, abs=1e-4)
    assert fraction_amplitude(np.arange(100, dtype=np.float32) / 10) < 1e-4


def test_an_empty_fraction_bin_leaves_the_curve_unknown():
    assert np.isnan(locking_curve(samples_with(lambda t: 0.0 * t, np.full(99, 4.5)))).all()


def test_nothing_measured_is_no_number_and_not_zero_error():
    found = figures(Samples(*[np.zeros(0, np.float32)] * 4, 10))
    assert found.valid == 0.0
    assert math.isnan(found.median_error_px)
    assert math.isnan(found.within_1_sigma)


def test_only_measured_pixels_of_the_mask_are_taken():
    true, found, sigma = (np.full((2, 3), value, np.float32) for value in (4.0, 5.0, 0.2))
    mask, valid = np.zeros((2, 2 + 1), bool), np.ones((2, 3), bool)
    mask[0] = True
    valid[0, 0] = False
    grid = np.array([[0.5], [0.0]], np.float32)
    one = take(true, mask, found, valid, sigma, grid)
    assert (one.known, one.true.tolist(), one.grid.tolist()) == (3, [4.0, 4.0], [0.5, 0.5])
    both = joined([one, one])
    assert (both.known, len(both.found), both.error.tolist()) == (6, 4, [1.0] * 4)
