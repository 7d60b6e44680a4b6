"""Rig of the serial teleop link: the driver on one end of a pseudo-terminal, the person on the other."""

from __future__ import annotations

import os
import pty
import select
import tty
from contextlib import suppress
from pathlib import Path

from rig import Make, RealRig, Rig

from robot.hal.interfaces import TeleopLink
from robot.hal.teleop.port import open_port
from robot.hal.teleop.serial import SerialTeleop


class PtyRig(Rig[TeleopLink]):
    """A person who says take at the beginning; the cable is a link that leads to the pseudo-terminal."""

    def __init__(self, folder: Path) -> None:
        self._cable = folder / "cable"
        self._plug_in()
        super().__init__(SerialTeleop(lambda: open_port(str(self._cable))))
        self.say(b"t")

    def say(self, data: bytes) -> None:
        """Type, and wait until the kernel has carried it over."""
        os.write(self._far, data)
        if not select.select([self._near], [], [], 5.0)[0]:
            raise TimeoutError("the pseudo-terminal carries nothing over")

    def heard(self) -> bytes:
        """What the robot said, empty if nothing."""
        with suppress(BlockingIOError):
            return os.read(self._far, 65536)
        return b""

    def break_down(self) -> None:
        """Pull the cable: the line hangs up and its name is gone."""
        os.close(self._far)
        os.close(self._near)
        self._cable.unlink()

    def mend(self) -> None:
        """Plug it in again; the person speaks as soon as the driver has found it."""
        self._plug_in()
        for _ in range(200):
            self.wait(0.04)
            self.device.latest(self.now)
            if not self.device.faults(self.now):
                break
        self.say(b"t")
        self.wait(0.04)

    def _plug_in(self) -> None:
        self._far, self._near = pty.openpty()
        tty.setraw(self._far)
        tty.setraw(self._near)
        os.set_blocking(self._far, False)
        self._cable.symlink_to(os.ttyname(self._near))


def real(address: str) -> Make:
    """A line with a person at its other end: a serial port."""
    return lambda folder: RealRig(SerialTeleop(lambda: open_port(address)))


MAKERS = {"teleop": {"serial": PtyRig}}
REAL = {"teleop": real}
