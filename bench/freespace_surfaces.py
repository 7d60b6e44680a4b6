"""Pictures for the small worlds' surfaces and floors. Drawn once a process; the same name, the same bytes."""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np

from bench.freespace_layout import Room, Surface, World
from robot.sim import textures
from robot.sim.textures import Picture

SIDE_PX, FEATURE_SCALE = 420, 600.0
"""Side of every picture, and the pixels a metre its patterns are drawn at."""
FLOOR_PX_PER_M = 440.0
SHADE_SHARE = 8
"""Soft shade is drawn at this part of the size."""
PAINT_GRAIN = 0.035


@lru_cache(maxsize=128)
def surface_picture(name: str, number: int) -> Picture:
    """The picture of one surface, (420, 420, 3); do not write into it.

    Raises:
        ValueError: no such surface.
    """
    draw = {**textures.WALLS, **textures.FLOORS}.get(name)
    rng = np.random.default_rng([number, *name.encode()])
    if draw is not None:
        return draw(rng, SIDE_PX, SIDE_PX, FEATURE_SCALE)
    if name == "paint":
        return _paint(rng)
    if name == "hole":
        return _painted_hole(rng)
    raise ValueError(f"no surface '{name}': choose a name of robot.sim.textures, paint or hole")


def dimmed(surface: Surface) -> Picture:
    """The picture of a surface with its own brightness."""
    picture = surface_picture(surface.name, surface.number)
    return cv2.convertScaleAbs(picture, alpha=surface.gain).astype(np.uint8, copy=False)


def _paint(rng: np.random.Generator) -> Picture:
    """Painted board: a tone, hardly any grain."""
    tone = textures.colour(rng, (5, 90), (110, 225))
    shade = PAINT_GRAIN * textures.noise(rng, SIDE_PX, SIDE_PX, 160, 2.0)
    return textures.tinted(tone, shade)


