"""A LED of the kernel's LED class: /sys/class/leds/NAME."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Final

from robot.hal.interfaces import DeviceError
from robot.hal.lamps.lamp import WrittenLamp

_ROOT: Final = Path("/sys/class/leds")


class SysfsLed(WrittenLamp):
    """A `LampDevice` on a LED by its name, or by its folder's path.

    Opening takes the LED from the kernel's trigger (heartbeat, disk, ...) and darkens it. Raises DeviceError
    with the cure if there is no such LED or it may not be written. A LED that vanishes (USB) is a fault; when
    it is back it is taken again. Levels are rounded to the steps it has (`max_brightness`).
    """

    def __init__(self, name_or_path: str, root: str | Path = _ROOT) -> None:
        super().__init__()
        if not name_or_path:
            raise DeviceError(f"no LED is named: {_those_in(Path(root))}")
        self._folder = Path(name_or_path) if "/" in name_or_path else Path(root) / name_or_path
        self._taken = False
        if not self._folder.is_dir():
            raise DeviceError(f"no LED {self._folder}: {_those_in(self._folder.parent)}")
        self._most = self._read_most()
        self._write(0.0, 0.0)

    def _offered(self, level: float) -> float:
        return round(level * self._most) / self._most

    def _write(self, level: float, now: float) -> None:
        try:
            if not self._taken:
                # A trigger would set the brightness again at its next turn. Not every LED has one.
                if (self._folder / "trigger").exists():
                    _put(self._folder / "trigger", "none")
                self._most = self._read_most()
            _put(self._folder / "brightness", str(round(level * self._most)))
        except OSError as error:
            self._taken = False
            raise DeviceError(_words(self._folder, error)) from error
        self._taken = True

    def _read_most(self) -> int:
        path = self._folder / "max_brightness"
        try:
            most = int(path.read_text(encoding="ascii"))
        except (OSError, ValueError) as error:
            raise DeviceError(f"{path} cannot be read: is {self._folder} a LED?") from error
        if most < 1:
            raise DeviceError(f"{path} says {most}: this LED cannot shine")
        return most


def _put(path: Path, text: str) -> None:
    """Write to a file of the kernel; unlike Path.write_text it never makes one."""
    file = os.open(path, os.O_WRONLY | os.O_TRUNC)
    try:
        os.write(file, text.encode("ascii"))
    finally:
        os.close(file)


def _those_in(folder: Path) -> str:
    names = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    return f"there are {', '.join(names)}" if names else f"there is none in {folder}"


def _words(folder: Path, error: OSError) -> str:
    if error.errno in (errno.EACCES, errno.EPERM):
        return f"{folder} may not be written: install the udev rule of deploy/ (or chmod g+w its brightness)"
    if error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return f"{folder} is gone: plug the LED in again"
    return f"{folder} cannot be written: {error.strerror or error}"
