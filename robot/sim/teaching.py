"""Pictures to teach a target from: the object on a turntable in a studio no scored scene ever shows.

Views go all round the object, at several distances, under several lights, with the camera a little higher
or lower. Rooms, textures, noise and places come from a stream of their own, apart from that of `World`.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, HeadPose, Image
from robot.sim.scene import Scene, SceneError, load_scene
from robot.sim.truth import Truth
from robot.sim.ways import MIDDLES_M
from robot.sim.world import World

YAW_STEPS = 24
DISTANCES_M = (0.5, 0.7, 1.0, 1.5, 2.1)
LIGHTS = ((0.9, 0.0), (0.6, 0.0), (1.05, 0.0), (0.4, 0.0), (0.03, 1.0))
"""Level of the room's light and of the lamp, one turn of the table each; the last by night."""
STUDIO_SALT = 0x7EAC
"""Mixed into the seed, so that no scored scene draws what a studio draws."""
MARGIN_PX = 3
SETTLING_TICKS = 12
"""From one view to the next: the head comes to rest, the exposure adapts."""


@dataclass(frozen=True, slots=True, eq=False)
class TeachingView:
    """One view: both pictures (H, W, 3) uint8 BGR, the tight box around the target in the left one, depth.

    depth_m: camera z of the surface at the box's centre; head: where the head looked; yaw: which side of the
    object faced the camera, radians (0: its front); mask: none is made.
    """

    image_bgr: Image
    box: Box
    depth_m: float
    right_bgr: Image
    head: HeadPose
    yaw: float
    mask: NDArray[np.bool_] | None = None


def studios() -> tuple[str, ...]:
    """Names of the shipped teaching scenes."""
    return ("teach-box", "teach-cup", "teach-calculator")


def views(scene_name_or_path: str | Path, seed: int) -> Iterator[TeachingView]:
    """About 120 views of the scene's target, the same for the same seed. SceneError if it has no target.

    >>> from itertools import islice
    >>> for view in islice(views("teach-box", seed=0), 2):
    ...     print(view.image_bgr.shape, 0.4 < view.depth_m < 2.4)
    (288, 352, 3) True
    (288, 352, 3) True
    """
    scene = load_scene(scene_name_or_path)
    if scene.target is None:
        raise SceneError(f"{scene_name_or_path}: has no [target] to teach from")
    rng = np.random.default_rng([seed, STUDIO_SALT, zlib.crc32(scene.name.encode())])
    for light, lamp in LIGHTS:
        studio = World(_lit(scene, light), int(rng.integers(2**31)))
        studio.lamp.send(lamp, studio.now)
        try:
            yield from _round(studio, rng)
        finally:
            studio.close()


def _lit(scene: Scene, light: float) -> Scene:
    """The studio under another light. Its name keeps its random stream apart from every scored scene."""
    return msgspec.structs.replace(
        scene, light=msgspec.structs.replace(scene.light, level=light), name=f"teach {scene.name} {light}"
    )


def _round(studio: World, rng: np.random.Generator) -> Iterator[TeachingView]:
    """One turn of the table: every step at a distance of its own."""
    truth = Truth(studio)
    first = int(rng.integers(len(DISTANCES_M)))
    offset = rng.uniform(0.0, math.tau / YAW_STEPS)
    for k in range(YAW_STEPS):
        yaw = math.remainder(offset + math.tau * k / YAW_STEPS, math.tau)
        distance = DISTANCES_M[(first + 2 * k) % len(DISTANCES_M)] * rng.uniform(0.93, 1.12)
        view = _look(studio, truth, yaw, distance, rng)
        if view is not None:
            yield view


def _look(
    studio: World, truth: Truth, yaw: float, distance: float, rng: np.random.Generator
) -> TeachingView | None:
    """Put the object that far before the robot, turned by `yaw`, and look at it; None if it is cut off."""
    start = studio.robot_pose
    bearing = rng.uniform(-0.12, 0.12)
    reach = distance + MIDDLES_M
    x = start.x + reach * math.cos(start.yaw + bearing)
    y = start.y + reach * math.sin(start.yaw + bearing)
    studio.place_target(x, y, start.yaw + bearing + math.pi + yaw)
    down = math.atan2(0.25 - 0.11, distance) + rng.uniform(-0.06, 0.06)
    studio.head.send(HeadPose(bearing + rng.uniform(-0.1, 0.1), down), studio.now)
    for _ in range(SETTLING_TICKS):
        studio.step()
    # One picture is enough: the exposure adapts by the time since the one before, however many lie between.
    moment = studio.moment
    frame = studio.camera.latest(studio.now)
    box, share = truth.visible(moment)
    if frame is None or frame.seq != moment.seq or box is None or share < 1.0 or not _inside(box, frame.left):
        return None
    hit = truth.range_at(moment, *box.centre)
    if hit is None or not hit[1]:
        return None
    return TeachingView(frame.left, box, hit[0], frame.right, studio.head.read(studio.now), yaw)


def _inside(box: Box, picture: Image) -> bool:
    height, width = picture.shape[:2]
    return (
        box.x >= MARGIN_PX and box.y >= MARGIN_PX
        and box.x + box.w <= width - MARGIN_PX and box.y + box.h <= height - MARGIN_PX
    )  # fmt: skip
