"""A camera's controls through its device node, beside whoever streams from it."""

from __future__ import annotations

import errno
import struct
from collections.abc import Callable
from typing import Final

from robot.hal.interfaces import DeviceError
from robot.hal.webcam.controls import ControlInfo
from robot.hal.webcam.node import (
    VIDIOC_G_CTRL,
    VIDIOC_QUERYCTRL,
    VIDIOC_S_CTRL,
    DeviceNode,
    Node,
    words,
)

# struct v4l2_queryctrl: id, type, name, minimum, maximum, step, default_value, flags, reserved
_QUERYCTRL: Final = struct.Struct("<II32siiiiIII")
_CONTROL: Final = struct.Struct("<Ii")  # struct v4l2_control: id, value
_DISABLED: Final = 0x0001


class V4l2Controls:
    """`Controls` on a V4L2 path. Raises DeviceError with the cure if it cannot be opened.

    Each call is one ioctl. The kernel itself bounds it: a control transfer to a USB camera that hangs ends
    after 0.5 s to 5 s (depending on its version), so call it where that may be borne.
    """

    def __init__(self, path: str, open_node: Callable[[str], Node] = DeviceNode) -> None:
        self._path = path
        self._node = open_node(path)

    def info(self, control: int) -> ControlInfo | None:
        """What the control takes, None if the camera has none such."""
        argument = bytearray(_QUERYCTRL.pack(control, 0, b"", 0, 0, 0, 0, 0, 0, 0))
        try:
            self._node.ioctl(VIDIOC_QUERYCTRL, argument)
        except OSError as error:
            if error.errno in (errno.EINVAL, errno.ENOTTY):
                return None
            raise DeviceError(f"camera {self._path}: {words(error)}") from error
        _, _, name, minimum, maximum, step, default, flags, _, _ = _QUERYCTRL.unpack(argument)
        if flags & _DISABLED:
            return None
        text = name.split(b"\0")[0].decode("utf-8", "replace")
        return ControlInfo(text, minimum, maximum, step, default)

    def read(self, *controls: int) -> dict[int, int]:
        """Their values."""
        return {control: self._exchange(VIDIOC_G_CTRL, control, 0) for control in controls}

    def write(self, control: int, value: int) -> None:
        """Set a control."""
        self._exchange(VIDIOC_S_CTRL, control, value)

    def close(self) -> None:
        """Release the node."""
        self._node.close()

    def _exchange(self, request: int, control: int, value: int) -> int:
        argument = bytearray(_CONTROL.pack(control, value))
        try:
            self._node.ioctl(request, argument)
        except OSError as error:
            raise DeviceError(f"camera {self._path}, control {control:#010x}: {words(error)}") from error
        return int(_CONTROL.unpack(argument)[1])
