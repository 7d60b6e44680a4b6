"""The real-time run: opens what the config names, ticks until told to stop, leaves the wheels standing."""

from __future__ import annotations

import io
import json
import signal
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest
from rich.console import Console

from calib.files import save_rig
from calib.model import StereoRig
from robot import run_hardware as run
from robot.clock import Clock
from robot.config import Config
from robot.errors import UserError
from robot.hal.factory import Hardware, open_hardware
from robot.hal.mock import MockBase
from robot.messages import Event, Fault, HeadPose, Intent, Odometry, Percepts, Sent, Tick, Transition, Twist
from robot.vision.textures import texture

PLAIN = Tick(
    0.5, "idle", None, Percepts(), Odometry(), HeadPose(), Intent(), Sent(Twist(), None, 0.0), (), ()
)


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[Hardware]:
    """All hardware that a test's runs open."""
    kept: list[Hardware] = []

    def keep(config: Config, clock: Clock) -> Hardware:
        kept.append(open_hardware(config, clock))
        return kept[-1]

    monkeypatch.setattr(run, "open_hardware", keep)
    return kept


def config_file(folder: Path, model: Path, more: str = "") -> Path:
    path = folder / "robot.toml"
    path.write_text(f'[vision]\nmodel = "{model}"\n{more}')
    return path


