"""How many basis images: the curve over ranks and the choice, by reconstruction or by recognition.

The publication leaves the rank open (it cites trying 1 .. min(n, m)); these curves are the rule.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from robot.vision.nmf import NMF, checked
from robot.vision.nmf_objectives import EUCLIDEAN, TINY, Matrix, Objective, euclidean_cost


@dataclass(frozen=True, slots=True)
class RankPoint:
    """Held-out reconstruction of one rank: root mean square error over pixels of unseen views."""

    rank: int
    error: float


def largest_rank(pixels: int, views: int) -> int:
    """The largest r that still compresses, (n + m) r < n m, at least 1.

    >>> largest_rank(100, 25)
    19
    """
    return max(1, (pixels * views - 1) // (pixels + views))


def rank_curve(
    V: Matrix,
    ranks: Sequence[int],
    *,
    objective: Objective = EUCLIDEAN,
    folds: int = 3,
    max_iterations: int = 60,
    seed: int = 0,
) -> tuple[RankPoint, ...]:
    """Error of reconstructing views that were held out of the factorisation, for every rank.

    V (n, m) with m >= 2 prepared views. Every view is held out once (`folds` interleaved groups, so that
    neighbours in a walk round the target stay in training). Returns one point for each rank, in order.
    The publication leaves the rank open; this curve is the rule.
    """
    V = checked(V)
    views = V.shape[1]
    if views < 2:
        raise ValueError("at least two views are needed to hold one out")
    groups = np.arange(views) % min(folds, views)
    points = []
    for rank in ranks:
        squares = 0.0
        for fold in range(min(folds, views)):
            held = groups == fold
            model = NMF(rank, objective, max_iterations=max_iterations, seed=seed).fit(V[:, ~held])
            squares += euclidean_cost(V[:, held], model.reconstruct(V[:, held]))
        points.append(RankPoint(rank, float(np.sqrt(squares / V.size))))
    return tuple(points)


def choose_rank(curve: Sequence[RankPoint], slack: float = 0.05) -> int:
    """The smallest rank whose held-out error is within `slack` (a share) of the curve's best.

    >>> choose_rank([RankPoint(2, 0.30), RankPoint(4, 0.21), RankPoint(8, 0.20)])
    4
    """
    if not curve:
        raise ValueError("the curve has no points")
    best = min(point.error for point in curve)
    return min(point.rank for point in curve if point.error <= best * (1 + slack))


def nearest_label(model: NMF, known: Matrix, labels: Sequence[Hashable], unknown: Matrix) -> list[Hashable]:
    """The label of the known view that lies nearest, for each unknown view (column).

    Nearest is by the cosine between what the basis shows of two views, away from the known views' mean. Of
    encodings themselves it would depend on how long and how alike the basis images happen to be.
    """
    ours, theirs = model.transform(known), model.transform(unknown)
    mean = ours.mean(axis=1, keepdims=True)
    # |W J| = |R J| with W = Q R.
    metric = np.linalg.qr(model.basis_, mode="r")
    ours, theirs = (_unit_columns(metric @ (J - mean)) for J in (ours, theirs))
    return [labels[int(i)] for i in (ours.T @ theirs).argmax(axis=0)]


def recognition_curve(
    V: Matrix,
    labels: Sequence[Hashable],
    ranks: Sequence[int],
    *,
    objective: Callable[[Sequence[Hashable]], Objective] = lambda labels: EUCLIDEAN,
    folds: int = 3,
    max_iterations: int = 60,
    seed: int = 0,
) -> tuple[RankPoint, ...]:
    """Share of held-out views that are given a wrong label, for every rank.

    V (n, m) prepared views, labels of them; objective: made from the labels of those learnt. Views are held
    out in `folds` interleaved groups within each class, so that every class stays in training.
    """
    V = checked(V)
    met: dict[Hashable, int] = {}
    turn = np.empty(len(labels), np.intp)
    for column, label in enumerate(labels):
        turn[column] = met.get(label, 0) % folds
        met[label] = met.get(label, 0) + 1
    points = []
    for rank in ranks:
        wrong = 0
        for fold in range(folds):
            held = turn == fold
            if not held.any() or held.all():
                continue
            mine, theirs = ([labels[i] for i in np.flatnonzero(part).tolist()] for part in (~held, held))
            model = NMF(rank, objective(mine), max_iterations=max_iterations, tolerance=None, seed=seed).fit(
                V[:, ~held]
            )
            told = nearest_label(model, V[:, ~held], mine, V[:, held])
            wrong += sum(a != b for a, b in zip(told, theirs, strict=True))
        points.append(RankPoint(rank, wrong / len(labels)))
    return tuple(points)


def choose_rank_by_recognition(curve: Sequence[RankPoint]) -> int:
    """The rank with the least error; of equal ones the smallest.

    >>> choose_rank_by_recognition([RankPoint(8, 0.30), RankPoint(16, 0.10), RankPoint(32, 0.10)])
    16
    """
    if not curve:
        raise ValueError("the curve has no points")
    return min(curve, key=lambda point: (point.error, point.rank)).rank


def _unit_columns(J: Matrix) -> Matrix:
    return np.asarray(J / np.maximum(np.linalg.norm(J, axis=0, keepdims=True), TINY))
