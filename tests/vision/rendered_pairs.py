"""Stereo pairs of textured blocks on a textured floor, ray-cast in numpy: an oracle with exact depth.

It shares no code with the simulator nor with the vision it tests, only the camera model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np

from calib.model import HeadMount, StereoRig

RIG = StereoRig.parallel(352, 288, 305.0, 0.06)
MOUNT = HeadMount()
TILT = 0.349


@dataclass(frozen=True)
class Block:
    """A box standing at (x, y), turned by yaw, from z0 to z1. Metres, robot frame."""

    x: float
    y: float
    length: float
    width: float
    z1: float
    z0: float = 0.0
    yaw: float = 0.0
    seed: int = 1


@dataclass(frozen=True)
class Room:
    """Blocks in a room whose walls stand `size` metres away; floor_paint dims the floor at (x, y)."""

    blocks: tuple[Block, ...] = ()
    size: float = 4.0
    floor: float = 0.0
    floor_paint: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None
    texels_per_metre: float = 250.0
    contrast: float = 1.0
    floor_seed: int = 7
    wall: Block = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "wall", Block(0, 0, 2 * self.size, 2 * self.size, 2.5, -0.5, seed=11))


@dataclass(frozen=True)
class Pair:
    """What the eyes see, and the true depth Z of every left pixel in metres."""

    left: np.ndarray
    right: np.ndarray
    depth: np.ndarray


@lru_cache(maxsize=64)
def texture(seed: int, size: int = 512) -> np.ndarray:
    """A periodic cloud of several octaves, mean 0.5, as float32 (size, size)."""
    rng = np.random.default_rng(seed)
    total = np.zeros((size, size), np.float32)
    for octave in range(1, 7):
        cells = size >> octave
        small = rng.standard_normal((cells, cells)).astype(np.float32)
        tiled = np.tile(small, (3, 3))
        big = cv2.resize(tiled, (3 * size, 3 * size), interpolation=cv2.INTER_CUBIC)
        total += big[size : 2 * size, size : 2 * size]
    return np.clip(0.5 + 0.16 * total / total.std(), 0.02, 0.98)


def render(
    room: Room,
    *,
    rig: StereoRig = RIG,
    mount: HeadMount = MOUNT,
    pan: float = 0.0,
    tilt: float = TILT,
    noise: float = 2.0,
    gain: float = 1.0,
    seed: int = 0,
    samples: int = 3,
) -> Pair:
    """Both eyes' pictures as a webcam gives them: box filter, Gaussian noise (grey levels), BGR uint8."""
    rotation, left_eye = mount.left_eye(pan, tilt)
    right_eye = left_eye + rotation @ np.array([rig.baseline, 0.0, 0.0])
    rng = np.random.default_rng(seed)
    left, depth = _shade(room, rig.left, rotation, left_eye, samples)
    right, _ = _shade(room, rig.right, rotation, right_eye, samples)
    return Pair(_expose(left, gain, noise, rng), _expose(right, gain, noise, rng), depth)


def _expose(grey: np.ndarray, gain: float, noise: float, rng: np.random.Generator) -> np.ndarray:
    noisy = 255 * gain * grey[..., None] + noise * rng.standard_normal((*grey.shape, 3))
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def _shade(room, camera, rotation, eye, samples):
    step = (np.arange(samples) + 0.5) / samples - 0.5
    u = (np.arange(camera.width)[:, None] + step).ravel()
    v = (np.arange(camera.height)[:, None] + step).ravel()
    x, y = np.meshgrid((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ rotation.T
    nearest, value = _floor(room, rays, eye)
    for block, inside in [(room.wall, True), *((b, False) for b in room.blocks)]:
        depth, shade = _block(room, block, rays, eye, inside)
        closer = depth < nearest
        nearest = np.where(closer, depth, nearest)
        value = np.where(closer, shade, value)
    shape = (camera.height, samples, camera.width, samples)
    return value.reshape(shape).mean(axis=(1, 3)), nearest.reshape(shape)[:, samples // 2, :, samples // 2]


def _sample(room: Room, seed: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    tile = cv2.copyMakeBorder(texture(seed), 0, 1, 0, 1, cv2.BORDER_WRAP)
    scale = room.texels_per_metre
    values = cv2.remap(
        tile,
        np.mod(a * scale, 512).astype(np.float32),
        np.mod(b * scale, 512).astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return 0.5 + room.contrast * (values - 0.5)


def _floor(room, rays, eye):
    with np.errstate(divide="ignore"):
        depth = (room.floor - eye[2]) / rays[..., 2]
    depth = np.where(depth > 0, depth, np.inf)
    reach = np.where(np.isfinite(depth), depth, 0.0)
    x, y = eye[0] + reach * rays[..., 0], eye[1] + reach * rays[..., 1]
    value = _sample(room, room.floor_seed, x, y)
    return depth, value if room.floor_paint is None else value * room.floor_paint(x, y)


def _block(room, block, rays, eye, inside):
    c, s = np.cos(block.yaw), np.sin(block.yaw)
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    origin = turn @ (eye - (block.x, block.y, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        direction = rays @ turn.T
        low = np.array([-block.length / 2, -block.width / 2, block.z0])
        high = np.array([block.length / 2, block.width / 2, block.z1])
        one, two = (low - origin) / direction, (high - origin) / direction
    enter = np.nan_to_num(np.minimum(one, two), nan=-np.inf)
    leave = np.nan_to_num(np.maximum(one, two), nan=np.inf)
    first, last = enter.max(axis=-1), leave.min(axis=-1)
    depth = last if inside else first
    depth = np.where((first <= last) & (depth > 0), depth, np.inf)
    axis = leave.argmin(axis=-1) if inside else enter.argmax(axis=-1)
    hit = origin + np.where(np.isfinite(depth), depth, 0.0)[..., None] * direction
    a = np.where(axis == 0, hit[..., 1], hit[..., 0]) + 0.37 * axis
    b = np.where(axis == 2, hit[..., 1], hit[..., 2]) + 0.61 * axis
    return depth, _sample(room, block.seed, a, b)
