"""Cars of the UIUC set: the set's own rule of what is found, recall and precision, equal-error rate.

Agarwal, Awan, Roth, "Learning to detect objects in images via a sparse, part-based representation" (PAMI
2004), section 4: a detection is right if it lies within an ellipse of a quarter of the object's size about
its true place, in the multi-scale set within an ellipsoid whose third axis is a quarter of its width; each
object counts once, all further detections of it are false.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from robot.errors import UserError
from robot.messages import Box, Image

TOLERANCE = 0.25
CROP = Box(0.0, 0.0, 100.0, 40.0)


@dataclass(frozen=True, slots=True)
class Found:
    """A detection: in which image, where, how sure."""

    image: str
    box: Box
    score: float


def crops(folder: Path, count: int, seed: int) -> tuple[list[Image], list[Image]]:
    """`count` cars and `count` backgrounds of the training set, chosen by the seed; grey, 100 x 40.

    Raises:
        UserError: the set is not there.
    """
    rng = np.random.default_rng(seed)
    found = []
    for kind in ("pos", "neg"):
        names = sorted((folder / "train" / kind).glob("*"))
        if len(names) < count:
            raise UserError(f"{folder / 'train' / kind} holds {len(names)} images, {count} are needed")
        found.append([grey(names[int(i)]) for i in rng.permutation(len(names))[:count]])
    return found[0], found[1]


def truths(folder: Path, kind: str) -> dict[str, list[Box]]:
    """Where the cars of each image of the set `single` or `multi` truly are."""
    found: dict[str, list[Box]] = {}
    with (folder / f"{kind}.csv").open(newline="") as lines:
        for row in csv.DictReader(lines):
            found.setdefault(row["image"], []).append(Box(*(float(row[k]) for k in "xywh")))
    return found


def grey(path: Path) -> Image:
    """A picture as grey values.

    Raises:
        UserError: it cannot be read.
    """
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if picture is None:
        raise UserError(f"cannot read {path} as a picture")
    return np.asarray(picture, np.uint8)


def right(found: Box, true: Box, *, scales: bool) -> bool:
    """Whether a detection is right by the set's rule; scales: the multi-scale set's.

    >>> right(Box(10, 0, 100, 40), Box(0, 0, 100, 40), scales=False)
    True
    >>> right(Box(30, 0, 100, 40), Box(0, 0, 100, 40), scales=False)
    False
    """
    (u, v), (x, y) = found.centre, true.centre
    off = ((u - x) / (TOLERANCE * true.w)) ** 2 + ((v - y) / (TOLERANCE * true.h)) ** 2
    if scales:
        off += ((found.w - true.w) / (TOLERANCE * true.w)) ** 2
    return off <= 1.0


def equal_error_rate(
    found: Sequence[Found], true: Mapping[str, Sequence[Box]], *, scales: bool
) -> tuple[float, float]:
    """Recall where it meets precision, and the recall of all detections together."""
    objects = sum(len(boxes) for boxes in true.values())
    taken: set[tuple[str, int]] = set()
    best, hits = 0.0, 0
    for told, one in enumerate(sorted(found, key=lambda f: -f.score), start=1):
        for index, box in enumerate(true[one.image]):
            if (one.image, index) not in taken and right(one.box, box, scales=scales):
                taken.add((one.image, index))
                hits += 1
                break
        best = max(best, min(hits / objects, hits / told))
    return best, hits / objects
