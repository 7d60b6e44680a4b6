"""Non-negative matrix factorisation V ~ W H: basis images W and encodings H of a target's views.

Columns of V are prepared views (`prepared_view`). W (n x r) holds r basis images of n pixels, H (r x m) the
encodings of m views, everything non-negative. What is minimised is an `Objective` that is handed to `NMF`:
`nmf_objectives` has the two published ones, `nmf_variants` the sparse, local and class-aware ones.

Sources: Lee & Seung, *Algorithms for Non-negative Matrix Factorization*, NIPS 2000; Wu & Snášel, *A
Vision-based Navigation System of Mobile Tracking Robot*, SMC 2010 (encodings by the pseudo-inverse).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robot.vision.nmf_objectives import EUCLIDEAN, TINY, Matrix, Objective


class NMF:
    """Factorises views into basis images and encodings; verbs and names as scikit-learn's, views in columns.

    Parameters: rank r >= 1; objective; max_iterations >= 1 (the publication stops at about 50);
    tolerance: stop when ten rounds together lower the cost by less than this share of it, None: make all
    rounds and look at the cost at the end alone; seed of the random start; cost_every: rounds from one look
    at the cost to the next (a divisor of ten).

    After `fit`: basis_ (n, r), components_ (r, n) the same with images in rows, encodings_ (r, m), errors_
    (cost before the first round and at every look), reconstruction_err_ (||V - WH||), n_iter_ rounds,
    inverse_ (r, n) = pinv(basis_). Everything has the type of V, float64 or float32.

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
        tolerance: float | None = 1e-2,
        seed: int = 0,
        cost_every: int = 10,
    ) -> None:
        if rank < 1:
            raise ValueError(f"rank must be at least 1, got {rank}")
        if max_iterations < 1:
            raise ValueError(f"max_iterations must be at least 1, got {max_iterations}")
        if cost_every < 1 or _SPAN % cost_every:
            raise ValueError(f"cost_every must be a divisor of {_SPAN}, got {cost_every}")
        self.rank = rank
        self.objective = objective
        self.max_iterations = max_iterations
        self.tolerance = tolerance
        self.seed = seed
        self.cost_every = cost_every
        self.basis_: Matrix = np.empty((0, rank))
        self.encodings_: Matrix = np.empty((rank, 0))
        self._inverse: Matrix | None = None
        self.errors_: list[float] = []
        self.n_iter_ = 0
        self.reconstruction_err_ = 0.0

    @property
    def components_(self) -> Matrix:
        """Basis images in rows, (r, n)."""
        return self.basis_.T

    @property
    def inverse_(self) -> Matrix:
        """pinv(basis_), (r, n)."""
        if self._inverse is None:
            self._inverse = np.linalg.pinv(self.basis_)
        return self._inverse

    def fit(self, V: Matrix, start: tuple[Matrix, Matrix] | None = None) -> NMF:
        """Learn basis and encodings of the columns of V (n, m), all entries finite and >= 0. Returns self.

        start: W (n, r) and H (r, m) to begin with; None: random ones.
        """
        V = checked(V)
        W, H = start if start is not None else _random_start(V, self.rank, self.seed)
        errors = [self.objective.cost(V, W @ H)]
        for round_ in range(1, self.max_iterations + 1):
            W, H = self.objective.update(V, W, H)
            self.n_iter_ = round_
            if self.tolerance is None or round_ % self.cost_every:
                continue
            errors.append(self.objective.cost(V, W @ H))
            looks = _SPAN // self.cost_every
            if round_ % _SPAN == 0 and _has_settled(errors, self.tolerance, looks):
                break
        if self.tolerance is None or self.n_iter_ % self.cost_every:
            errors.append(self.objective.cost(V, W @ H))
        self.basis_, self.encodings_, self.errors_ = W, H, errors
        self.reconstruction_err_ = float(np.linalg.norm(V - W @ H))
        self._inverse = None
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


def checked(V: Matrix) -> Matrix:
    """V as float64, or float32 if it is; raises ValueError if it is no finite non-negative matrix."""
    V = np.asarray(V)
    V = V if V.dtype == np.float32 else np.asarray(V, np.float64)
    if V.ndim != 2 or V.size == 0:
        raise ValueError(f"V must be a matrix of pixels x views, got shape {V.shape}")
    if not np.isfinite(V).all() or (V < 0).any():
        raise ValueError("V must be finite and non-negative: prepare the views first")
    return V


_SPAN = 10


def _random_start(V: Matrix, rank: int, seed: int) -> tuple[Matrix, Matrix]:
    """Non-negative random W, H whose product has about the mean of V; the seed alone decides them."""
    rng = np.random.default_rng(seed)
    size = np.sqrt(max(float(V.mean()), TINY) / rank)
    W = size * np.abs(rng.standard_normal((V.shape[0], rank)))
    H = size * np.abs(rng.standard_normal((rank, V.shape[1])))
    return W.astype(V.dtype), H.astype(V.dtype)


def _has_settled(errors: Sequence[float], tolerance: float, looks: int) -> bool:
    return len(errors) > looks and errors[-1 - looks] - errors[-1] < tolerance * errors[-1 - looks]
