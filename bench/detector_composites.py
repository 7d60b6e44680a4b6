"""Cups of ETH-80 put into real pictures: at random size and place, half hidden, in the dark.

The views lie on plain ground and have masks; one half of a cup's views is taught, the other half is put into
pictures that were not taught. Backgrounds are the real pictures of the data folder without cups.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.detector_uiuc import grey
from robot.errors import UserError
from robot.messages import Box, Image

Mask = NDArray[np.bool_]

SIZE = (352, 288)
LONGER_EDGE_PX = 70.0
DARK_GAIN, ELECTRONS_PER_GREY, READ_GREY = 0.25, 8.0, 1.2
"""Of the dark: a quarter of the light, shot noise and read noise."""
FRAMES_APART = 60


@dataclass(frozen=True, slots=True)
class Condition:
    """How a cup is shown: scales of its size, half hidden or not, dark or not."""

    name: str
    scales: tuple[float, float]
    hidden: bool = False
    dark: bool = False


CONDITIONS = (
    Condition("clean", (0.8, 1.25)),
    Condition("half hidden", (0.8, 1.25), hidden=True),
    Condition("dark", (0.8, 1.25), dark=True),
    Condition("all at once", (0.7, 2.0), hidden=True, dark=True),
)


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """A picture (288, 352) with a cup: its box with what is hidden, and the pixels of it one sees."""

    image: Image
    box: Box
    visible: Mask


def cup_views(folder: Path) -> list[tuple[Image, Mask]]:
    """All views of a cup with their masks, in order.

    Raises:
        UserError: there are none, or not as many masks.
    """
    views, masks = (sorted((folder / kind).glob("*.png")) for kind in ("views", "masks"))
    if not views or len(views) != len(masks):
        raise UserError(f"{folder} holds {len(views)} views and {len(masks)} masks, they must be as many")
    return [(grey(view), grey(mask) > 127) for view, mask in zip(views, masks, strict=True)]


def backgrounds(data: Path) -> list[Image]:
    """Real pictures without cups: left eyes of the stereo pairs, some frames of the sequences.

    Raises:
        UserError: too few.
    """
    names = sorted(data.glob("stereo/*/left.png"))
    for case in sorted(data.glob("tracking/*/frames")):
        names += sorted(case.glob("*.jpg"))[::FRAMES_APART]
    if len(names) < 4:
        raise UserError(f"{data} holds {len(names)} pictures to put cups into, at least 4 are needed")
    return [grey(name) for name in names]


def box_of(mask: Mask) -> Box:
    """The smallest box that holds all of a mask."""
    rows, columns = np.nonzero(mask)
    return Box(float(columns.min()), float(rows.min()), float(np.ptp(columns) + 1), float(np.ptp(rows) + 1))


def cut(image: Image, rng: np.random.Generator) -> Image:
    """A part of the picture, 352 x 288, as much of it as there is."""
    grow = max(SIZE[0] / image.shape[1], SIZE[1] / image.shape[0]) * 1.01
    large = cv2.resize(image, None, fx=grow, fy=grow, interpolation=cv2.INTER_AREA)
    x, y = (int(rng.integers(whole - part + 1)) for whole, part in zip(large.shape[::-1], SIZE, strict=True))
    return np.asarray(large[y : y + SIZE[1], x : x + SIZE[0]], np.uint8).copy()


def put(
    view: Image, mask: Mask, background: Image, hider: Image, how: Condition, rng: np.random.Generator
) -> Shown:
    """A view put into a background; where it is hidden one sees the hider, both (288, 352)."""
    scale = LONGER_EDGE_PX * rng.uniform(*how.scales) / max(box_of(mask).w, box_of(mask).h)
    small = cv2.resize(view, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    shape = cv2.resize(mask.astype(np.uint8), small.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
    inner = box_of(shape)
    x, y = (
        int(rng.integers(0, whole - int(edge))) - int(corner)
        for whole, edge, corner in zip(SIZE, (inner.w, inner.h), (inner.x, inner.y), strict=True)
    )
    rows, columns = np.nonzero(shape)
    image, visible = background.copy(), np.zeros(background.shape, np.bool_)
    image[rows + y, columns + x] = small[rows, columns]
    visible[rows + y, columns + x] = True
    box = box_of(visible)
    if how.hidden:
        hidden = _half(visible, box, int(rng.integers(4)))
        image[hidden] = hider[hidden]
        visible &= ~hidden
    return Shown(darkened(image, rng) if how.dark else image, box, visible)


def darkened(image: Image, rng: np.random.Generator) -> Image:
    """The picture in a quarter of the light, with the noise of a camera that sees little."""
    light = DARK_GAIN * image.astype(np.float64)
    noise = rng.normal(0.0, 1.0, light.shape) * np.sqrt(light / ELECTRONS_PER_GREY + READ_GREY**2)
    return np.clip(np.rint(light + noise), 0, 255).astype(np.uint8)


def _half(mask: Mask, box: Box, side: int) -> Mask:
    """The part of the box on one side (0 above, 1 below, 2 left, 3 right) that holds half of the mask."""
    rows, columns = np.nonzero(mask)
    middle = int(np.median(rows if side < 2 else columns))
    found = np.zeros_like(mask)
    y0, x0, y1, x1 = int(box.y), int(box.x), int(box.y + box.h), int(box.x + box.w)
    edges = [(y0, middle, x0, x1), (middle, y1, x0, x1), (y0, y1, x0, middle), (y0, y1, middle, x1)][side]
    found[edges[0] : edges[1], edges[2] : edges[3]] = True
    return found
