"""The command line as a person meets it: exit codes, one line that names the cure, nothing half-written."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from io import FileIO
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest

from calib.files import save_rig
from calib.model import StereoRig
from robot import chart, cli, config, model_file
from robot.messages import Image
from robot.vision.textures import texture

COMMANDS = ("chart", "config", "demo", "look", "run", "teach")


class Said(NamedTuple):
    """What a command answered."""

    code: int
    out: str
    err: str


class Shell:
    """Types `robot ...` in an empty folder, in this process."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], folder: Path
    ) -> None:
        self._monkeypatch, self._capsys = monkeypatch, capsys
        self.folder = folder
        monkeypatch.chdir(folder)

    def __call__(self, *words: object) -> Said:
        self._monkeypatch.setattr(sys, "argv", ["robot", *(str(word) for word in words)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        code = ended.value.code
        assert isinstance(code, int)
        return Said(code, *self._capsys.readouterr())

    def refused(self, *words: object) -> str:
        """The one line a command is refused with; what is on disk afterwards is what was there before."""
        before = self.tree()
        said = self(*words)
        assert said.code == 2, said
        assert said.err.count("\n") == 1, said.err
        assert said.out == ""
        assert "Traceback" not in said.err
        assert self.tree() == before
        return said.err

    def tree(self) -> dict[str, bytes | None]:
        """Everything in the folder with its content."""
        return {
            str(path.relative_to(self.folder)): path.read_bytes() if path.is_file() else None
            for path in self.folder.rglob("*")
        }


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Shell:
    """`robot ...` in an empty folder."""
    return Shell(monkeypatch, capsys, tmp_path)


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def picture(path: Path, size: tuple[int, int] = (96, 80), seed: int = 0) -> Path:
    """A picture file of drawn texture."""
    cv2.imwrite(str(path), texture(size, np.random.default_rng(seed)))
    return path


def two_eyes(folder: Path) -> tuple[Path, Path]:
    """A pair that differs: one picture twice is refused for itself."""
    pair = picture(folder / "l.png"), picture(folder / "r.png")
    shifted = np.roll(cv2.imread(str(pair[1])), -3, axis=1)
    cv2.imwrite(str(pair[1]), shifted)
    return pair


def printed(k: int, height: int = 90) -> Image:
    """The k-th look at a label of coloured fields: what a good teaching picture is."""
    fields = np.random.default_rng(50 + k % 3).integers(0, 256, (5, 4, 3), np.uint8)
    big = cv2.resize(np.roll(fields, k, axis=0), (150, 200), interpolation=cv2.INTER_NEAREST)
    small = cv2.resize(big, (round(0.75 * height), height), interpolation=cv2.INTER_AREA)
    return cv2.convertScaleAbs(small, alpha=1.0 - 0.04 * (k % 9))


# -------------------------------------------------------------------------------------------- help, show


def test_help_lists_every_command(robot: Shell) -> None:
    said = robot("--help")
    assert said.code == 0
    assert all(re.search(rf"^  {name} +\S", said.out, re.MULTILINE) for name in COMMANDS), said.out


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(robot: Shell, command: str) -> None:
    said = robot(command, "--help")
    assert said.code == 0
    assert said.out.startswith(f"Usage: robot {command}")


def test_help_needs_nothing_heavy() -> None:
    """A child process, because this one has long imported everything."""
    heavy = "{'numpy', 'cv2', 'mujoco', 'scipy', 'statemachine', 'matplotlib'}"
    code = f"import sys, robot.cli; print({heavy} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_the_chart_is_printed_as_mermaid(robot: Shell) -> None:
    said = robot("chart")
    assert said.code == 0
    assert said.out == chart.mermaid()
    assert "stateDiagram-v2" in said.out


def test_config_show_prints_a_config_that_check_accepts(robot: Shell) -> None:
    shown = robot("config", "show")
    assert shown.code == 0
    path = write(robot.folder / "robot.toml", shown.out)
    assert config.load(path) == config.Config()
    checked = robot("config", "check", path)
    assert (checked.code, checked.out) == (0, f"{path}: valid\n")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[base]\nmax_sped_m_s = 0.1\n", r"base\.max_sped_m_s: unknown key; did you mean 'max_speed_m_s'"),
        ("[base]\nmax_speed_m_s = 20.0\n", r"base\.max_speed_m_s = 20.0 .*number from 0 to 2"),
        ('[cameras]\nwidth_px = "wide"\n', r"cameras\.width_px .*whole number from 64 to 4096"),
        ("[base\n", "not valid TOML"),
    ],
)
def test_a_bad_config_is_named_with_key_and_range(robot: Shell, text: str, words: str) -> None:
    path = write(robot.folder / "bad.toml", text)
    for command in (("config", "check", path), ("run", "--config", path)):
        said = robot.refused(*command)
        assert re.search(words, said)
        assert str(path) in said


