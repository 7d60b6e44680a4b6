"""How long a control tick takes, how old percepts are when decided on, and what share of a core vision takes.

The demo runs in lockstep, but each vision stage is charged the wall time it really took here, on one core.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from bench.report import Bar, arguments, publish
from robot.run_sim import SimOptions, SimRun
from robot.sim.scene import load_scene
from robot.taught import target_for
from robot.workers import Job, Result, SteppedWorker, run


class ChargedWorker(SteppedWorker):
    """Like the lockstep worker, but a job costs the wall time it took."""

    def __init__(self) -> None:
        super().__init__({})
        self.wall = 0.0
        self.seconds: dict[str, list[float]] = {}

    def submit(self, jobs: Sequence[Job], now: float) -> None:
        """Run the jobs and charge what they took."""
        at = now
        for job in jobs:
            start = time.perf_counter()
            result = run(job, 0.0)
            seconds = time.perf_counter() - start
            self.wall += seconds
            self.seconds.setdefault(job.stage, []).append(seconds)
            at += seconds
            self._pending.append((at, Result(result.stage, result.view, result.value, seconds, result.error)))
        self._busy_until = at


def measure(scene_name: str, seed: int) -> dict[str, Any]:
    """Run one scene; wall times of the control tick without vision, ages at decision, shares of a core."""
    scene = load_scene(scene_name)
    target, worker = target_for(scene.taught_object), ChargedWorker()
    simulated = SimRun(scene, seed, target.finder, worker=worker, height_m=target.height_m)
    ticks, track_ages, floor_ages = [], [], []
    try:
        while not simulated.done:
            simulated.world.step()
            simulated.clock.step()
            _draw(simulated)
            worker.wall = 0.0
            start = time.perf_counter()
            tick = simulated.loop.tick()
            ticks.append(time.perf_counter() - start - worker.wall)
            simulated.observe(tick)
            if tick.state == "track":
                percepts = tick.percepts
                if percepts.track is not None:
                    track_ages.append(percepts.track.age(tick.now))
                if percepts.free_space is not None:
                    floor_ages.append(percepts.free_space.age(tick.now))
        seconds = worker.seconds
        duration = simulated.clock.now()
    finally:
        simulated.close()
    return {
        "ticks": ticks,
        "track_ages": track_ages,
        "floor_ages": floor_ages,
        "duration": duration,
        "shares": {stage: sum(times) / duration for stage, times in seconds.items()},
        "medians": {stage: float(np.median(times)) for stage, times in seconds.items()},
    }


def _draw(simulated: SimRun) -> None:
    """Let the simulator draw this tick's pictures now: on the robot a camera delivers them."""
    frame = simulated.world.camera.latest(simulated.clock.now())
    if frame is not None:
        _ = frame.left, frame.right


def slowed(scene_name: str, seed: int) -> tuple[bool, bool]:
    """Run with every stage three times slower: whether the run said so, and whether it collided."""
    scene = load_scene(scene_name)
    target = target_for(scene.taught_object)
    simulated = SimRun(scene, seed, target.finder, options=SimOptions(slow=3.0), height_m=target.height_m)
    said = False
    try:
        while not simulated.done:
            tick = simulated.step()
            said |= any(fault.key == "vision.late" for fault in tick.faults)
        return said, bool(simulated.referee.report()["collisions"])
    finally:
        simulated.close()


def main() -> int:
    """Measure and print."""
    options = arguments(__doc__ or "").parse_args()
    scenes = ("demo", "standing", "moving") if options.full else ("demo",)
    runs = [measure(scene, seed=1) for scene in scenes]
    tick = np.concatenate([run["ticks"] for run in runs]) * 1e3
    track, floor = (
        np.round(np.concatenate([run[key] for run in runs]) * 1e3, 6) for key in ("track_ages", "floor_ages")
    )
    duration = sum(run["duration"] for run in runs)
    stages = sorted({stage for run in runs for stage in run["shares"]})
    shares = {stage: sum(r["shares"][stage] * r["duration"] for r in runs) / duration for stage in stages}
    said, collisions = slowed("demo", seed=1)
    rows: list[dict[str, Any]] = [
        {
            "case": "control tick without vision",
            "method": "loop",
            "median_ms": float(np.median(tick)),
            "p99_ms": float(np.percentile(tick, 99)),
        },
        {
            "case": "age of track at decision",
            "method": "track",
            "median_ms": float(np.median(track)),
            "p99_ms": float(np.percentile(track, 99)),
        },
        {
            "case": "age of free space in TRACK",
            "method": "free_space",
            "median_ms": float(np.median(floor)),
            "p99_ms": float(np.percentile(floor, 99)),
        },
    ]
    for stage in stages:
        medians = [run["medians"][stage] for run in runs if stage in run["medians"]]
        rows.append(
            {
                "case": "vision stage",
                "method": stage,
                "share_of_core": shares[stage],
                "median_ms": 1e3 * float(np.median(medians)) if medians else 0.0,
            }
        )
    bars = [
        Bar("control tick p99, ms", rows[0]["p99_ms"], 10.0),
        Bar("age of track at decision p99, ms", rows[1]["p99_ms"], 80.0),
        Bar("age of free space p99, ms", rows[2]["p99_ms"], 200.0),
        Bar("share of vision, cores", sum(shares.values()), 0.9),
        Bar("slowed three times: the run says so", float(said), 1.0, at_most=False),
        Bar("slowed three times: collisions", float(collisions), 0.0),
    ]
    return publish("tick", rows, bars, options.json)


if __name__ == "__main__":
    sys.exit(main())
