"""Filling and enlarging against loops; the fit against pictures shifted by exact fractions of a pixel."""

from functools import cache

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from robot.vision.stereo_refinement import (
    JUMP,
    SIGMA_FLOOR_PX,
    Window,
    doubled,
    enlarge,
    fill_rows,
    fit,
    median,
)

SHAPE = (96, 256)
INNER = np.s_[12:-12, 24:-24]

# ------------------------------------------------------------------------------------------ filling rows


def filled_by_hand(values, known):
    """Each gap by its row's nearest known pixels, the lesser of both; blank rows by the nearest other row."""
    height, width = values.shape
    out = np.zeros((height, width), np.float32)
    seen = [row for row in range(height) if known[row].any()]
    for row in seen:
        columns = [c for c in range(width) if known[row, c]]
        for column in range(width):
            sides = [c for c in columns if c <= column][-1:] + [c for c in columns if c >= column][:1]
            out[row, column] = min(values[row, c] for c in sides)
    for row in set(range(height)) - set(seen):
        out[row] = out[min(seen, key=lambda other: (abs(other - row), other))] if seen else 0.0
    return out


@settings(max_examples=150, deadline=None)
@given(
    values=hnp.arrays(
        np.float32, st.tuples(st.integers(1, 6), st.integers(1, 12)), elements=st.integers(0, 30).map(float)
    ),
    share=st.sampled_from([0.0, 0.1, 0.5, 1.0]),
    seed=st.integers(0, 999),
)
def test_gaps_are_filled_as_by_hand(values, share, seed):
    known = np.random.default_rng(seed).random(values.shape) < share
    found = fill_rows(values, known)
    assert found.dtype == np.float32
    assert (found == filled_by_hand(values, known)).all()
    assert (found[known] == values[known]).all()


def test_what_stands_in_the_gaps_does_not_matter():
    known = np.array([[False, True, False, True, False]])
    values = np.array([[np.nan, 7.0, -np.inf, 3.0, 99.0]], np.float32)
    assert fill_rows(values, known).tolist() == [[7.0, 7.0, 3.0, 3.0, 3.0]]


# --------------------------------------------------------------------------------- median, sizes, indices


def test_the_median_is_of_nine_pixels_the_rim_repeated():
    values = np.random.default_rng(1).random((5, 7)).astype(np.float32)
    wide = np.pad(values, 1, mode="edge")
    expected = [[np.median(wide[r : r + 3, c : c + 3]) for c in range(7)] for r in range(5)]
    assert median(values) == pytest.approx(np.array(expected))


@pytest.mark.parametrize("kind", [np.uint8, np.float32])
def test_doubling_repeats_each_pixel_four_times(kind):
    plane = np.arange(12).reshape(3, 4).astype(kind)
    assert doubled(plane).dtype == kind
    assert (doubled(plane) == np.kron(plane, np.ones((2, 2)))).all()