def test_a_missing_config_says_how_to_get_one(robot: Shell) -> None:
    assert "robot config show" in robot.refused("config", "check", "none.toml")


# ------------------------------------------------------------------------------------------- mistyped words


@pytest.mark.parametrize(
    ("words", "cure"),
    [
        (("run", "--simm", "standing"), "--sim"),
        (("fly",), "robot --help"),
        (("run", "--seed", "three"), "robot run --help"),
        (("run", "--slow", "0"), "0.1<=x<=20"),
        (("look", "a.png", "b.png"), "--calib"),
        (("teach", "--from", "x"), "--name"),
        (("run",), "--config FILE"),
        (("run", "--config", "robot.toml", "--wire"), "--sim"),
        (("run", "--sim", "standing", "--wire", "--slow", "2"), "in real time"),
        (("teleop", "/dev/tty-none"), "terminal"),
        (("run", "--sim", "standing", "--duration", "3"), "duration_s"),
    ],
)
def test_a_mistyped_command_is_answered_in_one_line(robot: Shell, words: tuple[str, ...], cure: str) -> None:
    assert cure in robot.refused(*words)


@pytest.mark.parametrize(
    ("fault", "cure"),
    [
        ("camera", "DEVICE.KIND@TIME"),
        ("camera.black", "DEVICE.KIND@TIME"),
        ("camera.black@soon", "DEVICE.KIND@TIME"),
        ("camera.black@1.2.3", "DEVICE.KIND@TIME"),
        ("camera.black@-1", "DEVICE.KIND@TIME"),
        ("camera.melted@1", "camera.black"),
        ("toaster.hot@1", "camera.black"),
        ("camera.black@1:0", "duration > 0"),
    ],
)
def test_a_fault_that_cannot_be_ordered_is_explained(robot: Shell, fault: str, cure: str) -> None:
    said = robot.refused("run", "--sim", "standing", "--fault", fault)
    assert cure in said
    assert repr(fault) in said


# ---------------------------------------------------------------------------------------------- scenes


SCENE = """
duration_s = 2.0
[target]
object = "box"
x = 2.1
y = 0.0
"""


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[target]\ncolour = 'red'\n", r"target: unknown key 'colour'; allowed: .*object"),
        ("durations = 3\n", "unknown key 'durations'; allowed: .*duration_s"),
        ("duration_s = 0.1\n", "duration_s"),
        ('[[obstacles]]\nshape = "cone"\nx = 1.0\ny = 0.0\n', r"obstacles\[0\]\.shape"),
        ("[target\n", "TOML"),
    ],
)
def test_a_bad_scene_is_named_with_key_and_what_is_allowed(robot: Shell, text: str, words: str) -> None:
    path = write(robot.folder / "bad.toml", text)
    said = robot.refused("run", "--sim", path)
    assert re.search(words, said), said
    assert "bad.toml" in said


def test_overlapping_bodies_are_named_and_leave_no_run_behind(robot: Shell, box_model: Path) -> None:
    block = '[[obstacles]]\nshape = "block"\nx = 2.1\ny = 0.0\n'
    path = write(robot.folder / "crowded.toml", SCENE + block)
    give(robot, box_model)
    said = robot.refused("run", "--sim", path)
    assert "overlap" in said
    assert "'crowded'" in said


def test_an_unknown_scene_is_answered_with_the_known_ones(robot: Shell) -> None:
    assert "standing" in robot.refused("run", "--sim", "livingroom")
    assert "no such scene file" in robot.refused("run", "--sim", "livingroom.toml")


