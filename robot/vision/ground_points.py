"""Matched pixels become points: where the two rays pass nearest to one another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.model import Camera, Matrix, StereoRig, Vector

Mask = NDArray[np.bool_]
Pixels = NDArray[np.float64]

STEP_PX = 0.25
"""Of the numerical derivative of depth along the row."""
LEAST_ANGLE = 1e-4
"""Rays nearer to parallel than this (sine) meet nowhere one can tell: 600 m for eyes 60 mm apart."""


@dataclass(frozen=True, slots=True, eq=False)
class SeenPoints:
    """rays (N, 3): lines of sight of the left pixels in the robot frame, for one metre of depth; depth (N,):
    camera z of the left eye, metres; sigma (N,): of depth, metres; before (N,) bool: the rays meet at all."""

    rays: Matrix
    depth: Vector
    sigma: Vector
    before: Mask

    def points(self, eye: Vector) -> Matrix:
        """(N, 3) robot frame; eye (3,): where the left lens is."""
        return np.asarray(eye + self.depth[:, None] * self.rays)

    def some(self, rows: NDArray[np.intp]) -> SeenPoints:
        """Those of these rows."""
        return SeenPoints(self.rays[rows], self.depth[rows], self.sigma[rows], self.before[rows])


def triangulate(left: Pixels, right: Pixels, rig: StereoRig) -> tuple[Vector, Mask]:
    """Depth (N,) along the left rays of their nearest approach to the right ones; and where there is one.

    left, right: (N, 2) px; rig: undistorted pair. Depth: left camera's z, metres; means nothing where False.

    >>> rig = StereoRig.parallel(352, 288, 305.0, 0.06)
    >>> depth, there = triangulate(np.array([[200.0, 90.0]]), np.array([[180.0, 90.0]]), rig)
    >>> depth.round(6).tolist(), there.tolist()
    ([0.915], [True])
    """
    ahead, lens = rays_of(left, rig.left), -rig.R.T @ np.asarray(rig.translation)
    return _nearest(ahead, rays_of(right, rig.right) @ rig.R, lens)


def seen_points(
    left: Pixels, right: Pixels, sigma_px: Vector, rig: StereoRig, rotation: Matrix
) -> SeenPoints:
    """Points of matches; sigma_px (N,): of the right columns; rotation (3, 3): left camera to robot frame."""
    ahead, lens = rays_of(left, rig.left), -rig.R.T @ np.asarray(rig.translation)
    aside = rays_of(right, rig.right)
    depth, there = _nearest(ahead, aside @ rig.R, lens)
    moved, still = _nearest(ahead, (aside + np.array([STEP_PX / rig.right.fx, 0.0, 0.0])) @ rig.R, lens)
    # Inverse depth is linear in the column, depth is not.
    slope = np.abs(1.0 / np.where(still, moved, np.inf) - 1.0 / np.where(there, depth, np.inf)) / STEP_PX
    there &= slope > 0.0
    return SeenPoints(
        ahead @ rotation.T,
        np.where(there, depth, 0.0),
        np.where(there, depth * depth * slope * sigma_px, np.inf),
        there,
    )


def rays_of(pixels: Pixels, camera: Camera) -> Matrix:
    """Lines of sight (N, 3) of pixels (N, 2), z = 1, camera frame; undistorted."""
    rays = np.ones((len(pixels), 3))
    rays[:, :2] = (pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    return rays


def _nearest(ahead: Matrix, aside: Matrix, lens: Vector) -> tuple[Vector, Mask]:
    """How far along rays (N, 3) from the origin they pass nearest to rays `aside` from `lens`; if ahead."""
    aa, bb, ab = (np.einsum("ni,ni->n", p, q) for p, q in ((ahead, ahead), (aside, aside), (ahead, aside)))
    angle = aa * bb - ab * ab
    there = angle > LEAST_ANGLE**2 * aa * bb
    depth = ((ahead @ lens) * bb - (aside @ lens) * ab) / np.where(there, angle, 1.0)
    return depth, there & (depth > 0.0)