def index_by_hand(halved, guide, grey):
    height, width = halved.shape
    out = np.zeros((2 * height, 2 * width), int)
    for y in range(2 * height):
        for x in range(2 * width):
            row, column = y // 2, x // 2
            around = halved[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
            beside_row = min(max(row + (1 if y % 2 else -1), 0), height - 1)
            beside_column = min(max(column + (1 if x % 2 else -1), 0), width - 1)
            near = [(row, column)]
            if around.max() - around.min() > JUMP:
                near += [(row, beside_column), (beside_row, column), (beside_row, beside_column)]
            unlike = [abs(int(grey[y, x]) - int(guide[place])) for place in near]
            best = near[unlike.index(min(unlike))]
            out[y, x] = best[0] * width + best[1]
    return out


@settings(max_examples=60, deadline=None)
@given(height=st.integers(1, 6), width=st.integers(1, 8), seed=st.integers(0, 999))
def test_each_pixel_takes_the_value_of_the_likest_of_its_four_neighbours_at_jumps(height, width, seed):
    rng = np.random.default_rng(seed)
    halved = (4.0 * (rng.random((height, width)) < 0.15)).astype(np.float32) + rng.random((1, 1), np.float32)
    guide = rng.integers(0, 256, (height, width)).astype(np.uint8)
    grey = rng.integers(0, 256, (2 * height, 2 * width)).astype(np.uint8)
    found = enlarge(halved, guide, grey)
    assert found.dtype == np.int32
    assert (found == index_by_hand(halved, guide, grey)).all()


def test_an_edge_lies_where_the_picture_has_it_not_where_pixels_pair():
    grey = np.full((8, 12), 30, np.uint8)
    grey[:, 5:] = 220  # between two columns of one pair
    guide = cv2.resize(grey, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    halved = np.repeat(np.array([[2, 2, 2, 9, 9, 9]], np.float32), 4, axis=0)
    found = halved.reshape(-1)[enlarge(halved, guide, grey)]
    assert (found[:, :4] == 2).all()
    assert (found[:, 5:] == 9).all(), "column 5 is the object's, though its pair's value is the wall's"


# ----------------------------------------------------------------------------------------------- the fit


@cache
def spectrum(seed):
    """Of a periodic cloud with grains of 1.5 px; multiplied by a phase it is shifted by any fraction."""
    rough = np.fft.rfft2(np.random.default_rng(seed).standard_normal(SHAPE))
    v, u = np.fft.fftfreq(SHAPE[0])[:, None], np.fft.rfftfreq(SHAPE[1])[None]
    return rough * np.exp(-2 * (np.pi * 1.5) ** 2 * (u**2 + v**2)), u


def pair_at(shift, *, seed=0, noise=0.0, contrast=40.0):
    """Grey pair whose right picture shows at x - shift what the left one shows at x."""
    cloud, u = spectrum(seed)
    rng = np.random.default_rng((seed, int(1000 * shift), int(noise)))
    unit = contrast / np.fft.irfft2(cloud, s=SHAPE).std()
    eyes = (128 + unit * np.fft.irfft2(cloud * np.exp(2j * np.pi * u * s), s=SHAPE) for s in (0.0, shift))
    left, right = (
        np.clip(np.rint(e + noise * rng.standard_normal(SHAPE)), 0, 255).astype(np.uint8) for e in eyes
    )
    return left, right


def errors(shift, *, start, window=None, **scene):
    """Errors of the good values, their sigma, and the share that is good."""
    left, right = pair_at(shift, **scene)
    coarse = np.full(SHAPE, shift + start, np.float32)
    found = fit(left, right, coarse) if window is None else fit(left, right, coarse, window)
    good = found.good[INNER]
    return (found.values[INNER] - shift)[good], found.sigma_px[INNER][good], good.mean()


FRACTIONS = np.round(np.linspace(0.0, 0.9, 10), 1)


@pytest.mark.parametrize("noise", [0.0, 1.0, 2.0, 4.0, 8.0])
@pytest.mark.parametrize("start", [-0.6, 0.4])
def test_shifts_of_any_fraction_are_recovered(noise, start):
    for shift in 10 + FRACTIONS[::3]:
        error, _, good = errors(shift, start=start, noise=noise)
        assert good > 0.99
        assert np.median(np.abs(error)) < 0.05


def test_no_fraction_is_preferred():
    """Pixel locking: the mean error at each fraction stays below 0.03 px (0.021 measured)."""
    for shift in 10 + FRACTIONS:
        for start in (-0.6, 0.0, 0.6):
            error, _, _ = errors(shift, start=start, noise=2.0, seed=int(10 * shift))
            assert abs(error.mean()) < 0.03, f"at {shift:.1f} px from {start:+.1f}"


@pytest.mark.parametrize("start", [-0.3, 0.3])
def test_a_single_step_ends_just_beyond_the_truth(start):
    """The gradient's kernel damps fine texture, so that steps are an eighth too long, never too short."""
    for shift in 10 + FRACTIONS[::3]:
        error, _, _ = errors(shift, start=start, noise=1.0, window=Window(steps=1))
        assert 0.0 < -error.mean() / start < 0.25


def test_a_single_step_is_half_a_pixel_at_most():
    """Hence the coarsest preset, which takes one, errs by 0.1 px where it began 0.6 px away."""
    for start in (-0.6, 0.6):
        error, _, _ = errors(10.0, start=start, noise=2.0, window=Window(half_side_px=5, steps=1))
        assert abs(error.mean() - np.sign(start) * 0.1) < 0.03


@pytest.mark.parametrize(
    ("contrast", "noise"), [(40.0, 2.0), (40.0, 8.0), (10.0, 2.0), (10.0, 4.0), (10.0, 8.0)]
)
def test_sigma_is_never_too_small(contrast, noise):
    """At least 60 % lie inside one sigma and 95 % inside two, at every signal to noise."""
    draws = [
        errors(10 + fraction, start=0.3, noise=noise, contrast=contrast, seed=draw)
        for draw, fraction in enumerate(FRACTIONS[::2])
    ]
    z = np.concatenate([np.abs(error) / sigma for error, sigma, _ in draws])
    assert (z < 1).mean() > 0.6
    assert (z < 2).mean() > 0.95


def test_where_noise_decides_sigma_is_not_much_too_large_either():
    """79 % inside one sigma measured on noise alone; with less noise the floor of 0.06 px rules."""
    draws = [errors(10.3, start=0.2, noise=8.0, contrast=10.0, seed=seed) for seed in range(6)]
    z = np.concatenate([np.abs(error) / sigma for error, sigma, _ in draws])
    assert 0.6 < (z < 1).mean() < 0.85


def test_sigma_grows_with_noise_and_with_blankness_and_has_a_floor():
    clean, noisy, faint = (
        float(np.median(errors(10.4, start=0.0, noise=noise, contrast=contrast)[1]))
        for noise, contrast in ((0.0, 40.0), (8.0, 40.0), (8.0, 10.0))
    )
    assert SIGMA_FLOOR_PX <= clean < 0.07 < noisy < faint


def test_a_blank_wall_teaches_nothing():
    blank = np.full(SHAPE, 100, np.uint8)
    found = fit(blank, blank, np.full(SHAPE, 5.5, np.float32))
    assert not found.good.any()
    assert (found.values == 5.5).all()
    assert (found.sigma_px > 1.0).all()


def test_where_it_is_no_match_the_coarse_value_stays():
    left, right = pair_at(10.0)[0], pair_at(10.0, seed=5)[1]
    coarse = np.full(SHAPE, 7.25, np.float32)
    found = fit(left, right, coarse)
    assert found.good.mean() < 0.01
    assert (found.values[~found.good] == 7.25).all()


@pytest.mark.parametrize("start", [-6.0, 6.0, 9.0])
def test_a_start_far_from_the_truth_is_no_match(start):
    assert errors(12.0, start=start, noise=2.0)[2] < 0.02


def test_no_value_is_moved_farther_than_a_pixel():
    left, right = pair_at(10.0, noise=2.0)
    coarse = (10 + np.random.default_rng(3).uniform(-3, 3, SHAPE)).astype(np.float32)
    found = fit(left, right, coarse)
    assert (np.abs(found.values - coarse) <= 1.0 + 1e-5).all()


@pytest.mark.parametrize("gain", [0.7, 0.85, 1.3])
def test_eyes_that_expose_differently_are_fitted_alike(gain):
    left, right = pair_at(10.4, noise=1.0, contrast=25.0)
    darker = np.clip(gain * right.astype(float) + 10, 0, 255).astype(np.uint8)
    found = fit(left, darker, np.full(SHAPE, 10.2, np.float32))
    assert found.good[INNER].mean() > 0.99
    assert np.median(np.abs(found.values[INNER] - 10.4)) < 0.05


def test_what_counts_as_a_match_is_the_windows_to_say():
    left, right = pair_at(10.0, noise=8.0, contrast=6.0)
    coarse = np.full(SHAPE, 10.0, np.float32)
    strict, normal, mild = (
        fit(left, right, coarse, Window(least_correlation=least)).good.mean() for least in (0.95, 0.8, 0.3)
    )
    assert strict < 0.05 < normal < 0.9 < mild