def test_a_bad_config_for_a_simulated_run_leaves_no_run_behind(robot: Shell, box_model: Path) -> None:
    give(robot, box_model)
    scene = write(robot.folder / "short.toml", SCENE)
    bad = write(robot.folder / "bad.toml", "[base]\nwheels = 3\n")
    assert "base.wheels: unknown key" in robot.refused("run", "--sim", scene, "--config", bad)


# --------------------------------------------------------------------------------------------- model files


def give(robot: Shell, model: Path) -> Path:
    """Put the taught box where simulated runs look for it."""
    (robot.folder / "models").mkdir(exist_ok=True)
    return Path(shutil.copy(model, robot.folder / "models" / "box.model"))


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda data: data[:-100], "cut short"),
        (lambda data: data[:8] + b"\x07\x00" + data[10:], "version 7"),
        (lambda data: b"PK\x03\x04" + data[4:], "no model"),
        (lambda data: b"", "cut short"),
    ],
)
def test_an_unfit_model_stops_every_command_that_needs_it(
    robot: Shell, box_model: Path, spoil: object, words: str
) -> None:
    assert callable(spoil)
    path = give(robot, box_model)
    path.write_bytes(spoil(path.read_bytes()))
    scene = write(robot.folder / "short.toml", SCENE)
    settings = write(robot.folder / "robot.toml", f'[vision]\nmodel = "{path}"\n')
    rig = robot.folder / "rig.toml"
    save_rig(rig, StereoRig.parallel(96, 80, 100.0, 0.06))
    pair = picture(robot.folder / "l.png"), picture(robot.folder / "r.png")
    for command in (
        ("run", "--sim", scene),
        ("run", "--config", settings),
        ("look", *pair, "--calib", rig, "--target", path),
    ):
        said = robot.refused(*command)
        assert words in said
        assert "box.model" in said
        assert "robot teach" in said


# ------------------------------------------------------------------------------------------- hardware


def settings_file(robot: Shell, box_model: Path, more: str) -> Path:
    return write(robot.folder / "robot.toml", f'[vision]\nmodel = "{box_model}"\n{more}')


def test_hardware_without_a_model_says_how_to_get_one(robot: Shell) -> None:
    path = write(robot.folder / "robot.toml", "")
    said = robot.refused("run", "--config", path)
    assert "vision.model" in said
    assert "robot teach" in said


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('[base]\ndriver = "nxt-usb"\n', "config key base: "),
        ('[base]\ndriver = "nxt-serial"\n', "base.port is empty"),
        ('[base]\ndriver = "nxt-serial"\nport = "/dev/no-such-port"\n', "/dev/no-such-port"),
        ('[cameras]\ndriver = "folder"\n', "cameras.left"),
        ('[cameras]\ndriver = "folder"\nleft = "nowhere"\n', "nowhere is not a folder"),
        ('[base]\ndriver = "tank"\n', "mock, nxt-usb, nxt-serial, none"),
    ],
)
def test_a_device_that_is_not_there_is_named_with_its_config_key(
    robot: Shell, box_model: Path, more: str, words: str
) -> None:
    assert words in robot.refused("run", "--config", settings_file(robot, box_model, more))


def test_a_calibration_that_is_missing_or_for_other_pictures_is_refused(
    robot: Shell, box_model: Path
) -> None:
    path = settings_file(robot, box_model, '[cameras]\ncalibration = "rig.toml"\n')
    assert "rig.toml: no such calibration file" in robot.refused("run", "--config", path)
    save_rig(robot.folder / "rig.toml", StereoRig.parallel(640, 480, 500.0, 0.06))
    said = robot.refused("run", "--config", path)
    assert "640x480" in said
    assert "352x288" in said


# ------------------------------------------------------------------------------------------------ look


@pytest.fixture
def rig(robot: Shell) -> Path:
    """Calibration of a pair of 96 x 80 pixels."""
    path = robot.folder / "rig.toml"
    save_rig(path, StereoRig.parallel(96, 80, 100.0, 0.06))
    return path


