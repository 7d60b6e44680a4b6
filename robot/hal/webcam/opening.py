"""The stereo camera that the config names."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Literal

from robot.clock import Clock
from robot.hal.interfaces import DeviceError
from robot.hal.webcam.alike import Look, LookKeeper, OpenControls
from robot.hal.webcam.controls_http import HttpControls
from robot.hal.webcam.controls_v4l2 import V4l2Controls
from robot.hal.webcam.http_source import HttpSource
from robot.hal.webcam.reader import DEFAULT_BACKOFF, Backoff, Reader
from robot.hal.webcam.source import Source
from robot.hal.webcam.stereo import SideBySideCamera, WebcamPair
from robot.hal.webcam.v4l2 import Format, V4l2Source
from robot.hal.webcam.video import VideoSource

Driver = Literal["v4l2", "http", "video"]

# An exchange that sets a picture's look is not part of any control loop.
_LOOK_TIMEOUT_S = 0.5


def open_webcams(
    left: str,
    right: str,
    driver: Driver,
    *,
    width: int,
    height: int,
    rate_hz: float,
    pixel_format: str = "MJPG",
    exposure_100us: int = 0,
    white_balance_k: int = 0,
    clock: Clock,
    backoff: Backoff = DEFAULT_BACKOFF,
) -> WebcamPair | SideBySideCamera:
    """Open two eyes, or one device that shows both side by side (right == "").

    left, right: device path, http:// address or video file, as `driver` says. width, height: pixels of one
    eye. exposure_100us and white_balance_k hold for both eyes; 0: the left eye finds it by itself, which
    takes up to 2 s, then both keep that. Raises DeviceError with the cure if an eye is not there or does not
    give what is asked; whatever was opened is closed again.
    """
    paths = [path for path in (left, right) if path]
    if not left:
        raise DeviceError("cameras.left is empty: name the left eye")
    if left == right:
        raise DeviceError(
            "cameras.left and cameras.right are the same: for one side-by-side device leave right empty"
        )
    wanted = Format(width * (1 if right else 2), height, rate_hz, pixel_format)
    keeper = LookKeeper(Look(exposure_100us or None, white_balance_k or None))
    start = clock.now()
    with ExitStack() as opened:
        readers = []
        for path in paths:
            source = _source(path, driver, wanted, clock, start)
            reader = Reader(source, backoff=backoff, on_open=_dressing(keeper, path, driver))
            reader.start()
            opened.callback(reader.close)
            readers.append(reader)
        if driver != "video":
            eyes = [(path, _controls(path, driver)) for path in paths]
            keeper.find(eyes[0], eyes[1:])
        opened.pop_all()
    if not right:
        return SideBySideCamera(readers[0], clock, (width, height))
    return WebcamPair(readers[0], readers[1], clock, rate_hz, (width, height))


def _source(path: str, driver: Driver, wanted: Format, clock: Clock, start: float) -> Source:
    if driver == "v4l2":
        return V4l2Source(path, wanted, clock)
    if driver == "http":
        return HttpSource(path, clock)
    return VideoSource(Path(path), clock, start, wanted.rate_hz)


def _controls(path: str, driver: Driver) -> OpenControls:
    if driver == "v4l2":
        return partial(V4l2Controls, path)
    return partial(HttpControls, path, _LOOK_TIMEOUT_S)


def _dressing(keeper: LookKeeper, path: str, driver: Driver) -> Callable[[], None] | None:
    return None if driver == "video" else partial(keeper.apply, path, _controls(path, driver))
