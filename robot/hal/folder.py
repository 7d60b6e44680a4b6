"""A stereo camera that plays pictures from disk."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from robot.hal.faultbook import FaultBook
from robot.hal.interfaces import DeviceError
from robot.messages import Fault, Image, StereoFrame

SUFFIXES: Final = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".ppm", ".pgm"})


class FolderCamera:
    """`StereoCamera` over pairs of picture files, one pair every 1 / rate_hz seconds from the first call on.

    After the last pair it keeps showing it, with its capture time: the pictures grow old, as they do when a
    camera stops. size is (width, height) in pixels that every picture must have, None: that of the first
    pair. A file that cannot be read later on is the fault `camera.link`, one of another size `camera.size`;
    the last good pair stays.

    Raises DeviceError if there is no pair or the first is not readable or of another size.
    """

    def __init__(
        self, pairs: Iterable[tuple[Path, Path]], rate_hz: float = 25.0, size: tuple[int, int] | None = None
    ) -> None:
        if rate_hz <= 0:
            raise ValueError(f"rate_hz must be positive, got {rate_hz}")
        self._pairs = list(pairs)
        if not self._pairs:
            raise DeviceError("there is no pair of pictures")
        self._rate_hz = rate_hz
        self._book = FaultBook("camera")
        left, right = (_read(path) for path in self._pairs[0])
        self._size = size or _size(left)
        for path, image in zip(self._pairs[0], (left, right), strict=True):
            if _size(image) != self._size:
                raise DeviceError(_wrong_size(path, image, self._size))
        self._first = (left, right)
        self._start: float | None = None
        self._shown = -1
        self._last: StereoFrame | None = None
        self._closed = False

    def latest(self, now: float) -> StereoFrame | None:
        """The pair due at `now`."""
        if self._closed:
            return self._last
        if self._start is None:
            self._start = now
        due = math.floor((now - self._start) * self._rate_hz + 1e-6)
        index = min(due, len(self._pairs) - 1)
        if index > self._shown:
            self._shown = index
            self._show(index, now)
        return self._last

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong with the pictures."""
        return self._book.open

    def close(self) -> None:
        """Play no further."""
        self._closed = True

    def _show(self, index: int, now: float) -> None:
        try:
            left, right = self._first if index == 0 else tuple(_read(path) for path in self._pairs[index])
        except DeviceError as error:
            self._book.raised("link", now, str(error))
            return
        self._book.cleared("link")
        for path, image in zip(self._pairs[index], (left, right), strict=True):
            if _size(image) != self._size:
                self._book.raised("size", now, _wrong_size(path, image, self._size))
                return
        self._book.cleared("size")
        assert self._start is not None
        captured_at = round(self._start + index / self._rate_hz, 9)
        self._last = StereoFrame(left, right, captured_at, seq=index)


def pairs_in(left: Path, right: Path | None = None) -> list[tuple[Path, Path]]:
    """Pairs of picture files: from two folders in the order of their names, or left_*/right_* of one folder.

    Raises DeviceError naming the folder and what is wrong: missing, empty, another number of pictures.
    """
    if right is None or right == left:
        lefts = [path for path in _pictures(left) if path.name.startswith("left")]
        rights = [path for path in _pictures(left) if path.name.startswith("right")]
        if not lefts:
            raise DeviceError(f"{left} holds no left_*.png: name the pictures left_*.png and right_*.png")
        missing = {path.name[4:] for path in lefts} ^ {path.name[5:] for path in rights}
        if missing:
            raise DeviceError(f"{left}: picture {sorted(missing)[0].lstrip('_')} is there for one eye only")
        return list(zip(lefts, rights, strict=True))
    lefts, rights = _pictures(left), _pictures(right)
    if len(lefts) != len(rights):
        raise DeviceError(f"{left} holds {len(lefts)} pictures, {right} {len(rights)}: make them pairs")
    return list(zip(lefts, rights, strict=True))


def _pictures(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise DeviceError(f"{folder} is not a folder")
    found = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    if not found:
        raise DeviceError(f"{folder} holds no pictures ({', '.join(sorted(SUFFIXES))})")
    return found


def _read(path: Path) -> Image:
    # Through bytes: cv2.imread writes to standard error about files it cannot read.
    try:
        data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except OSError as error:
        raise DeviceError(f"picture {path} cannot be read: {error.strerror}") from error
    image = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    if image is None:
        raise DeviceError(f"{path} is no readable picture: remove or replace it")
    return np.asarray(image, dtype=np.uint8)


def _size(image: Image) -> tuple[int, int]:
    return image.shape[1], image.shape[0]


def _wrong_size(path: Path, image: Image, size: tuple[int, int]) -> str:
    width, height = _size(image)
    return f"{path} is {width} x {height} pixels, not {size[0]} x {size[1]}"