def test_look_needs_a_calibration(robot: Shell) -> None:
    pair = picture(robot.folder / "l.png"), picture(robot.folder / "r.png")
    assert "none.toml: no such calibration file" in robot.refused("look", *pair, "--calib", "none.toml")
    assert "give the path" in robot.refused("look", *pair, "--calib", "none.toml")


def test_look_refuses_pictures_it_cannot_use(robot: Shell, rig: Path) -> None:
    good = picture(robot.folder / "good.png")
    cut = robot.folder / "cut.png"
    cut.write_bytes(good.read_bytes()[:60])
    words = write(robot.folder / "words.png", "not a picture")
    larger = picture(robot.folder / "larger.png", (128, 80))
    odd = picture(robot.folder / "odd.png", (97, 81))
    tiny = picture(robot.folder / "tiny.png", (20, 16))
    for bad in (cut, words):
        assert f"{bad}: not a picture" in robot.refused("look", bad, good, "--calib", rig)
        assert f"{bad}: not a picture" in robot.refused("look", good, bad, "--calib", rig)
    assert "none.png: cannot be read" in robot.refused("look", "none.png", good, "--calib", rig)
    assert "equal size" in robot.refused("look", good, larger, "--calib", rig)
    assert "calibration is for 96x80" in robot.refused("look", odd, odd, "--calib", rig)
    assert "too small" in robot.refused("look", tiny, tiny, "--calib", rig)


@pytest.mark.parametrize("box", ["", "1,2,3", "1,2,3,x", "1,2,0,4", "1,2,nan,4", "1,2,-3,4", "900,2,10,10"])
def test_look_refuses_a_box_that_is_none(robot: Shell, rig: Path, box: str) -> None:
    pair = two_eyes(robot.folder)
    assert "--box" in robot.refused("look", *pair, "--calib", rig, "--box", box)


def test_look_refuses_a_picture_name_it_cannot_write(robot: Shell, rig: Path) -> None:
    pair = two_eyes(robot.folder)
    assert "--out" in robot.refused("look", *pair, "--calib", rig, "--out", "look.txt")
    assert "--out" in robot.refused("look", *pair, "--calib", rig, "--out", "nowhere/look.png")


# ----------------------------------------------------------------------------------------------- teach


def lesson(folder: Path, count: int, blur: float = 0.0, height: int = 90) -> Path:
    """A folder of teaching pictures."""
    folder.mkdir()
    for k in range(count):
        view = printed(k, height)
        if blur:
            view = cv2.GaussianBlur(view, (0, 0), blur * view.shape[0])
        cv2.imwrite(str(folder / f"{k:02d}.png"), view)
    return folder


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        ({"count": 3}, "3 of 3 views can be used, 8 are needed"),
        ({"count": 9, "blur": 0.125}, "9 blurred"),
        ({"count": 9, "height": 20}, "9 smaller than 24 px"),
    ],
)
def test_teach_refuses_views_it_cannot_learn_from(robot: Shell, spoilt: dict[str, int], words: str) -> None:
    folder = lesson(robot.folder / "views", **spoilt)
    (robot.folder / "models").mkdir()
    said = robot.refused("teach", "--from", folder, "--name", "label")
    assert words in said
    assert "take more pictures" in said


def test_teach_refuses_sources_names_and_places(robot: Shell) -> None:
    (robot.folder / "models").mkdir()
    folder = lesson(robot.folder / "views", 9)
    empty = robot.folder / "empty"
    empty.mkdir()
    film = write(robot.folder / "film.avi", "no film")
    assert "holds no pictures" in robot.refused("teach", "--from", empty, "--name", "x")
    assert "no such scene" in robot.refused("teach", "--from", "nothing", "--name", "x")
    assert "--box" in robot.refused("teach", "--from", film, "--name", "x")
    assert "--box" in robot.refused("teach", "--from", film, "--name", "x", "--box", "1,2,3")
    assert "no readable video" in robot.refused("teach", "--from", film, "--name", "x", "--box", "1,2,30,40")
    assert "--name" in robot.refused("teach", "--from", folder, "--name", "../x")
    assert "--name" in robot.refused("teach", "--from", folder, "--name", "")
    assert "--out" in robot.refused("teach", "--from", folder, "--name", "x", "--out", "nowhere/x.model")
    assert "--out" in robot.refused("teach", "--from", folder, "--name", "x", "--out", "x.png")


