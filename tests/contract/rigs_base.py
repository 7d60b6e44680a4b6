"""Rigs of the drive base."""

from __future__ import annotations

import numpy as np
from rig import Make, MockRig, RealRig, Rig

from robot.config import Base
from robot.hal.factory import nxt_settings, open_base
from robot.hal.interfaces import DriveBase
from robot.hal.links import MemoryLink
from robot.hal.mock import MockBase
from robot.hal.nxt.base import NxtBase
from robot.hal.nxt.brick import Brick
from robot.hal.nxt.settings import BLUETOOTH, USB, NxtSettings
from robot.hal.unplugged import NoBase
from robot.sim.brick_emulator import BrickEmulator
from robot.sim.motor import FreeMotor


class NxtRig(Rig[DriveBase]):
    """The NXT driver before the emulated brick."""

    def __init__(self, settings: NxtSettings, seed: int = 3) -> None:
        rng = np.random.default_rng(seed)
        motors = [None, FreeMotor(rng, load_inertia=0.0005), FreeMotor(rng, load_inertia=0.0005)]
        self.brick = BrickEmulator(motors, rng)
        self.motors = motors[1:]
        super().__init__(NxtBase(Brick(MemoryLink(self.brick.handle)), settings))

    def wait(self, seconds: float) -> None:
        """The brick lives on while the host is silent."""
        super().wait(seconds)
        self.brick.advance(seconds)

    def break_down(self) -> None:
        """Pull the cable."""
        self.brick.cut_link()

    def mend(self) -> None:
        """Put it back."""
        self.brick.restore_link()


def _nxt(transport: NxtSettings) -> Make:
    return lambda folder: NxtRig(nxt_settings(Base(), transport))


def real(address: str) -> Make:
    """A base on the table: `usb`, `usb:SERIAL` or a serial port."""
    if address.split(":")[0] == "usb":
        config = Base(driver="nxt-usb", brick=address.partition(":")[2])
    else:
        config = Base(driver="nxt-serial", port=address)
    return lambda folder: RealRig(open_base(config))


MAKERS = {
    "base": {
        "mock": lambda folder: MockRig(MockBase(), ("send", "stop", "read")),
        "nxt-usb": _nxt(USB),
        "nxt-bluetooth": _nxt(BLUETOOTH),
        "none": lambda folder: Rig(NoBase()),
    }
}
REAL = {"base": real}
