"""Remedies for plain NMF's weak spots, which [W] names and leaves undone: sparse, local and class-aware.

Each is an `Objective` for `NMF`. Plain NMF may find basis images that overlap and show whole views; the
sparse one says how concentrated each must be, the local one prefers few, disjoint parts, the Fisher one
encodings that tell classes apart.

Sources: Hoyer, "Non-negative matrix factorization with sparseness constraints" (JMLR 2004); Li, Hou, Zhang,
Cheng, "Learning spatially localized, parts-based representation" (CVPR 2001); Zafeiriou, Tefas, Buciu, Pitas,
"Exploiting discriminant information in nonnegative matrix factorization with application to frontal face
verification" (IEEE Trans. Neural Networks 2006).
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence

import numpy as np

from robot.vision.nmf_objectives import TINY, Matrix, Objective, divergence_cost, euclidean_cost


def sparse(sparseness: float) -> Objective:
    """Least squares with basis images of a given sparseness: 0 all pixels alike, 1 one pixel alone.

    W takes a gradient step no longer than the cost allows and is projected, column by column, to the wanted
    sparseness; H is updated as ever. From the second round on the cost never increases: the random start is
    not sparse yet.

    Raises:
        ValueError: sparseness not within 0..1.

    >>> from robot.vision.nmf import NMF
    >>> V = np.random.default_rng(0).random((30, 12))
    >>> basis = NMF(3, sparse(0.6), max_iterations=20, seed=0).fit(V).basis_
    >>> [round(sparseness_of(column), 3) for column in basis.T]
    [0.6, 0.6, 0.6]
    """
    if not 0.0 <= sparseness <= 1.0:
        raise ValueError(f"sparseness must be 0 to 1, got {sparseness}")

    def update(V: Matrix, W: Matrix, H: Matrix) -> tuple[Matrix, Matrix]:
        H = H * (W.T @ V) / np.maximum(W.T @ W @ H, TINY)
        gram = H @ H.T
        step = 1.0 / max(float(np.linalg.norm(gram, 2)), TINY)
        W = W - W.dtype.type(step) * (W @ gram - V @ H.T)
        return np.stack([projected(column, sparseness) for column in W.T], axis=1), H

    return Objective("sparse", euclidean_cost, update)


def sparseness_of(values: Matrix) -> float:
    """Hoyer's sparseness of a vector, (sqrt(n) - |x|_1 / |x|_2) / (sqrt(n) - 1).

    >>> sparseness_of(np.array([0.0, 0.0, 3.0, 0.0])), sparseness_of(np.ones(4))
    (1.0, 0.0)
    """
    root, length = math.sqrt(values.size), float(np.linalg.norm(values))
    return (root - float(np.abs(values).sum()) / max(length, TINY)) / max(root - 1.0, TINY)


def projected(values: Matrix, sparseness: float) -> Matrix:
    """The non-negative vector nearest to `values` that has their length and a sparseness (Hoyer's algorithm).

    >>> round(sparseness_of(projected(np.array([3.0, 2.0, -1.0, 0.5]), 0.8)), 6)
    0.8
    """
    count, length = values.size, float(np.linalg.norm(values))
    total = length * (math.sqrt(count) - sparseness * (math.sqrt(count) - 1.0))
    found = values + (total - float(values.sum())) / count
    free = np.ones(count, np.bool_)
    while True:
        middle = np.where(free, total / max(int(free.sum()), 1), 0.0)
        found = middle + _stretch(middle, found - middle, length) * (found - middle)
        negative = found < 0.0
        if not negative.any():
            return found.astype(values.dtype)
        free &= ~negative
        found = np.where(free, found, 0.0)
        found = np.where(free, found - (float(found.sum()) - total) / max(int(free.sum()), 1), 0.0)


def _stretch(middle: Matrix, away: Matrix, length: float) -> float:
    """How often `away` goes from the middle until the vector has the length: the larger root."""
    a, b = float(away @ away), 2.0 * float(middle @ away)
    c = float(middle @ middle) - length * length
    if a <= TINY:
        return 0.0
    return (-b + math.sqrt(max(b * b - 4.0 * a * c, 0.0))) / (2.0 * a)


MOST_BETWEEN = 0.25
"""Of `within`: stronger, and the means of classes fly apart without end."""


def _local_update(V: Matrix, W: Matrix, H: Matrix) -> tuple[Matrix, Matrix]:
    H = np.sqrt(H * (W.T @ (V / np.maximum(W @ H, TINY))))
    W = W * ((V / np.maximum(W @ H, TINY)) @ H.T) / np.maximum(H.sum(axis=1)[None, :], TINY)
    return _columns_of_sum_one(W), H


LOCAL = Objective("local", divergence_cost, _local_update)
"""Local NMF: columns of W sum to 1. Its cost is the divergence and terms that its update lowers with it, so
the divergence alone, which is reported, may rise."""


def fisher(labels: Sequence[Hashable], within: float = 0.005, between: float = 0.001) -> Objective:
    """Class-aware NMF: divergence + within tr(S_w) - between tr(S_b) of the encodings; columns of W sum to 1.

    labels: the class of each column of V. within, between: weights of the scatter of encodings about their
    class's mean and of the classes' means about the whole one. The divergence alone is told; it may rise.

    Raises:
        ValueError: between above a quarter of within (means fly apart without end); a class with too few
            views for the weights: it needs more than 1 + between / within.
    """
    if not 0.0 <= between <= MOST_BETWEEN * within:
        raise ValueError(f"between must be 0 to {MOST_BETWEEN} of within ({within}), got {between}")
    groups = [np.flatnonzero([one == label for one in labels]) for label in dict.fromkeys(labels)]
    fewest = min(len(group) for group in groups)
    if fewest <= 1.0 + between / within:
        raise ValueError(f"each class needs more than {1.0 + between / within:.2f} views, one has {fewest}")

    def update(V: Matrix, W: Matrix, H: Matrix) -> tuple[Matrix, Matrix]:
        pull = H * (W.T @ (V / np.maximum(W @ H, TINY)))
        mean, found = H.mean(axis=1, keepdims=True), np.empty_like(H)
        for group in groups:
            mine, count = H[:, group], len(group)
            others = mine.sum(axis=1, keepdims=True) - mine
            bend = 2.0 * within - 2.0 * (within + between) / count
            slope = 2.0 * (within + between) * others / count - 2.0 * between * mean - 1.0
            # The positive root of bend h^2 - slope h - pull = 0, where the bound of the cost has its minimum.
            found[:, group] = (slope + np.sqrt(slope**2 + 4.0 * bend * pull[:, group])) / (2.0 * bend)
        W = W * ((V / np.maximum(W @ found, TINY)) @ found.T)
        W = W / np.maximum(found.sum(axis=1)[None, :], TINY)
        return _columns_of_sum_one(W), found

    return Objective("fisher", divergence_cost, update)


def _columns_of_sum_one(W: Matrix) -> Matrix:
    return np.asarray(W / np.maximum(W.sum(axis=0, keepdims=True), TINY))
