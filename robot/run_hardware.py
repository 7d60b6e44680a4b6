"""The robot on its own hardware, in real time: opens what the config names and ticks until told to stop."""

from __future__ import annotations

import signal
import threading
import time
from datetime import datetime
from pathlib import Path

from rich.console import Console

from calib.files import load_rig
from robot import faults, model_file
from robot.app import build_loop, build_perception, nominal_rig
from robot.clock import MonotonicClock
from robot.config import Config, load
from robot.errors import UserError
from robot.hal.factory import open_hardware
from robot.loop import Devices, Loop
from robot.messages import Fault, Tick
from robot.record.recorder import Recorder
from robot.record.run_folder import RunFolder
from robot.workers import ThreadWorker

PERIOD = 0.04
DONE, HARDWARE_FAULT = 0, 3


def run_hardware(config_path: Path, root: Path, duration: float | None) -> int:
    """Run until a signal or `duration` seconds; 0, or 3 if it ended halted by a fault."""
    console = Console(stderr=True)
    config = load(config_path)
    recognizer = model_file.load(model_path(config, config_path)).recognizer
    rig = load_rig(Path(config.cameras.calibration)) if config.cameras.calibration else nominal_rig(config)
    hardware = open_hardware(config)
    clock = MonotonicClock()
    folder = RunFolder.create(root, datetime.now())
    perception = build_perception(config, rig, recognizer, ThreadWorker(clock))
    announce = Announcer(console)
    devices = Devices(hardware.camera, hardware.head, hardware.lamp, hardware.base, hardware.teleop)
    loop = build_loop(config, devices, perception, clock, [Recorder(folder.open_events()), announce])
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda _number, _frame: stop.set())
    console.print(f"running, {PERIOD * 1e3:.0f} ms a tick; Ctrl-C ends it; record in {folder.path}")
    try:
        tick_until(loop, stop, duration)
    finally:
        loop.close()
        perception.close()
        hardware.close()
        folder.close()
    return HARDWARE_FAULT if announce.state == "halted" else DONE


def model_path(config: Config, config_path: Path) -> Path:
    """The taught target's file. Raises UserError if the config names none."""
    if not config.vision.model:
        raise UserError(f"{config_path}: vision.model is empty; teach a target (`robot teach`) and name its file")
    return Path(config.vision.model)


def tick_until(loop: Loop, stop: threading.Event, duration: float | None) -> None:
    """Tick at a steady rate; a tick that comes late is not made up for."""
    begun = time.monotonic()
    due = begun
    while not stop.is_set() and (duration is None or time.monotonic() - begun < duration):
        loop.tick()
        due = max(due + PERIOD, time.monotonic())
        stop.wait(due - time.monotonic())


class Announcer:
    """Tells the person at the terminal what changes: states with their reasons, faults with their cures."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._faults: dict[str, Fault] = {}
        self.state = "idle"

    def __call__(self, tick: Tick) -> None:
        """Print what this tick changed."""
        self.state = tick.state
        for change in tick.transitions:
            self._console.print(f"{tick.now:7.2f} s  {change.source} -> {change.target}: {change.event.reason}")
        active = {fault.key: fault for fault in tick.faults}
        for key in active.keys() - self._faults.keys():
            self._console.print(f"{tick.now:7.2f} s  [red]{faults.explain(active[key])}[/]")
        for key in self._faults.keys() - active.keys():
            self._console.print(f"{tick.now:7.2f} s  {key} is over")
        self._faults = active
