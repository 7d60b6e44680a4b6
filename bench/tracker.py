"""How well a target is kept: `python -m bench.tracker --data DIR [--peer-python PYTHON] [--json] [--full]`.

Every sequence of DIR/tracking is run once as it was filmed, with the target half covered for 30 frames, and
with the target out of view for 100 frames (several seeded times each). Our tracker and OpenCV's (CSRT, KCF,
MIL; CSRT alone on the changed sequences) see each frame in turn, on one thread. The peers need
opencv-contrib, so they run under another Python: `make bench-peers` builds it; without one they are left out
and the bars that compare say so by failing. Exit code 0 if all bars hold.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from bench.report import Bar, arguments, publish
from bench.tracker_figures import (
    HELD,
    after_cover,
    false_locks,
    found_again_s,
    held_before_cover,
    overlaps,
    success_auc,
)
from bench.tracker_peers import PEERS, Peer, PeerServer
from bench.tracker_runs import Run, Tracker, run
from bench.tracker_sequences import Filmed, gone, half_covered, sequence
from robot.errors import UserError
from robot.vision.tracker import OnlineTracker

Row = dict[str, Any]
Peers = Callable[[Sequence[str]], Mapping[str, Tracker]]

OURS, RIVAL = "ours", "CSRT"
PEER_PYTHON = Path(".venv-peers/bin/python")
TIMES, FULL = 2, 6
"""Changed sequences of each kind."""
SPEED, AFTER_COVER, FOUND_S = 1.5, 0.65, 1.0


def as_filmed(film: Filmed, peers: Peers) -> list[Row]:
    """A row for each tracker: success AUC, frames held, time of an update."""
    rows = []
    for name, one in run(film, {OURS: OnlineTracker(), **peers(PEERS)}).items():
        overlap = overlaps(one.tracks, film.truth)
        rows.append(
            {"sequence": film.name, "tracker": name, "frames": len(film.frames),
             "auc": round(success_auc(overlap), 3), "held": round(float(np.nanmean(overlap >= HELD)), 3),
             "ms": round(one.ms, 2), "mean_ms": round(1000.0 * float(np.mean(one.seconds)), 2)}
        )  # fmt: skip
    return rows


def covered(film: Filmed, peers: Peers, seeds: Sequence[int]) -> list[Row]:
    """Rows of the half covered sequences: overlap before and after."""
    rows = []
    for seed in seeds:
        changed = half_covered(film, seed)
        if changed is None:
            continue
        runs = run(changed, {OURS: OnlineTracker(), **peers((RIVAL,))})
        overlap = {name: overlaps(one.tracks, changed.truth) for name, one in runs.items()}
        judge = overlap.get(RIVAL, overlap[OURS])
        rows.append(
            {"sequence": f"{film.name}, half covered {seed}", "judged": held_before_cover(judge),
             **{f"after_{name}": round(after_cover(o), 3) for name, o in overlap.items()}}
        )  # fmt: skip
    return rows


def away(film: Filmed, peers: Peers, seeds: Sequence[int]) -> list[Row]:
    """Rows of the sequences with the target out of view: seconds until found again, false locks."""
    rows = []
    for seed in seeds:
        changed = gone(film, seed)
        if changed is None:
            continue
        row: Row = {"sequence": f"{film.name}, out of view {seed}"}
        runs: dict[str, Run] = run(changed, {OURS: OnlineTracker(), **peers((RIVAL,))})
        for name, one in runs.items():
            row[f"found_s_{name}"] = round(found_again_s(overlaps(one.tracks, changed.truth)), 2)
            row[f"false_{name}"] = false_locks(one.tracks, changed.truth)
        rows.append(row)
    return rows


def bars(rows: Sequence[Row]) -> list[Bar]:
    """What the rows are held to."""
    filmed = [row for row in rows if "auc" in row]
    auc = {name: _mean(filmed, name, "auc") for name in (OURS, RIVAL)}
    ms = {name: _mean(filmed, name, "mean_ms") for name in (OURS, RIVAL)}
    judged = [row[f"after_{OURS}"] for row in rows if row.get("judged")]
    found = [row for row in rows if f"found_s_{OURS}" in row]
    late = [row[f"found_s_{OURS}"] > FOUND_S for row in found]
    return [
        Bar("mean success AUC over CSRT's", auc[OURS] / auc[RIVAL], 1.0, at_most=False),
        Bar("speed over CSRT's, mean update", ms[RIVAL] / ms[OURS], SPEED, at_most=False),
        Bar("least overlap after a half cover", min(judged, default=np.nan), AFTER_COVER, at_most=False),
        Bar("not found again within 1 s", float(sum(late)) if found else np.nan, 0.0),
        Bar("runs with a false lock", float(sum(row[f"false_{OURS}"] > 0 for row in found)), 0.0),
    ]


def _mean(rows: Sequence[Row], tracker: str, key: str) -> float:
    values = [row[key] for row in rows if row["tracker"] == tracker]
    return float(np.mean(values)) if values else float("nan")


def measured(data: Path, peers: Peers, times: int) -> list[Row]:
    """All rows of all sequences."""
    folders = sorted(path for path in (data / "tracking").glob("*") if path.is_dir())
    if not folders:
        raise UserError(f"{data / 'tracking'} holds no sequences")
    films = [sequence(folder) for folder in folders]
    rows = [row for film in films for row in as_filmed(film, peers)]
    rows += [row for film in films for row in covered(film, peers, range(times))]
    return rows + [row for film in films for row in away(film, peers, range(times))]


def main(words: Sequence[str] | None = None) -> int:
    """Run the bench; returns the exit code."""
    parser = arguments(__doc__ or "")
    parser.add_argument("--peer-python", default=str(PEER_PYTHON), help="a Python with opencv-contrib")
    options = parser.parse_args(words)
    cv2.setNumThreads(1)
    try:
        if not options.data:
            raise UserError("give the folder of real images with --data DIR")
        times = FULL if options.full else TIMES
        if not Path(options.peer_python).exists():
            print(f"no {options.peer_python}: OpenCV's trackers are left out", file=sys.stderr)
            rows = measured(Path(options.data), lambda names: {}, times)
        else:
            with PeerServer(options.peer_python) as server:
                rows = measured(Path(options.data), lambda names: {n: Peer(server, n) for n in names}, times)
    except UserError as problem:
        print(problem, file=sys.stderr)
        return 2
    return publish("tracker", rows, bars(rows), options.json)


if __name__ == "__main__":
    raise SystemExit(main())
