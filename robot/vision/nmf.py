"""Non-negative matrix factorisation V ~ W H: basis images W and encodings H of a target's views.

Columns of V are prepared views (`prepare`). W (n x r) holds r basis images of n pixels, H (r x m) the
encodings of m views, everything non-negative. The cost and its multiplicative update form one
`Objective` that is handed to `NMF`, so that other objectives (sparse, local, discriminant) fit in
without touching the class.

Sources: Lee & Seung, *Algorithms for Non-negative Matrix Factorization*, NIPS 2000 (updates); Wu &
Snášel, *A Vision-based Navigation System of Mobile Tracking Robot*, SMC 2010 (preparation of views,
encodings by the pseudo-inverse).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
Update = Callable[[Matrix, Matrix, Matrix], tuple[Matrix, Matrix]]
Cost = Callable[[Matrix, Matrix], float]

TARGET_MEAN = 0.25
TARGET_STD = 0.25
# A view whose grey values (0..255) spread less than this shows nothing that could be recognised.
FLAT_STD = 1.5
# Keeps quotients finite where a product has become exactly zero.
_TINY = 1e-12


class FlatViewError(ValueError):
    """The view has (almost) no contrast, so that it cannot be scaled to the wanted spread."""


def normalise(pixels: NDArray[Any]) -> Matrix:
    """Scale grey values linearly to mean 0.25 and standard deviation 0.25, then clip to [0, 1].

    pixels: any shape, at least two different values on any scale. Returns float64 of the same shape;
    mean and spread hold exactly *before* clipping ([W], section II).

    Raises FlatViewError where all pixels are equal.

    >>> normalise(np.array([0.0, 2.0]))
    array([0. , 0.5])
    """
    values = np.asarray(pixels, dtype=np.float64)
    std = float(values.std())
    if not std > 1e-9:
        raise FlatViewError("the view has no contrast: all its pixels are equal")
    scaled: Matrix = np.clip(TARGET_MEAN + TARGET_STD * (values - values.mean()) / std, 0.0, 1.0)
    return scaled


def prepare(view: NDArray[Any], size: tuple[int, int]) -> Matrix:
    """Make one column of V from a grey view.

    view: (H, W) uint8, or floating point on the same 0..255 scale. size: (width, height) every view is
    brought to, in pixels. Returns (width * height,) float64 in [0, 1], row by row; clipping what lies below 0
    lifts the mean a little above 0.25.

    Raises FlatViewError for a view without contrast, ValueError for one that is not a grey picture.

    >>> view = np.tile(np.arange(0, 80, 10, dtype=np.uint8), (8, 1))
    >>> column = prepare(view, (4, 4))
    >>> column.shape, round(float(column.mean()), 3)
    ((16,), 0.271)
    """
    if view.ndim != 2 or min(view.shape) < 1:
        raise ValueError(f"a grey view (H, W) is needed, got shape {view.shape}")
    grey = np.asarray(view, dtype=np.float32)
    if not np.isfinite(grey).all():
        raise ValueError("the view holds values that are not numbers")
    shrinks = size[0] < grey.shape[1] and size[1] < grey.shape[0]
    resized = cv2.resize(grey, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    if float(resized.std()) < FLAT_STD:
        raise FlatViewError(f"the view is flat: its grey values spread by only {float(resized.std()):.2f}")
    return normalise(resized).ravel()


# ----------------------------------------------------------------------------- costs and their updates


def euclidean_cost(V: Matrix, WH: Matrix) -> float:
    """||V - WH||^2, summed over all entries of two (n, m) matrices.

    >>> euclidean_cost(np.ones((2, 2)), np.zeros((2, 2)))
    4.0
    """
    return float(np.square(V - WH).sum())


def euclidean_update(V: Matrix, W: Matrix, H: Matrix) -> tuple[Matrix, Matrix]:
    """One round of H <- H (W'V)/(W'WH), W <- W (VH')/(WHH') (Lee & Seung 2000, equation 4).

    V (n, m), W (n, r), H (r, m), all >= 0. Returns the new W and H; the Euclidean cost never increases.
    """
    H = H * (W.T @ V) / np.maximum(W.T @ W @ H, _TINY)
    W = W * (V @ H.T) / np.maximum(W @ (H @ H.T), _TINY)
    return W, H


def divergence_cost(V: Matrix, WH: Matrix) -> float:
    """sum(V log(V/WH) - V + WH), the generalised Kullback-Leibler divergence; 0 log 0 counts as 0.

    >>> divergence_cost(np.ones((2, 2)), np.ones((2, 2)))
    0.0
    """
    WH = np.maximum(WH, _TINY)
    logs = np.log(np.where(V > 0, V, 1.0) / np.where(V > 0, WH, 1.0))
    return float((V * logs - V + WH).sum())


def divergence_update(V: Matrix, W: Matrix, H: Matrix) -> tuple[Matrix, Matrix]:
    """One round of the divergence's multiplicative update (Lee & Seung 2000, equation 5).

    V (n, m), W (n, r), H (r, m), all >= 0. Returns the new W and H; the divergence never increases.
    """
    H = H * (W.T @ (V / np.maximum(W @ H, _TINY))) / np.maximum(W.sum(axis=0)[:, None], _TINY)
    W = W * ((V / np.maximum(W @ H, _TINY)) @ H.T) / np.maximum(H.sum(axis=1)[None, :], _TINY)
    return W, H


@dataclass(frozen=True, slots=True)
class Objective:
    """What is minimised and how one step towards it is made.

    cost(V, WH) -> float and update(V, W, H) -> (W, H); the cost must never increase under the update.
    """

    name: str
    cost: Cost
    update: Update


EUCLIDEAN = Objective("euclidean", euclidean_cost, euclidean_update)
DIVERGENCE = Objective("divergence", divergence_cost, divergence_update)


# -------------------------------------------------------------------------------------- factorisation


class NMF:
    """Factorises views into basis images and encodings.

    Parameters: rank r >= 1; objective; max_iterations >= 1 (the publication stops at about 50);
    tolerance: stop when ten rounds together lower the cost by less than this share of it; seed of the
    random start. After `fit`: basis_ (n, r), encodings_ (r, m), errors_ (cost before the first and after
    every round), inverse_ (r, n) = pinv(basis_).

    >>> rng = np.random.default_rng(0)
    >>> V = rng.random((30, 4)) @ rng.random((4, 12))
    >>> model = NMF(rank=4, max_iterations=300, seed=1).fit(V)
    >>> model.transform(V).shape, bool(model.errors_[-1] < 0.01 * model.errors_[0])
    ((4, 12), True)
    """

    def __init__(
        self,
        rank: int,
        objective: Objective = EUCLIDEAN,
        *,
        max_iterations: int = 200,
        tolerance: float = 1e-2,
        seed: int = 0,
    ) -> None:
        if rank < 1:
            raise ValueError(f"rank must be at least 1, got {rank}")
        if max_iterations < 1:
            raise ValueError(f"max_iterations must be at least 1, got {max_iterations}")
        self.rank = rank
        self.objective = objective
        self.max_iterations = max_iterations
        self.tolerance = tolerance
        self.seed = seed
        self.basis_: Matrix = np.empty((0, rank))
        self.encodings_: Matrix = np.empty((rank, 0))
        self.inverse_: Matrix = np.empty((rank, 0))
        self.errors_: list[float] = []

    def fit(self, V: Matrix) -> NMF:
        """Learn basis and encodings of the columns of V (n, m), all entries finite and >= 0. Returns self."""
        V = _checked(V)
        W, H = _random_start(V, self.rank, self.seed)
        errors = [self.objective.cost(V, W @ H)]
        for _ in range(self.max_iterations):
            W, H = self.objective.update(V, W, H)
            errors.append(self.objective.cost(V, W @ H))
            if _has_settled(errors, self.tolerance):
                break
        self.basis_, self.encodings_, self.errors_ = W, H, errors
        self.inverse_ = np.asarray(np.linalg.pinv(W), dtype=np.float64)
        return self

    def transform(self, U: Matrix) -> Matrix:
        """Encodings J = pinv(W) U of the columns of U (n, k): (r, k) float64, entries of either sign.

        Compare them with `transform` of the training columns, never with `encodings_`: the two differ
        by half their size.
        """
        if U.shape[0] != self.basis_.shape[0]:
            raise ValueError(f"columns of {self.basis_.shape[0]} pixels are needed, got {U.shape[0]}")
        return np.asarray(self.inverse_ @ U)

    def reconstruct(self, U: Matrix) -> Matrix:
        """The part of the columns of U (n, k) that the basis can show, W pinv(W) U: (n, k)."""
        return np.asarray(self.basis_ @ self.transform(U))


def _checked(V: Matrix) -> Matrix:
    V = np.asarray(V, dtype=np.float64)
    if V.ndim != 2 or V.size == 0:
        raise ValueError(f"V must be a matrix of pixels x views, got shape {V.shape}")
    if not np.isfinite(V).all() or (V < 0).any():
        raise ValueError("V must be finite and non-negative: prepare the views first")
    return V


def _random_start(V: Matrix, rank: int, seed: int) -> tuple[Matrix, Matrix]:
    """Non-negative random W, H whose product has about the mean of V; the seed alone decides them."""
    rng = np.random.default_rng(seed)
    size = np.sqrt(max(float(V.mean()), _TINY) / rank)
    W = size * np.abs(rng.standard_normal((V.shape[0], rank)))
    H = size * np.abs(rng.standard_normal((rank, V.shape[1])))
    return W, H


def _has_settled(errors: Sequence[float], tolerance: float, span: int = 10) -> bool:
    if len(errors) <= span or (len(errors) - 1) % span:
        return False
    return errors[-1 - span] - errors[-1] < tolerance * errors[-1 - span]


# ------------------------------------------------------------------------------------- choice of rank


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
    V = _checked(V)
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
