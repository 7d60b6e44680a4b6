"""Rigs of the head inside a camera, by HTTP and by a fake device node, and on the table."""

from __future__ import annotations

import errno
import os
import struct
from math import radians

from rig import Make, RealRig, Rig
from webcam_far_end import PAN, TILT, FakeStreamer, control

from robot.config import Head
from robot.hal.interfaces import PanTilt
from robot.hal.mock.head import HeadLimits
from robot.hal.uvc_head import UvcHead, open_uvc_head
from robot.hal.webcam.controls_v4l2 import V4l2Controls
from robot.messages import HeadPose

_RANGES = {PAN: (-360000, 360000), TILT: (-324000, 324000)}


class HttpHeadRig(Rig[PanTilt]):
    """A head behind mjpg-streamer, which repeats what was set."""

    def __init__(self) -> None:
        self.server = FakeStreamer([control(n, "axis", *ends) for n, ends in _RANGES.items()])
        super().__init__(open_uvc_head(self.server.base, HeadLimits(), 200.0, HeadPose()))

    def break_down(self) -> None:
        """Stop the server."""
        self.server.down()

    def mend(self) -> None:
        """Start it again."""
        self.server.up()


class PanTiltNode:
    """A device node whose pan and tilt controls tell where the head is: it turns 200 degrees a second."""

    def __init__(self) -> None:
        self.goal = dict.fromkeys(_RANGES, 0)
        self.at = dict(self.goal)
        self.gone = False

    def ioctl(self, request: int, argument: bytearray) -> None:
        """Queries, gets and sets as the kernel does."""
        if self.gone:
            raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
        number = struct.unpack_from("<I", argument)[0]
        if number not in _RANGES:
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        if request == 0xC0445624:  # VIDIOC_QUERYCTRL
            struct.pack_into("<II32s5i", argument, 0, number, 1, b"axis", *_RANGES[number], 1, 0, 0)
        elif request == 0xC008561B:  # VIDIOC_G_CTRL
            struct.pack_into("<Ii", argument, 0, number, self.at[number])
        else:
            self.goal[number] = struct.unpack("<Ii", argument)[1]

    def wait_for_picture(self, timeout: float) -> bool:
        """Nobody streams here."""
        return False

    def close(self) -> None:
        """Nothing to release."""

    def turn(self, seconds: float) -> None:
        """Let the motors run."""
        most = round(200 * 3600 * seconds)
        for number, goal in self.goal.items():
            self.at[number] += max(-most, min(most, goal - self.at[number]))


class NodeHeadRig(Rig[PanTilt]):
    """A head on USB."""

    def __init__(self) -> None:
        self.node = PanTiltNode()

        def reach() -> V4l2Controls:
            return V4l2Controls("/dev/video0", lambda path: self.node)

        super().__init__(UvcHead(reach(), HeadLimits(), radians(200.0), reach))

    def wait(self, seconds: float) -> None:
        """The head turns meanwhile."""
        super().wait(seconds)
        self.node.turn(seconds)

    def break_down(self) -> None:
        """Pull the cable."""
        self.node.gone = True

    def mend(self) -> None:
        """Put it back."""
        self.node.gone = False


def real(address: str) -> Make | None:
    """A head on the table: /dev/v4l/by-path/... or http://HOST:PORT; None for other addresses."""
    if not address.startswith(("/dev/v", "http:")):
        return None
    return lambda folder: RealRig(open_uvc_head(address, HeadLimits(), Head().slew_deg_s, HeadPose()))


MAKERS = {"head": {"uvc-http": lambda folder: HttpHeadRig(), "uvc": lambda folder: NodeHeadRig()}}
REAL = {"head": real}
