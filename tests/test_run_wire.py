"""Robot and world in two processes, in real time: whole runs, and what happens when the robot is told to stop
or killed while it drives."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from robot.config import Config
from robot.errors import UserError
from robot.run_recorded import SimJob
from robot.run_sim import SimOptions
from robot.run_wire import run_wire, wired
from robot.sim.injected import InjectedFault
from robot.sim.scene import load_scene
from robot.sim.wire.launch import StartedWorld, start_world
from robot.sim.wire.messages import Addresses

DEADLINE_S = 40.0
NEAR = """
title = "The target stands before the robot, at the distance to keep"
duration_s = 30.0
hold_s = 0.4
stand_off_m = 1.4
mirror = false
[robot]
x = 0.9
heading_deg = 0.0
[target]
object = "box"
x = 2.3
y = 0.0
heading_deg = 180.0
"""
FAR = (
    NEAR.replace("hold_s = 0.4", "hold_s = 20.0")
    .replace("stand_off_m = 1.4", "stand_off_m = 0.5")
    .replace("x = 2.3", "x = 4.0")
)
LEAD_AND_COASTING_S = 0.6


def scene_file(folder: Path, text: str) -> str:
    path = folder / "near.toml"
    path.write_text(text)
    return str(path)


def wait_for(condition: Callable[[], bool], within_s: float = DEADLINE_S) -> None:
    until = time.monotonic() + within_s
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.005)


# ----------------------------------------------------------------------------------------------- whole runs


def test_a_mission_over_the_wire_ends_with_the_report_of_lockstep_and_its_own_figures(
    tmp_path: Path, box_model: Path
) -> None:
    job = SimJob(scene_file(tmp_path, NEAR), 1, box_model)
    told: list[tuple[float, str]] = []
    report = run_wire(
        job, tmp_path / "runs", datetime.now(), lambda share, words: told.append((share, words))
    )
    assert report["success"], report
    assert report["collisions"] == 0
    assert report["range_samples"] > 0
    assert report["range_error_median"] < 0.05, "claims were matched with the pictures they speak of"
    wire = report["wire"]
    assert wire["ticks"] > 25
    assert wire["world_ticks"] > 25
    assert wire["unmatched_claims"] <= 1
    assert "stopped" not in report
    folder = Path(report["folder"])
    assert json.loads((folder / "report.json").read_text()) == report
    assert (folder / "trajectory.png").stat().st_size > 10_000
    kinds = {json.loads(line)["kind"] for line in (folder / "events.jsonl").read_text().splitlines()}
    assert {"transition", "target found"} <= kinds
    assert told
    assert all(0.0 < share <= 1.0 for share, _ in told)


@pytest.mark.parametrize(
    "job",
    [
        SimJob("no-such-scene", 1, Path("x.model")),
        SimJob("standing", 1, Path("no-such.model")),
        SimJob("standing", 1, Path("x.model"), video=True),
        SimJob("standing", 1, Path("x.model"), SimOptions(slow=2.0)),
    ],
)
def test_what_cannot_be_run_is_refused_before_anything_starts(job: SimJob, tmp_path: Path) -> None:
    with pytest.raises(UserError):
        run_wire(job, tmp_path / "runs", datetime.now())
    assert not (tmp_path / "runs").exists()


def test_every_driver_is_a_real_one_at_the_worlds_addresses() -> None:
    config = wired(Config(), Addresses("/b", "/t", "http://h:1", "http://h:2", "h:3"))
    assert (config.cameras.driver, config.cameras.left) == ("http", "http://h:1/?action=stream")
    assert config.cameras.right == "http://h:2/?action=stream"
    assert (config.head.driver, config.head.device) == ("uvc", config.cameras.left)
    assert (config.base.driver, config.base.port) == ("nxt-serial", "/b")
    assert (config.lamp.driver, config.lamp.device) == ("modbus", "h:3")
    assert (config.teleop.driver, config.teleop.port) == ("serial", "/t")
    assert config.arm.driver == "none"


# ------------------------------------------------------------------- the robot in a process of its own

ATTACHED = """
import sys, threading
from multiprocessing.connection import Connection
from pathlib import Path
from robot import model_file
from robot.config import Config
from robot.run_hardware import stopped_by_signals
from robot.run_sim import armed
from robot.run_wire import WireRobot, wired
from robot.sim.scene import load_scene
from robot.sim.wire.launch import WorldChannel

world = WorldChannel(Connection(int(sys.argv[1])))
scene = load_scene(sys.argv[2])
config = wired(armed(Config(), scene, 1), world.addresses)
stop = threading.Event()
with stopped_by_signals(stop):
    robot = WireRobot(config, model_file.load(Path(sys.argv[3])), world)
    world.begin()
    robot.run(stop, [], [])
    robot.close()
"""


def driving_robot(world: StartedWorld, scene: str, model: Path) -> subprocess.Popen[bytes]:
    """A robot in a process of its own; a person drives it ahead, both wheels turning."""
    descriptor = world.spare[0].fileno()
    command = [sys.executable, "-c", ATTACHED, str(descriptor), scene, str(model)]
    robot = subprocess.Popen(command, pass_fds=[descriptor])
    world.spare[0].close()

    def drives() -> bool:
        assert robot.poll() is None, "it ended by itself"
        truth = world.truth()
        world.type_keys(b"i" if b"you drive" in truth.heard else b"t")
        time.sleep(0.1)
        return min(truth.wheels) > 1.5

    wait_for(drives)
    return robot


def stood_after(world: StartedWorld, since: float) -> float:
    """Seconds of the world's time from `since` until both wheels stood for good."""
    begun = world.truth().now
    wait_for(lambda: world.truth().now > begun + 1.5)
    speeds = world.trace().wheels
    then = next(speed.now for speed in speeds if speed.at >= since)
    return max(speed.now for speed in speeds if max(abs(speed.left), abs(speed.right)) > 0.1) - then