def record(root: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """report.json and events.jsonl of the newest run."""
    newest = root / "latest"
    lines = (newest / "events.jsonl").read_text().splitlines()
    return json.loads((newest / "report.json").read_text()), [json.loads(line) for line in lines]


def base_of(hardware: Hardware) -> MockBase:
    assert isinstance(hardware.base, MockBase)
    return hardware.base


# ------------------------------------------------------------------------------------------- whole runs


def test_a_run_on_mock_devices_ends_after_its_duration_with_everything_closed(
    tmp_path: Path, box_model: Path, opened: list[Hardware], capsys: pytest.CaptureFixture[str]
) -> None:
    """The mock camera shows one picture for ever: the robot notices, and does not begin autonomy on it."""
    path = config_file(tmp_path, box_model, "[mission]\narmed_at_start = true\n")
    begun = time.monotonic()
    code = run.run_until(threading.Event(), path, tmp_path / "runs", 0.6)
    assert code == 0
    assert 0.6 <= time.monotonic() - begun < 10.0
    report, events = record(tmp_path / "runs")
    assert report["success"] is True
    assert report["duration_s"] >= 0.5
    assert {"median", "p99"} == report["tick_ms"].keys()
    assert [event["fault"] for event in events if event["kind"] == "fault raised"] == ["camera.frozen"]
    base = base_of(opened[0])
    assert base.closed
    assert {call.method for call in base.calls} == {"read", "send", "stop"}
    assert all(call.args[0].is_zero for call in base.calls if call.method == "send"), "bad eyes never drive"
    said = capsys.readouterr().err
    assert "camera.frozen" in said
    assert "unplug and replug the cameras" in said, "the cure"


def folder_of_pairs(folder: Path, sizes: list[tuple[int, int]]) -> Path:
    folder.mkdir()
    for k, (width, height) in enumerate(sizes):
        wall = texture((width + 12, height), np.random.default_rng(k))
        cv2.imwrite(str(folder / f"left_{k:03d}.png"), wall[:, :width])
        cv2.imwrite(str(folder / f"right_{k:03d}.png"), wall[:, 12:])
    return folder


def test_a_fault_that_halts_ends_with_code_3_and_its_cure(
    tmp_path: Path, box_model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pairs = folder_of_pairs(tmp_path / "pairs", [(352, 288), (320, 240)])
    path = config_file(tmp_path, box_model, f'[cameras]\ndriver = "folder"\nleft = "{pairs}"\n')
    assert run.run_until(threading.Event(), path, tmp_path / "runs", 0.5) == 3
    report, events = record(tmp_path / "runs")
    assert (report["success"], report["state"]) == (False, "halted")
    assert "size" in report["reason"]
    assert any(event["kind"] == "transition" and event["to"] == "halted" for event in events)
    assert "cameras.width_px" in capsys.readouterr().err


def test_a_drill_on_mocks_is_told_and_judged_by_the_table(
    tmp_path: Path, box_model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = config_file(tmp_path, box_model)
    assert run.run_until(threading.Event(), path, tmp_path / "runs", 0.5, ["base.stranded@0.1"]) == 3
    assert "switch the brick off" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("drill", "words"),
    [
        ("base.stall@1", r"base\.driver is 'none'; only mocks and simulated ones break"),
        ("base.tired@1", r"no such fault; there are: "),
        ("base", r"write DEVICE\.KIND@TIME"),
    ],
)
def test_a_drill_that_cannot_be_held_is_refused(
    tmp_path: Path, box_model: Path, drill: str, words: str
) -> None:
    path = config_file(tmp_path, box_model, '[base]\ndriver = "none"\n')
    with pytest.raises(UserError, match=words):
        run.run_until(threading.Event(), path, tmp_path / "runs", 0.5, [drill])


def test_being_told_to_stop_at_once_ticks_not_even_once(
    tmp_path: Path, box_model: Path, opened: list[Hardware]
) -> None:
    stop = threading.Event()
    stop.set()
    assert run.run_until(stop, config_file(tmp_path, box_model), tmp_path / "runs", None) == 0
    assert base_of(opened[0]).closed
    assert not [call for call in base_of(opened[0]).calls if call.method == "send"]


def test_an_error_in_a_tick_stops_and_closes_everything(
    tmp_path: Path, box_model: Path, opened: list[Hardware], monkeypatch: pytest.MonkeyPatch
) -> None:
    def breaks(*_: object) -> list[float]:
        raise ZeroDivisionError

    monkeypatch.setattr(run, "tick_until", breaks)
    with pytest.raises(ZeroDivisionError):
        run.run_until(threading.Event(), config_file(tmp_path, box_model), tmp_path / "runs", None)
    base = base_of(opened[0])
    assert base.closed
    assert not [call for call in base.calls if call.method == "send" and not call.args[0].is_zero]


def test_a_record_that_cannot_begin_closes_the_devices_again(
    tmp_path: Path, box_model: Path, opened: list[Hardware]
) -> None:
    (tmp_path / "runs").write_text("in the way")
    with pytest.raises(UserError, match="writable folder"):
        run.run_until(threading.Event(), config_file(tmp_path, box_model), tmp_path / "runs", 0.2)
    assert base_of(opened[0]).closed


# ---------------------------------------------------------------------------------------------- signals


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_asks_for_the_stop_and_means_later_what_it_meant_before(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    stop = threading.Event()
    with run.stopped_by_signals(stop):
        signal.raise_signal(number)
        assert stop.is_set()
    assert signal.getsignal(number) is before


class Counting:
    """A loop that asks for the stop at a tick."""

    def __init__(self, stop: threading.Event, last: int) -> None:
        self._stop, self._last = stop, last
        self.ticks = 0

    def tick(self) -> Tick:
        self.ticks += 1
        if self.ticks == self._last:
            self._stop.set()
        return PLAIN


def test_no_tick_follows_the_stop() -> None:
    stop = threading.Event()
    loop = Counting(stop, 3)
    assert len(run.tick_until(loop, stop, None)) == 3
    assert loop.ticks == 3


def test_ticks_come_at_the_steady_rate() -> None:
    stop = threading.Event()
    begun = time.monotonic()
    run.tick_until(Counting(stop, 6), stop, None)
    assert time.monotonic() - begun >= 5 * run.PERIOD - 0.005, "never faster"


def test_the_duration_ends_it_too() -> None:
    stop = threading.Event()
    ticks = len(run.tick_until(Counting(stop, -1), stop, 0.2))
    assert 1 <= ticks <= 6
    assert not stop.is_set()


# ------------------------------------------------------------------------------------------- calibration


def with_calibration(path: Path) -> Config:
    plain = Config()
    cameras = msgspec.structs.replace(plain.cameras, calibration=str(path))
    return msgspec.structs.replace(plain, cameras=cameras)


def test_the_calibrated_pair_is_used_where_there_is_one(tmp_path: Path) -> None:
    assert run.rig_of(Config()).baseline == pytest.approx(0.06)
    path = tmp_path / "rig.toml"
    save_rig(path, StereoRig.parallel(352, 288, 320.0, 0.071))
    rig = run.rig_of(with_calibration(path))
    assert (rig.left.fx, rig.baseline) == pytest.approx((320.0, 0.071))


@pytest.mark.parametrize("text", ["", "[left]\n", "no toml ["])
def test_an_unfit_calibration_is_the_users_to_mend(tmp_path: Path, text: str) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(text)
    with pytest.raises(UserError, match=r"rig\.toml"):
        run.rig_of(with_calibration(path))


# ------------------------------------------------------------------------------------------- what is said


def test_changes_are_announced_once_with_reason_and_cure() -> None:
    out = io.StringIO()
    announce = run.Announcer(Console(file=out, width=200))
    stall = Fault("base", "stall", 0.4, "port [B]")
    seen = Transition("search", "recognize", Event("candidate_seen", "something red"))
    announce(replace(PLAIN, state="recognize", transitions=(seen,)))
    announce(replace(PLAIN, state="recognize", faults=(stall,)))
    announce(replace(PLAIN, state="recognize", faults=(stall,)))
    announce(replace(PLAIN, state="recognize"))
    first, second, third = out.getvalue().splitlines()
    assert first.endswith("search -> recognize: something red")
    assert "base.stall" in second
    assert "port [B]" in second, "brackets are no markup"
    assert "free it" in second
    assert third.endswith("base.stall is over")
    assert (announce.state, announce.reason, announce.halted) == ("recognize", "something red", False)
    announce(replace(PLAIN, state="halted"))
    assert announce.halted
