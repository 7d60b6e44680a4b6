"""Rigs of a head that only pans: a motor on the brick, geared down three times, the tilt fixed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rig import Make, Rig

from robot.hal.interfaces import PanTilt
from robot.hal.links import MemoryLink
from robot.hal.nxt.brick import Brick
from robot.hal.nxt.pan import NxtPan
from robot.hal.nxt.settings import BLUETOOTH_PAN, USB_PAN, PanSettings
from robot.sim.brick_emulator import BrickEmulator
from robot.sim.motor import FreeMotor


class NxtPanRig(Rig[PanTilt]):
    """The pan motor before the emulated brick."""

    def __init__(self, settings: PanSettings) -> None:
        rng = np.random.default_rng(3)
        self.motor = FreeMotor(rng, load_inertia=0.0003, load_torque=0.01)
        self.brick = BrickEmulator([None, None, self.motor], rng)
        super().__init__(NxtPan(Brick(MemoryLink(self.brick.handle)), replace(settings, gear=3.0)))

    def wait(self, seconds: float) -> None:
        """The brick lives on."""
        super().wait(seconds)
        self.brick.advance(seconds)

    def break_down(self) -> None:
        """Pull the cable."""
        self.brick.cut_link()

    def mend(self) -> None:
        """Put it back."""
        self.brick.restore_link()


def _nxt(settings: PanSettings) -> Make:
    return lambda folder: NxtPanRig(settings)


MAKERS = {"pan": {"nxt-pan-usb": _nxt(USB_PAN), "nxt-pan-bluetooth": _nxt(BLUETOOTH_PAN)}}
