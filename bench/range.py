"""How true the ranges are that the running robot measures, per distance band, and how honest their sigma is.

Ranges of closed-loop runs are held against the true depth of the visible surface at the box's centre at the
moment the frame was taken. Errors within one run are alike (one room, one target's side), so every run counts
equally: at most `PER_RUN` samples a band, evenly spread.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np

from bench.report import Bar, arguments, publish
from robot.run_sim import SimRun
from robot.sim.scene import load_scene
from robot.taught import target_for

BANDS = ((0.5, 1.0), (1.0, 2.0), (2.0, 3.0))
SCENES = ("standing", "moving", "post", "table", "lost")
PER_RUN = 40
SECONDS = 20.0  # of each run: the approach, and some of the following
Sample = tuple[float, float, float]  # true, measured, sigma


def samples(scene_name: str, seed: int) -> Iterator[Sample]:
    """True depth, measured depth and sigma of every range of one run."""
    scene = load_scene(scene_name)
    model = target_for(scene.taught_object)
    run = SimRun(scene, seed, model.finder, height_m=model.height_m)
    last = -1.0
    seq_at: dict[float, int] = {}
    try:
        while not run.done and run.clock.now() < SECONDS:
            tick = run.step()
            if tick.view is not None:
                seq_at[tick.view.frame.captured_at] = tick.view.frame.seq
            target, track = tick.percepts.target, tick.percepts.track
            if target is None or track is None or target.at <= last or track.at != target.at:
                continue
            last = target.at
            true = run.referee.true_range(seq_at[target.at], track.value.box)
            if true is not None and target.value.method == "stereo":
                yield true, target.value.distance, target.value.sigma
    finally:
        run.close()


def spread(run: list[Sample], band: tuple[float, float]) -> list[Sample]:
    """At most `PER_RUN` of a run's samples in a band, evenly spread."""
    inside = [sample for sample in run if band[0] <= sample[0] < band[1]]
    return (
        [inside[i] for i in np.unique(np.linspace(0, len(inside) - 1, PER_RUN).astype(int))] if inside else []
    )


def main() -> int:
    """Measure and print."""
    options = arguments(__doc__ or "").parse_args()
    seeds = range(101, 121 if options.full else 104)
    runs = [list(samples(scene, seed)) for scene in SCENES for seed in seeds]
    found = np.array([sample for run in runs for band in BANDS for sample in spread(run, band)])
    rows, bars = [], []
    for low, high in BANDS:
        band = found[(found[:, 0] >= low) & (found[:, 0] < high)] if len(found) else found.reshape(0, 3)
        error = np.abs(band[:, 1] - band[:, 0])
        case = f"{low:g}-{high:g} m"
        relative = float(np.median(error / band[:, 0])) if len(band) else float("nan")
        one, two = (float(np.mean(error <= k * band[:, 2])) if len(band) else float("nan") for k in (1, 2))
        rows.append(
            {
                "case": case,
                "method": "range_box",
                "samples": len(band),
                "median_error": relative,
                "bias": float(np.median((band[:, 1] - band[:, 0]) / band[:, 0]))
                if len(band)
                else float("nan"),
                "within_1_sigma": one,
                "within_2_sigma": two,
            }
        )
        bars += [
            Bar(f"samples {case}", len(band), 50, at_most=False),
            Bar(f"median relative error {case}", relative, 0.03),
            Bar(f"share within one sigma {case}, lower", one, 0.6, at_most=False),
            Bar(f"share within one sigma {case}, upper", one, 0.8),
            Bar(f"share within two sigma {case}", two, 0.9, at_most=False),
        ]
    return publish("range", rows, bars, options.json)


if __name__ == "__main__":
    sys.exit(main())
