"""A target's views in the coordinates of their NMF basis, and how windows of a picture compare with them.

Encodings are J = pinv(W) U ([W], section II). Two comparisons are offered: over a whole picture by
filtering, with windows normalised but not clipped (clipping is not linear), and for a stack of windows
with the clipping of the training views.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.vision.nmf import NMF
from robot.vision.nmf_objectives import Objective
from robot.vision.prepared_view import FLAT_STD, TARGET_MEAN, TARGET_STD, Matrix, prepare
from robot.vision.windows import Floats, local_mean_std

# Windows of the whole picture are compared with at most this many typical views: more cost time, not misses.
TYPICAL_VIEWS = 24
# Below this spread of grey values sensor noise outweighs any print.
_FLAT_WINDOW_STD = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class ViewSpace:
    """m training views of one size (width, height), n = width * height pixels, in a basis of rank r.

    inverse (r, n): pinv(W). encodings (r, m): pinv(W) V with columns of length 1. columns (m, n): the
    prepared views with mean 0 and length 1. gauge (t, r): weighs encodings of windows with mean 0 and
    standard deviation 1 so that they become correlations with t typical views.
    """

    size: tuple[int, int]
    inverse: Floats
    encodings: Floats
    columns: Floats
    gauge: Floats

    @classmethod
    def learn(
        cls, views: Sequence[Floats], size: tuple[int, int], rank: int, seed: int, objective: Objective
    ) -> ViewSpace:
        """Factorise grey views (each (H, W) float32, 0..255). Raises FlatViewError for a flat one."""
        V = np.column_stack([prepare(view, size) for view in views])
        model = NMF(rank, objective, seed=seed).fit(V)
        encodings = _unit_columns(model.transform(V))
        centred = V - V.mean(axis=0)
        columns = _unit_columns(centred).T
        typical = _representatives(columns, TYPICAL_VIEWS)
        # The views themselves, not their centred forms, lie in the span of the basis.
        spread = np.linalg.norm(centred[:, typical], axis=0)[:, None]
        return cls(
            size,
            np.ascontiguousarray(model.inverse_, np.float32),
            np.ascontiguousarray(encodings, np.float32),
            np.ascontiguousarray(columns, np.float32),
            np.ascontiguousarray(V[:, typical].T @ model.basis_ / (spread * math.sqrt(len(V))), np.float32),
        )

    def similarity_map(self, grey: Floats) -> Floats:
        """How near the encoding of every window of a picture lies to the nearest typical view's encoding.

        grey (H, W) float32, 0..255, already at the scale where the target has `size`. Returns
        (H - height + 1, W - width + 1) float32 in about -1..1, indexed by the window's top left corner;
        flat windows get -1. Nearness is the correlation of the window with the view's reconstruction,
        t' W pinv(W) u: the basis is not orthogonal, and a bare cosine of encodings would neither know
        that nor see what of the window lies outside the basis.
        """
        width, height = self.size
        mean, std = local_mean_std(grey, self.size)
        rows, columns = std.shape
        responses = np.empty((len(self.inverse), rows, columns), np.float32)
        for response, row in zip(responses, self.inverse, strict=True):
            kernel = row.reshape(height, width)
            filtered = cv2.filter2D(grey, cv2.CV_32F, kernel, anchor=(0, 0))[:rows, :columns]
            np.multiply(mean, -kernel.sum(), out=response)
            response += filtered
        nearest = (self.gauge @ responses.reshape(len(self.inverse), -1)).max(axis=0).reshape(rows, columns)
        return np.where(std < _FLAT_WINDOW_STD, np.float32(-1.0), nearest / np.maximum(std, _FLAT_WINDOW_STD))

    def prepared(self, pixels: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Windows (k, n) scaled and clipped as the training views were; which are not flat (k,)."""
        scaled = pixels - pixels.mean(axis=1, keepdims=True)
        std = np.sqrt(np.einsum("ij,ij->i", scaled, scaled) / np.float32(pixels.shape[1]))
        scaled *= (np.float32(TARGET_STD) / np.maximum(std, np.float32(FLAT_STD)))[:, None]
        scaled += np.float32(TARGET_MEAN)
        return np.clip(scaled, 0.0, 1.0, out=scaled), std >= FLAT_STD

    def encoding_similarity(self, prepared: Floats) -> Floats:
        """Cosine of each prepared window's encoding with every training encoding: (k, n) -> (k, m)."""
        encodings = prepared @ self.inverse.T
        lengths = np.maximum(np.sqrt(np.einsum("ij,ij->i", encodings, encodings)), 1e-9)[:, None]
        return np.asarray(encodings @ self.encodings / lengths, dtype=np.float32)

    def correlation(self, prepared: Floats) -> Floats:
        """Normalised correlation of prepared windows with every training view: (k, n) -> (k, m)."""
        centred = prepared - prepared.mean(axis=1, keepdims=True)
        lengths = np.maximum(np.linalg.norm(centred, axis=1, keepdims=True), 1e-9)
        return np.asarray(centred @ self.columns.T / lengths, dtype=np.float32)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Everything needed to rebuild the space, as plain arrays."""
        return {
            "size": np.asarray(self.size, np.int32),
            "inverse": self.inverse,
            "encodings": self.encodings,
            "columns": self.columns,
            "gauge": self.gauge,
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[np.generic]]) -> ViewSpace:
        """The inverse of `arrays`. Raises KeyError or ValueError where they do not fit together."""
        width, height = (int(edge) for edge in arrays["size"])
        inverse, encodings, columns, gauge = (
            np.asarray(arrays[name], np.float32) for name in ("inverse", "encodings", "columns", "gauge")
        )
        rank, pixels = inverse.shape
        views = columns.shape[0]
        if pixels != width * height or encodings.shape != (rank, views) or columns.shape != (views, pixels):
            raise ValueError("the arrays of a view space do not fit together")
        if gauge.ndim != 2 or gauge.shape[1] != rank or not len(gauge):
            raise ValueError("the gauge of a view space does not fit its basis")
        return cls((width, height), inverse, encodings, columns, gauge)


def window_size(aspect: float, pixels: int) -> tuple[int, int]:
    """(width, height) of about `pixels` pixels for windows of width/height = aspect.

    >>> window_size(0.5, 128)
    (8, 16)
    """
    height = max(4, round(math.sqrt(pixels / aspect)))
    return max(4, round(aspect * height)), height


def _unit_columns(matrix: Matrix) -> Matrix:
    return np.asarray(matrix / np.maximum(np.linalg.norm(matrix, axis=0), 1e-12))


def _representatives(columns: Matrix, count: int) -> NDArray[np.int32]:
    """Indices of up to `count` rows that cover the others: the most typical, then always the farthest."""
    similarity = columns @ columns.T
    chosen = [int(similarity.sum(axis=1).argmax())]
    covered = similarity[chosen[0]].copy()
    while len(chosen) < min(count, len(columns)):
        chosen.append(int(covered.argmin()))
        covered = np.maximum(covered, similarity[chosen[-1]])
    return np.asarray(sorted(set(chosen)), np.int32)