@pytest.mark.usefixtures("short_lessons")
def test_teach_writes_a_model_its_picture_and_what_was_learnt(robot: Shell) -> None:
    said = robot("teach", "--from", lesson(robot.folder / "views", 9), "--name", "label")
    assert said.code == 0
    assert "label: 9 views used" in said.err
    model = model_file.load(Path("models/label.model"))
    assert (model.name, model.views) == ("label", 9)
    assert cv2.imread("models/label.png") is not None


# ------------------------------------------------------------------------------------- simulated runs


def test_a_simulated_run_reports_json_and_leaves_its_folder(robot: Shell, box_model: Path) -> None:
    give(robot, box_model)
    scene = write(robot.folder / "short.toml", SCENE)
    said = robot("run", "--sim", scene, "--seed", 2, "--json", "--video")
    report = json.loads(said.out)
    assert said.code == (0 if report["success"] else 1)
    assert "Mission failed" in said.err, "two seconds are not enough to get there"
    assert report["reason"] in " ".join(said.err.split())
    needed = {
        "success", "reason", "seed", "scene", "found_s", "range_error_median", "in_view", "at_distance",
        "spl", "collisions", "clearance_min", "false_detections", "tick_ms", "version",
    }  # fmt: skip
    assert needed <= report.keys()
    assert (report["scene"], report["seed"], report["duration_s"]) == ("short", 2, 2.0)
    folder = Path("runs/latest")
    assert {path.name for path in folder.iterdir()} == {
        "events.jsonl", "report.json", "run.mp4", "trajectory.png",
    }  # fmt: skip
    assert json.loads((folder / "report.json").read_text())["reason"] == report["reason"]
    events = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]
    assert events[0]["kind"] == "transition"
    assert [event["t"] for event in events if event["kind"] == "status"] == [1.0, 2.0]


def test_a_full_disk_ends_the_record_but_not_the_run(
    robot: Shell, box_model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    give(robot, box_model)
    scene = write(robot.folder / "short.toml", SCENE)
    whole = json.loads(robot("run", "--sim", scene, "--json").out)
    lines = Path("runs/latest/events.jsonl").read_bytes().splitlines(keepends=True)

    class Disk(FileIO):
        """Full after the second event and a half."""

        left = len(lines[0]) + len(lines[1]) + 10

        def write(self, data: bytes, /) -> int:  # type: ignore[override]
            if Disk.left <= 0:
                raise OSError(28, "No space left on device")
            taken = super().write(data[: Disk.left])
            Disk.left -= taken
            return taken

    monkeypatch.setattr("robot.record.run_folder.FileIO", Disk)
    said = robot("run", "--sim", scene, "--json")
    report = json.loads(said.out)
    assert {**report, "tick_ms": 0, "folder": 0} == {
        **whole, "tick_ms": 0, "folder": 0,
        "recording_stopped_at": json.loads(lines[2])["t"],
        "recording_stopped_reason": "No space left on device",
    }  # fmt: skip
    written = json.loads(Path("runs/latest/report.json").read_text())
    assert written["recording_stopped_at"] == report["recording_stopped_at"]
    assert Path("runs/latest/events.jsonl").read_bytes() == lines[0] + lines[1]


def test_a_run_that_cannot_be_recorded_from_the_start_is_refused(robot: Shell, box_model: Path) -> None:
    give(robot, box_model)
    write(robot.folder / "runs", "in the way")
    scene = write(robot.folder / "short.toml", SCENE)
    assert "choose a writable folder" in robot.refused("run", "--sim", scene)


def test_several_runs_are_a_list_and_a_table(robot: Shell, box_model: Path) -> None:
    give(robot, box_model)
    scene = write(robot.folder / "short.toml", SCENE.replace("2.0", "1.0"))
    said = robot("run", "--sim", scene, "--seeds", 2, "--jobs", 2, "--json")
    runs = json.loads(said.out)["runs"]
    assert [run["seed"] for run in runs] == [1, 2]
    assert said.code == 1
    assert "0/2" in said.err
    assert len({run["folder"] for run in runs}) == 2
