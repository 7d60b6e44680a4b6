"""What a room looks like: pictures for its walls, floor and ceiling, drawn anew for every seed."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from robot.sim import textures
from robot.sim.layout import Layout
from robot.sim.scene import Room
from robot.sim.textures import Picture

WALL_PX_PER_M = 320.0
FLOOR_PX_PER_M = 320.0


@dataclass(frozen=True, slots=True, eq=False)
class RoomPictures:
    """Walls in the order back (x = 0), right, front, left; the floor seen from above; the ceiling."""

    walls: tuple[Picture, ...]
    floor: Picture
    ceiling: Picture


def draw_room(room: Room, layout: Layout, rng: np.random.Generator) -> RoomPictures:
    """Draw the surfaces of a room. The floor's picture has x to the right and y upwards."""
    style = (
        room.walls
        if room.walls != "any"
        else sorted(textures.WALLS)[int(rng.integers(0, len(textures.WALLS)))]
    )
    accent = sorted(textures.WALLS)[int(rng.integers(0, len(textures.WALLS)))]
    widths = (layout.width, layout.length, layout.width, layout.length)
    odd = int(rng.integers(0, 4)) if room.walls == "any" else -1
    walls = tuple(
        _wall(accent if k == odd else style, rng, width, layout.height) for k, width in enumerate(widths)
    )
    ceiling = textures.tinted((215, 222, 225), 0.05 * textures.noise(rng, 512, 512, 128))
    for k in range(0, 512, 64):
        cv2.line(ceiling, (k, 0), (k, 512), (150, 155, 158), 2)
        cv2.line(ceiling, (0, k), (512, k), (150, 155, 158), 2)
    return RoomPictures(walls, _floor(room, layout, rng), ceiling)


def _wall(style: str, rng: np.random.Generator, width_m: float, height_m: float) -> Picture:
    scale = WALL_PX_PER_M
    height, width = round(height_m * scale), round(width_m * scale)
    picture = textures.WALLS[style](rng, height, width, scale)
    if rng.random() < 0.5:
        _door(picture, rng, scale)
    place = rng.uniform(0.2, 0.5)
    while place < width_m - 0.6:
        w, h = rng.uniform(0.3, 0.75), rng.uniform(0.35, 0.8)
        low = rng.uniform(0.15, 1.0)
        patch = textures.poster(rng, round(h * scale), round(w * scale))
        textures.paste(picture, patch, round(place * scale), height - round((low + h) * scale))
        place += w + rng.uniform(0.15, 0.7)
    board = round(0.09 * scale)
    skirting = textures.tinted(
        textures.colour(rng, (10, 90), (50, 200)), 0.12 * textures.noise(rng, board, width, 12)
    )
    picture[height - board :] = skirting
    cv2.line(picture, (0, height - board), (width, height - board), (40, 40, 40), 2)
    # Corners and the foot of a wall get less light than its middle.
    y, x = np.ogrid[:height, :width]
    foot = np.exp(-(height - 1 - y) / (0.25 * scale))
    corner = np.exp(-np.minimum(x, width - 1 - x) / (0.3 * scale))
    shade = (1.0 - 0.3 * foot) * (1.0 - 0.25 * corner)
    shaded: Picture = (picture * shade[..., None].astype(np.float32)).astype(np.uint8)
    return shaded


def _door(picture: Picture, rng: np.random.Generator, scale: float) -> None:
    height, width = picture.shape[:2]
    w, h = round(0.85 * scale), round(2.0 * scale)
    if width < 2 * w:
        return
    left = int(rng.integers(0, width - w))
    door = textures.wood(rng, h, w, scale)
    edge = round(0.05 * scale)
    for top, low in ((0.08, 0.45), (0.52, 0.92)):
        cv2.rectangle(
            door, (3 * edge, int(top * h)), (w - 3 * edge, int(low * h)), (30, 45, 65), 4, cv2.LINE_AA
        )
    cv2.rectangle(door, (0, 0), (w, h), (200, 205, 210), 2 * edge)
    cv2.circle(door, (w - 3 * edge // 2 - 6, h // 2), max(3, edge // 2), (90, 180, 200), -1, cv2.LINE_AA)
    textures.paste(picture, door, left, height - h)


def _floor(room: Room, layout: Layout, rng: np.random.Generator) -> Picture:
    scale = FLOOR_PX_PER_M
    height, width = round(layout.width * scale), round(layout.length * scale)
    style = (
        room.floor
        if room.floor != "any"
        else sorted(textures.FLOORS)[int(rng.integers(0, len(textures.FLOORS)))]
    )
    picture = textures.FLOORS[style](rng, height, width, scale)
    for _ in range(room.rugs):
        _rug(picture, rng, scale)
    for _ in range(room.lines):
        ends = rng.integers(0, (width, height), (2, 2)).tolist()
        cv2.line(
            picture,
            ends[0],
            ends[1],
            textures.colour(rng, (60, 255), (60, 250)),
            round(0.03 * scale),
            cv2.LINE_AA,
        )
    shade = _contact_shade(layout, height, width, scale)
    shaded: Picture = (picture * shade[..., None]).astype(np.uint8)
    return shaded


def _rug(picture: Picture, rng: np.random.Generator, scale: float) -> None:
    w, h = round(rng.uniform(0.8, 1.8) * scale), round(rng.uniform(0.7, 1.4) * scale)
    rug = textures.carpet(rng, h, w, scale)
    for k in range(1, 4):
        inset = round(0.07 * k * scale)
        ink = textures.colour(rng, (60, 220), (60, 230))
        cv2.rectangle(rug, (inset, inset), (w - inset, h - inset), ink, round(0.025 * scale))
    for _ in range(12):
        x, y = int(rng.integers(0, w)), int(rng.integers(0, h))
        size = int(rng.uniform(0.03, 0.09) * scale)
        cv2.ellipse(
            rug,
            (x, y),
            (size, size // 2),
            rng.uniform(0, 180),
            0,
            360,
            textures.colour(rng, (60, 220), (60, 230)),
            -1,
        )
    left = int(rng.integers(0, max(1, picture.shape[1] - w)))
    textures.paste(picture, rug, left, int(rng.integers(0, max(1, picture.shape[0] - h))))


def _contact_shade(layout: Layout, height: int, width: int, scale: float) -> textures.Field:
    """Soft darkness where things stand and along the walls, 0..1 (height, width)."""
    # So soft that an eighth of the size is enough, at a fiftieth of the cost.
    coarse = scale / 8.0
    rows, columns = round(height / 8), round(width / 8)
    stands = np.zeros((rows, columns), np.float32)
    for solid in layout.solids:
        if solid.bottom < 0.02:
            corners = [(x * coarse, (layout.width / 2 - y) * coarse) for x, y in solid.outline]
            cv2.fillPoly(stands, [np.array(corners, np.int32)], 1.0)
    near, wide = (cv2.GaussianBlur(stands, (0, 0), reach * coarse) for reach in (0.05, 0.15))
    soft = np.maximum(near, 0.6 * wide)
    y, x = np.ogrid[:rows, :columns]
    to_wall = np.minimum(np.minimum(x, columns - 1 - x), np.minimum(y, rows - 1 - y)) / coarse
    shade = (1.0 - 0.55 * np.clip(soft, 0, 1)) * (1.0 - 0.35 * np.exp(-to_wall / 0.15))
    fine: textures.Field = cv2.resize(shade.astype(np.float32), (width, height))
    return fine
