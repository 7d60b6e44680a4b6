"""The robot on its own hardware, in real time: opens what the config names and ticks until told to stop."""

from __future__ import annotations

import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Protocol

from rich.console import Console

from calib.model import StereoRig
from calib.rectify import rectifier
from robot import __version__, faults, model_file
from robot.app import build_loop, build_perception, devices_of, nominal_rig
from robot.clock import MonotonicClock
from robot.config import Config, load
from robot.errors import UserError
from robot.hal.factory import open_hardware, reach_of
from robot.hal.hardware import behind_workers
from robot.hal.interfaces import WaitsForPictures
from robot.hal.rectified import RectifiedCamera
from robot.messages import Fault, Tick
from robot.pacing import PERIOD, Pacer, WaitForPicture, quick_hand_over
from robot.record.recorder import Recorder, tick_ms
from robot.record.run_folder import RunFolder
from robot.rig_file import load_rig
from robot.told_faults import Drill, ToldFault, parse_told
from robot.workers import ThreadWorker

TIMED_TICKS = 15_000  # the report's tick times are those of the last ten minutes
DONE, HARDWARE_FAULT = 0, 3


class Ticks(Protocol):
    """What can be ticked."""

    def tick(self) -> Tick:
        """Run one control tick."""
        ...


def run_hardware(config_path: Path, root: Path, duration: float | None, drills: Sequence[str] = ()) -> int:
    """Run until a signal or `duration` seconds; 0, or 3 if it ended halted by a fault.

    drills: faults of mock devices to be told, DEVICE.KIND@TIME[:DURATION].

    Raises UserError, before a device moves and without leaving a run folder, for a config, model or
    calibration that cannot be used and for a device that is not there.
    """
    stop = threading.Event()
    with stopped_by_signals(stop):
        return run_until(stop, config_path, root, duration, drills)


def run_until(
    stop: threading.Event, config_path: Path, root: Path, duration: float | None, drills: Sequence[str] = ()
) -> int:
    """Like `run_hardware`, but ended by `stop`."""
    console = Console(stderr=True)
    config = load(config_path)
    drill = Drill([mock_fault(text, config) for text in drills])
    target = model_file.load(model_path(config, config_path))
    straight = rectifier(rig_of(config))
    with ExitStack() as closing:  # last opened, first closed: the wheels stand before anything else goes
        clock = MonotonicClock()
        hardware = behind_workers(open_hardware(config, clock), reach_of(config), clock)
        closing.callback(hardware.close)
        folder = RunFolder.create(root, datetime.now())
        closing.callback(folder.close)
        perception = build_perception(
            config,
            straight.rig,
            target.recognition(config.vision.method),
            ThreadWorker(clock),
            target.height_m,
        )
        closing.callback(perception.close)
        announce = Announcer(console)
        camera = RectifiedCamera(hardware.camera, straight)
        devices = devices_of(config, replace(hardware, camera=camera))
        observers: list[Callable[[Tick], None]] = [Recorder(folder.open_events()), announce]
        watched = [folder.recording.faults, drill.faults]
        loop = build_loop(config, devices, perception, clock, observers, watched)
        closing.callback(loop.close)
        words = f"running, {PERIOD * 1e3:.0f} ms a tick; Ctrl-C ends it; record in {folder.path}"
        console.print(words, soft_wrap=True, markup=False)
        eyes = hardware.camera
        wait = eyes.wait_newer if isinstance(eyes, WaitsForPictures) else None
        seconds = tick_until(loop, stop, duration, wait)
        folder.write_report(report(announce, clock.now(), seconds))
    return HARDWARE_FAULT if announce.halted else DONE


def mock_fault(text: str, config: Config) -> ToldFault:
    """A drill from 'device.kind@time[:duration]'. Raises UserError if the device is a real one."""
    fault = parse_told(text)
    section = {"camera": "cameras", "near": "base"}.get(fault.device, fault.device)
    settings = getattr(config, section, None)
    if settings is not None and settings.driver != "mock":
        raise UserError(
            f"--fault {text!r}: {section}.driver is {settings.driver!r}; only mocks and simulated ones break"
        )
    return fault


def model_path(config: Config, config_path: Path) -> Path:
    """The taught target's file. Raises UserError if the config names none."""
    if not config.vision.model:
        raise UserError(
            f"{config_path}: vision.model is empty; teach a target (`robot teach`) and name its file"
        )
    return Path(config.vision.model)


def rig_of(config: Config) -> StereoRig:
    """The pair as calibrated, else as the config describes it. Raises UserError for an unfit calibration."""
    eyes = config.cameras
    if not eyes.calibration:
        return nominal_rig(config)
    rig = load_rig(Path(eyes.calibration))
    if (rig.left.width, rig.left.height) != (eyes.width_px, eyes.height_px):
        raise UserError(
            f"{eyes.calibration} is for {rig.left.width}x{rig.left.height} pictures, the config has "
            f"{eyes.width_px}x{eyes.height_px}: set cameras.width_px and height_px, or calibrate at that size"
        )
    return rig


@contextmanager
def stopped_by_signals(stop: threading.Event) -> Iterator[None]:
    """SIGTERM and Ctrl-C set `stop` as long as this lasts; afterwards they mean what they meant before."""
    before = {
        number: signal.signal(number, lambda _number, _frame: stop.set())
        for number in (signal.SIGTERM, signal.SIGINT)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def tick_until(
    loop: Ticks,
    stop: threading.Event,
    duration: float | None,
    wait_for_picture: WaitForPicture | None = None,
) -> Sequence[float]:
    """Tick at the pacer's rate until told to stop. Returns the newest ticks' seconds."""
    begun = time.monotonic()
    pacer = Pacer(stop, wait_for_picture)
    seconds: deque[float] = deque(maxlen=TIMED_TICKS)
    with quick_hand_over():
        while not stop.is_set() and (duration is None or time.monotonic() - begun < duration):
            start = time.perf_counter()
            loop.tick()
            seconds.append(time.perf_counter() - start)
            pacer.pause()
    return list(seconds)


def report(announce: Announcer, now: float, seconds: Sequence[float]) -> dict[str, object]:
    """report.json of a run without a referee: how it ended, and whether the ticks kept time."""
    return {
        "success": not announce.halted,
        "reason": announce.reason,
        "state": announce.state,
        "duration_s": round(now, 2),
        "tick_ms": tick_ms(seconds),
        "version": __version__,
    }


class Announcer:
    """Tells the person at the terminal what changes: states with their reasons, faults with their cures."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._faults: dict[str, Fault] = {}
        self.state = "idle"
        self.reason = "nothing happened"
        """Why it is in this state."""

    @property
    def halted(self) -> bool:
        """True if a fault has ended the robot's work."""
        return self.state == "halted"

    def __call__(self, tick: Tick) -> None:
        """Print what this tick changed."""
        self.state = tick.state
        for change in tick.transitions:
            self.reason = change.event.reason
            self._say(tick, f"{change.source} -> {change.target}: {change.event.reason}")
        active = {fault.key: fault for fault in tick.faults}
        for key in sorted(active.keys() - self._faults.keys()):
            self._say(tick, faults.explain(active[key]), "red")
        for key in sorted(self._faults.keys() - active.keys()):
            self._say(tick, f"{key} is over")
        self._faults = active

    def _say(self, tick: Tick, words: str, style: str | None = None) -> None:
        # Words may hold brackets (a fault's evidence): they are no markup.
        line = f"{tick.now:7.2f} s  {words}"
        self._console.print(line, style=style, markup=False, highlight=False, soft_wrap=True)
