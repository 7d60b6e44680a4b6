"""The small rigid motion that explains how points seen by a camera moved in its picture.

A motion D = (rotation, translation) of the body that carries the camera takes a point Q of the body's
predicted frame to D^-1 Q. `fit` finds the D whose points project to where they were seen: Gauss-Newton with
redescending weights (Geman & McClure 1987) whose scale is lowered step by step (graduated non-convexity,
Blake & Zisserman 1987), so that it needs no random samples and finds the motion of the majority.
METHODS 5 solves for (x, z, heading); here height, roll and pitch are free as well: a base that is lifted
or tipped leaves the floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NEAREST_M = 0.05
"""Depth below which a point has no place in the picture any more."""
ROUNDS, FINE_ROUNDS = 7, 4
LEAST_SCALE, WIDEST_SCALE = 2.0, 40.0
"""Scale of the weights in standard deviations of a pixel: where they end, and the widest they begin."""
RIDGE = 1e-6
"""Keeps the normal equations solvable where the points leave a direction open."""


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """A pinhole camera on the body: focal lengths and centre in pixels, rotation camera to body, position."""

    fx: float
    fy: float
    cx: float
    cy: float
    rotation: Array
    position: Array

    def project(self, points: Array) -> tuple[Array, Array]:
        """Pixels (N, 2) of points (N, 3) in the body's frame, and their derivative by the point (N, 2, 3)."""
        camera = (points - self.position) @ self.rotation
        z = np.maximum(camera[:, 2], NEAREST_M)
        x, y = camera[:, 0] / z, camera[:, 1] / z
        pixels = np.column_stack([self.cx + self.fx * x, self.cy + self.fy * y])
        by_camera = np.zeros((len(points), 2, 3))
        by_camera[:, 0, 0], by_camera[:, 0, 2] = self.fx / z, -self.fx * x / z
        by_camera[:, 1, 1], by_camera[:, 1, 2] = self.fy / z, -self.fy * y / z
        return pixels, by_camera @ self.rotation.T


@dataclass(frozen=True, slots=True, eq=False)
class RigidFit:
    """D as (x, y, z, roll, pitch, yaw) in metres and radians, its covariance (6, 6), residuals (N,) in px."""

    motion: Array
    covariance: Array
    residuals: Array


def fit(points: Array, pixels: Array, sight: Sight, sigma_px: float) -> RigidFit:
    """Fit D to at least 6 points (N, 3) of the predicted frame seen at pixels (N, 2), each sigma_px sure.

    Raises ValueError for fewer points: six unknowns need them.
    """
    if len(points) < 6:
        raise ValueError(f"a rigid motion needs 6 points or more, got {len(points)}")
    rotation, translation = np.eye(3), np.zeros(3)
    spread = 2.0 * float(np.median(_lengths(residuals(points, pixels, sight)))) / sigma_px
    start = min(max(spread, LEAST_SCALE), WIDEST_SCALE)
    scales = np.geomspace(start, LEAST_SCALE, ROUNDS).tolist() + [LEAST_SCALE] * FINE_ROUNDS
    for scale in scales:
        moved = (points - translation) @ rotation
        seen, by_point = sight.project(moved)
        error = pixels - seen
        jacobian = _by_motion(moved, by_point)
        weights = _weights(_lengths(error) / (sigma_px * scale))
        step = _solve(jacobian, error, weights)
        translation = translation + rotation @ step[:3]
        rotation = rotation @ rotation_of(step[3:])
    moved = (points - translation) @ rotation
    seen, by_point = sight.project(moved)
    lengths = _lengths(pixels - seen)
    information = _information(_by_motion(moved, by_point), _weights(lengths / (sigma_px * LEAST_SCALE)))
    covariance = np.linalg.inv(information / sigma_px**2 + RIDGE * np.eye(6))
    motion = np.concatenate([translation, vector_of(rotation)])
    return RigidFit(motion, np.asarray(covariance, dtype=np.float64), lengths)


def residuals(points: Array, pixels: Array, sight: Sight) -> Array:
    """Pixels (N, 2) by which points were seen aside from where the prediction puts them."""
    return pixels - sight.project(points)[0]


def explained(points: Array, pixels: Array, sight: Sight, doubt: Array, sigma_px: float) -> Array:
    """Distance (N,) of each point from its prediction, in standard deviations of pixel and prediction.

    doubt: covariance (6, 6) of the predicted motion, order as in `RigidFit.motion`.
    """
    seen, by_point = sight.project(points)
    error = pixels - seen
    jacobian = _by_motion(points, by_point)
    spread = jacobian @ doubt @ jacobian.transpose(0, 2, 1) + sigma_px**2 * np.eye(2)
    solved = np.linalg.solve(spread, error[..., None])[..., 0]
    return np.asarray(np.sqrt(np.maximum(np.sum(error * solved, axis=1), 0.0)))


def rotation_of(vector: Array) -> Array:
    """Rotation matrix of a rotation vector (Rodrigues).

    >>> bool(np.allclose(vector_of(rotation_of(np.array([0.1, -0.2, 0.3]))), [0.1, -0.2, 0.3]))
    True
    """
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    k = _cross(vector / angle)
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k))


def vector_of(rotation: Array) -> Array:
    """Rotation vector of a rotation matrix that turns by less than half a turn."""
    odd = 0.5 * np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    sine = float(np.linalg.norm(odd))
    angle = float(np.arctan2(sine, 0.5 * (np.trace(rotation) - 1.0)))
    return odd if sine < 1e-9 else odd * (angle / sine)


def _by_motion(points: Array, by_point: Array) -> Array:
    """Derivative (N, 2, 6) of the pixels by a small motion of the body: dQ = -t - w x Q = -t + [Q] w."""
    turned = np.zeros((len(points), 3, 3))
    x, y, z = points.T
    turned[:, 0, 1], turned[:, 0, 2] = -z, y
    turned[:, 1, 0], turned[:, 1, 2] = z, -x
    turned[:, 2, 0], turned[:, 2, 1] = -y, x
    return np.concatenate([-by_point, by_point @ turned], axis=2)


def _solve(jacobian: Array, error: Array, weights: Array) -> Array:
    information = _information(jacobian, weights) + RIDGE * np.eye(6)
    pull = np.einsum("nij,ni,n->j", jacobian, error, weights)
    return np.asarray(np.linalg.solve(information, pull), dtype=np.float64)


def _information(jacobian: Array, weights: Array) -> Array:
    flat = (jacobian * np.sqrt(weights)[:, None, None]).reshape(-1, 6)
    return np.asarray(flat.T @ flat, dtype=np.float64)


def _weights(scaled: Array) -> Array:
    """Geman-McClure: 1 at 0, a quarter at 1, next to nothing beyond 3."""
    return 1.0 / (1.0 + scaled**2) ** 2


def _lengths(vectors: Array) -> Array:
    return np.hypot(vectors[:, 0], vectors[:, 1])


def _cross(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
