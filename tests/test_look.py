"""`robot look` on a real pair: true ranges, exit codes, a picture one can look at, nothing half-written."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from skimage import data

from calib.files import save_rig
from calib.model import Camera, StereoRig
from robot import look as look_command
from robot.errors import UserError
from robot.look import look_at
from robot.look_measure import Look, free_passage, look, searched_disparities
from robot.look_picture import CAPTION_PX, draw
from robot.messages import Box, Detection
from robot.vision.stereo import Disparity

RIG = StereoRig.parallel(741, 500, 994.978, 0.193001, cx=311.193, cy=254.877, doffs=31.086)
"""As the pair's documentation tells it."""
OBJECTS = {
    "tank": Box(395, 195, 60, 50),
    "front wheel": Box(570, 330, 60, 60),
    "carton on the shelf": Box(525, 25, 60, 70),
}
Pair = tuple[np.ndarray, np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def motorcycle() -> Pair:
    """Left, right (BGR) and the true depth of the left picture's pixels."""
    left, right, disparity = data.stereo_motorcycle()
    depth = 994.978 * 0.193001 / (np.where(np.isfinite(disparity), disparity, np.nan) + 31.086)
    return left[..., ::-1].copy(), right[..., ::-1].copy(), depth


@pytest.fixture(scope="module")
def files(motorcycle: Pair, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with left.png, right.png and rig.toml."""
    folder = tmp_path_factory.mktemp("motorcycle")
    cv2.imwrite(str(folder / "left.png"), motorcycle[0])
    cv2.imwrite(str(folder / "right.png"), motorcycle[1])
    save_rig(folder / "rig.toml", RIG)
    return folder


class Finder:
    """A taught target that is found where it is told."""

    def __init__(self, *found: Detection) -> None:
        self.found = found

    def predict(self, image: np.ndarray) -> Sequence[Detection]:
        return self.found


@pytest.fixture(scope="module")
def found(motorcycle: Pair) -> Look:
    named = (Detection(box, 0.9, name) for name, box in OBJECTS.items())
    return look(motorcycle[0], motorcycle[1], RIG, target=Finder(*named))


def test_the_range_of_three_objects_is_true(found: Look, motorcycle: Pair) -> None:
    errors = []
    for sight in found.sights:
        u, v = (round(c) for c in sight.box.centre)
        true = float(np.nanmedian(motorcycle[2][v - 3 : v + 4, u - 3 : u + 4]))
        assert sight.distance is not None
        assert sight.dense == pytest.approx(true, rel=0.05)
        errors.append(abs(sight.distance - true) / true)
    assert [sight.label for sight in found.sights] == list(OBJECTS)
    assert np.median(errors) <= 0.01
    assert max(errors) <= 0.03


def test_dense_depth_is_true(found: Look, motorcycle: Pair) -> None:
    true = motorcycle[2]
    known = found.disparity.valid & np.isfinite(true)
    error = np.abs(found.rig.depth(found.disparity.values)[known] - true[known]) / true[known]
    assert known.mean() > 0.6
    assert np.median(error) <= 0.01


def test_the_passage_lies_behind_the_motorcycle_and_is_free(found: Look, motorcycle: Pair) -> None:
    assert found.passage is not None
    (u, v), radius = found.passage.centre, found.passage.radius_px
    rows, columns = np.mgrid[:500, :741]
    inside = motorcycle[2][np.hypot(columns - u, rows - v) < 0.9 * radius]
    assert radius > 40
    assert np.mean(inside[np.isfinite(inside)] > found.beyond) > 0.98
    depth = found.passage.position[0]
    assert found.passage.diameter == pytest.approx(2 * radius * depth / 994.978, rel=0.01)
    assert np.sign(found.passage.position[1]) == np.sign(311.193 - u)


def test_exchanged_pictures_are_refused(motorcycle: Pair) -> None:
    rig = StereoRig.parallel(741, 500, 994.978, 0.193001)
    left, right = motorcycle[0], np.roll(motorcycle[1], -31, axis=1)
    look(left, right, rig)
    with pytest.raises(UserError, match=r"exchanged.*give LEFT first"):
        look(right, left, rig)


def test_a_toed_in_pair_is_rectified_first(motorcycle: Pair) -> None:
    """The same pair with the right camera turned a little: warped by hand, undone by the calibration."""
    true = StereoRig.parallel(741, 500, 994.978, 0.193001, cx=311.193, cy=254.877, doffs=31.086)
    turn = cv2.Rodrigues(np.array([0.004, 0.02, 0.006]))[0]
    homography = true.right.matrix @ turn @ np.linalg.inv(true.right.matrix)
    right = cv2.warpPerspective(motorcycle[1], homography, (741, 500))
    translation = tuple((turn @ np.array([-0.193001, 0.0, 0.0])).tolist())
    eye = Camera(741, 500, 994.978, 994.978, 311.193, 254.877)
    rig = StereoRig(eye, true.right, tuple(turn.ravel().tolist()), translation)
    box = OBJECTS["carton on the shelf"]
    sight = look(motorcycle[0], right, rig, box).sights[0]
    u, v = (round(c) for c in box.centre)
    assert sight.distance == pytest.approx(float(motorcycle[2][v, u]), rel=0.02)


def test_the_picture_shows_both_panels_and_leaves_the_input_alone(found: Look) -> None:
    before = found.picture.copy()
    picture = draw(found)
    assert picture.shape[0] == 500 + CAPTION_PX
    assert picture.shape[1] > 2 * 741
    assert picture.dtype == np.uint8
    assert np.array_equal(found.picture, before)
    left, right = picture[:500, :741], picture[:500, 747 : 747 + 741]
    assert np.mean(left == found.picture) > 0.8
    near, far = (right[v, u].astype(int) for u, v in ((395, 240), (150, 60)))
    assert near[1] > far[1] + 50, "near is bright, far is dark"


def test_the_picture_of_a_blank_pair_can_be_drawn_too() -> None:
    blank = np.full((80, 96, 3), 90, np.uint8)
    nothing = look(blank, blank, StereoRig.parallel(96, 80, 100.0, 0.06), Box(30, 30, 20, 20))
    assert nothing.passage is None
    assert nothing.sights[0].distance is None
    assert draw(nothing).shape[0] > 400


@pytest.mark.parametrize(
    ("width", "f", "baseline", "expected"), [(352, 305, 0.06, 96), (741, 995, 0.193, 192), (64, 60, 0.06, 16)]
)
def test_the_search_suits_picture_and_rig(width: int, f: float, baseline: float, expected: int) -> None:
    assert searched_disparities(StereoRig.parallel(width, 48, f, baseline)) == expected


def test_what_was_not_measured_is_not_free() -> None:
    rig = StereoRig.parallel(96, 80, 100.0, 0.06)
    values = np.full((80, 96), 1.0, np.float32)  # 6 m
    valid = np.ones((80, 96), np.bool_)
    valid[:, 60:] = False
    passage = free_passage(Disparity(values, valid, np.full_like(values, 0.1)), rig, 1.5)
    assert passage is not None
    assert passage.centre[0] + passage.radius_px <= 60
    assert passage.diameter == pytest.approx(59 * 0.06, rel=0.05)
    assert free_passage(Disparity(values, np.zeros_like(valid), values), rig, 1.5) is None


# ------------------------------------------------------------------------------------------ the command


def test_the_command_prints_the_range_and_writes_the_picture(
    files: Path, tmp_path: Path, motorcycle: Pair, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "seen.png"
    code = look_at(files / "left.png", files / "right.png", files / "rig.toml", None, "395,195,60,50", out)
    said = capsys.readouterr().out
    distance = float(said.split(": ")[1].split(" m")[0])
    assert code == look_command.DONE
    assert distance == pytest.approx(float(motorcycle[2][220, 425]), rel=0.03)
    assert "+-" in said
    assert "floor: " in said
    assert "way: " in said
    assert cv2.imread(str(out)).shape[0] == 500 + CAPTION_PX
    assert [p.name for p in tmp_path.iterdir()] == ["seen.png"]


def test_no_range_is_exit_code_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blank = np.full((80, 96, 3), 90, np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), blank)
    save_rig(tmp_path / "rig.toml", StereoRig.parallel(96, 80, 100.0, 0.06))
    pair = tmp_path / "a.png", tmp_path / "a.png", tmp_path / "rig.toml"
    assert look_at(*pair, None, "30,30,20,20", tmp_path / "o.png") == look_command.FAILED
    said = capsys.readouterr().out
    assert "no range" in said
    assert "free passage: none" in said
    assert look_at(*pair, None, None, tmp_path / "o.png") == look_command.DONE


def test_a_target_that_is_not_there_is_said(found: Look) -> None:
    nothing = Look(found.picture, found.disparity, found.rig, (), found.passage, found.beyond)
    assert "cup: not in the picture" in look_command.words(nothing, "cup")


def test_bad_requests_are_refused_and_nothing_is_written(files: Path, tmp_path: Path) -> None:
    pair = files / "left.png", files / "right.png", files / "rig.toml"
    (tmp_path / "no.model").write_bytes(b"ROBOT")
    out = tmp_path / "out.png"
    for arguments, words in (
        ((*pair, tmp_path / "no.model", "1,2,3,4", out), "exclude each other"),
        ((*pair, tmp_path / "no.model", None, out), r"no\.model"),
        ((*pair, None, None, tmp_path / "out.gif"), "must end in"),
        ((*pair, None, "800,20,10,10", out), "outside the picture"),
        ((*pair[:2], tmp_path / "none.toml", None, None, out), "no such calibration file"),
        ((tmp_path / "none.png", *pair[1:], None, None, out), "cannot be read"),
        ((pair[2], *pair[1:], None, None, out), "not a picture"),
    ):
        with pytest.raises(UserError, match=words):
            look_at(*arguments)
    assert [p.name for p in tmp_path.iterdir()] == ["no.model"]


def test_pictures_that_are_no_pair_of_this_calibration_are_refused(files: Path, tmp_path: Path) -> None:
    sizes = {"small": (1, 1), "odd": (501, 741), "other": (500, 740)}
    for name, (height, width) in sizes.items():
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.zeros((height, width, 3), np.uint8))
    good, rig, out = files / "left.png", files / "rig.toml", tmp_path / "out.png"
    for left, right, words in (
        ("small", "small", "too small"),
        ("odd", "odd", "calibration is for 741x500"),
        ("other", None, "equal size"),
    ):
        other = good if right is None else tmp_path / f"{right}.png"
        with pytest.raises(UserError, match=words):
            look_at(tmp_path / f"{left}.png", other, rig, None, None, out)
    assert not out.exists()


def test_a_folder_that_is_not_there_is_refused(files: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"cannot be written.*give another --out"):
        look_command.write_picture(tmp_path / "nowhere" / "a.png", np.zeros((4, 4, 3), np.uint8))
