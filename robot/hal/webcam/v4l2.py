"""A webcam through the kernel's V4L2."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol

import cv2
import numpy as np

from robot.clock import Clock
from robot.hal.interfaces import DeviceError
from robot.hal.webcam.node import NO_ROOM, DeviceNode, Node, check_capture, words
from robot.hal.webcam.source import TimedImage

# A camera that gives fewer pictures than this share of those asked for was set up wrongly.
_LEAST_RATE_SHARE: Final = 0.8
# Broken pictures happen (a bad cable, the first ones after a start), a row of them is a broken camera.
_MOST_BROKEN: Final = 10
# Older or newer stamps are of another clock than CLOCK_MONOTONIC.
_OLDEST_S: Final = 5.0
_FIRST_PICTURE_S: Final = 3.0
_SILENCE_S: Final = 2.0


@dataclass(frozen=True, slots=True)
class Format:
    """What a camera is asked for. Size of the whole picture in pixels; pixel_format 'MJPG' or 'YUYV'."""

    width: int
    height: int
    rate_hz: float
    pixel_format: str = "MJPG"


class Capture(Protocol):
    """What is used of cv2.VideoCapture."""

    def isOpened(self) -> bool: ...
    def set(self, propId: int, value: float) -> bool: ...
    def get(self, propId: int) -> float: ...
    def grab(self) -> bool: ...
    def retrieve(self) -> tuple[bool, Any]: ...
    def release(self) -> None: ...


def open_capture(path: str) -> Capture:
    """OpenCV's V4L2 device behind a path; not opened if there is none that it can use."""
    return cv2.VideoCapture(os.path.realpath(path), cv2.CAP_V4L2)