def test_a_robot_killed_while_it_drives_stands_within_lead_and_coasting(
    tmp_path: Path, box_model: Path
) -> None:
    """SIGKILL: nobody stops the wheels but their tacho limit."""
    scene = scene_file(tmp_path, FAR)
    with start_world(load_scene(scene), 1, spare_channels=1) as world:
        robot = driving_robot(world, scene, box_model)
        killed = time.monotonic()
        robot.kill()
        robot.wait()
        assert 0.0 < stood_after(world, killed) <= LEAD_AND_COASTING_S
        assert not [telegram for telegram in world.trace().telegrams if telegram.at > killed + 0.1]


def test_a_robot_told_to_stop_leaves_wheels_standing_lamp_off_and_is_gone_within_a_second(
    tmp_path: Path, box_model: Path
) -> None:
    scene = scene_file(tmp_path, FAR)
    with start_world(load_scene(scene), 1, spare_channels=1) as world:
        robot = driving_robot(world, scene, box_model)
        told = time.monotonic()
        robot.send_signal(signal.SIGTERM)
        assert robot.wait(DEADLINE_S) == 0
        assert time.monotonic() - told < 1.0
        assert stood_after(world, told) < 1.0
        stops = [
            telegram.at for telegram in world.trace().telegrams if telegram.stops and telegram.at >= told
        ]
        assert stops
        assert stops[0] - told < 0.5
        assert world.truth().lamp == 0.0


# --------------------------------------------------------------------- the whole command, world included

COMMAND = """
import sys
import threading
from datetime import datetime
from pathlib import Path
from robot.run_hardware import stopped_by_signals
from robot.run_recorded import SimJob
from robot.run_wire import run_wire

stop = threading.Event()
with stopped_by_signals(stop):
    job = SimJob(sys.argv[1], 1, Path(sys.argv[2]))
    report = run_wire(job, Path(sys.argv[3]), datetime.now(), stop=stop)
assert report["stopped"], report
"""


def children(pid: int) -> list[int]:
    """Processes this one started."""
    listed = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(number) for file in listed for number in file.read_text().split()]


def running(pid: int) -> bool:
    try:
        return ") Z " not in Path(f"/proc/{pid}/stat").read_text()
    except FileNotFoundError:
        return False


@pytest.fixture
def command(tmp_path: Path, box_model: Path) -> subprocess.Popen[bytes]:
    """A run over the wire, under way and driving."""
    arguments = [scene_file(tmp_path, FAR), str(box_model), str(tmp_path / "runs")]
    process = subprocess.Popen([sys.executable, "-c", COMMAND, *arguments])
    events = tmp_path / "runs" / "latest" / "events.jsonl"

    def drives() -> bool:
        assert process.poll() is None, "it ended by itself"
        text = events.read_text() if events.exists() else ""
        return bool(re.search(r'"kind":"status".*"v":0\.[01]*[1-9]', text))

    wait_for(drives)
    return process


@pytest.mark.slow
def test_sigterm_ends_the_whole_command_within_a_second_with_its_record_closed(
    command: subprocess.Popen[bytes], tmp_path: Path
) -> None:
    worlds = children(command.pid)
    assert len(worlds) == 1
    told = time.monotonic()
    command.send_signal(signal.SIGTERM)
    assert command.wait(DEADLINE_S) == 0
    assert time.monotonic() - told < 1.0
    report = json.loads((tmp_path / "runs" / "latest" / "report.json").read_text())
    assert report["stopped"] is True
    for line in (tmp_path / "runs" / "latest" / "events.jsonl").read_text().splitlines():
        json.loads(line)
    wait_for(lambda: not running(worlds[0]))


@pytest.mark.slow
def test_sigkill_of_the_whole_command_leaves_no_process_behind(command: subprocess.Popen[bytes]) -> None:
    worlds = children(command.pid)
    assert len(worlds) == 1
    command.kill()
    command.wait()
    wait_for(lambda: not running(worlds[0]))


# ---------------------------------------------------------------------------------------------------- faults


@pytest.mark.slow
def test_an_ordered_fault_is_met_by_the_drivers_and_the_mission_goes_on(
    tmp_path: Path, box_model: Path
) -> None:
    faults = (InjectedFault("camera", "link", 1.0, 1.0), InjectedFault("base", "silent", 4.0, 0.8))
    text = NEAR.replace("hold_s = 0.4", "hold_s = 5.0")
    job = SimJob(scene_file(tmp_path, text), 1, box_model, SimOptions(faults=faults))
    report = run_wire(job, tmp_path / "runs", datetime.now())
    assert report["success"], report
    events = (Path(report["folder"]) / "events.jsonl").read_text().splitlines()
    raised: dict[str, Any] = {}
    for event in map(json.loads, events):
        if event["kind"] == "fault raised":
            raised.setdefault(event["fault"], event["t"])
    assert {"camera.link", "base.link"} <= raised.keys()


@pytest.mark.slow
def test_a_stop_before_the_first_tick_ends_it_at_once(tmp_path: Path, box_model: Path) -> None:
    stop = threading.Event()
    stop.set()
    report = run_wire(SimJob("standing", 1, box_model), tmp_path / "runs", datetime.now(), stop=stop)
    assert report["stopped"] is True
    assert report["wire"]["ticks"] <= 1
    assert os.path.lexists(tmp_path / "runs" / "latest")
