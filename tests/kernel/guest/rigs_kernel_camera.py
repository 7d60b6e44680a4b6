"""The stereo camera before two V4L2 devices of the kernel, whose cables a test can pull.

In the guest this lies beside the other rigs, where the contract suites pick it up.
"""

from __future__ import annotations

import time

import vivid
from brick_remote import wait_until
from rig import RealRig

from robot.clock import MonotonicClock
from robot.hal.interfaces import StereoCamera
from robot.hal.webcam.opening import open_webcams


def open_eyes(clock: MonotonicClock) -> StereoCamera:
    """Both cameras as one stereo camera."""
    left, right = vivid.nodes()
    return open_webcams(
        left,
        right,
        "v4l2",
        width=vivid.WIDTH,
        height=vivid.HEIGHT,
        rate_hz=vivid.RATE_HZ,
        pixel_format=vivid.PIXEL_FORMAT,
        clock=clock,
    )


class KernelCameraRig(RealRig[StereoCamera]):
    """The V4L2 driver, OpenCV, the kernel's media stack and vivid."""

    def __init__(self) -> None:
        vivid.plug()
        self._clock = MonotonicClock()
        super().__init__(open_eyes(self._clock))
        self.now = self._clock.now()

    def wait(self, seconds: float) -> None:
        """Wait; the time is the driver's own clock's."""
        time.sleep(seconds)
        self.now = self._clock.now()

    def break_down(self) -> None:
        """Pull both cables."""
        vivid.unplug()

    def mend(self) -> None:
        """Put them back and wait until the driver has noticed: how long it takes is measured elsewhere."""
        vivid.plug()
        wait_until(lambda: not self.device.faults(self._clock.now()), "the driver to open the cameras again")
        self.now = self._clock.now()


MAKERS = {"camera": {"kernel-v4l2": lambda folder: KernelCameraRig()}}
