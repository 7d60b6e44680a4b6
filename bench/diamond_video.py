"""Blocks of real videos for `bench.diamond`: textured ones chosen by a seeded rule, and the true boxes.

A case is three frames in a row and a place: the block is cut from the middle frame, looked for in the last,
and its motion from the first to the middle one is what a tracker already knows. Rule: of every n-th frame, so
that a sequence gives 20 of them (80 with --full), places are drawn at random, seeded by the numbers of the
sequence and the frame; the first PLACES whose texture is enough are taken, and as many of any texture. A
sequence with a truth.csv gives one block more for each frame: all three frames are scaled so that the box's
geometric mean is 48 px, the block is the 48 x 48 px about its centre. Where the window of +-14 px leaves the
picture, no block is taken.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.errors import UserError
from robot.messages import Box
from robot.vision.diamond import Displacement

Picture = NDArray[np.uint8]

EDGE, MARGIN = 48, 14
PLACES, DRAWS = 8, 60
LEAST_TEXTURE = 2.0
"""Grey values per px: root mean square slope in the direction in which it is least (Shi & Tomasi)."""
_VIDEOS = (".mp4", ".mpg", ".avi", ".mkv")


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A block at (left, top) of the middle one of three grey pictures. kind: textured, any, box."""

    sequence: str
    frame: int
    kind: str
    pictures: tuple[Picture, Picture, Picture]
    left: int
    top: int

    @property
    def block(self) -> Picture:
        """(48, 48), cut from the middle picture."""
        return self._cut(self.pictures[1])

    @property
    def block_before(self) -> Picture:
        """What the first picture shows at the same place."""
        return self._cut(self.pictures[0])

    def window(self, reach: int) -> Picture:
        """The part of the last picture in which the block can lie: (48 + 2 reach, 48 + 2 reach)."""
        rows = slice(self.top - reach, self.top + EDGE + reach)
        return self.pictures[2][rows, self.left - reach : self.left + EDGE + reach]

    def _cut(self, picture: Picture) -> Picture:
        return picture[self.top : self.top + EDGE, self.left : self.left + EDGE].copy()


def sources(data: str | None, video: str | None) -> list[Path]:
    """Folders of DATA/tracking and the video files in and below VIDEO, in order of their names.

    Raises UserError if neither is given or nothing is found.
    """
    found = sorted(path.parent for path in Path(data, "tracking").glob("*/truth.csv")) if data else []
    if video:
        found += sorted(path for path in Path(video).rglob("*") if path.suffix.lower() in _VIDEOS)
    if not found:
        raise UserError(
            "no videos: give --data DIR with DIR/tracking/*/truth.csv, or --video DIR with videos"
        )
    return found


def frames(source: Path) -> list[Picture]:
    """All frames of a sequence, grey. Raises UserError if there are fewer than three."""
    if source.is_dir() and not (source / "video.mpg").exists():
        read = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in sorted(source.glob("frames/*.jpg"))]
        pictures = [np.asarray(picture, np.uint8) for picture in read if picture is not None]
    else:
        pictures = list(_decoded(source / "video.mpg" if source.is_dir() else source))
    if len(pictures) < 3:
        raise UserError(f"{source}: fewer than three frames could be read")
    return pictures


def _decoded(path: Path) -> Iterator[Picture]:
    capture = cv2.VideoCapture(str(path))
    while (read := capture.read())[0]:
        yield np.asarray(cv2.cvtColor(read[1], cv2.COLOR_BGR2GRAY), np.uint8)
    capture.release()


def cases(source: Path, number: int, pairs: int) -> list[Case]:
    """The blocks of one sequence by the rule above; `number` seeds the draw."""
    pictures = frames(source)
    boxes = _truth(source / "truth.csv")
    chosen: list[Case] = []
    for frame in range(2, len(pictures), max(1, -(-(len(pictures) - 2) // pairs))):
        before, middle, last = pictures[frame - 2 : frame + 1]
        three = (before, middle, last)
        rng = np.random.default_rng([number, frame])
        for kind, least in (("textured", LEAST_TEXTURE), ("any", 0.0)):
            for left, top in _places(middle, rng, least):
                chosen.append(Case(source.stem, frame, kind, three, left, top))
        if (box := boxes.get(frame - 1)) is not None:
            chosen += _box_case(source.stem, frame, three, box)
    return chosen


def texture(block: Picture) -> float:
    """Root mean square slope in the direction in which it is least, grey values per px.

    >>> ramp = np.tile(np.arange(0, 240, 5, dtype=np.uint8), (48, 1))
    >>> texture(ramp), round(texture(ramp + ramp.T), 1) > 0
    (0.0, True)
    """
    across = cv2.Sobel(block, cv2.CV_64F, 1, 0, scale=1 / 8)
    down = cv2.Sobel(block, cv2.CV_64F, 0, 1, scale=1 / 8)
    mixed = np.mean(across * down)
    tensor = np.array([[np.mean(across**2), mixed], [mixed, np.mean(down**2)]])
    return float(np.sqrt(max(0.0, np.linalg.eigvalsh(tensor)[0])))


def _places(picture: Picture, rng: np.random.Generator, least: float) -> list[Displacement]:
    free_x, free_y = (extent - EDGE - 2 * MARGIN for extent in picture.shape[::-1])
    if min(free_x, free_y) < 0:
        return []
    found: list[Displacement] = []
    for _ in range(DRAWS):
        left, top = MARGIN + int(rng.integers(free_x + 1)), MARGIN + int(rng.integers(free_y + 1))
        if texture(picture[top : top + EDGE, left : left + EDGE]) >= least:
            found.append((left, top))
        if len(found) == PLACES:
            break
    return found


def _box_case(sequence: str, frame: int, three: Sequence[Picture], box: Box) -> list[Case]:
    scale = EDGE / float(np.sqrt(box.area))
    kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    scaled = [
        np.asarray(cv2.resize(p, None, fx=scale, fy=scale, interpolation=kind), np.uint8) for p in three
    ]
    left, top = (round(middle * scale) - EDGE // 2 for middle in box.centre)
    height, width = scaled[1].shape
    room = min(left, top, width - EDGE - left, height - EDGE - top)
    if room < MARGIN:
        return []
    return [Case(sequence, frame, "box", (scaled[0], scaled[1], scaled[2]), left, top)]


def _truth(path: Path) -> dict[int, Box]:
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {
            int(row["frame"]): Box(float(row["x"]), float(row["y"]), float(row["w"]), float(row["h"]))
            for row in csv.DictReader(file)
            if row["x"]
        }
