"""Rows of the bench: right figures from a matcher whose answers are known."""

import numpy as np
import pytest

from bench import stereo
from bench.stereo_data import stereo_case
from bench.stereo_peers import Method
from bench.stereo_rooms import room_view
from robot.messages import HeadPose
from robot.vision.stereo import Disparity


def wrong_by(case, px):
    return lambda left, right, disparities: (np.nan_to_num(case.truth) + np.float32(px)).astype(np.float32)


def small_case():
    truth = np.full((20, 60), 5.0, np.float32)
    truth[:, 30:35] = 9.0
    truth[0] = np.nan
    eye = np.zeros((20, 60, 3), np.uint8)
    return stereo_case("small", eye, eye, truth, 16)


def test_error_rows_hold_both_masks_and_times_of_the_timed():
    case = small_case()

    def background_only(left, right, disparities):
        return np.full(case.truth.shape, 5.0, np.float32)

    rows = list(
        stereo.error_rows(
            case,
            [Method("sgbm", wrong_by(case, 1.9)), Method("flat", background_only)],
            [Method("far", wrong_by(case, 2.1))],
            3,
        )
    )
    by_name = {row["method"]: row for row in rows}
    assert [row["method"] for row in rows] == ["sgbm", "flat", "far"]
    assert by_name["sgbm"]["bad2_all"] == 0.0
    assert by_name["sgbm"]["ratio"] == 1.0
    assert by_name["far"]["bad2_all"] == 100.0
    assert "ratio" not in by_name["far"]
    # 5 of 60 columns are off; 5 + 4 columns are not seen by the right eye.
    assert by_name["flat"]["bad2_all"] == pytest.approx(100 * 5 / 60)
    assert by_name["flat"]["bad2_non_occluded"] == pytest.approx(100 * 5 / 51)


def test_time_rows_are_at_both_searches():
    case = small_case()
    asked = []

    def run(left, right, disparities):
        asked.append((left.shape, disparities))
        return np.zeros(left.shape[:2], np.float32)

    rows = list(stereo.time_rows(case, [Method("sgbm", run)], 1))
    assert [row["disparities"] for row in rows] == [64, 176]
    assert set(asked) == {((288, 352, 3), 64), ((288, 352, 3), 176)}


@pytest.fixture(scope="module")
def view():
    return room_view("standing", 4, HeadPose(0.3, 0.3))


def test_a_matcher_that_knows_the_truth_makes_no_error_plain(view):
    def oracle(left, right):
        truth = view.case.truth
        return Disparity(np.nan_to_num(truth), np.isfinite(truth), np.full(truth.shape, 0.1, np.float32))

    (row, _) = stereo.sub_pixel_rows([view], {"oracle": oracle})
    assert (row["case"], row["valid"], row["median_error_px"], row["gross"]) == ("rooms plain", 1.0, 0.0, 0.0)
    assert row["samples"] == view.case.non_occluded.sum()


def test_locking_behind_the_floor_alignment_is_measured_on_the_sheared_grid(view):
    floor = stereo.floor_disparities(view.rig, view.mount, view.pan, view.tilt, 288)
    shift = np.maximum(floor - stereo.MARGIN_PX, 0.0).astype(np.float32)[:, None]

    def rounding(left, right):  # sees the sheared pair: its disparities are the truth less the shift
        sheared = np.nan_to_num(view.case.truth) - shift
        known = np.isfinite(view.case.truth)
        return Disparity(np.rint(sheared), known, np.full(sheared.shape, 0.3, np.float32))

    found = stereo.aligned_samples(view, rounding)
    assert len(found.true) > 50_000
    assert np.abs(found.error).max() <= 0.5 + 1e-4
    row = stereo.stereo_subpixel.figures(found)
    assert row.fraction_amplitude == pytest.approx(2.0, abs=1e-3)
    assert row.locking_px == pytest.approx(1 / np.pi, abs=0.02)  # first harmonic of rounding's saw tooth
