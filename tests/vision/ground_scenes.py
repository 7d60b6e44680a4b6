"""Rendered pairs that try a ground-plane test: glossy floors, drops, rugs, shadows, a tipped base.

Extends `rendered_pairs`: the same blocks and textures, cast on a floor that may mirror or end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from rendered_pairs import MOUNT, RIG, TILT, Pair, Room, _block, _expose, _sample

from calib.model import HeadMount, StereoRig

FOREVER = 1e6


@dataclass(frozen=True)
class Ground:
    """How the floor of a room is: gloss 0..1 of what it mirrors is seen in it; where x passes `edge` (along
    `edge_yaw`) it lies `drop` metres lower. Metres, radians."""

    gloss: float = 0.0
    edge: float = FOREVER
    edge_yaw: float = 0.0
    drop: float = 0.0
    lower_seed: int = 23


@dataclass(frozen=True)
class TippedMount:
    """A head on a base tipped by pitch (front down), roll (left side up), lifted; the robot knows nothing."""

    pitch: float = 0.0
    roll: float = 0.0
    lift: float = 0.0
    believed: HeadMount = MOUNT

    def left_eye(self, pan: float, tilt: float) -> tuple[np.ndarray, np.ndarray]:
        """As `HeadMount.left_eye`, in the frame of the true floor."""
        rotation, eye = self.believed.left_eye(pan, tilt)
        c, s = math.cos(self.pitch), math.sin(self.pitch)
        about_y = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        c, s = math.cos(self.roll), math.sin(self.roll)
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        tip = about_y @ about_x
        return tip @ rotation, tip @ eye + (0.0, 0.0, self.lift)


def look(
    room: Room,
    ground: Ground | None = None,
    *,
    rig: StereoRig = RIG,
    mount: HeadMount | TippedMount = MOUNT,
    pan: float = 0.0,
    tilt: float = TILT,
    noise: float = 2.0,
    gains: tuple[float, float] = (1.0, 1.0),
    seed: int = 0,
    samples: int = 3,
) -> Pair:
    """Both eyes' pictures of a room on such a ground, BGR uint8, and the left one's true depth in metres.

    rig: any pair without distortion; the right eye stands where the rig says.
    """
    ground = ground or Ground()
    rotation, left_eye = mount.left_eye(pan, tilt)
    right_rotation = rotation @ rig.R.T
    right_eye = left_eye - right_rotation @ np.array(rig.translation)
    rng = np.random.default_rng(seed)
    left, depth = _shade(room, ground, rig.left, rotation, left_eye, samples)
    right, _ = _shade(room, ground, rig.right, right_rotation, right_eye, samples)
    return Pair(_expose(left, gains[0], noise, rng), _expose(right, gains[1], noise, rng), depth)


def lines(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Tape on the floor, along and across."""
    tape = (np.mod(x, 0.4) < 0.03) | (np.mod(y + 0.1, 0.5) < 0.03)
    return np.where(tape, 0.25, 1.0)


def chequers(side: float):
    """A chequered rug from 0.45 to 1.7 m ahead, half a metre to both sides, squares `side` metres wide."""

    def paint(x, y):
        rug = (x > 0.45) & (x < 1.7) & (np.abs(y) < 0.5)
        dark = np.mod(np.floor(x / side) + np.floor(y / side), 2) > 0
        return np.where(rug & dark, 0.3, 1.0)

    return paint


def soft_shadows(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A dark lane with soft borders and a round shade."""
    lane = 1.0 / (1.0 + np.exp(-np.abs(y - 0.3 * (x - 0.9)) / 0.02 + 5.0))
    disc = 1.0 / (1.0 + np.exp(-(np.hypot(x - 0.7, y + 0.15) - 0.15) / 0.01))
    return (0.4 + 0.6 * lane) * (0.55 + 0.45 * disc)


def _shade(room, ground, camera, rotation, eye, samples):
    step = (np.arange(samples) + 0.5) / samples - 0.5
    u = (np.arange(camera.width)[:, None] + step).ravel()
    v = (np.arange(camera.height)[:, None] + step).ravel()
    x, y = np.meshgrid((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ rotation.T
    depth, value = _floor(room, ground, rays, eye)
    if ground.gloss > 0.0:
        # What a mirror shows is what an eye below the floor sees looking up.
        flip = np.array([1.0, 1.0, -1.0])
        _, mirrored = _things(room, rays * flip, eye * flip, np.full(depth.shape, np.inf), value)
        value = np.where(np.isfinite(depth), (1.0 - ground.gloss) * value + ground.gloss * mirrored, value)
    depth, value = _things(room, rays, eye, depth, value)
    shape = (camera.height, samples, camera.width, samples)
    middle = samples // 2
    return value.reshape(shape).mean(axis=(1, 3)), depth.reshape(shape)[:, middle, :, middle]


def _things(room, rays, eye, nearest, value):
    for block, inside in [(room.wall, True), *((b, False) for b in room.blocks)]:
        depth, shade = _block(room, block, rays, eye, inside)
        closer = depth < nearest
        nearest = np.where(closer, depth, nearest)
        value = np.where(closer, shade, value)
    return nearest, value


def _floor(room, ground, rays, eye):
    depth, x, y = _level(rays, eye, room.floor)
    paint = room.floor_paint or (lambda a, b: np.ones_like(a))
    value = _sample(room, room.floor_seed, x, y) * paint(x, y)
    if ground.drop > 0.0:
        below, low_x, low_y = _level(rays, eye, room.floor - ground.drop)
        beyond = x * math.cos(ground.edge_yaw) + y * math.sin(ground.edge_yaw) > ground.edge
        lower = _sample(room, ground.lower_seed, low_x, low_y) * paint(low_x, low_y)
        depth, value = np.where(beyond, below, depth), np.where(beyond, lower, value)
    return depth, value


def _level(rays, eye, height):
    with np.errstate(divide="ignore"):
        depth = (height - eye[2]) / rays[..., 2]
    depth = np.where(depth > 0, depth, np.inf)
    reach = np.where(np.isfinite(depth), depth, 0.0)
    return depth, eye[0] + reach * rays[..., 0], eye[1] + reach * rays[..., 1]
