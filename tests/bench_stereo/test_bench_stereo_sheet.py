"""The contact sheet: pairs with their calibration, colours that order distances, words that tell shares."""

import json

import cv2
import numpy as np
import pytest

from bench import stereo_sheet
from robot.errors import UserError
from robot.vision.stereo import Disparity

CALIBRATION = {
    "width": 64, "height": 48, "baseline_meters": 0.075, "fx": 45.0, "fy": 45.0,
    "cx0": 30.0, "cx1": 32.5, "cy": 25.0, "left_image_rect_normalized": [0.125, 0.0, 0.75, 1],
}  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "stereodemo_calibration.json").write_text(json.dumps(CALIBRATION), encoding="utf-8")
    for name in ("stairs", "desk_lamp"):
        for eye in ("left", "right"):
            cv2.imwrite(str(tmp_path / f"{name}_{eye}.png"), np.full((48, 64, 3), 90, np.uint8))
    return tmp_path


def test_pairs_are_cut_to_what_the_rectification_filled_and_their_rig_follows(folder):
    pairs = stereo_sheet.real_pairs(folder)
    assert [pair.name for pair in pairs] == ["desk_lamp", "stairs"]
    rig = pairs[0].rig
    assert pairs[0].left.shape == pairs[0].right.shape == (48, 48, 3)
    assert (rig.left.width, rig.left.height, rig.left.cx, rig.left.cy) == (48, 48, 22.0, 25.0)
    assert (rig.doffs, rig.baseline) == (2.5, 0.075)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda at: (at / "stereodemo_calibration.json").write_text("{}"), "no calibration"),
        (lambda at: (at / "stairs_right.png").unlink(), r"stairs_right\.png: missing"),
        (
            lambda at: cv2.imwrite(str(at / "stairs_right.png"), np.zeros((4, 4), np.uint8)),
            "4 x 4, but the calibration is for 64 x 48",
        ),
        (lambda at: [path.unlink() for path in at.glob("*.png")], "no NAME_left.png"),
    ],
)
def test_a_spoilt_folder_is_named(folder, spoil, words):
    spoil(folder)
    with pytest.raises(UserError, match=words):
        stereo_sheet.real_pairs(folder)


def test_nearer_is_brighter_and_unmeasured_is_grey():
    distance = np.geomspace(0.3, 20.0, 60)[None]
    valid = np.ones((1, 60), bool)
    valid[0, 30] = False
    colours = stereo_sheet.depth_colours(distance, valid)
    luma = cv2.cvtColor(colours, cv2.COLOR_BGR2GRAY)[0].astype(int)
    measured = np.delete(luma, 30)
    assert (np.diff(measured) <= 1).all()
    assert measured[0] > measured[-1] + 100
    assert tuple(colours[0, 30]) == stereo_sheet.UNMEASURED


def test_what_lies_at_infinity_has_the_far_end_of_the_scale():
    colours = stereo_sheet.depth_colours(np.array([[np.inf, 8.0]]), np.ones((1, 2), bool))
    assert (colours[0, 0] == colours[0, 1]).all()


def test_the_search_reaches_the_nearest_distance(folder):
    pair = stereo_sheet.real_pairs(folder)[0]
    found = stereo_sheet.searched_disparities(pair.rig)
    assert found % 16 == 0
    assert found >= 45.0 * 0.075 / stereo_sheet.NEAREST_M


@pytest.mark.parametrize("overlaid", [False, True])
def test_the_sheet_holds_every_pair_and_the_overlay(folder, overlaid):
    pairs = stereo_sheet.real_pairs(folder)
    mark = (7, 250, 13)

    def match(pair):
        valid = np.zeros((48, 48), bool)
        return Disparity(np.zeros((48, 48), np.float32), valid, np.ones((48, 48), np.float32))

    def overlay(pair, found):
        return np.full((48, 48, 3), mark, np.uint8)

    drawn = stereo_sheet.sheet(pairs, match, overlay if overlaid else None)
    assert drawn.dtype == np.uint8
    side = stereo_sheet.PANEL_PX[1] ** 2  # a square picture fills the panel's height
    assert (drawn == 90).all(axis=-1).sum() == pytest.approx(2 * side, rel=0.02)
    assert (drawn == mark).all(axis=-1).sum() == (2 * side if overlaid else 0)
    one = stereo_sheet.sheet(pairs[:1], match, None)
    assert (one == 90).all(axis=-1).sum() == pytest.approx(side, rel=0.02)
