"""Where single pictures come from, and when they were taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from robot.hal.interfaces import DeviceError
from robot.messages import Image


@dataclass(frozen=True, slots=True, eq=False)
class TimedImage:
    """A BGR uint8 picture (H, W, 3) and when it was captured, in seconds of the run's clock."""

    image: Image
    at: float

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.image.shape[1], self.image.shape[0]


class EndOfPicturesError(DeviceError):
    """The source has shown all it has; opening it again would give nothing more."""


class Source(Protocol):
    """One eye. One thread at a time calls its methods; after a `DeviceError` it is closed and opened anew."""

    @property
    def name(self) -> str:
        """What a person knows it by: path or address."""
        ...

    def open(self) -> None:
        """Begin to deliver. Raises DeviceError with the cure."""
        ...

    def grab(self, timeout: float) -> TimedImage | None:
        """The next picture, or None if none came within `timeout` seconds. Raises DeviceError when broken.

        Raises EndOfPicturesError after the last picture.
        """
        ...

    def close(self) -> None:
        """Release the device. May be called twice."""
        ...
