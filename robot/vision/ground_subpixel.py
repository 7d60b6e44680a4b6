"""A match found to a pixel, placed to a fraction of one by least squares, with an honest sigma."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot.vision.ground_patches import bilinear, patches_at

Floats = NDArray[np.float32]
Pixels = NDArray[np.float64]
Vector = NDArray[np.float64]

FINE_HALF = 5
"""Half the side of the patches compared, px."""
STEPS, MOST = 2, 3.0
"""Of the search, and how far it may lead, px."""
SIGMA_FLOOR_PX, SIGMA_GAIN = 0.05, 1.8
"""What residuals do not tell: lenses, interpolation, surfaces that are not plane; both measured."""


def placed(left: Floats, right: Floats, points: Pixels, found: Pixels) -> tuple[Pixels, Vector, Vector]:
    """Places (N, 2) in the right picture, sigma px (N,) along the row, and the correlation (N,) reached.

    Least squares over the patch's shift, its slants and a little rise (Gauss-Newton); gain and offset free.
    Its normal matrix is the correlation peak's curvature: sigma^2 = residual variance x inverse normal
    matrix, times what was measured to be left out of that.

    Args:
        left, right: grey pictures, float32.
        points: (N, 2) px of the left picture, N > 0.
        found: (N, 2) px of the right one, within about a pixel.
    """
    side = 2 * FINE_HALF + 1
    template = patches_at(left, points[:, 0], points[:, 1], FINE_HALF).reshape(-1, side * side)
    template = template - (template @ _NEAR)[:, None]
    own = (template * template) @ _NEAR
    shift = np.zeros((len(points), 4), np.float32)
    start_u, start_v = (found[:, k, None].astype(np.float32) + g for k, g in ((0, _WIDE_X), (1, _WIDE_Y)))
    for _ in range(STEPS):
        wide = bilinear(right, start_u + shift[:, :3] @ _WIDE_BASIS, start_v + shift[:, 3:])
        wide = wide.reshape(-1, side + 2, side + 2)
        seen = wide[:, 1:-1, 1:-1].reshape(-1, side * side)
        seen = seen - (seen @ _NEAR)[:, None]
        along, down = (
            _centred(0.5 * (after - before).reshape(-1, side * side))
            for after, before in (
                (wide[:, 1:-1, 2:], wide[:, 1:-1, :-2]),
                (wide[:, 2:, 1:-1], wide[:, :-2, 1:-1]),
            )
        )
        cross, other = (template * seen) @ _NEAR, (seen * seen) @ _NEAR
        gain = np.clip(cross / np.maximum(other, np.float32(1e-3)), 0.4, 2.5)
        residual = template - gain[:, None] * seen
        normal = _normal_matrix(along, down) * (gain * gain)[:, None, None] + _HOLD
        slope = np.column_stack([(along * residual) @ _WEIGHTED, (down * residual) @ _NEAR]) * gain[:, None]
        # The rise is known to be small: what is held is drawn back to nothing.
        slope -= shift * np.diagonal(_HOLD)
        inverse = np.linalg.inv(normal)
        shift = np.clip(shift + (inverse @ slope[:, :, None])[:, :, 0], -MOST, MOST).astype(np.float32)
    variance = (residual * residual) @ _NEAR
    sigma = np.sqrt(SIGMA_GAIN**2 * variance * inverse[:, 0, 0] / _INDEPENDENT + SIGMA_FLOOR_PX**2)
    correlation = cross / np.sqrt(np.maximum(own * other, np.float32(1e-6)))
    return found + shift[:, [0, 3]], sigma.astype(np.float64), correlation.astype(np.float64)


def _normal_matrix(along: Floats, down: Floats) -> Floats:
    """(N, 4, 4) of gradients (N, S S) along and down: shift, two slants, rise."""
    normal = np.empty((len(along), 4, 4), np.float32)
    # All products of the basis at once: linear in the gradients' squares.
    normal[:, :3, :3] = ((along * along) @ _PRODUCTS).reshape(-1, 3, 3)
    normal[:, :3, 3] = normal[:, 3, :3] = (along * down) @ _WEIGHTED
    normal[:, 3, 3] = (down * down) @ _NEAR
    return normal


def _centred(values: Floats) -> Floats:
    return np.asarray(values - (values @ _NEAR)[:, None], np.float32)


def _grid(half: int) -> tuple[Floats, Floats]:
    """Offsets x, y of a patch's pixels from its middle, flat."""
    step = np.arange(-half, half + 1, dtype=np.float32)
    y, x = np.meshgrid(step, step, indexing="ij")
    return x.ravel(), y.ravel()


def _basis(half: int) -> Floats:
    """How shift and the two slants move a patch's columns, (3, S S)."""
    x, y = _grid(half)
    return np.stack([np.ones_like(x), x / FINE_HALF, y / FINE_HALF]).astype(np.float32)


def _nearness() -> Floats:
    """How much a fine patch's pixels count (S S); sum 1."""
    x, y = _grid(FINE_HALF)
    near = np.exp(-(x * x + y * y) / np.float32(2.0 * (0.7 * FINE_HALF) ** 2))
    return np.asarray(near / near.sum(), np.float32)


_NEAR = _nearness()
_WIDE_X, _WIDE_Y = _grid(FINE_HALF + 1)
_WIDE_BASIS, _FINE_BASIS = _basis(FINE_HALF + 1), _basis(FINE_HALF)
_WEIGHTED = np.ascontiguousarray((_FINE_BASIS * _NEAR).T)
_PRODUCTS = np.ascontiguousarray((_FINE_BASIS[:, None] * _FINE_BASIS[None] * _NEAR).reshape(9, -1).T)
_INDEPENDENT = 1.0 / float((_NEAR * _NEAR).sum())
_HOLD = np.diag([1e-3, 2.0, 2.0, 1.0]).astype(np.float32)
"""A patch without the texture to tell its slant or rise keeps none."""
