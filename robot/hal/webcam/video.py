"""A video file played as a camera."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from robot.clock import Clock
from robot.hal.interfaces import DeviceError
from robot.hal.webcam.source import EndOfPicturesError, TimedImage

_EPSILON_S: Final = 1e-6


class VideoSource:
    """`Source` over an AVI, MP4, ... file, played at its own rate on the run's clock.

    Picture n is due at start + n / rate, in seconds of that clock: two files with one `start` are played
    side by side. A reader that is late skips pictures. Files that tell no rate are played at rate_hz. With
    `loop` it begins again after the last picture, else it ends in words.
    """

    def __init__(
        self,
        path: Path,
        clock: Clock,
        start: float,
        rate_hz: float = 25.0,
        loop: bool = False,
        pause: Callable[[float], None] = time.sleep,
    ) -> None:
        self._path = path
        self._clock = clock
        self._start = start
        self._rate_hz = rate_hz
        self._loop = loop
        self._pause = pause
        self._capture: cv2.VideoCapture | None = None
        self._next = 0  # number of the picture that the file gives next, counted through all loops
        self._begun_at = 0  # number of the file's first picture in this loop

    @property
    def name(self) -> str:
        """The file's path."""
        return str(self._path)

    def open(self) -> None:
        """Open the file. Raises DeviceError."""
        self.close()
        if not self._path.is_file():
            raise DeviceError(f"the video {self._path} is not there: check its path")
        capture = cv2.VideoCapture(str(self._path))
        if not capture.isOpened():
            raise DeviceError(f"{self._path} is no video that can be read: use AVI (MJPG) or MP4")
        rate = capture.get(cv2.CAP_PROP_FPS)
        if 0.1 <= rate <= 1000.0:
            self._rate_hz = rate
        self._capture, self._next, self._begun_at = capture, 0, 0

    def grab(self, timeout: float) -> TimedImage | None:
        """The picture due now, or the next one if it is due within `timeout` seconds."""
        if self._capture is None:
            raise DeviceError(f"the video {self._path} is closed")
        wait = self._due(self._next) - self._clock.now()
        if wait > _EPSILON_S:
            self._pause(min(wait, timeout))
            if self._due(self._next) - self._clock.now() > _EPSILON_S:
                return None
        while self._due(self._next + 1) <= self._clock.now() + _EPSILON_S and self._capture.grab():
            self._next += 1
        good, image = self._capture.read()
        if not good or image is None:
            self._rewind()
            return None
        at = self._due(self._next)
        self._next += 1
        return TimedImage(np.asarray(image, dtype=np.uint8), at)

    def close(self) -> None:
        """Release the file."""
        capture, self._capture = self._capture, None
        if capture is not None:
            capture.release()

    def _due(self, number: int) -> float:
        return self._start + number / self._rate_hz

    def _rewind(self) -> None:
        assert self._capture is not None
        if self._next == self._begun_at:
            raise DeviceError(f"the video {self._path} holds no picture: use another file")
        if not self._loop:
            raise EndOfPicturesError(f"the video {self._path} is over: start again, or give a longer one")
        self._capture.release()
        self._capture = cv2.VideoCapture(str(self._path))
        self._begun_at = self._next
