"""A video device node and the few kernel calls (ioctls) on it that OpenCV does not offer.

Numbers and layouts are those of <linux/videodev2.h>, the same on all 64-bit Linux systems. Every open file
of a node may ask and set controls while another one streams.
"""

from __future__ import annotations

import errno
import fcntl
import os
import select
import struct
from typing import Final, Protocol

from robot.hal.interfaces import DeviceError

VIDIOC_QUERYCAP: Final = 0x80685600
VIDIOC_REQBUFS: Final = 0xC0145608
VIDIOC_G_CTRL: Final = 0xC008561B
VIDIOC_S_CTRL: Final = 0xC008561C
VIDIOC_QUERYCTRL: Final = 0xC0445624

_CAPABILITY_BYTES: Final = 104
_CAPABILITIES_OFFSET: Final = 84  # capabilities, device_caps: u32 each
_HAS_DEVICE_CAPS: Final = 0x80000000
_VIDEO_CAPTURE: Final = 0x00000001
_VIDEO_CAPTURE_MPLANE: Final = 0x00001000
_BUF_TYPE_VIDEO_CAPTURE: Final = 1
_MEMORY_MMAP: Final = 1


class Node(Protocol):
    """An open device node."""

    def ioctl(self, request: int, argument: bytearray) -> None:
        """One kernel call; the answer is written into `argument`. Raises OSError with its errno."""
        ...

    def wait_for_picture(self, timeout: float) -> bool:
        """Wait until a picture can be taken out of a running stream, at most `timeout` seconds.

        Raises OSError if the stream broke or the camera is gone.
        """
        ...

    def close(self) -> None:
        """Release it. May be called twice."""
        ...


class DeviceNode:
    """`Node` on a path, e.g. /dev/v4l/by-path/pci-0000:00:14.0-usb-0:1:1.0-video-index0.

    Raises DeviceError with the cure if it cannot be opened.
    """

    def __init__(self, path: str) -> None:
        try:
            self._file = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            raise DeviceError(f"camera {path}: {words(error)}") from error

    def ioctl(self, request: int, argument: bytearray) -> None:
        """One kernel call. Raises OSError."""
        if self._file < 0:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        fcntl.ioctl(self._file, request, argument, True)

    def wait_for_picture(self, timeout: float) -> bool:
        """Wait for a picture of the device's stream, whichever file of the device it was started on."""
        poll = select.poll()
        poll.register(self._file, select.POLLIN)
        events = dict(poll.poll(round(max(0.0, timeout) * 1000))).get(self._file, 0)
        if events & (select.POLLERR | select.POLLHUP | select.POLLNVAL):
            raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
        return bool(events & select.POLLIN)

    def close(self) -> None:
        """Release it."""
        file, self._file = self._file, -1
        if file >= 0:
            os.close(file)


def check_capture(node: Node, path: str) -> None:
    """Raise DeviceError with the cure unless the node delivers pictures and nobody else takes them."""
    answer = bytearray(_CAPABILITY_BYTES)
    try:
        node.ioctl(VIDIOC_QUERYCAP, answer)
    except OSError as error:
        if error.errno in (errno.ENOTTY, errno.EINVAL):
            raise DeviceError(f"{path} is no camera: name a node of /dev/v4l/by-path") from error
        raise DeviceError(f"camera {path}: {words(error)}") from error
    capabilities, device_caps = struct.unpack_from("<II", answer, _CAPABILITIES_OFFSET)
    able = device_caps if capabilities & _HAS_DEVICE_CAPS else capabilities
    if not able & (_VIDEO_CAPTURE | _VIDEO_CAPTURE_MPLANE):
        raise DeviceError(f"{path} delivers no pictures: name the camera's node that ends in index0")
    try:
        # Asking for no buffers does nothing, but is refused while another program holds some.
        node.ioctl(
            VIDIOC_REQBUFS, bytearray(struct.pack("<5I", 0, _BUF_TYPE_VIDEO_CAPTURE, _MEMORY_MMAP, 0, 0))
        )
    except OSError as error:
        if error.errno == errno.EBUSY:
            raise DeviceError(f"camera {path}: {words(error)}") from error


def words(error: OSError) -> str:
    """What went wrong with a camera's node, and the cure."""
    if error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return "it is not there: check its cable; `ls /dev/v4l/by-path` names those that are"
    if error.errno in (errno.EACCES, errno.EPERM):
        return "no permission: add the user to the group video and log in again"
    if error.errno == errno.EBUSY:
        return "another program uses it: close that one (`fuser -v /dev/video*` names it)"
    if error.errno == errno.ENOSPC:
        return NO_ROOM
    return error.strerror or str(error)


NO_ROOM: Final = (
    "the USB bus has no room for its pictures: set cameras.pixel_format = 'MJPG', fewer cameras.rate_hz, "
    "or plug each camera into a controller of its own"
)