class V4l2Source:
    """`Source` over one V4L2 device; opens it by path (best one of /dev/v4l/by-path: it names the plug).

    Format, size and rate are set and read back: a camera that does otherwise is refused with the setting
    that fits. Capture times are the driver's own (CLOCK_MONOTONIC) on the run's clock.

    OpenCV's grab waits ten seconds for a silent camera, so the device is asked first, through a second file,
    whether there is a picture. Only the first grab, which starts the stream, is at OpenCV's mercy.
    """

    def __init__(
        self,
        path: str,
        wanted: Format,
        clock: Clock,
        open_capture: Callable[[str], Capture] = open_capture,
        open_node: Callable[[str], Node] = DeviceNode,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._path = path
        self._wanted = wanted
        self._clock = clock
        self._open_capture = open_capture
        self._open_node = open_node
        self._monotonic = monotonic
        self._capture: Capture | None = None
        self._node: Node | None = None
        self._first: TimedImage | None = None
        self._broken = 0
        self._heard_at = -math.inf

    @property
    def name(self) -> str:
        """The path."""
        return self._path

    def open(self) -> None:
        """Open, set up, and take the first picture: only that shows that the bus has room.

        Raises DeviceError.
        """
        self.close()
        self._node = self._open_node(self._path)
        try:
            check_capture(self._node, self._path)
            self._capture = self._open_capture(self._path)
            if not self._capture.isOpened():
                raise DeviceError(f"camera {self._path} cannot be opened: unplug and replug it")
            _set_up(self._capture, self._wanted)
            check_format(_read_back(self._capture), self._wanted, self._path)
            self._broken = 0
            self._first = self._first_picture(self._capture, self._node)
        except (OSError, cv2.error) as error:
            self.close()
            raise _as_device_error(self._path, error) from error

    def grab(self, timeout: float) -> TimedImage | None:
        """The next picture; None also for one that came broken."""
        if self._capture is None or self._node is None:
            raise DeviceError(f"camera {self._path} is closed")
        first, self._first = self._first, None
        if first is not None:
            return first
        try:
            if self._node.wait_for_picture(timeout):
                return self._take(self._capture)
        except DeviceError:
            raise
        except (OSError, cv2.error) as error:
            raise self._gone() from error
        self._check_silence()
        return None

    def close(self) -> None:
        """Release the device."""
        capture, self._capture = self._capture, None
        if capture is not None:
            capture.release()
        node, self._node = self._node, None
        if node is not None:
            node.close()

    def _first_picture(self, capture: Capture, node: Node) -> TimedImage:
        # The stream starts with the first grab: here, not later, a full USB bus refuses it.
        if not capture.grab():
            raise DeviceError(f"camera {self._path} starts no stream: {NO_ROOM}")
        until = self._monotonic() + _FIRST_PICTURE_S
        picture = self._retrieve(capture)
        while picture is None:
            if self._monotonic() > until or not node.wait_for_picture(_FIRST_PICTURE_S):
                raise DeviceError(f"camera {self._path} gives no picture: unplug and replug it")
            picture = self._take(capture)
        return picture

    def _take(self, capture: Capture) -> TimedImage | None:
        if not capture.grab():
            raise self._gone()
        return self._retrieve(capture)

    def _retrieve(self, capture: Capture) -> TimedImage | None:
        stamp = capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0
        now, arrival = self._clock.now(), self._monotonic()
        self._heard_at = arrival
        good, image = capture.retrieve()
        if not good or image is None or image.ndim != 3:
            self._broken += 1
            if self._broken >= _MOST_BROKEN:
                raise DeviceError(
                    f"camera {self._path}: {self._broken} broken pictures in a row: check its cable"
                )
            return None
        self._broken = 0
        age = arrival - stamp
        if not (stamp > 0 and -_OLDEST_S < age < _OLDEST_S):
            age = 0.0
        return TimedImage(np.asarray(image, dtype=np.uint8), now - max(age, 0.0))

    def _check_silence(self) -> None:
        if self._monotonic() - self._heard_at > _SILENCE_S:
            raise DeviceError(f"camera {self._path} delivers nothing for {_SILENCE_S:.0f} s: replug it")

    def _gone(self) -> DeviceError:
        if not os.path.exists(self._path):
            return DeviceError(f"camera {self._path} was unplugged: check its cable")
        return DeviceError(f"camera {self._path} stopped delivering: check its cable")


def check_format(given: Format, wanted: Format, path: str) -> None:
    """Raise DeviceError, with the setting that fits, if the camera gives something else than was asked.

    A figure of 0 or less is unknown and passes; a rate is refused if it is below 80 % of the wanted one.
    """
    if given.pixel_format and given.pixel_format != wanted.pixel_format:
        raise DeviceError(
            f"camera {path} gives {given.pixel_format}, not {wanted.pixel_format}: "
            f"set cameras.pixel_format to what `v4l2-ctl -d {path} --list-formats-ext` shows"
        )
    sizes = (given.width, given.height), (wanted.width, wanted.height)
    if min(sizes[0]) > 0 and sizes[0] != sizes[1]:
        raise DeviceError(
            f"camera {path} gives {given.width} x {given.height} pixels, not {wanted.width} x "
            f"{wanted.height}: mend cameras.width_px and cameras.height_px"
        )
    if 0 < given.rate_hz < _LEAST_RATE_SHARE * wanted.rate_hz:
        raise DeviceError(
            f"camera {path} gives {given.rate_hz:.1f} pictures a second, not {wanted.rate_hz:g}: "
            "lower cameras.rate_hz or the picture's size"
        )


def fourcc_text(code: float) -> str:
    """The four letters of a pixel format's number; '' if it is none.

    >>> fourcc_text(0x47504A4D)
    'MJPG'
    """
    number = int(code) if math.isfinite(code) else 0
    letters = bytes((number >> shift) & 0xFF for shift in (0, 8, 16, 24)) if number > 0 else b""
    return letters.decode("ascii") if letters.isascii() and letters.decode("ascii").isprintable() else ""


def _set_up(capture: Capture, wanted: Format) -> None:
    # The format first: sizes and rates depend on it.
    capture.set(cv2.CAP_PROP_FOURCC, float(cv2.VideoWriter.fourcc(*wanted.pixel_format)))
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, wanted.width)
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, wanted.height)
    capture.set(cv2.CAP_PROP_FPS, wanted.rate_hz)


def _read_back(capture: Capture) -> Format:
    return Format(
        width=round(capture.get(cv2.CAP_PROP_FRAME_WIDTH)),
        height=round(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)),
        rate_hz=capture.get(cv2.CAP_PROP_FPS),
        pixel_format=fourcc_text(capture.get(cv2.CAP_PROP_FOURCC)),
    )


def _as_device_error(path: str, error: Exception) -> DeviceError:
    if isinstance(error, DeviceError):
        return error
    text = words(error) if isinstance(error, OSError) else " ".join(str(error).split())
    return DeviceError(f"camera {path} cannot be used: {text}")
