"""The things a robot is taught: a printed package, a mug, a desk calculator; each the same in every room.

Design 0 is the taught one; designs 1 to 8 are look-alikes of the same shape with another print. Objects
stand on z = 0 and show their front to +x.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from robot.sim import textures
from robot.sim.meshes import Mesh, Rect, box, cylinder, join
from robot.sim.textures import Colour, Picture

PX_PER_M = 900
KEYS = "789+456-123x0.=/C%"


@dataclass(frozen=True, slots=True)
class ObjectShape:
    """Half sizes of the bounding box on the floor and the height, metres, and who draws it."""

    half_x: float
    half_y: float
    height: float
    build: Callable[[int], tuple[Mesh, Picture]]


# -------------------------------------------------------------------------------------------- pictures


def _draw(design: int, which: int) -> np.random.Generator:
    return np.random.default_rng([7919, which, design])


def _palette(rng: np.random.Generator, count: int) -> list[Colour]:
    """Colours spread over the hues, alternately light and dark so that prints have contrast in grey too."""
    first = rng.uniform(0, 180)
    inks: list[Colour] = []
    for k in range(count):
        hue, saturation = int(first + 180 * k / count) % 180, int(rng.integers(150, 240))
        pixel = np.array([[[hue, saturation, (95, 235)[k % 2]]]], np.uint8)
        b, g, r = cv2.cvtColor(pixel, cv2.COLOR_HSV2BGR)[0, 0].tolist()
        inks.append((b, g, r))
    return inks


def _label(rng: np.random.Generator, height: int, width: int, ground: Colour, inks: list[Colour]) -> Picture:
    """One printed face: a ground, two or three bold shapes, a band with a word, small print."""
    picture = np.full((height, width, 3), ground, np.uint8)
    kind = int(rng.integers(0, 4))
    middle = (int(width * rng.uniform(0.35, 0.65)), int(height * rng.uniform(0.3, 0.45)))
    size = int(0.36 * width)
    if kind == 0:
        for k, share in enumerate((1.0, 0.66, 0.33)):
            cv2.circle(picture, middle, int(size * share), inks[k % len(inks)], -1, cv2.LINE_AA)
    elif kind == 1:
        for k in range(-height, width, max(8, width // 4)):
            corners = [[k, height], [k + width // 8, height], [k + width // 8 + height, 0], [k + height, 0]]
            cv2.fillPoly(picture, [np.array(corners, np.int32)], inks[0], cv2.LINE_AA)
        cv2.circle(picture, middle, size // 2, inks[1], -1, cv2.LINE_AA)
    elif kind == 2:
        star = [
            (middle[0] + r * math.sin(k * math.pi / 5), middle[1] - r * math.cos(k * math.pi / 5))
            for k in range(10)
            for r in [size if k % 2 == 0 else 0.42 * size]
        ]
        cv2.rectangle(picture, (0, 0), (width, int(0.62 * height)), inks[1], -1)
        cv2.fillPoly(picture, [np.array(star, np.int32)], inks[0], cv2.LINE_AA)
    else:
        side = max(6, width // 5)
        for i, top in enumerate(range(0, int(0.65 * height), side)):
            for j, left in enumerate(range(0, width, side)):
                if (i + j) % 2:
                    cv2.rectangle(picture, (left, top), (left + side, top + side), inks[(i * 3 + j) % 2], -1)
    band = int(rng.uniform(0.55, 0.68) * height)
    cv2.rectangle(picture, (0, band), (width, band + int(0.2 * height)), inks[2], -1)
    light = sum(inks[2]) > 380
    word = textures.WORDS[int(rng.integers(0, len(textures.WORDS)))]
    ink = (25, 25, 25) if light else (245, 245, 245)
    textures.write(picture, word, (int(0.08 * width), band + int(0.16 * height)), int(0.84 * width), 0, ink)
    for k in range(int(rng.integers(2, 5))):
        y = band + int((0.24 + 0.04 * k) * height)
        cv2.line(picture, (int(0.1 * width), y), (int(rng.uniform(0.4, 0.9) * width), y), inks[1], 2)
    return _printed(picture, rng)


def _printed(picture: Picture, rng: np.random.Generator) -> Picture:
    grain = 0.035 * textures.noise(rng, picture.shape[0], picture.shape[1], 5)
    return np.clip(picture * (1.0 + grain[..., None]), 0, 255).astype(np.uint8)


def _strip(parts: list[Picture]) -> tuple[Picture, list[Rect]]:
    """Pictures side by side in one, and where each of them is."""
    height, width = max(p.shape[0] for p in parts), sum(p.shape[1] for p in parts)
    atlas = np.full((height, width, 3), 128, np.uint8)
    rects, left = [], 0
    for part in parts:
        h, w = part.shape[:2]
        atlas[:h, left : left + w] = part
        # Half a pixel inside, so that a neighbour does not shine through.
        rects.append(((left + 0.5) / width, 0.5 / height, (left + w - 0.5) / width, (h - 0.5) / height))
        left += w
    return atlas, rects


# --------------------------------------------------------------------------------------------- objects


def package(design: int) -> tuple[Mesh, Picture]:
    """A printed cardboard package, 0.10 x 0.16 x 0.22 m, every face another print."""
    rng = _draw(design, 1)
    inks = _palette(rng, 5)
    h, wide, narrow = (round(m * PX_PER_M) for m in (0.22, 0.16, 0.10))
    parts = []
    for k, w in enumerate((wide, narrow, wide, narrow)):
        parts.append(_label(rng, h, w, inks[k], [inks[(k + 1) % 5], inks[(k + 2) % 5], inks[(k + 3) % 5]]))
    parts.append(_label(rng, narrow, wide, inks[4], inks[:3]))
    atlas, rects = _strip(parts)
    return box((0.05, 0.08, 0.11), (*rects, rects[4]), cell=0.06).shifted(0.0, 0.0, 0.11), atlas


def mug(design: int) -> tuple[Mesh, Picture]:
    """A big printed mug, 0.14 m across and 0.18 m high, with a handle at its left side."""
    rng = _draw(design, 2)
    inks = _palette(rng, 6)
    h, w = round(0.18 * PX_PER_M), round(math.tau * 0.07 * PX_PER_M)
    quarter = w // 4
    side = np.concatenate(
        [
            _label(rng, h, quarter, inks[k], [inks[(k + 1) % 6], inks[(k + 3) % 6], inks[(k + 4) % 6]])
            for k in range(4)
        ],
        axis=1,
    )
    cv2.rectangle(side, (0, 0), (side.shape[1], 10), inks[5], -1)
    inside = np.full((128, 128, 3), inks[5], np.uint8)
    cv2.circle(inside, (64, 64), 56, (30, 40, 55), -1, cv2.LINE_AA)
    handle = _printed(np.full((64, 64, 3), inks[5], np.uint8), rng)
    atlas, (side_rect, top, grip) = _strip([side, inside, handle])
    parts = [cylinder(0.07, 0.18, side_rect, top).shifted(0.0, 0.0, 0.09)]
    for y, z, half_y, half_z in (
        (0.088, 0.135, 0.022, 0.011),
        (0.088, 0.055, 0.022, 0.011),
        (0.105, 0.095, 0.011, 0.05),
    ):
        bar = box((0.011, half_y, half_z), (grip,) * 6, cell=0.1)
        parts.append(bar.shifted(0.0, y, z))
    return join(*parts), atlas


def calculator(design: int) -> tuple[Mesh, Picture]:
    """A big desk calculator on end, 0.09 x 0.16 x 0.22 m: keys in front, labels behind, ribs at the sides."""
    rng = _draw(design, 3)
    inks = _palette(rng, 5)
    body: Colour = ((60, 58, 55), (205, 212, 215), (120, 80, 50), (60, 60, 140))[design % 4]
    h, w, d = (round(m * PX_PER_M) for m in (0.22, 0.16, 0.09))
    parts = [_keys(rng, h, w, body, inks), _ribs(rng, h, d, body, inks[1]), _back(rng, h, w, body, inks)]
    parts += [_ribs(rng, h, d, body, inks[2])[:, ::-1], _ribs(rng, d, w, body, inks[3])]
    atlas, rects = _strip(parts)
    return box((0.045, 0.08, 0.11), (*rects, rects[4]), cell=0.06).shifted(0.0, 0.0, 0.11), atlas


def _keys(rng: np.random.Generator, h: int, w: int, body: Colour, inks: list[Colour]) -> Picture:
    picture = np.full((h, w, 3), body, np.uint8)
    cv2.rectangle(picture, (w // 12, h // 16), (w - w // 12, h // 4), (150, 190, 165), -1)
    textures.write(
        picture, str(int(rng.integers(10**6, 10**7))), (w // 8, h // 5), int(0.75 * w), 0, (25, 35, 25)
    )
    across, deep = int(rng.integers(4, 6)), 5
    for i in range(deep):
        for j in range(across):
            left, top = int(w * (0.08 + 0.86 * j / across)), int(h * (0.31 + 0.66 * i / deep))
            right, low = int(left + 0.68 * w / across), int(top + 0.1 * h)
            ink = inks[i % 4] if j == across - 1 else ((235, 235, 230) if (i + j) % 2 else (175, 175, 170))
            cv2.rectangle(picture, (left, top), (right, low), ink, -1)
            key = KEYS[(i * across + j) % len(KEYS)]
            cv2.putText(picture, key, (left + 5, low - 5), 0, 0.5, (20, 20, 20), 2, cv2.LINE_AA)
    return _printed(picture, rng)


def _ribs(rng: np.random.Generator, h: int, w: int, body: Colour, ink: Colour) -> Picture:
    picture = np.full((h, w, 3), body, np.uint8)
    for y in range(h // 10, int(0.6 * h), max(10, h // 12)):
        cv2.rectangle(
            picture, (w // 8, y), (w - w // 8, y + max(4, h // 30)), tuple(c // 3 for c in body), -1
        )
    cv2.rectangle(picture, (0, int(0.68 * h)), (w, int(0.86 * h)), ink, -1)
    cv2.circle(
        picture,
        (int(w * rng.uniform(0.3, 0.7)), int(0.77 * h)),
        max(4, h // 20),
        (240, 240, 240),
        -1,
        cv2.LINE_AA,
    )
    return _printed(picture, rng)


def _back(rng: np.random.Generator, h: int, w: int, body: Colour, inks: list[Colour]) -> Picture:
    picture = np.full((h, w, 3), body, np.uint8)
    cv2.rectangle(picture, (w // 8, h // 12), (w - w // 8, int(0.42 * h)), (215, 215, 205), -1)
    textures.write(
        picture, "MODEL " + str(int(rng.integers(10, 99))), (w // 7, h // 4), int(0.68 * w), 0, (20, 20, 20)
    )
    for k in range(3):
        y = int((0.29 + 0.04 * k) * h)
        cv2.line(picture, (w // 7, y), (int(w * rng.uniform(0.5, 0.85)), y), (60, 60, 60), 3)
    cv2.rectangle(picture, (w // 6, int(0.52 * h)), (w - w // 6, int(0.88 * h)), inks[4], -1)
    cv2.rectangle(picture, (w // 6, int(0.52 * h)), (w - w // 6, int(0.88 * h)), (20, 20, 20), 3)
    for k in range(4):
        cv2.line(
            picture,
            (w // 4, int((0.6 + 0.06 * k) * h)),
            (w - w // 4, int((0.6 + 0.06 * k) * h)),
            (20, 20, 20),
            3,
        )
    for corner in ((12, 12), (w - 12, 12), (12, h - 12), (w - 12, h - 12)):
        cv2.circle(picture, corner, 6, (150, 150, 150), -1, cv2.LINE_AA)
    return _printed(picture, rng)


SHAPES: dict[str, ObjectShape] = {
    "box": ObjectShape(0.05, 0.08, 0.22, package),
    "cup": ObjectShape(0.07, 0.116, 0.18, mug),
    "calculator": ObjectShape(0.045, 0.08, 0.22, calculator),
}
"""Every object by the name scenes use."""
