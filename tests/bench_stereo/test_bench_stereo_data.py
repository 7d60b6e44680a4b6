"""Cases are read as their layout says, and occlusion is what a z-buffer says."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.stereo_data import aloe_case, folder_cases, non_occluded, read_case, stereo_case
from robot.errors import UserError


def write_case(folder, *, truth=None, meta="scale = 4\nndisp = 16\n", right_shape=(6, 20, 3)):
    folder.mkdir(parents=True)
    left = np.arange(6 * 20 * 3, dtype=np.uint8).reshape(6, 20, 3)
    cv2.imwrite(str(folder / "left.png"), left)
    cv2.imwrite(str(folder / "right.png"), np.zeros(right_shape, np.uint8))
    cv2.imwrite(str(folder / "truth.png"), np.full((6, 20), 10, np.uint8) if truth is None else truth)
    (folder / "meta.toml").write_text(meta, encoding="utf-8")
    return left


def test_a_case_is_what_its_folder_says(tmp_path):
    truth = np.full((6, 20), 10, np.uint8)
    truth[0, 3] = 0
    left = write_case(tmp_path / "desk", truth=truth)
    case = read_case(tmp_path / "desk")
    assert (case.name, case.disparities) == ("desk", 16)
    assert (case.left == left).all()
    assert case.truth.dtype == np.float32
    assert np.isnan(case.truth[0, 3])
    assert case.known.sum() == 119
    assert np.nanmin(case.truth) == np.nanmax(case.truth) == 2.5


def test_sixteen_bit_truth_keeps_its_precision(tmp_path):
    write_case(tmp_path / "desk", truth=np.full((6, 20), 2563, np.uint16), meta="scale = 256.0\nndisp = 16\n")
    assert read_case(tmp_path / "desk").truth[2, 2] == pytest.approx(2563 / 256)


@pytest.mark.parametrize("below", ["stereo", "."])
def test_pairs_are_found_below_stereo_or_directly(tmp_path, below):
    for name in ("b", "a"):
        write_case(tmp_path / below / name)
    (tmp_path / below / "notes").mkdir()
    assert [case.name for case in folder_cases(tmp_path)] == ["a", "b"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"meta": "scale = 4\n"}, "meta.toml: needs the numbers scale and ndisp"),
        ({"meta": "scale = 0\nndisp = 16\n"}, "above 0"),
        ({"meta": "scale ="}, "meta.toml"),
        ({"right_shape": (6, 21, 3)}, "differ in size"),
        ({"truth": np.zeros((6, 20), np.uint8)}, "knows no pixel"),
        ({"truth": np.full((6, 20), 68, np.uint8)}, "truth reaches 17.0 px but ndisp is 16"),
        ({"truth": np.ones((6, 20, 3), np.uint8)}, "has colours"),
    ],
)
def test_a_wrong_folder_is_named_with_its_cure(tmp_path, change, words):
    write_case(tmp_path / "desk", **change)
    with pytest.raises(UserError, match=words):
        read_case(tmp_path / "desk")


def test_a_missing_picture_and_an_empty_folder_are_named(tmp_path):
    with pytest.raises(UserError, match="no stereo pairs"):
        folder_cases(tmp_path)
    with pytest.raises(UserError, match=r"aloeL\.jpg: missing"):
        aloe_case(tmp_path)
    write_case(tmp_path / "desk")
    (tmp_path / "desk" / "right.png").write_bytes(b"no picture")
    with pytest.raises(UserError, match=r"right\.png: missing, or not a picture"):
        folder_cases(tmp_path)


def test_aloe_is_reduced_with_its_truth(tmp_path):
    # A truth of 1 px more each column; of each block of 3 x 3 its centre counts.
    truth = np.where(np.arange(180) < 30, 0, np.arange(30, 210))[None].repeat(31, axis=0).astype(np.uint8)
    eye = np.repeat(np.arange(60, dtype=np.uint8), 3)[None].repeat(31, axis=0)
    for name in ("aloeL.jpg", "aloeR.jpg"):
        cv2.imwrite(str(tmp_path / name), eye, [cv2.IMWRITE_JPEG_QUALITY, 100])
    cv2.imwrite(str(tmp_path / "aloeGT.png"), truth)
    case = aloe_case(tmp_path)
    assert case.left.shape == (10, 60, 3)
    assert np.isnan(case.truth[:, :10]).all()
    assert np.allclose(case.truth[0, 10:], 20 + np.arange(50) + 1 / 3)
    assert np.abs(case.left[0, :, 0].astype(int) - np.arange(60)).max() <= 2


def test_a_bar_before_a_wall_hides_what_its_parallax_covers():
    truth = np.full((3, 40), 2.0, np.float32)
    truth[:, 20:26] = 7.0  # 5 px nearer: hides the 5 wall columns left of it
    expected = np.ones((3, 40), bool)
    expected[:, :2] = False  # left of the right eye's picture
    expected[:, 15:20] = False
    assert (non_occluded(truth) == expected).all()


def test_a_slanted_surface_does_not_hide_itself_and_unknown_hides_nothing():
    slope = (4.0 + 0.4 * np.arange(30, dtype=np.float32))[None].repeat(2, axis=0)
    # Its columns fall together: 0.6 columns in the right eye to one in the left.
    seen = non_occluded(slope)
    assert seen[:, 12:].all()
    slope[:, 20:] = np.nan
    assert not non_occluded(slope)[:, 20:].any()
    assert (non_occluded(slope)[:, :20] == seen[:, :20]).all()


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, 9), min_size=12, max_size=12))
def test_non_occluded_agrees_with_looking_at_every_pair_of_pixels(row):
    truth = np.array([row], np.float32)
    landing = np.arange(12) - truth[0]
    expected = [
        landing[i] >= 0
        and not any(landing[j] == landing[i] and truth[0, j] > truth[0, i] + 1 for j in range(12))
        for i in range(12)
    ]
    assert non_occluded(truth)[0].tolist() == expected


def test_a_case_carries_its_non_occluded_pixels():
    truth = np.full((2, 12), 3.0, np.float32)
    eye = np.zeros((2, 12, 3), np.uint8)
    case = stereo_case("flat", eye, eye, truth, 16)
    assert case.non_occluded.sum() == 2 * 9
