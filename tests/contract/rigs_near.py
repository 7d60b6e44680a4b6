"""Rigs of bumper and sonar."""

from __future__ import annotations

import numpy as np
from rig import Make, RealRig, Rig

from robot.hal.interfaces import NearSensors
from robot.hal.links import MemoryLink
from robot.hal.nxt.brick import Brick
from robot.hal.nxt.near import NxtNear
from robot.hal.nxt.settings import BLUETOOTH_NEAR, USB_NEAR, NearSettings
from robot.sim.brick_emulator import BrickEmulator
from robot.sim.brick_inputs import TouchSensor, UltrasonicSensor


class NxtNearRig(Rig[NearSensors]):
    """The NXT's sensors before the emulated brick: touch on inputs 1 and 2, sonar on 4."""

    def __init__(self, settings: NearSettings) -> None:
        self.touch, self.other_touch = TouchSensor(), TouchSensor()
        self.sonar = UltrasonicSensor(80)
        sensors = {0: self.touch, 1: self.other_touch, 3: self.sonar}
        self.brick = BrickEmulator([None] * 3, np.random.default_rng(3), sensors=sensors)
        super().__init__(NxtNear(Brick(MemoryLink(self.brick.handle)), settings.plugged("12", "4")))

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


def _nxt(settings: NearSettings) -> Make:
    return lambda folder: NxtNearRig(settings)


MAKERS = {"near": {"nxt-usb": _nxt(USB_NEAR), "nxt-bluetooth": _nxt(BLUETOOTH_NEAR)}}


def real(address: str) -> Make | None:
    """Sensors on the table: `usb` or a serial port, touch on input 1 and sonar on input 4."""
    from robot.hal.nxt.serial import SerialLink, open_serial_port
    from robot.hal.nxt.usb import UsbLink, find_brick

    if address == "usb":
        return lambda folder: RealRig(NxtNear(Brick(UsbLink(find_brick), 0.05), USB_NEAR.plugged("1", "4")))
    if address.startswith("/dev/"):
        return lambda folder: RealRig(
            NxtNear(
                Brick(SerialLink(lambda: open_serial_port(address)), 0.15), BLUETOOTH_NEAR.plugged("1", "4")
            )
        )
    return None


REAL = {"near": real}
