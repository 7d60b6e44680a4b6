"""What a glossy floor mirrors: it triangulates below the floor, yet nothing falls away there.

A mirrored point lies as far below the floor as the thing itself stands above it, and looks the same upside
down. Both eyes see the thing too, so the picture about it, mirrored at the floor's plane, must look like the
picture about the point. A step down has no such twin. Whatever cannot be compared stays a step down.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.model import Camera, Matrix, Vector
from robot.vision.ground_plane import GroundPlane

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Pixels = NDArray[np.float64]

HALF_PX = 6
LEAST_LIKENESS = 0.75
LEAST_CONTRAST = 2.0
FOOT_M = 0.12
"""Mirrored points of one thing stand within this of one another, seen from above."""
FEWEST_TWINS = 2
DEEP_PX = 8.0
"""So far from where floor would be matched, a patch is like floor by chance alone."""
FLOOR_LIKENESS = 0.6
AMID_PX, AMID_LEAST, AMID_SHARE = 28.0, 4, 0.4
"""Half a neighbourhood's side, the fewest corners like floor in it, and their share: by chance it is 0.1."""
AMID_GAP = math.radians(150.0)
"""Floor about a point leaves no gap so wide; behind a straight edge it leaves 180 degrees or more."""
SLIDES_PX = (-2.0, 0.0, 2.0)
"""A depth off by a little puts the twin so much higher or lower."""


def mirrored(
    picture: Floats, camera: Camera, plane: GroundPlane, pixels: Pixels, depth: Vector, sigma: Vector
) -> Mask:
    """Which points below the floor are mirror images, (N,) bool.

    A point is one if its twin above the floor looks the same, or if it stands where two such points stand
    (most of a tall thing's mirror image has its twin above the picture).

    Args:
        picture: (H, W) left, grey float32.
        camera: the left eye, undistorted.
        plane: the floor before it.
        pixels, depth, sigma: (N, 2) px, (N,) m, (N,) m: the points below the floor.
    """
    if not len(pixels):
        return np.zeros(0, np.bool_)
    alike = twin_likeness(picture, camera, plane, pixels, depth) >= LEAST_LIKENESS
    if alike.sum() < FEWEST_TWINS:
        return np.zeros(len(pixels), np.bool_)
    normal = np.asarray(plane.normal)
    points = np.column_stack([_ray(camera, pixels), np.ones(len(pixels))]) * depth[:, None]
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
    step = np.arange(-HALF_PX, HALF_PX + 1, dtype=np.float64)
    dv, du = np.meshgrid(step, step, indexing="ij")
    u, v = pixels[:, 0, None] + du.ravel(), pixels[:, 1, None] + dv.ravel()
    here = _sample(picture, u, v)
    normal = np.asarray(plane.normal)
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], axis=-1)
    points = rays * depth[:, None, None]
    above = points - 2.0 * (points @ normal - plane.height)[..., None] * normal
    ahead = np.maximum(above[..., 2], 1e-3)
    twin_u = camera.cx + camera.fx * above[..., 0] / ahead
    twin_v = camera.cy + camera.fy * above[..., 1] / ahead
    height, width = picture.shape
    inside = (twin_u.min(axis=1) >= 0.0) & (twin_u.max(axis=1) <= width - 1)
    inside &= (twin_v.min(axis=1) >= 0.0) & (twin_v.max(axis=1) <= height - 1)
    likeness = np.max([_correlation(here, _sample(picture, twin_u, twin_v + by)) for by in SLIDES_PX], axis=0)
    return np.where(inside, likeness, 0.0)


def _ray(camera: Camera, pixels: Pixels) -> Matrix:
    return np.asarray((pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy))


def _sample(picture: Floats, u: Matrix, v: Matrix) -> Floats:
    at_u, at_v = u.astype(np.float32), v.astype(np.float32)
    found = cv2.remap(picture, at_u, at_v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found, np.float32)


def _correlation(one: Floats, other: Floats) -> Vector:
    a, b = one - one.mean(axis=1, keepdims=True), other - other.mean(axis=1, keepdims=True)
    spread = a.std(axis=1) * b.std(axis=1)
    clear = (a.std(axis=1) >= LEAST_CONTRAST) & (b.std(axis=1) >= LEAST_CONTRAST)
    return np.where(clear, (a * b).mean(axis=1) / np.maximum(spread, 1e-6), 0.0).astype(np.float64)


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
    amid = np.zeros(len(pixels), np.bool_)
    for k, pixel in enumerate(pixels):
        towards = corners - pixel
        near = np.abs(towards).max(axis=1) < AMID_PX
        on_floor = towards[near & floor]
        if len(on_floor) >= max(AMID_LEAST, AMID_SHARE * near.sum()):
            amid[k] = _widest_gap(np.arctan2(on_floor[:, 1], on_floor[:, 0])) < AMID_GAP
    return amid


def _widest_gap(angles: Vector) -> float:
    """Between neighbouring directions, radians."""
    ordered = np.sort(angles)
    return float(np.diff(ordered, append=ordered[0] + math.tau).max())
