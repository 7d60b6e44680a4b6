"""Random single views of the simulator with their truth, for the free-space bench and for trying a percept.

    for view in views("narrow", 200, seed=1):
        look = finder(view.left, view.right, view.pan, view.tilt)
        print(look.passage, view.truth.must_pass(BASE))

The robot believes `pan` and `tilt`; in truth it stands tipped by up to 0.5 degrees in pitch and 0.3 in roll.
"""

from __future__ import annotations

import hashlib
import math
import pickle
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.freespace_hand_worlds import HAND_KINDS, draw_hand_world
from bench.freespace_layout import World
from bench.freespace_stage import take_pictures
from bench.freespace_truth import Truth
from bench.freespace_worlds import BASE_KINDS, draw_world
from calib.model import HeadMount, StereoRig
from robot.messages import Image

KINDS = (*BASE_KINDS, *HAND_KINDS)
VERSION = 5
"""Of all that makes a view: part of a cached view's place. Raise it when pictures or truth change."""
BASE_RIG, HAND_RIG = StereoRig.parallel(352, 288, 305.0, 0.06), StereoRig.parallel(352, 288, 408.0, 0.04)
BASE_MOUNT = HeadMount()
HAND_MOUNT = HeadMount(forward=0.0, height=0.0, eye_forward=0.0, baseline=0.04)
"""The hand's frame: the middle between the eyes, x along the approach."""
TIPPED_PITCH, TIPPED_ROLL = math.radians(0.5), math.radians(0.3)


@dataclass(frozen=True, slots=True, eq=False)
class FreeSpaceView:
    """One look and what was truly there.

    left, right: (H, W, 3) uint8 BGR. pan, tilt: radians, as the robot believes. depth: (H, W) float32, true
    camera z of the left picture's pixels in metres. truth: what stands there, in the frame of the true floor.
    """

    kind: str
    seed: int
    left: Image
    right: Image
    rig: StereoRig
    mount: HeadMount
    pan: float
    tilt: float
    depth: NDArray[np.float32]
    truth: Truth


def views(kind: str, count: int, seed: int, cache: Path | None = None) -> Iterator[FreeSpaceView]:
    """`count` views of one kind, the seeds from `seed` on; the same seed gives the same bytes.

    Args:
        kind: one of `KINDS`.
        count: how many.
        seed: of the first; the next have the next numbers.
        cache: folder in which views are kept and found again; None: every view is drawn.
    """
    return (view(kind, number, cache) for number in range(seed, seed + count))


def view(kind: str, seed: int, cache: Path | None = None) -> FreeSpaceView:
    """One view.

    Raises:
        ValueError: no such kind.
    """
    if cache is None:
        return draw_view(kind, seed)
    path = cache / f"v{VERSION}" / kind / f"{seed}.pickle"
    if path.exists():
        return _unpacked(path.read_bytes())
    made = draw_view(kind, seed)
    path.parent.mkdir(parents=True, exist_ok=True)
    # Written aside and renamed: another job may want the same view, or this one be stopped.
    aside = path.with_suffix(f".{hashlib.sha1(made.left.tobytes()).hexdigest()[:8]}")
    aside.write_bytes(_packed(made))
    aside.replace(path)
    return made


def draw_view(kind: str, seed: int) -> FreeSpaceView:
    """Draw the world and take its pictures.

    Raises:
        ValueError: no such kind.
    """
    if kind not in KINDS:
        raise ValueError(f"no views of kind '{kind}': choose one of {', '.join(KINDS)}")
    layout, stand, eyes = np.random.default_rng([seed, *kind.encode()]).spawn(3)
    if kind in HAND_KINDS:
        world, rig, mount = draw_hand_world(kind, layout), HAND_RIG, HAND_MOUNT
        rotation, position = mount.left_eye(0.0, 0.0)
    else:
        world, rig, mount = draw_world(kind, layout), BASE_RIG, BASE_MOUNT
        rotation, position = _tipped(world, mount, stand)
    left, right, depth = take_pictures(world, rig, rotation, position, eyes)
    return FreeSpaceView(kind, seed, left, right, rig, mount, world.pan, world.tilt, depth, world.truth)


def _tipped(
    world: World, mount: HeadMount, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The left eye as it really is: the base tips about its origin on the floor."""
    pitch, roll = rng.uniform(-TIPPED_PITCH, TIPPED_PITCH), rng.uniform(-TIPPED_ROLL, TIPPED_ROLL)
    c, s = math.cos(pitch), math.sin(pitch)
    about_y = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    c, s = math.cos(roll), math.sin(roll)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    rotation, position = mount.left_eye(world.pan, world.tilt)
    tip = about_y @ about_x
    return tip @ rotation, tip @ position


def _packed(made: FreeSpaceView) -> bytes:
    return zlib.compress(pickle.dumps(made), 1)


def _unpacked(stored: bytes) -> FreeSpaceView:
    made = pickle.loads(zlib.decompress(stored))
    if not isinstance(made, FreeSpaceView):
        raise ValueError("the cache holds something else than views: give another folder")
    return made
