"""Rigs of the cameras that deliver by themselves: MJPEG over HTTP, and V4L2 devices on the table."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from rig import TICK_S, Make, RealRig, Rig
from webcam_far_end import FakeStreamer, jpeg, part

from robot.clock import MonotonicClock
from robot.config import Cameras
from robot.hal.interfaces import StereoCamera
from robot.hal.webcam.opening import Driver, open_webcams
from robot.hal.webcam.reader import Backoff
from robot.hal.webcam.stereo import SideBySideCamera, WebcamPair
from robot.messages import Fault, StereoFrame

_DEADLINE_S = 10.0
_SIZE = (64, 48)


class RigClock:
    """The rig's time as a clock."""

    def __init__(self) -> None:
        self.rig: Rig[StereoCamera] | None = None

    def now(self) -> float:
        """The time the rig says."""
        return 0.0 if self.rig is None else self.rig.now


class LookedAt:
    """The camera, before whose lens a new picture is held whenever somebody looks."""

    def __init__(self, camera: SideBySideCamera | WebcamPair, show: Callable[[], None]) -> None:
        self._camera = camera
        self._show = show

    def latest(self, now: float) -> StereoFrame | None:
        """The newest pair."""
        self._show()
        return self._camera.latest(now)

    def faults(self, now: float) -> tuple[Fault, ...]:
        """The camera's."""
        return self._camera.faults(now)

    def close(self) -> None:
        """The camera's."""
        self._camera.close()


class HttpRig(Rig[StereoCamera]):
    """Two servers (one: side by side) that send one picture for each tick in which somebody looks.

    The reader's threads run in real time, everything else in the rig's: whatever it does, the rig waits
    until the driver has taken notice of it.
    """

    def __init__(self, side_by_side: bool) -> None:
        self.eyes = [FakeStreamer(controls=[]) for _ in range(1 if side_by_side else 2)]
        self._size = (2 * _SIZE[0], _SIZE[1]) if side_by_side else _SIZE
        self._shown_at = -1.0
        clock = RigClock()
        urls = [eye.url for eye in self.eyes]
        camera = open_webcams(
            urls[0],
            "" if side_by_side else urls[1],
            "http",
            width=_SIZE[0],
            height=_SIZE[1],
            rate_hz=25.0,
            clock=clock,
            backoff=Backoff(0.01, 0.05),
        )
        self._camera = camera
        super().__init__(LookedAt(camera, self._show))
        clock.rig = self
        self._until_connected()

    def break_down(self) -> None:
        """Pull the network cable."""
        for eye in self.eyes:
            eye.down()
        _until(lambda: bool(self.device.faults(self.now)))

    def mend(self) -> None:
        """Put it back."""
        for eye in self.eyes:
            eye.connected = threading.Semaphore(0)
            eye.up()
        self._until_connected()

    def _until_connected(self) -> None:
        for eye in self.eyes:
            assert eye.connected.acquire(timeout=_DEADLINE_S)

    def _show(self) -> None:
        if self.now == self._shown_at or not all(eye.is_up for eye in self.eyes):
            return
        self._shown_at = self.now
        for eye in self.eyes:
            eye.push(part(jpeg(round(self.now * 100) % 200, self._size), 100.0 + self.now))
        # A closed camera takes nothing in and says so at once.
        self._camera.wait_newer(_DEADLINE_S)


def _until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + _DEADLINE_S
    while not condition():
        assert time.monotonic() < end, "the driver took no notice in time"
        time.sleep(0.001)


def real(address: str) -> Make | None:
    """LEFT,RIGHT or one side-by-side device: /dev/... or http://...; None if it is neither.

    Size, rate and format are the config's defaults.
    """
    left, _, right = address.partition(",")
    drivers: dict[str, Driver] = {"/dev/": "v4l2", "http:": "http"}
    driver = drivers.get(left[:5])
    if driver is None:
        return None
    return lambda folder: _live(left, right, driver)


def _live(left: str, right: str, driver: Driver) -> Rig[StereoCamera]:
    eyes, clock = Cameras(), MonotonicClock()
    device = open_webcams(
        left,
        right,
        driver,
        width=eyes.width_px,
        height=eyes.height_px,
        rate_hz=eyes.rate_hz,
        pixel_format=eyes.pixel_format,
        exposure_100us=eyes.exposure_100us,
        white_balance_k=eyes.white_balance_k,
        clock=clock,
    )
    rig = RealRig(device)
    rig._start = clock._start  # one time for both
    _until(lambda: device.latest(clock.now()) is not None)
    rig.wait(TICK_S)
    return rig


MAKERS = {
    "camera": {
        "http": lambda folder: HttpRig(side_by_side=False),
        "http-side-by-side": lambda folder: HttpRig(side_by_side=True),
    }
}
REAL = {"camera": real}
