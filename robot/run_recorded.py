"""One simulated run with its record: events, report, trajectory and, if wanted, the video."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from robot import __version__, model_file
from robot.app import head_mount, nominal_rig
from robot.config import Config, load
from robot.errors import UserError
from robot.messages import Tick
from robot.record.annotate import annotate_tick, annotated_size
from robot.record.recorder import Recorder, Way, tick_ms
from robot.record.run_folder import RunFolder
from robot.record.trajectory import check_plots
from robot.record.video import VideoWriter
from robot.run_plot import plot_run
from robot.run_sim import SimOptions, SimRun
from robot.sim.scene import load_scene

Progress = Callable[[float, str], None]
VIDEO_EVERY = 2  # ticks: 12.5 pictures a second are enough to watch


@dataclass(frozen=True, slots=True)
class SimJob:
    """One simulated run to make; picklable, so that it can be made in another process."""

    scene: str
    seed: int
    model: Path
    options: SimOptions = field(default_factory=SimOptions)
    video: bool = False
    config: Path | None = None


def run_recorded(job: SimJob, root: Path, started: datetime, progress: Progress | None) -> dict[str, Any]:
    """Make the run and leave its folder; returns the report.

    Raises UserError, and leaves no folder, for a scene, config or model that cannot be used.
    """
    check_plots()
    scene = load_scene(job.scene)
    config = load(job.config) if job.config is not None else Config()
    # All that can be refused comes before the folder: a run that never began leaves nothing behind.
    target = model_file.load(job.model)
    run = SimRun(
        scene,
        job.seed,
        target.recognition(config.vision.method),
        config,
        job.options,
        height_m=target.height_m,
    )
    try:
        folder = RunFolder.create(root, started)
    except UserError:
        run.close()
        raise
    recorder, video = _recorder(folder, config, job.video, scene.taught_object)
    way = Way()
    wall: list[float] = []
    try:
        while not run.done:
            start = time.perf_counter()
            tick = run.step()
            recorder(tick)
            way(tick)
            wall.append(time.perf_counter() - start)
            if progress is not None and len(wall) % 25 == 0:
                progress(tick.now / scene.duration_s, f"{tick.now:.0f} s: {tick.state}")
        report = run.referee.report() | {
            "tick_ms": tick_ms(wall),
            "version": __version__,
            "folder": str(folder.path),
        }
        times = [step.now for step in way.points]
        title = f"{job.scene}, seed {job.seed}: {report['reason']}"
        plot_run(folder, run.referee.scenery(), times, way.points, title)
    finally:
        run.close()
        if video is not None:
            video.close()
        folder.close()
    folder.write_report(report)
    return report | folder.recording.summary()


def _recorder(
    folder: RunFolder, config: Config, with_video: bool, label: str
) -> tuple[Recorder, VideoWriter | None]:
    if not with_video:
        return Recorder(folder.open_events(), None, label), None
    rig, mount = nominal_rig(config), head_mount(config)
    video = VideoWriter(
        folder.video_path, annotated_size(rig), config.cameras.rate_hz / VIDEO_EVERY, folder.recording
    )

    def show(tick: Tick) -> None:
        if tick.view is not None and tick.view.frame.seq % VIDEO_EVERY == 0:
            picture = annotate_tick(tick, rig, mount)
            if picture is not None:
                video.write(picture, tick.now)

    return Recorder(folder.open_events(), show, label), video
