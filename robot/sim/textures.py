"""Pictures for walls, floors and things: procedural, seeded, rich enough for stereo at every scale.

Every function takes a random generator and gives a BGR uint8 picture (height, width, 3).
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
Field = NDArray[np.float32]
Colour = tuple[int, int, int]

FONTS = (
    cv2.FONT_HERSHEY_DUPLEX,
    cv2.FONT_HERSHEY_TRIPLEX,
    cv2.FONT_HERSHEY_COMPLEX,
    cv2.FONT_HERSHEY_SIMPLEX,
)
WORDS = (
    "OPEN", "JAZZ", "1987", "MARE", "ROMA", "TEA", "NORD", "FILM", "ATLAS", "SALE", "LUNA", "EXPO", "PARK",
    "OSLO", "KINO", "42", "BERG", "SOLAR", "ZOO", "PIANO",
)  # fmt: skip


def noise(
    rng: np.random.Generator, height: int, width: int, coarsest_px: float, finest_px: float = 1.5
) -> Field:
    """Multi-octave noise, mean 0, standard deviation 1, from blobs of `coarsest_px` down to `finest_px`."""
    total = np.zeros((height, width), np.float32)
    size, weight = coarsest_px, 1.0
    while size >= finest_px:
        shape = (max(2, round(height / size) + 1), max(2, round(width / size) + 1))
        grid = rng.standard_normal(shape, dtype=np.float32)
        total += weight * cv2.resize(grid, (width, height), interpolation=cv2.INTER_LINEAR)
        size /= 2.0
        weight *= 0.75
    total -= total.mean()
    return total / max(float(total.std()), 1e-6)


def tinted(colour: Colour, shade: Field) -> Picture:
    """A colour made lighter and darker by `shade` (0 as it is, 1 twice as bright)."""
    planes = np.clip((1.0 + shade[..., None]) * np.array(colour, np.float32), 0, 255)
    picture: Picture = planes.astype(np.uint8)
    return picture


def colour(rng: np.random.Generator, saturation: tuple[int, int], value: tuple[int, int]) -> Colour:
    """A random BGR colour with saturation and value drawn from these ranges (0-255)."""
    hsv = np.array([[[rng.integers(0, 180), rng.integers(*saturation), rng.integers(*value)]]], np.uint8)
    b, g, r = cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR)[0, 0].tolist()
    return int(b), int(g), int(r)


# ------------------------------------------------------------------------------------------- surfaces


def brick(rng: np.random.Generator, height: int, width: int, px_per_m: float) -> Picture:
    """A brick wall."""
    base = (70 + int(rng.integers(0, 30)), 90 + int(rng.integers(0, 40)), 150 + int(rng.integers(0, 40)))
    picture = tinted((150, 155, 160), 0.1 * noise(rng, height, width, 24))
    brick_h, brick_w, joint = round(0.09 * px_per_m), round(0.27 * px_per_m), max(2, round(0.012 * px_per_m))
    shade = 0.16 * noise(rng, height, width, 40)
    for row, top in enumerate(range(0, height, brick_h)):
        for left in range(-(row % 2) * brick_w // 2, width, brick_w):
            area = (
                slice(top, min(top + brick_h - joint, height)),
                slice(max(left, 0), max(left + brick_w - joint, 0)),
            )
            own = tuple(int(c * rng.uniform(0.72, 1.18)) for c in base)
            picture[area] = tinted((own[0], own[1], own[2]), shade[area])
    return picture


def wood(rng: np.random.Generator, height: int, width: int, px_per_m: float) -> Picture:
    """Boards along the width with grain and joints."""
    base = np.array([60, 105, 160]) * rng.uniform(0.8, 1.25)
    board = round(rng.uniform(0.11, 0.17) * px_per_m)
    grain = cv2.resize(noise(rng, height, max(width // 12, 4), 20, 1.0), (width, height))
    fine = noise(rng, height, width, 30)
    picture = np.empty((height, width, 3), np.uint8)
    for top in range(0, height, board):
        rows = slice(top, min(top + board, height))
        left = -int(rng.integers(0, round(1.0 * px_per_m)))
        while left < width:
            right = left + round(rng.uniform(0.5, 1.1) * px_per_m)
            area = (rows, slice(max(left, 0), max(min(right, width), 0)))
            own = base * rng.uniform(0.72, 1.2)
            picture[area] = tinted(
                (int(own[0]), int(own[1]), int(own[2])), 0.15 * grain[area] + 0.08 * fine[area]
            )
            cv2.line(picture, (right, top), (right, top + board), (25, 40, 60), 2)
            left = right
        cv2.line(picture, (0, top), (width, top), (25, 40, 60), 2)
    return picture


def plaster(rng: np.random.Generator, height: int, width: int, px_per_m: float) -> Picture:
    """Rough, mottled plaster with scratches."""
    tone = colour(rng, (10, 70), (150, 215))
    shade = 0.12 * noise(rng, height, width, 0.5 * px_per_m, 2.0) + 0.09 * noise(rng, height, width, 8)
    picture = tinted(tone, shade)
    for _ in range(round(height * width / px_per_m**2 * 14)):
        x, y = int(rng.integers(0, width)), int(rng.integers(0, height))
        reach = round(0.05 * px_per_m)
        end = (x + int(rng.integers(-reach, reach + 1)), y + int(rng.integers(-reach, reach + 1)))
        dark = tuple(int(c * rng.uniform(0.5, 0.85)) for c in tone)
        cv2.line(picture, (x, y), end, dark, int(rng.integers(1, 4)), cv2.LINE_AA)
    return picture


def paper(rng: np.random.Generator, height: int, width: int, px_per_m: float) -> Picture:
    """Wallpaper: irregular flowers and leaves on a mottled ground."""
    ground = colour(rng, (20, 90), (150, 220))
    picture = tinted(ground, 0.07 * noise(rng, height, width, 30))
    inks = [colour(rng, (60, 180), (60, 210)) for _ in range(4)]
    step = 0.16 * px_per_m
    for row in range(int(height / step) + 1):
        for column in range(int(width / step) + 1):
            x = int((column + 0.5 * (row % 2) + rng.uniform(-0.25, 0.25)) * step)
            y = int((row + rng.uniform(-0.25, 0.25)) * step)
            ink, size = inks[int(rng.integers(0, 4))], rng.uniform(0.018, 0.042) * px_per_m
            turn = rng.uniform(0, 180)
            for k in range(int(rng.integers(3, 7))):
                axes = (max(2, int(size)), max(1, int(0.4 * size)))
                cv2.ellipse(picture, (x, y), axes, turn + 60 * k, 0, 360, ink, -1, cv2.LINE_AA)
            cv2.circle(picture, (x, y), max(1, int(0.3 * size)), inks[(column + row) % 4], -1, cv2.LINE_AA)
    return picture


def panel(rng: np.random.Generator, height: int, width: int, px_per_m: float) -> Picture:
    """Upright wood panelling: `wood` turned by a quarter."""
    return np.ascontiguousarray(wood(rng, width, height, px_per_m).transpose(1, 0, 2))


def tiles(rng: np.random.Generator, height: int, width: int, px_per_m: float) -> Picture:
    """Stone tiles, each of its own tone, with joints."""
    tone = np.array(colour(rng, (15, 80), (130, 200)), np.float64)
    other = np.array(colour(rng, (15, 90), (80, 150)), np.float64)
    side = round(rng.uniform(0.22, 0.33) * px_per_m)
    shade = 0.14 * noise(rng, height, width, 0.12 * px_per_m)
    picture = tinted((120, 120, 118), 0.1 * noise(rng, height, width, 8))
    joint = max(2, round(0.008 * px_per_m))
    chequered = rng.random() < 0.6
    for row, top in enumerate(range(0, height, side)):
        for column, left in enumerate(range(0, width, side)):
            own = (other if chequered and (row + column) % 2 else tone) * rng.uniform(0.8, 1.15)
            area = (slice(top, top + side - joint), slice(left, left + side - joint))
            picture[area] = tinted((int(own[0]), int(own[1]), int(own[2])), shade[area])
    return picture


def carpet(rng: np.random.Generator, height: int, width: int, px_per_m: float) -> Picture:
    """Flecked carpet."""
    picture = tinted(colour(rng, (40, 130), (90, 160)), 0.16 * noise(rng, height, width, 0.4 * px_per_m, 2.5))
    fleck = colour(rng, (20, 120), (160, 230))
    mask = noise(rng, height, width, 7, 2.5) > 1.1
    picture[mask] = (0.5 * picture[mask] + 0.5 * np.array(fleck)).astype(np.uint8)
    return picture


def lino(rng: np.random.Generator, height: int, width: int, px_per_m: float) -> Picture:
    """Marbled linoleum."""
    tone = colour(rng, (25, 90), (110, 190))
    swirl = noise(rng, height, width, 0.25 * px_per_m, 3.0)
    return tinted(tone, 0.14 * np.sin(3.0 * swirl).astype(np.float32) + 0.09 * noise(rng, height, width, 6))


WALLS: dict[str, Callable[[np.random.Generator, int, int, float], Picture]] = {
    "brick": brick, "wood": wood, "plaster": plaster, "paper": paper, "panel": panel,
}  # fmt: skip
FLOORS: dict[str, Callable[[np.random.Generator, int, int, float], Picture]] = {
    "tiles": tiles, "wood": wood, "carpet": carpet, "lino": lino,
}  # fmt: skip


def any_surface(rng: np.random.Generator, height: int, width: int, px_per_m: float) -> Picture:
    """One of all the surfaces: what obstacles are clad in."""
    kinds = (brick, wood, plaster, paper, panel, tiles, carpet, lino)
    return kinds[int(rng.integers(0, len(kinds)))](rng, height, width, px_per_m)


# ----------------------------------------------------------------------------------------- decorations


def poster(rng: np.random.Generator, height: int, width: int) -> Picture:
    """A poster: gradient, shapes, a word or two, a frame."""
    top = np.array(colour(rng, (60, 220), (60, 230)), np.float32)
    low = np.array(colour(rng, (60, 220), (60, 230)), np.float32)
    share = np.linspace(0, 1, height, dtype=np.float32)[:, None, None]
    picture = np.repeat((1 - share) * top + share * low, width, axis=1).astype(np.uint8)
    small = min(height, width)
    for _ in range(int(rng.integers(5, 11))):
        ink = colour(rng, (80, 255), (60, 255))
        x, y = int(rng.integers(0, width)), int(rng.integers(0, height))
        size = int(rng.uniform(0.06, 0.28) * small)
        match int(rng.integers(0, 4)):
            case 0:
                cv2.circle(picture, (x, y), size, ink, -1, cv2.LINE_AA)
            case 1:
                cv2.rectangle(picture, (x, y), (x + size, y + int(size * 1.4)), ink, -1)
            case 2:
                corners = np.array([[x, y - size], [x + size, y + size], [x - size, y + size]], np.int32)
                cv2.fillPoly(picture, [corners], ink, cv2.LINE_AA)
            case _:
                end = (int(rng.integers(0, width)), int(rng.integers(0, height)))
                cv2.line(picture, (x, y), end, ink, max(2, size // 4), cv2.LINE_AA)
    for _ in range(int(rng.integers(1, 3))):
        word = WORDS[int(rng.integers(0, len(WORDS)))]
        ink = (250, 250, 250) if rng.random() < 0.6 else (20, 20, 20)
        place = (int(0.06 * width), int(rng.uniform(0.2, 0.95) * height))
        write(picture, word, place, int(0.85 * width), int(rng.integers(0, len(FONTS))), ink)
    edge = max(2, small // 30)
    cv2.rectangle(picture, (0, 0), (width - 1, height - 1), colour(rng, (0, 120), (20, 240)), 2 * edge)
    grain = 0.06 * noise(rng, height, width, 6)
    return np.clip(picture * (1.0 + grain[..., None]), 0, 255).astype(np.uint8)


def write(picture: Picture, word: str, place: tuple[int, int], width: int, font: int, ink: Colour) -> None:
    """Write `word` `width` pixels wide with its lower left corner at `place`."""
    (natural, tall), _ = cv2.getTextSize(word, FONTS[font], 1.0, 2)
    scale = min(width / max(natural, 1), 0.35 * picture.shape[0] / max(tall, 1))
    cv2.putText(picture, word, place, FONTS[font], scale, ink, max(1, round(2.2 * scale)), cv2.LINE_AA)


def paste(picture: Picture, patch: Picture, left: int, top: int) -> None:
    """Put `patch` onto `picture`, cut off at its border."""
    x0, y0 = max(left, 0), max(top, 0)
    x1, y1 = min(left + patch.shape[1], picture.shape[1]), min(top + patch.shape[0], picture.shape[0])
    if x1 > x0 and y1 > y0:
        picture[y0:y1, x0:x1] = patch[y0 - top : y1 - top, x0 - left : x1 - left]
