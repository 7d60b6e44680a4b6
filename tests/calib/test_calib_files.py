"""A calibration survives the disk exactly; files that are none are refused in one line with the cure."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib.files import CalibrationError, format_rig, load_rig, parse_rig, save_rig
from calib.model import Camera, StereoRig
from robot.errors import UserError
from robot.rig_file import load_rig as load_rig_for_commands

GOOD = """
[left]
width = 352
height = 288
fx = 305.0
fy = 305
cx = 175.5
cy = 143.5
[right]
width = 352
height = 288
fx = 304.0
fy = 304.5
cx = 176.5
cy = 142.5
distortion = [-0.1, 0.01, 0.0, 0.0, 0.0]
[pair]
translation = [-0.06, 0.001, 0.0]
"""


def turned(degrees: float) -> tuple[float, ...]:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return (float(c), 0.0, float(s), 0.0, 1.0, 0.0, float(-s), 0.0, float(c))


numbers = st.floats(-1e4, 1e4, allow_nan=False)
cameras = st.builds(
    Camera, st.just(640), st.just(480), st.floats(1.0, 1e4), st.floats(1.0, 1e4), numbers, numbers,
    st.sampled_from([0, 4, 5]).flatmap(lambda n: st.tuples(*[st.floats(-1, 1)] * n)),
)  # fmt: skip
rigs = st.builds(
    StereoRig, cameras, cameras, st.floats(-20, 20).map(turned),
    st.tuples(st.floats(-2.0, -0.01), st.floats(-0.005, 0.005), st.floats(-0.005, 0.005)),
)  # fmt: skip


@given(rig=rigs)
@settings(deadline=None, max_examples=60)
def test_what_is_written_reads_back_as_the_same_rig(rig: StereoRig) -> None:
    assert parse_rig(format_rig(rig), "text") == rig


def test_save_and_load(tmp_path: Path) -> None:
    rig = StereoRig.parallel(741, 500, 994.978, 0.193001, cx=311.193, cy=254.877, doffs=31.086)
    save_rig(tmp_path / "rig.toml", rig)
    assert load_rig(tmp_path / "rig.toml") == rig
    assert load_rig_for_commands(tmp_path / "rig.toml") == rig
    assert [p.name for p in tmp_path.iterdir()] == ["rig.toml"]


def test_rotation_and_distortion_may_be_left_out_and_whole_numbers_given() -> None:
    rig = parse_rig(GOOD, "text")
    assert np.array_equal(rig.R, np.eye(3))
    assert rig.left.distortion == ()
    assert rig.left.fy == 305.0
    assert rig.right.distortion[0] == -0.1
    assert rig.doffs == 1.0


def test_a_rotation_rounded_to_four_decimals_is_made_one() -> None:
    rough = ", ".join(f"{c:.4f}" for c in turned(3.0))
    rig = parse_rig(GOOD + f"rotation = [{rough}]\n", "text")
    assert np.allclose(rig.R.T @ rig.R, np.eye(3), atol=1e-12)
    assert np.allclose(rig.R, np.reshape(turned(3.0), (3, 3)), atol=1e-4)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("fx = 305.0", "fx = 0.0", "left.fx"),
        ("fx = 305.0", 'fx = "305"', "left.fx"),
        ("fx = 305.0", "fx = nan", "left.fx"),
        ("cx = 175.5", "cx = inf", "left.cx: must be finite"),
        ("fx = 305.0\n", "", "left: Table missing required field `fx`"),
        ("cx = 175.5", "cx = 175.5\nfocus = 3", "unknown field `focus`"),
        ("width = 352", "width = 0", "left.width"),
        ("width = 352", "width = 640", "the eyes differ in size, 640x288 and 352x288"),
        ("-0.1, 0.01, 0.0, 0.0, 0.0", "-0.1, 0.01", "right.distortion: 2 numbers; give k1"),
        ("[-0.06, 0.001, 0.0]", "[0.06, 0.0, 0.0]", "exchange \\[left\\] and \\[right\\]"),
        ("[-0.06, 0.001, 0.0]", "[-0.01, 0.06, 0.0]", "side by side"),
        ("[-0.06, 0.001, 0.0]", "[0.0, 0.0, 0.0]", "side by side"),
        ("[-0.06, 0.001, 0.0]", "[-0.06, 0.0]", "pair.translation"),
        ("[pair]", "[pair]\nrotation = [1.0, 0, 0, 0, 1.0, 0, 0, 0, -1.0]", "pair.rotation: not a rotation"),
        ("[pair]", "[pair]\nrotation = [2.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0]", "pair.rotation: not a rotation"),
        ("[pair]", "[pair", "not valid TOML"),
        ("[pair]", "[other]", "missing required field `pair`|unknown field `other`"),
    ],
)
def test_a_bad_file_is_refused_in_one_line_that_names_file_and_key(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    path = tmp_path / "bad.toml"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(CalibrationError, match=words) as caught:
        load_rig(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    with pytest.raises(UserError, match=words):
        load_rig_for_commands(path)


def test_what_is_no_readable_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    for path, words in ((tmp_path / "none.toml", "no such calibration file"), (tmp_path, "cannot be read")):
        with pytest.raises(CalibrationError, match=words):
            load_rig(path)
    with pytest.raises(CalibrationError, match="UTF-8"):
        load_rig(tmp_path / "binary.toml")


def test_a_place_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    rig = StereoRig.parallel(352, 288, 305.0, 0.06)
    with pytest.raises(CalibrationError, match="cannot be written"):
        save_rig(tmp_path / "nowhere" / "rig.toml", rig)
    (tmp_path / "folder").mkdir()
    with pytest.raises(CalibrationError, match="cannot be written"):
        save_rig(tmp_path / "folder", rig)
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]
