"""The peers are OpenCV's at their best, dense, and filled alike."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from bench.stereo_peers import BM_BLOCK_PX, fill_rows, match_blocks, multiple_of_16, peers, side_peers

SHIFT = 9


def shifted_pair(seed=0):
    rough = np.random.default_rng(seed).standard_normal((60, 240))
    scene = cv2.normalize(cv2.GaussianBlur(rough, (0, 0), 1.5), None, 0, 255, cv2.NORM_MINMAX)
    colour = cv2.cvtColor(scene.astype(np.uint8), cv2.COLOR_GRAY2BGR)
    return colour[:, :180], colour[:, SHIFT : 180 + SHIFT]


@pytest.mark.parametrize("method", [*peers(), *side_peers()], ids=lambda method: method.name)
def test_every_peer_finds_a_shift_at_every_pixel(method):
    left, right = shifted_pair()
    before = left.copy(), right.copy()
    found = method.run(left, right, 30)  # no multiple of 16: the peer searches 32
    assert found.shape == (60, 180)
    assert found.dtype == np.float32
    assert np.isfinite(found).all()
    # What the right eye cannot see (the first columns) is filled, so it counts too.
    assert np.mean(np.abs(found - SHIFT) < 1.0) > (0.9 if method.name == "sgbm_no_margin" else 0.97)
    assert (left == before[0]).all()
    assert (right == before[1]).all()


def test_the_margin_lets_sgbm_measure_its_first_columns():
    left, right = shifted_pair()
    right = right.copy()
    right[:, :23] = right[:, 4:27]  # there the shift is 4 px larger
    run = {method.name: method.run for method in (*peers(), *side_peers())}
    assert np.median(run["sgbm"](left, right, 64)[:, 18:24]) == pytest.approx(SHIFT + 4, abs=0.5)
    assert np.median(run["sgbm_no_margin"](left, right, 64)[:, 18:24]) == pytest.approx(SHIFT, abs=0.5)


def test_the_margin_moves_no_measurement_of_block_matching():
    left, right = shifted_pair()
    u, v = np.meshgrid(np.arange(180, dtype=np.float32), np.arange(60, dtype=np.float32))
    right = cv2.remap(right, u + 4 * np.sin(u / 9), v, cv2.INTER_LINEAR)  # disparities change everywhere
    grey = [cv2.cvtColor(eye, cv2.COLOR_BGR2GRAY) for eye in (left, right)]
    plain = cv2.StereoBM.create(32, BM_BLOCK_PX).compute(*grey)
    inner = np.zeros(plain.shape, bool)
    inner[12:-12, 50:-20] = True
    measured = inner & (plain > 0)
    assert measured.sum() > 1500
    assert np.ptp(plain[measured]) > 5 * 16
    assert (match_blocks(left, right, 32)[measured] == plain[measured] / 16).all()


def test_names_are_unique_and_those_the_bars_ask_for_are_there():
    names = [method.name for method in (*peers(), *side_peers())]
    assert len(set(names)) == len(names)
    assert {"bm", "sgbm", "3way", "hh4", "3way_filtered"} <= {method.name for method in peers()}


@pytest.mark.parametrize(("asked", "searched"), [(1, 16), (16, 16), (17, 32), (176, 176)])
def test_the_search_is_rounded_up(asked, searched):
    assert multiple_of_16(asked) == searched


def test_no_search_is_refused():
    with pytest.raises(ValueError, match="above 0"):
        multiple_of_16(0)


def brute_fill(values, valid):
    filled = values.copy()
    for row in range(values.shape[0]):
        for column in np.flatnonzero(~valid[row]):
            left = values[row, :column][valid[row, :column]]
            right = values[row, column:][valid[row, column:]]
            sides = [*left[-1:], *right[:1]]
            filled[row, column] = min(sides) if sides else np.nan
    return filled


@settings(max_examples=40, deadline=None)
@given(
    values=arrays(np.float32, (3, 9), elements=st.integers(0, 60).map(float)), valid=arrays(np.bool_, (3, 9))
)
def test_holes_take_the_farther_neighbour(values, valid):
    filled, expected = fill_rows(values, valid), brute_fill(values, valid)
    measured = valid.any(axis=1)
    assert (filled[measured] == expected[measured]).all()
    assert np.isfinite(filled).all()
    if not measured.any():
        assert (filled == 0).all()


def test_a_row_without_a_value_takes_the_nearest_row():
    values = np.zeros((5, 4), np.float32)
    valid = np.zeros((5, 4), bool)
    values[0, 1], valid[0, 1] = 3.0, True
    values[4, 2], valid[4, 2] = 8.0, True
    assert fill_rows(values, valid)[:, 0].tolist() == [3.0, 3.0, 3.0, 8.0, 8.0]
