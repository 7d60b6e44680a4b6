"""The adjusting screws of a camera by their V4L2 numbers, however they are reached."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol


class Cid(IntEnum):
    """Control numbers of <linux/v4l2-controls.h>; units as the kernel defines them."""

    AUTO_WHITE_BALANCE = 0x0098090C  # 0, 1
    AUTOGAIN = 0x00980912  # 0, 1
    GAIN = 0x00980913
    POWER_LINE_FREQUENCY = 0x00980918  # 0 off, 1 50 Hz, 2 60 Hz, 3 auto
    WHITE_BALANCE_TEMPERATURE = 0x0098091A  # kelvin
    EXPOSURE_AUTO = 0x009A0901  # 0 auto, 1 manual, 2 shutter priority, 3 aperture priority
    EXPOSURE_ABSOLUTE = 0x009A0902  # 100 us
    EXPOSURE_AUTO_PRIORITY = 0x009A0903  # 1: the rate may drop for longer exposure
    PAN_ABSOLUTE = 0x009A0908  # arc-seconds, positive to the right
    TILT_ABSOLUTE = 0x009A0909  # arc-seconds, positive up
    FOCUS_ABSOLUTE = 0x009A090A
    FOCUS_AUTO = 0x009A090C  # 0, 1
    ZOOM_ABSOLUTE = 0x009A090D


@dataclass(frozen=True, slots=True)
class ControlInfo:
    """A control a camera has: its name and the values it takes."""

    name: str
    minimum: int
    maximum: int
    step: int = 1
    default: int = 0

    def fitted(self, value: float) -> int:
        """The nearest value the control takes.

        >>> ControlInfo("Pan", -36000, 36000, step=3600).fitted(5000)
        3600
        """
        step = max(1, self.step)
        inside = min(max(value, self.minimum), self.maximum)
        steps = round((inside - self.minimum) / step)
        return min(self.minimum + steps * step, self.minimum + (self.maximum - self.minimum) // step * step)


class Controls(Protocol):
    """The controls of one camera. Every method raises DeviceError if the camera does not answer."""

    def info(self, control: int) -> ControlInfo | None:
        """What the control takes, None if the camera has none such."""
        ...

    def read(self, *controls: int) -> Mapping[int, int]:
        """Values of these controls, in one exchange where that is possible."""
        ...

    def write(self, control: int, value: int) -> None:
        """Set a control."""
        ...

    def close(self) -> None:
        """Release the camera. May be called twice."""
        ...
