"""Sequences a tracker is held to: as they were filmed, half covered for a while, out of view for a while."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.errors import UserError
from robot.messages import Box, Image

BEFORE, COVERED, AWAY, AFTER = 30, 30, 100, 50
"""Frames: before the target is covered or gone, covered, gone, and after."""
LOOP = 25
"""While the target is away so many frames run forth and back."""
ROOM_SHARE = 0.2
"""Of the box, painted over beside it on every side: truth is drawn tightly."""
FEATHER_PX = 3


@dataclass(frozen=True, slots=True, eq=False)
class Filmed:
    """Frames (H, W, 3) uint8 and where the target is in each; None: not visible."""

    name: str
    frames: tuple[Image, ...]
    truth: tuple[Box | None, ...]


def sequence(folder: Path) -> Filmed:
    """A case of `tracking/`: frames/*.jpg or video.mpg, and truth.csv (frame, x, y, w, h).

    Raises:
        UserError: there is no picture, or no truth.
    """
    try:
        lines = (folder / "truth.csv").read_text().splitlines()[1:]
    except OSError as problem:
        raise UserError(f"{folder} is no tracking case: {problem}") from problem
    truth = [_box(line.split(",")[1:]) for line in lines]
    frames = _frames(folder)[: len(truth)]
    if not frames or not truth or truth[0] is None:
        raise UserError(f"{folder} holds no frames with a target to start on")
    return Filmed(folder.name, tuple(frames), tuple(truth[: len(frames)]))


def half_covered(film: Filmed, seed: int) -> Filmed | None:
    """From `BEFORE` frames before a seeded one on: one half of the box shows other texture for 30 frames.

    None if the target is never visible so long.
    """
    rng = np.random.default_rng([seed, 50])
    begin = _visible_run(film.truth, BEFORE + COVERED + AFTER, rng)
    if begin is None:
        return None
    cut = slice(begin, begin + BEFORE + COVERED + AFTER)
    frames, truth = list(film.frames[cut]), film.truth[cut]
    side, start = int(rng.integers(4)), truth[BEFORE]
    assert start is not None
    texture = _elsewhere(frames[BEFORE], start, rng)
    for i in range(BEFORE, BEFORE + COVERED):
        box = truth[i]
        assert box is not None
        frames[i] = _painted(frames[i], _half(box, side), texture)
    return Filmed(film.name, tuple(frames), truth)


def gone(film: Filmed, seed: int) -> Filmed | None:
    """From `BEFORE` frames before a seeded one on: the target is out of view for 100 frames, and back.

    While it is away some frames run forth and back, what lies beside it painted over it.
    """
    rng = np.random.default_rng([seed, 100])
    begin = _visible_run(film.truth, BEFORE + LOOP + AFTER, rng)
    if begin is None:
        return None
    at = begin + BEFORE
    there = [at + min(i % (2 * LOOP), 2 * LOOP - 1 - i % (2 * LOOP)) for i in range(AWAY)]
    empty = [_without(film.frames[i], film.truth[i]) for i in there]
    frames = (*film.frames[begin:at], *empty, *film.frames[at : at + AFTER])
    truth = (*film.truth[begin:at], *(None for _ in there), *film.truth[at : at + AFTER])
    return replace(film, frames=frames, truth=truth)


def _frames(folder: Path) -> list[Image]:
    pictures = sorted((folder / "frames").glob("*.jpg"))
    if pictures:
        return [np.asarray(cv2.imread(str(path)), np.uint8) for path in pictures]
    video = cv2.VideoCapture(str(folder / "video.mpg"))
    found: list[Image] = []
    while True:
        there, frame = video.read()
        if not there:
            return found
        found.append(np.asarray(frame, np.uint8))


def _box(words: Sequence[str]) -> Box | None:
    if any(not word.strip() for word in words[:4]) or len(words) < 4:
        return None
    x, y, w, h = (float(word) for word in words[:4])
    return Box(x, y, w, h) if w > 0 and h > 0 else None


def _visible_run(truth: Sequence[Box | None], length: int, rng: np.random.Generator) -> int | None:
    """A seeded beginning of so many frames in a row that show the target."""
    seen = np.array([box is not None for box in truth], np.int32)
    starts = np.flatnonzero(np.convolve(seen, np.ones(length, np.int32), mode="valid") == length)
    return int(rng.choice(starts)) if len(starts) else None


def _half(box: Box, side: int) -> Box:
    w, h = (box.w / 2, box.h) if side < 2 else (box.w, box.h / 2)
    x, y = box.x + (box.w / 2 if side == 1 else 0.0), box.y + (box.h / 2 if side == 3 else 0.0)
    return Box(x, y, w, h)


def _elsewhere(frame: Image, box: Box, rng: np.random.Generator) -> Image:
    """A patch of the box's size that lies farthest from it, of some at random places."""
    height, width = frame.shape[:2]
    w, h = min(round(box.w) + 2, width), min(round(box.h) + 2, height)
    places = rng.integers((0, 0), (width - w + 1, height - h + 1), (20, 2))
    x, y = max(places, key=lambda p: float(np.hypot(p[0] - box.x, p[1] - box.y)))
    return frame[y : y + h, x : x + w].copy()


def _without(frame: Image, box: Box | None) -> Image:
    """The frame with what lies beside the box painted over it: of four neighbours the one that fits best."""
    assert box is not None
    wide = _grown(box, ROOM_SHARE)
    height, width = frame.shape[:2]
    fits = []
    for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        x, y = round(wide.x + dx * wide.w), round(wide.y + dy * wide.h)
        x, y = min(max(x, 0), width - round(wide.w)), min(max(y, 0), height - round(wide.h))
        patch = frame[y : y + round(wide.h), x : x + round(wide.w)]
        overlap = Box(x, y, wide.w, wide.h).iou(box)
        fits.append((overlap + _seam(frame, wide, patch) / 255.0, patch))
    return _painted(frame, wide, min(fits, key=lambda fit: fit[0])[1])


def _seam(frame: Image, box: Box, patch: NDArray[np.uint8]) -> float:
    """Mean grey levels by which the patch differs from what lies about the box."""
    done = _painted(frame, box, patch)
    ring = _grown(box, 0.05)
    x, y = max(round(ring.x), 0), max(round(ring.y), 0)
    area = np.s_[y : round(ring.y + ring.h), x : round(ring.x + ring.w)]
    return float(cv2.absdiff(frame[area], cv2.blur(done, (9, 9))[area]).mean())


def _grown(box: Box, share: float) -> Box:
    return Box(box.x - share * box.w, box.y - share * box.h, box.w * (1 + 2 * share), box.h * (1 + 2 * share))


def _painted(frame: Image, box: Box, texture: Image) -> Image:
    """The frame with the texture in the box, its edges feathered."""
    height, width = frame.shape[:2]
    x0, y0 = max(round(box.x), 0), max(round(box.y), 0)
    x1, y1 = min(round(box.x + box.w), width), min(round(box.y + box.h), height)
    if x1 <= x0 or y1 <= y0:
        return frame
    cover = np.zeros((height, width), np.float32)
    cover[y0:y1, x0:x1] = 1.0
    soft = cv2.blur(cover, (FEATHER_PX, FEATHER_PX))[..., None]
    painted = frame.copy()
    painted[y0:y1, x0:x1] = cv2.resize(texture, (x1 - x0, y1 - y0), interpolation=cv2.INTER_LINEAR)
    return np.asarray(np.rint(soft * painted + (1.0 - soft) * frame), np.uint8)
