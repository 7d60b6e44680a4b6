"""Textured meshes: quads cut into cells, boxes, upright cylinders. Plain arrays, no MuJoCo.

Lighting is computed at the vertices, so large faces are cut into cells: else a lamp's cone would vanish
between the corners of a wall. Texture coordinates (u, v) run right and down from the picture's top left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rect = tuple[float, float, float, float]
"""u0, v0, u1, v1 of a part of a picture, in shares of its width and height (above 1: repeated)."""

WHOLE: Rect = (0.0, 0.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """vertices (N, 3), normals (N, 3), texture coordinates (N, 2); faces (M, 3), counter-clockwise."""

    vertices: Array
    normals: Array
    uv: Array
    faces: NDArray[np.int32]

    def shifted(self, x: float, y: float, z: float) -> Mesh:
        """The same mesh moved by (x, y, z)."""
        return Mesh(self.vertices + np.array([x, y, z]), self.normals, self.uv, self.faces)


def quad(corner: Array, right: Array, down: Array, rect: Rect = WHOLE, cell: float = 0.25) -> Mesh:
    """A flat face from its top left corner, its right and its down edge (as seen from outside), all (3,)."""
    across = max(1, math.ceil(float(np.linalg.norm(right)) / cell))
    deep = max(1, math.ceil(float(np.linalg.norm(down)) / cell))
    s, t = np.meshgrid(np.linspace(0, 1, across + 1), np.linspace(0, 1, deep + 1))
    vertices = corner + s[..., None] * right + t[..., None] * down
    uv = np.stack([rect[0] + s * (rect[2] - rect[0]), rect[1] + t * (rect[3] - rect[1])], axis=-1)
    normal = np.cross(down, right)
    normal = normal / np.linalg.norm(normal)
    index = np.arange((across + 1) * (deep + 1)).reshape(deep + 1, across + 1)
    a, b, c, d = (i.ravel() for i in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
    faces = np.concatenate([np.column_stack([a, c, b]), np.column_stack([b, c, d])])
    normals = np.broadcast_to(normal, (vertices.size // 3, 3)).copy()
    return Mesh(vertices.reshape(-1, 3), normals, uv.reshape(-1, 2), faces.astype(np.int32))


def join(*meshes: Mesh) -> Mesh:
    """Several meshes as one."""
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes[:-1])])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.normals for m in meshes]),
        np.concatenate([m.uv for m in meshes]),
        np.concatenate([m.faces + o for m, o in zip(meshes, offsets, strict=True)]).astype(np.int32),
    )


def box(half: tuple[float, float, float], faces: tuple[Rect, ...], cell: float = 0.25) -> Mesh:
    """A box about the origin. faces: parts of the picture for front (+x), left, back, right, top, bottom."""
    x, y, z = half
    directions = (
        ((x, -y, z), (0, 2 * y, 0), (0, 0, -2 * z)),
        ((x, y, z), (-2 * x, 0, 0), (0, 0, -2 * z)),
        ((-x, y, z), (0, -2 * y, 0), (0, 0, -2 * z)),
        ((-x, -y, z), (2 * x, 0, 0), (0, 0, -2 * z)),
        ((-x, -y, z), (0, 2 * y, 0), (2 * x, 0, 0)),
        ((x, -y, -z), (0, 2 * y, 0), (-2 * x, 0, 0)),
    )
    quads = [
        quad(np.array(corner, float), np.array(right, float), np.array(down, float), rect, cell)
        for (corner, right, down), rect in zip(directions, faces, strict=True)
    ]
    return join(*quads)


def clad(half: tuple[float, float, float], metres: float, cell: float = 0.25) -> Mesh:
    """A box clad all round in a picture that covers `metres` x `metres` and repeats."""
    x, y, z = (2 * h / metres for h in half)
    around = np.cumsum([0.0, y, x, y, x])
    sides = tuple((float(around[k]), 0.0, float(around[k + 1]), z) for k in range(4))
    return box(half, (*sides, (0.0, 0.0, y, x), (0.0, 0.0, y, x)), cell)


def cylinder(
    radius: float, height: float, side: Rect, top: Rect, cell: float = 0.06, steps: int = 24
) -> Mesh:
    """An upright cylinder about the origin, no bottom. The side's picture begins at the back (-x) and runs
    counter-clockwise seen from above; the top's picture has its upper edge at the back."""
    angles = np.linspace(-math.pi, math.pi, steps + 1)
    rows = max(1, math.ceil(height / cell))
    angle, t = np.meshgrid(angles, np.linspace(0, 1, rows + 1))
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)
    vertices = radius * ring + (height * (0.5 - t))[..., None] * np.array([0.0, 0.0, 1.0])
    share = (angle + math.pi) / math.tau
    uv = np.stack([side[0] + share * (side[2] - side[0]), side[1] + t * (side[3] - side[1])], axis=-1)
    index = np.arange(angle.size).reshape(angle.shape)
    a, b, c, d = (i.ravel() for i in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
    wall = Mesh(
        vertices.reshape(-1, 3), ring.reshape(-1, 3), uv.reshape(-1, 2),
        np.concatenate([np.column_stack([a, c, b]), np.column_stack([b, c, d])]).astype(np.int32),
    )  # fmt: skip
    return join(wall, _disc(radius, height / 2, top, steps))


def _disc(radius: float, z: float, rect: Rect, steps: int) -> Mesh:
    angles = np.linspace(-math.pi, math.pi, steps, endpoint=False)
    rim = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(steps, z)])
    vertices = np.vstack([[(0.0, 0.0, z)], rim])
    centre = np.array([(rect[0] + rect[2]) / 2, (rect[1] + rect[3]) / 2])
    size = np.array([(rect[2] - rect[0]) / 2, (rect[3] - rect[1]) / 2])
    uv = centre + size * np.column_stack([vertices[:, 1], vertices[:, 0]]) / radius
    faces = np.array([[0, 1 + k, 1 + (k + 1) % steps] for k in range(steps)], np.int32)
    return Mesh(vertices, np.tile([0.0, 0.0, 1.0], (steps + 1, 1)), uv, faces)
