"""A match found to a pixel, placed to a fraction of one by least squares, with an honest sigma."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot.vision.ground_patches import bilinear, offsets, patches_at

Floats = NDArray[np.float32]
Pixels = NDArray[np.float64]
Vector = NDArray[np.float64]

FINE_HALF = 5
"""Half the side of the patches compared, px."""
STEPS, MOST = 3, 3.0
"""Of the search, and how far it may lead, px."""
GAINS = (0.4, 2.5)
"""Ratio of the eyes' contrasts that is still believed: beyond it the patches show different things."""
SIGMA_FLOOR_PX, SIGMA_GAIN = 0.04, 1.8
"""What residuals do not tell: lenses, interpolation, surfaces that are not plane; both measured."""


def placed(
    left: Floats, right: Floats, points: Pixels, u: Floats, v: Floats
) -> tuple[Pixels, Vector, Vector]:
    """Places (N, 2) in the right picture, sigma px (N,) along the row, and the correlation (N,) reached.

    Least squares over the patch's shift, its slants and a little rise (Gauss-Newton with the left patch's
    gradients, which need no new normal matrix in each step); gain and offset free. The normal matrix is the
    correlation peak's curvature: sigma^2 = residual variance x inverse normal matrix, times what was measured
    to be left out of that.

    Args:
        left, right: grey pictures, float32.
        points: (N, 2) px of the left picture, N > 0.
        u, v: (N, S S) px of the right one, where the pixels of the patches about the points are to be found,
            within about a pixel; see `ground_patches.squares`.
    """
    template = _template(left, points)
    shift = np.zeros((len(points), 4), np.float32)
    for _ in range(STEPS):
        seen = bilinear(right, u + shift[:, :3] @ _BASIS, v + shift[:, 3:])
        mean = seen @ _NEAR
        other = (seen * seen) @ _NEAR - mean * mean
        onto = np.einsum("nkm,nm->nk", template.onto, seen)
        cross = onto[:, 4]
        gain = np.clip(cross / np.maximum(other, np.float32(1e-3)), *GAINS)
        # What is held is drawn back to nothing.
        slope = template.own[:, :4] - gain[:, None] * onto[:, :4] - shift * _HOLD
        step = (template.inverse @ slope[:, :, None])[:, :, 0]
        shift = np.clip(shift + step, -MOST, MOST)
    own = template.own[:, 4]
    variance = np.maximum(own - gain * (2.0 * cross - gain * other), 0.0)
    sigma = np.sqrt(SIGMA_GAIN**2 * variance * template.inverse[:, 0, 0] / _INDEPENDENT + SIGMA_FLOOR_PX**2)
    correlation = cross / np.sqrt(np.maximum(own * other, np.float32(1e-6)))
    places = np.column_stack([u[:, _MIDDLE] + shift[:, 0], v[:, _MIDDLE] + shift[:, 3]])
    return places.astype(np.float64), sigma.astype(np.float64), correlation.astype(np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class _Template:
    """Left patches as the search needs them.

    onto (N, 5, S S): how the patch changes with shift, two slants and rise, and the patch itself; weighted,
    without their means. own (N, 5): the patch seen by these; inverse (N, 4, 4): of the normal matrix.
    """

    onto: Floats
    own: Floats
    inverse: Floats


def _template(left: Floats, points: Pixels) -> _Template:
    side = 2 * FINE_HALF + 3
    wide = patches_at(left, points, FINE_HALF + 1).reshape(-1, side, side)
    along = (0.5 * (wide[:, 1:-1, 2:] - wide[:, 1:-1, :-2])).reshape(len(points), -1)
    down = (0.5 * (wide[:, 2:, 1:-1] - wide[:, :-2, 1:-1])).reshape(len(points), -1)
    patch = wide[:, 1:-1, 1:-1].reshape(len(points), -1)
    mean = np.column_stack([along @ _WEIGHTED, down @ _NEAR, patch @ _NEAR])
    onto = np.empty((len(points), 5, patch.shape[1]), np.float32)
    np.multiply(along[:, None, :], _BASIS, out=onto[:, :3])
    onto[:, 3], onto[:, 4] = down, patch
    onto -= mean[:, :, None]
    onto *= _NEAR
    inverse = np.linalg.inv(_normal_matrix(along, down, mean[:, :4]) + np.diag(_HOLD))
    return _Template(onto, np.einsum("nkm,nm->nk", onto, patch), np.asarray(inverse, np.float32))


def _normal_matrix(along: Floats, down: Floats, mean: Floats) -> Floats:
    """(N, 4, 4) of gradients (N, S S) along and down: shift, two slants, rise; less their means (N, 4)."""
    normal = np.empty((len(along), 4, 4), np.float32)
    # All products of the basis at once: linear in the gradients' squares.
    normal[:, :3, :3] = ((along * along) @ _PRODUCTS).reshape(-1, 3, 3)
    normal[:, :3, 3] = normal[:, 3, :3] = (along * down) @ _WEIGHTED
    normal[:, 3, 3] = (down * down) @ _NEAR
    return normal - mean[:, :, None] * mean[:, None, :]


def _nearness() -> Floats:
    """How much a patch's pixels count (S S,): a Gaussian of 0.7 of its half side; sum 1."""
    near = np.exp(-(_X * _X + _Y * _Y) / np.float32(2.0 * (0.7 * FINE_HALF) ** 2))
    return np.asarray(near / near.sum(), np.float32)


_X, _Y = offsets(FINE_HALF)
_MIDDLE = _X.size // 2
_NEAR = _nearness()
_BASIS = np.stack([np.ones_like(_X), _X / FINE_HALF, _Y / FINE_HALF]).astype(np.float32)
"""How shift and the two slants move a patch's columns, (3, S S)."""
_WEIGHTED = np.ascontiguousarray((_BASIS * _NEAR).T)
_PRODUCTS = np.ascontiguousarray((_BASIS[:, None] * _BASIS[None] * _NEAR).reshape(9, -1).T)
_INDEPENDENT = 1.0 / float((_NEAR * _NEAR).sum())
_HOLD = np.array([1e-3, 2.0, 2.0, 5.0], np.float32)
"""A patch without the texture to tell its slant or rise keeps none; a match hardly rises."""
