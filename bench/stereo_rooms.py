"""Simulated pairs with exact depth: what the robot's eyes see in random rooms, noise and blur included."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.stereo_data import Floats, StereoCase, non_occluded
from calib.model import HeadMount, StereoRig
from robot.messages import HeadPose, StereoFrame
from robot.sim.builder import EYE_SEES
from robot.sim.gl import mujoco
from robot.sim.scene import load_scene
from robot.sim.world import World

SCENES = ("standing", "distractors", "post", "step", "passage", "table", "trap", "lost")
PAN_LIMIT = math.radians(40.0)
TILT_RANGE = (math.radians(5.0), math.radians(30.0))
SETTLE_TICKS = 25
"""Ticks until the head has come to rest."""
DISPARITIES = 64


@dataclass(frozen=True, slots=True, eq=False)
class RoomView:
    """One view of a room: the pair with its true disparity, and where the head says it looks (radians)."""

    case: StereoCase
    rig: StereoRig
    mount: HeadMount
    pan: float
    tilt: float


def room_views(count: int, seed: int = 1) -> Iterator[RoomView]:
    """`count` views, the scenes in turn, each a new room and a new direction of the head.

    The same count and seed give the same pictures. UserError if OpenGL is missing.
    """
    random = np.random.default_rng(seed)
    for number in range(count):
        head = HeadPose(random.uniform(-PAN_LIMIT, PAN_LIMIT), random.uniform(*TILT_RANGE))
        yield room_view(SCENES[number % len(SCENES)], int(random.integers(1 << 30)), head)


def room_view(scene: str, seed: int, head: HeadPose) -> RoomView:
    """What the robot sees at its start in one room with the head turned.

    Disparities nearer than the search (`DISPARITIES`) are unknown in the truth: no matcher can find them.
    """
    world = World(load_scene(scene), seed)
    try:
        world.head.send(head, world.now)
        for _ in range(SETTLE_TICKS):
            world.step()
        frame = world.camera.latest(world.now)
        while frame is None or frame.seq != world.moment.seq:  # a dropped frame: the next one comes
            world.step()
            frame = world.camera.latest(world.now)
        truth = world.rig.left.fx * world.rig.baseline / true_depth(world) - world.rig.doffs
        case = _case(f"room {scene}", frame, truth.astype(np.float32))
        seen = world.head.read(world.now)
        return RoomView(case, world.rig, world.mount, seen.pan, seen.tilt)
    finally:
        world.close()


def _case(name: str, frame: StereoFrame, truth: Floats) -> StereoCase:
    within = truth <= DISPARITIES - 1
    # What is too near to be found hides what lies behind it all the same.
    seen = non_occluded(truth) & within
    known = np.where(within, truth, np.float32(np.nan))
    return StereoCase(name, frame.left, frame.right, known, DISPARITIES, seen)


def true_depth(world: World) -> NDArray[np.float64]:
    """Depth (camera z, metres) at the centre of every pixel of the left eye now, inf where nothing is.

    Rays against the very shapes that are drawn; nothing of the renderer's depth buffer.
    """
    eye, moment = world.rig.left, world.moment
    u, v = np.meshgrid(np.arange(eye.width), np.arange(eye.height))
    # Rays one metre deep: distances count in their lengths, so they are depths.
    local = np.stack([(u - eye.cx) / eye.fx, (v - eye.cy) / eye.fy, np.ones(u.shape)], axis=-1)
    rays = local.reshape(-1, 3) @ moment.rotation.T
    count = len(rays)
    depth, geom = np.full(count, -1.0), np.full(count, -1, np.int32)
    mujoco.mj_multiRay(
        world.model, world.data, moment.position, rays.ravel(), np.array(EYE_SEES, np.uint8), True, -1,
        geom, depth, None, count, 100.0,
    )  # fmt: skip
    return np.where(depth > 0.0, depth, np.inf).reshape(u.shape)
