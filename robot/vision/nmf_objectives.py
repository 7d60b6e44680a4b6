"""What a factorisation V ~ W H minimises, and one step towards it: the two costs of Lee and Seung.

Source: Lee & Seung, *Algorithms for Non-negative Matrix Factorization*, NIPS 2000.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[Any]
"""float64 or float32; results have the type of what they are made from."""
Update = Callable[[Matrix, Matrix, Matrix], tuple[Matrix, Matrix]]
Cost = Callable[[Matrix, Matrix], float]

TINY = 1e-12
"""Keeps quotients finite where a product has become exactly zero."""


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
    H = _scaled(H, W.T @ V, (W.T @ W) @ H)
    W = _scaled(W, V @ H.T, W @ (H @ H.T))
    return W, H


def divergence_cost(V: Matrix, WH: Matrix) -> float:
    """sum(V log(V/WH) - V + WH), the generalised Kullback-Leibler divergence; 0 log 0 counts as 0.

    >>> divergence_cost(np.ones((2, 2)), np.ones((2, 2)))
    0.0
    """
    WH = np.maximum(WH, TINY)
    logs = np.log(np.where(V > 0, V, 1.0) / np.where(V > 0, WH, 1.0))
    return float((V * logs - V + WH).sum())


def divergence_update(V: Matrix, W: Matrix, H: Matrix) -> tuple[Matrix, Matrix]:
    """One round of the divergence's multiplicative update (Lee & Seung 2000, equation 5).

    V (n, m), W (n, r), H (r, m), all >= 0. Returns the new W and H; the divergence never increases.
    """
    H = _scaled(H, W.T @ _quotient(V, W @ H), W.sum(axis=0)[:, None])
    W = _scaled(W, _quotient(V, W @ H) @ H.T, H.sum(axis=1)[None, :])
    return W, H


def _scaled(factor: Matrix, above: Matrix, below: Matrix) -> Matrix:
    """factor * above / below; `above` is written over."""
    above /= np.maximum(below, TINY)
    above *= factor
    return above


def _quotient(V: Matrix, WH: Matrix) -> Matrix:
    """V / WH; `WH` is written over."""
    np.maximum(WH, TINY, out=WH)
    return np.divide(V, WH, out=WH)


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
