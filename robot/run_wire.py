"""One run against the simulated world in a second process: real drivers, real links, real time.

The robot here is the one `robot run --config` runs on hardware; only what its drivers reach is emulated.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

from msgspec import structs

from robot import __version__, model_file
from robot.app import build_loop, build_perception, devices_of, nominal_rig
from robot.clock import MonotonicClock
from robot.config import Config, load
from robot.errors import UserError
from robot.fault_watch import FaultSource
from robot.hal.factory import open_hardware, reach_of
from robot.hal.hardware import behind_workers
from robot.hal.interfaces import WaitsForPictures
from robot.messages import Tick
from robot.model_file import Model
from robot.record.recorder import Recorder, Way, tick_ms
from robot.record.run_folder import RunFolder
from robot.record.trajectory import check_plots
from robot.run_hardware import tick_until
from robot.run_plot import plot_run
from robot.run_recorded import Progress, SimJob
from robot.run_sim import armed
from robot.sim.scene import load_scene
from robot.sim.wire.launch import WorldChannel, start_world
from robot.sim.wire.messages import Addresses, Outcome, Trace
from robot.told_faults import Drill
from robot.wire_figures import Decision, capture_to_telegram, in_ms, missed_ticks, order_to_telegram
from robot.wire_witness import TimedBase, Witness
from robot.workers import ThreadWorker

STREAM = "/?action=stream"


def run_wire(
    job: SimJob,
    root: Path,
    started: datetime,
    progress: Progress | None = None,
    stop: threading.Event | None = None,
) -> dict[str, Any]:
    """Make the run and leave its folder; returns the report of `run_recorded` with `wire` added to it.

    stop: set by a signal, ends the run before its time; the report has `stopped` then.
    Raises UserError, and leaves no folder, for what cannot be used.
    """
    if job.video or job.options.slow != 1.0:
        raise UserError("--wire runs in real time: --video and --slow are for runs without it")
    check_plots()
    stop = stop or threading.Event()
    scene = load_scene(job.scene)
    config = load(job.config) if job.config is not None else Config()
    target = model_file.load(job.model)
    with ExitStack() as closing:  # last opened, first closed: the wheels stand before the world ends
        world = closing.enter_context(start_world(scene, job.seed, job.options.faults))
        robot = WireRobot(wired(armed(config, scene, job.seed), world.addresses), target, world)
        closing.callback(robot.close)
        folder = RunFolder.create(root, started)
        closing.callback(folder.close)
        way, shown = Way(), _Shown(progress, scene.duration_s)
        recorder = Recorder(folder.open_events(), None, scene.taught_object)
        watched = [folder.recording.faults, Drill(job.options.told).faults]
        world.begin()
        seconds = robot.run(stop, [recorder, way, shown], watched)
        robot.close()
        outcome, trace = world.outcome(), world.trace()
        report = outcome.report | {
            "tick_ms": tick_ms(seconds),
            "wire": wire_figures(robot.decisions, trace, outcome),
            "version": __version__,
            "folder": str(folder.path),
        }
        if stop.is_set():  # no plot: whoever stops it waits a second at most
            report |= {"stopped": True, "reason": "stopped by a signal"}
        elif outcome.scenery is not None:
            times = [at - robot.began for at in trace.moments[-outcome.pace.ticks :]]
            title = f"{job.scene}, seed {job.seed}: {report['reason']}"
            plot_run(folder, outcome.scenery, times, way.points, title)
        folder.write_report(report)
    return report | folder.recording.summary()


def wired(config: Config, addresses: Addresses) -> Config:
    """The config with the real drivers at the world's addresses."""
    left, right = addresses.left_eye + STREAM, addresses.right_eye + STREAM
    return structs.replace(
        config,
        cameras=structs.replace(config.cameras, driver="http", left=left, right=right),
        head=structs.replace(config.head, driver="uvc", device=left),
        base=structs.replace(config.base, driver="nxt-serial", port=addresses.brick),
        lamp=structs.replace(config.lamp, driver="modbus", device=addresses.box),
        arm=structs.replace(config.arm, driver="none"),
        teleop=structs.replace(config.teleop, driver="serial", port=addresses.teleop),
    )