def _painted_hole(rng: np.random.Generator) -> Picture:
    """A picture of a dark round opening with a rim of light: there is none."""
    picture = textures.plaster(rng, SIDE_PX, SIDE_PX, FEATURE_SCALE)
    centre, radius = (SIDE_PX // 2, SIDE_PX // 2), int(rng.uniform(0.16, 0.32) * SIDE_PX)
    dark = tuple(int(c) for c in rng.integers(8, 40, 3))
    cv2.circle(picture, centre, radius, dark, -1, cv2.LINE_AA)
    cv2.ellipse(picture, centre, (radius, radius), 0, 20, 160, (190, 200, 205), 4, cv2.LINE_AA)
    grain = 0.05 * textures.noise(rng, SIDE_PX, SIDE_PX, 12)
    return np.clip(picture * (1.0 + grain[..., None]), 0, 255).astype(np.uint8)


# ------------------------------------------------------------------------------------------------- floor


def floor_picture(world: World) -> Picture:
    """The floor from above, x to the right and y upwards, with its marks and the shade of what stands."""
    room, ground = world.room, world.ground
    height, width = round(2 * room.half * FLOOR_PX_PER_M), round((room.front - room.back) * FLOOR_PX_PER_M)
    tile = dimmed(ground.surface)
    side = round(ground.surface.metres * FLOOR_PX_PER_M)
    tile = cv2.resize(tile, (side, side), interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
    rows, columns = math.ceil(height / side), math.ceil(width / side)
    picture: Picture = np.ascontiguousarray(np.tile(tile, (rows, columns, 1))[:height, :width])
    rng = np.random.default_rng(ground.marks_seed)
    for mark in ground.marks:
        if mark in _MARKS:
            _MARKS[mark](picture, rng, room)
    shaded: Picture = (picture * _shade(world, height, width)[..., None]).astype(np.uint8)
    return shaded


def _place(rng: np.random.Generator, room: Room) -> tuple[int, int]:
    """A pixel of the floor that the robot looks at: 0.4 to 1.6 m ahead."""
    x, y = rng.uniform(0.4, 1.6), rng.uniform(-0.5, 0.5)
    return round((x - room.back) * FLOOR_PX_PER_M), round((room.half - y) * FLOOR_PX_PER_M)


def _tape(picture: Picture, rng: np.random.Generator, room: Room) -> None:
    for _ in range(int(rng.integers(1, 4))):
        start, end = _place(rng, room), _place(rng, room)
        reach = np.subtract(end, start) * 2
        ink = textures.colour(rng, (0, 255), (20, 250))
        wide = round(float(rng.uniform(0.015, 0.05)) * FLOOR_PX_PER_M)
        cv2.line(
            picture, np.subtract(start, reach).tolist(), np.add(end, reach).tolist(), ink, wide, cv2.LINE_AA
        )


def _chequers(picture: Picture, rng: np.random.Generator, room: Room) -> None:
    side, count = round(float(rng.uniform(0.06, 0.15)) * FLOOR_PX_PER_M), int(rng.integers(4, 10))
    field = np.indices((count, count)).sum(axis=0) % 2
    inks = np.array([textures.colour(rng, (0, 120), (20, 90)), textures.colour(rng, (0, 120), (150, 240))])
    board = np.kron(field, np.ones((side, side), np.int64))
    rug = inks[board].astype(np.float32) * (
        1.0 + 0.06 * textures.noise(rng, len(board), len(board), 8)[..., None]
    )
    _lay(picture, np.clip(rug, 0, 255).astype(np.uint8), rng, room)


def _rug(picture: Picture, rng: np.random.Generator, room: Room) -> None:
    size = (rng.uniform(0.5, 1.2, 2) * FLOOR_PX_PER_M).astype(int)
    rug = textures.carpet(rng, int(size[0]), int(size[1]), FLOOR_PX_PER_M)
    for k in range(1, 4):
        inset = round(0.05 * k * FLOOR_PX_PER_M)
        ink = textures.colour(rng, (60, 220), (60, 230))
        cv2.rectangle(rug, (inset, inset), (int(size[1]) - inset, int(size[0]) - inset), ink, 6)
    _lay(picture, rug, rng, room)


def _print(picture: Picture, rng: np.random.Generator, room: Room) -> None:
    size = (rng.uniform(0.25, 0.7, 2) * FLOOR_PX_PER_M).astype(int)
    _lay(picture, textures.poster(rng, int(size[0]), int(size[1])), rng, room)


def _shadow(picture: Picture, rng: np.random.Generator, room: Room) -> None:
    """The shadow of something out of view: dark, soft at its edges."""
    mask = np.zeros(picture.shape[:2], np.float32)
    corners = np.array([_place(rng, room) for _ in range(4)], np.int32)
    cv2.fillConvexPoly(mask, cv2.convexHull(corners).astype(np.int32), 1.0)
    mask = cv2.GaussianBlur(mask, (0, 0), float(rng.uniform(0.008, 0.04)) * FLOOR_PX_PER_M).astype(np.float32)
    dark = 1.0 - float(rng.uniform(0.3, 0.6)) * mask
    picture[:] = (picture * dark[..., None]).astype(np.uint8)


def _lay(picture: Picture, patch: Picture, rng: np.random.Generator, room: Room) -> None:
    """Put a flat thing on the floor, turned as it happens to lie."""
    x, y = _place(rng, room)
    turn = cv2.getRotationMatrix2D((patch.shape[1] / 2, patch.shape[0] / 2), float(rng.uniform(-45, 45)), 1.0)
    turn[:, 2] += (x - patch.shape[1] / 2, y - patch.shape[0] / 2)
    size = (picture.shape[1], picture.shape[0])
    laid = cv2.warpAffine(patch, turn, size)
    cover = cv2.warpAffine(np.full(patch.shape[:2], 255, np.uint8), turn, size) > 127
    picture[cover] = laid[cover]


_MARKS = {"tape": _tape, "chequers": _chequers, "rug": _rug, "print": _print, "shadow": _shadow}


def _shade(world: World, height: int, width: int) -> textures.Field:
    """Soft darkness where things stand and along the walls, 0..1 (height, width)."""
    room, coarse = world.room, FLOOR_PX_PER_M / SHADE_SHARE
    rows, columns = max(round(height / SHADE_SHARE), 2), max(round(width / SHADE_SHARE), 2)
    stands = np.zeros((rows, columns), np.float32)
    for thing in world.things:
        if thing.solid.bottom < 0.02:
            corners = [((x - room.back) * coarse, (room.half - y) * coarse) for x, y in thing.solid.outline]
            cv2.fillPoly(stands, [np.array(corners).round().astype(np.int32)], 1.0)
    near, wide = (cv2.GaussianBlur(stands, (0, 0), reach * coarse) for reach in (0.05, 0.15))
    soft = np.clip(np.maximum(near, 0.6 * wide), 0.0, 1.0)
    y, x = np.ogrid[:rows, :columns]
    to_wall = np.minimum(np.minimum(x, columns - 1 - x), np.minimum(y, rows - 1 - y)) / coarse
    shade = (1.0 - 0.5 * soft) * (1.0 - 0.3 * np.exp(-to_wall / 0.15))
    fine: textures.Field = cv2.resize(shade.astype(np.float32), (width, height))
    return fine
