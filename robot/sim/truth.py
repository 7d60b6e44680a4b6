"""What a remembered moment truly looked like: the target's box in the left eye, and the range to any surface.

Rays stand for sight. Only the target moves, so a past moment is asked by moving the ray, not the world.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Pose2
from robot.sim.builder import EYE_SEES, TARGET_GROUP
from robot.sim.gl import mujoco
from robot.sim.objects import SHAPES
from robot.sim.world import Moment, World

Array = NDArray[np.float64]
_TARGET_ONLY = tuple(int(group == TARGET_GROUP) for group in range(6))
_SURFACE_SLACK_M = 0.004


class Truth:
    """Answers about moments of one world; pixel coordinates of the left eye."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._eye = world.rig.left
        placed = world.layout.target
        self._points = np.zeros((0, 3))
        self._body = -1
        if placed is not None:
            mesh, _ = SHAPES[placed.shape].build(placed.design)
            self._points = np.unique(np.round(mesh.shifted(0.0, 0.0, placed.pedestal).vertices, 5), axis=0)
            self._body = mujoco.mj_name2id(world.model, mujoco.mjtObj.mjOBJ_BODY, "target")

    def full_box(self, moment: Moment) -> Box | None:
        """The target's box as if nothing hid or cut it off; None if it is not wholly before the eye."""
        seen = self._seen(moment)
        if seen is None or float(seen[2].min()) < 0.05:
            return None
        return _around(seen[0], seen[1])

    def visible(self, moment: Moment) -> tuple[Box | None, float]:
        """The box around what the picture shows of the target, and the share of the target it shows."""
        seen = self._seen(moment)
        if seen is None:
            return None, 0.0
        u, v, z, points = seen
        eye = self._eye
        inside = (z > 0.05) & (u > -0.5) & (u < eye.width - 0.5) & (v > -0.5) & (v < eye.height - 0.5)
        if not inside.any():
            return None, 0.0
        shown = inside.copy()
        shown[inside] = ~self._hidden(moment.position, points[inside])
        share = float(shown.mean())
        return (_around(u[shown], v[shown]), share) if shown.sum() >= 3 else (None, 0.0)

    def range_at(self, moment: Moment, u: float, v: float) -> tuple[float, bool] | None:
        """Depth (camera z, metres) of the surface at (u, v) and whether it is the target's; None: nothing."""
        eye = self._eye
        ray = moment.rotation @ np.array([(u - eye.cx) / eye.fx, (v - eye.cy) / eye.fy, 1.0])
        ray_length = float(np.linalg.norm(ray))
        direction = ray / ray_length
        scene = self._cast(moment.position, direction, EYE_SEES, self._body)
        target = math.inf
        if moment.target is not None and self._world.target_pose is not None:
            here = _moved(moment.position, moment.target, self._world.target_pose)
            there = _moved(moment.position + direction, moment.target, self._world.target_pose)
            target = self._cast(here, there - here, _TARGET_ONLY, -1)
        nearest = min(scene, target)
        return None if math.isinf(nearest) else (nearest / ray_length, target <= scene)

    def _seen(self, moment: Moment) -> tuple[Array, Array, Array, Array] | None:
        """Columns, rows, depths and room positions of points all over the target."""
        if moment.target is None:
            return None
        pose = moment.target
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        local = self._points
        points = np.column_stack(
            [
                pose.x + c * local[:, 0] - s * local[:, 1],
                pose.y + s * local[:, 0] + c * local[:, 1],
                local[:, 2],
            ]
        )
        x, y, z = ((points - moment.position) @ moment.rotation).T
        depth = np.where(z > 1e-6, z, 1e-6)
        return self._eye.fx * x / depth + self._eye.cx, self._eye.fy * y / depth + self._eye.cy, z, points

    def _hidden(self, eye: Array, points: Array) -> NDArray[np.bool_]:
        """Which points something other than the target stands before."""
        rays = points - eye
        count = len(rays)
        distance, geom = np.full(count, -1.0), np.full(count, -1, np.int32)
        world = self._world
        mujoco.mj_multiRay(
            world.model, world.data, eye, rays.ravel(), np.array(EYE_SEES, np.uint8), True, self._body,
            geom, distance, None, count, 100.0,
        )  # fmt: skip
        # Distances count in lengths of the ray: 1 is the point itself.
        lengths = np.linalg.norm(rays, axis=1)
        hidden: NDArray[np.bool_] = (distance >= 0.0) & (distance * lengths < lengths - _SURFACE_SLACK_M)
        return hidden

    def _cast(self, origin: Array, direction: Array, groups: tuple[int, ...], without: int) -> float:
        geom = np.full(1, -1, np.int32)
        world = self._world
        distance = mujoco.mj_ray(
            world.model, world.data, origin, direction, np.array(groups, np.uint8), True, without, geom
        )
        return float(distance) if distance >= 0.0 else math.inf


def _around(u: Array, v: Array) -> Box:
    return Box(float(u.min()), float(v.min()), float(u.max() - u.min()), float(v.max() - v.min()))


def _moved(point: Array, old: Pose2, new: Pose2) -> Array:
    """The point that lies to the target at `new` as `point` lay to it at `old`."""
    local = old.to_local(point[None, :2])
    moved = new.to_world(local)[0]
    return np.array([moved[0], moved[1], point[2]])
