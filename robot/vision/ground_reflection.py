"""What a glossy floor mirrors: it triangulates below the floor, yet nothing falls away there.

A mirrored point lies as far below the floor as the thing itself stands above it, and looks the same upside
down. Both eyes see the thing too, so the picture about it, mirrored at the floor's plane, must look like the
picture about the point. A step down has no such twin. Whatever cannot be compared stays a step down.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from calib.model import Camera, Vector
from robot.vision.ground_patches import bilinear, normalised, offsets, patches_at
from robot.vision.ground_plane import GroundPlane
from robot.vision.ground_points import rays_of

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Pixels = NDArray[np.float64]

HALF_PX = 3
"""Half the side of the patches compared."""
LEAST_LIKENESS = 0.75
"""Correlation of a mirrored patch with its twin: floor with floor is below 0.5."""
FOOT_M = 0.12
"""Mirrored points of one thing stand within this of one another, seen from above."""
FEWEST_TWINS = 2
"""One likeness alone is chance."""
SLIDES_PX = (-1.0, 0.0, 1.0)
"""A depth off by a little puts the twin so much higher or lower."""
FLOOR_LIKENESS = 0.6
"""Correlation of both eyes' patches where floor is expected, from which on it looks like floor."""
AMID_PX, AMID_LEAST, AMID_SHARE = 28.0, 4, 0.4
"""Half a neighbourhood's side, the fewest corners like floor in it, and their share: by chance it is 0.1."""
AMID_GAP = math.radians(150.0)
"""Floor about a point leaves no gap so wide; behind a straight edge it leaves 180 degrees or more."""


def mirrored(
    picture: Floats, camera: Camera, plane: GroundPlane, pixels: Pixels, depth: Vector, sigma: Vector
) -> Mask:
    """Which points below the floor are mirror images, (N,) bool.

    A point is one if its twin above the floor looks the same, or if it stands where two such points stand
    (most of a tall thing's mirror image has its twin above the picture).

    Args:
        picture: (H, W) left, grey float32, of half size: a patch there covers 14 pixels of the full one.
        camera: the left eye's at that size, undistorted.
        plane: the floor before it.
        pixels, depth, sigma: (N, 2) px of `picture`, (N,) m, (N,) m: the points below the floor.
    """
    if not len(pixels):
        return np.zeros(0, np.bool_)
    alike = twin_likeness(picture, camera, plane, pixels, depth) >= LEAST_LIKENESS
    if alike.sum() < FEWEST_TWINS:
        return np.zeros(len(pixels), np.bool_)
    normal = np.asarray(plane.normal)
    points = rays_of(pixels, camera) * depth[:, None]
    # Seen from above: the floor's normal taken out.
    flat = points - (points @ normal)[:, None] * normal
    apart = np.linalg.norm(flat[:, None] - flat[None, alike], axis=2)
    near = apart < FOOT_M + 2.0 * np.hypot(sigma[:, None], sigma[None, alike])
    return np.asarray(near.sum(axis=1) >= FEWEST_TWINS)


def twin_likeness(
    picture: Floats, camera: Camera, plane: GroundPlane, pixels: Pixels, depth: Vector
) -> Vector:
    """Correlation (N,) of the picture about points below the floor with that about their twins above it.

    0 where the twin lies outside the picture or there is no contrast. The patch is taken for upright and
    facing the eye: each of its pixels is put at the point's depth, mirrored at the plane and seen again.
    """
    side = offsets(HALF_PX).T
    around = (pixels[:, None, :] + side).reshape(-1, 2)
    normal = np.asarray(plane.normal)
    points = rays_of(around, camera) * np.repeat(depth, len(side))[:, None]
    above = points - 2.0 * (points @ normal - plane.height)[:, None] * normal
    twins = (above / np.maximum(above[:, 2:], 1e-3)) @ camera.matrix.T
    u, v = (twins[:, k].reshape(-1, len(side)).astype(np.float32) for k in (0, 1))
    height, width = picture.shape
    inside = (u.min(axis=1) >= 0.0) & (u.max(axis=1) <= width - 1)
    inside &= (v.min(axis=1) >= 0.0) & (v.max(axis=1) <= height - 1)
    here = normalised(patches_at(picture, pixels, HALF_PX))
    there = [normalised(bilinear(picture, u, v + np.float32(by))) for by in SLIDES_PX]
    likeness = np.max([np.einsum("nm,nm->n", here, twin) for twin in there], axis=0)
    return np.where(inside, likeness, 0.0).astype(np.float64)


def amid_floor(pixels: Pixels, corners: Pixels, floor: Mask) -> Mask:
    """Which points far below the floor have floor all about them, (N,) bool.

    A mirror image of what stands out of view (a far wall, a lamp) has no twin to compare it with, but the
    floor that shows it is seen between its points. Behind an edge there is no floor: what looks like floor
    by chance is rare, and floor about a point at the edge lies to one side. Holds only for points so deep
    that chance decides (`DEEP_PX`); a hole in the floor counts if it is wider than the neighbourhood.

    Args:
        pixels: (N, 2) px, points that seem to lie far below the floor.
        corners: (M, 2) px, corners of the left picture.
        floor: (M,) bool: which of them look alike in both eyes where floor is expected.
    """
    counts, like = (_near(pixels, corners[kept]) for kept in (slice(None), floor))
    enough = np.flatnonzero(like.sum(axis=1) >= np.maximum(AMID_LEAST, AMID_SHARE * counts.sum(axis=1)))
    amid = np.zeros(len(pixels), np.bool_)
    for k in enough:
        towards = corners[floor][like[k]] - pixels[k]
        amid[k] = _widest_gap(np.arctan2(towards[:, 1], towards[:, 0])) < AMID_GAP
    return amid


def near_any(pixels: Pixels, corners: Pixels) -> Mask:
    """Which corners (M,) lie in the neighbourhood of any of the pixels: `amid_floor` asks for no others."""
    return np.asarray(_near(pixels, corners).any(axis=0))


def _near(pixels: Pixels, corners: Pixels) -> Mask:
    """Which corners (M, 2) lie in the neighbourhoods of pixels (N, 2), (N, M)."""
    across, down = (np.abs(pixels[:, None, k] - corners[:, k]) < AMID_PX for k in (0, 1))
    return np.asarray(across & down)


def _widest_gap(angles: Vector) -> float:
    """Between neighbouring directions, radians."""
    ordered = np.sort(angles)
    return float(np.diff(ordered, append=ordered[0] + math.tau).max())