class WireRobot:
    """The whole robot on its drivers, and a witness of what it does. `close` leaves the wheels standing.

    Raises UserError if a device cannot be opened.
    """

    def __init__(self, config: Config, target: Model, world: WorldChannel) -> None:
        self._config, self._target, self._world = config, target, world
        self.clock = MonotonicClock()
        self.began = time.monotonic() - self.clock.now()
        """`time.monotonic()` at zero of the robot's clock."""
        self._hardware = behind_workers(open_hardware(config, self.clock), reach_of(config), self.clock)
        self._base = TimedBase(self._hardware.base)
        self._ended = threading.Event()
        self.witness = Witness(world, self._base, self.began, self._ended.set)

    @property
    def decisions(self) -> list[Decision]:
        """What was decided when, one entry a tick."""
        return self.witness.decisions.all()

    def run(
        self,
        stop: threading.Event,
        observers: Sequence[Callable[[Tick], None]],
        watched: Sequence[FaultSource],
    ) -> list[float]:
        """Tick until the referee has seen enough or `stop` is set; returns the ticks' seconds.

        Raises WorldGoneError if the world is gone before that.
        """
        hardware = self._hardware
        perception = build_perception(
            self._config,
            nominal_rig(self._config),
            self._target.recognition(self._config.vision.method),
            ThreadWorker(self.clock),
            self._target.height_m,
        )
        try:
            devices = devices_of(self._config, replace(hardware, base=self._base))
            watching: list[Callable[[Tick], None]] = [*observers, self.witness, self._ending_with(stop)]
            loop = build_loop(self._config, devices, perception, self.clock, watching, watched)
            try:
                eyes = hardware.camera
                wait = eyes.wait_newer if isinstance(eyes, WaitsForPictures) else None
                seconds = list(tick_until(loop, self._ended, None, wait))
            finally:
                loop.close()
        finally:
            perception.close()
        if self.witness.gone is not None:
            raise self.witness.gone
        return seconds

    def _ending_with(self, stop: threading.Event) -> Callable[[Tick], None]:
        def watch(tick: Tick) -> None:
            if stop.is_set():
                self._ended.set()

        return watch

    def close(self) -> None:
        """Close all devices. May be called twice."""
        self._hardware.close()


def wire_figures(decisions: list[Decision], trace: Trace, outcome: Outcome) -> dict[str, Any]:
    """How well robot and world kept time."""
    missed = missed_ticks([decision.at for decision in decisions])
    return {
        "ticks": len(decisions),
        "missed_ticks": missed,
        "missed_share": round(missed / max(len(decisions) + missed, 1), 5),
        "track_to_telegram_ms": in_ms(
            capture_to_telegram(decisions, trace.telegrams, trace.moments, lambda d: d.track_at)
        ),
        "floor_to_telegram_ms": in_ms(
            capture_to_telegram(decisions, trace.telegrams, trace.moments, lambda d: d.floor_at)
        ),
        "order_to_telegram_ms": in_ms(order_to_telegram(decisions, trace.telegrams)),
        "world_ticks": outcome.pace.ticks,
        "world_late_ticks": outcome.pace.late,
        "world_slipped_s": round(outcome.pace.slipped_s, 3),
        "world_pictures_missed": outcome.pace.pictures_missed,
        "unmatched_claims": outcome.unmatched,
    }


class _Shown:
    """An observer that shows progress once a second."""

    def __init__(self, progress: Progress | None, duration_s: float) -> None:
        self._progress, self._duration_s = progress, duration_s
        self._shown_at = 0.0

    def __call__(self, tick: Tick) -> None:
        if self._progress is not None and tick.now - self._shown_at >= 1.0:
            self._shown_at = tick.now
            self._progress(min(tick.now / self._duration_s, 1.0), f"{tick.now:.0f} s: {tick.state}")
