"""Rigs of the lamp: a LED's folder, a coil of the emulated controller, a mocked pin."""

from __future__ import annotations

import os
from pathlib import Path

from gpiozero.pins.mock import MockFactory, MockPWMPin
from rig import Make, RealRig, Rig

from robot.hal.interfaces import LampDevice
from robot.hal.lamps import GpioLamp, ModbusLamp, SysfsLed, open_gpio_lamp
from robot.hal.modbus import ModbusLink, open_modbus_link
from robot.sim.arm_controller import ArmController
from robot.sim.arm_registers import ArmRegisters
from robot.sim.modbus_memory import MemoryModbusClient


class SysfsRig(Rig[LampDevice]):
    """A LED as files; unplugged its folder is away."""

    def __init__(self, root: Path) -> None:
        self.led = root / "lamp"
        self.led.mkdir()
        (self.led / "brightness").write_text("0\n")
        (self.led / "max_brightness").write_text("255\n")
        (self.led / "trigger").write_text("none [heartbeat] default-on\n")
        super().__init__(SysfsLed("lamp", root))

    def break_down(self) -> None:
        """Unplug it."""
        os.rename(self.led, self.led.with_name("away"))

    def mend(self) -> None:
        """Plug it in again."""
        os.rename(self.led.with_name("away"), self.led)


class CoilRig(Rig[LampDevice]):
    """A coil of the arm's controller."""

    def __init__(self) -> None:
        self.registers = ArmRegisters(ArmController())
        client = MemoryModbusClient(self.registers)
        super().__init__(ModbusLamp(ModbusLink(client, "the box in memory"), coil=4))

    def break_down(self) -> None:
        """It answers nothing any more."""
        self.registers.silent = True

    def mend(self) -> None:
        """It answers, and the link's back-off is over."""
        self.registers.silent = False
        self.wait(1.0)


class PinRig(Rig[LampDevice]):
    """A mocked pin whose library can fail."""

    def __init__(self) -> None:
        self.factory = MockFactory(pin_class=MockPWMPin)
        self.device: GpioLamp
        super().__init__(open_gpio_lamp("GPIO18", self.factory))
        self._led = self.device._led

    def break_down(self) -> None:
        """Every access fails."""
        self.device._led = _DeadLed()

    def mend(self) -> None:
        """The pin works again."""
        self.device._led = self._led


class _DeadLed:
    @property
    def value(self) -> float:
        raise RuntimeError("the pin is lost")

    @value.setter
    def value(self, level: float) -> None:
        raise RuntimeError("the pin is lost")

    def close(self) -> None:
        """Nothing to release."""


def real(address: str) -> Make:
    """A lamp on the table: `sysfs:NAME`, `gpio:PIN` or `coil:NUMBER@HOST:PORT`."""
    kind, _, rest = address.partition(":")
    coil, _, box = rest.partition("@")
    openers = {
        "sysfs": lambda: SysfsLed(rest),
        "gpio": lambda: open_gpio_lamp(rest),
        "coil": lambda: ModbusLamp(open_modbus_link(box), int(coil)),
    }
    return lambda folder: RealRig(openers[kind]())


MAKERS = {
    "lamp": {
        "sysfs": SysfsRig,
        "modbus": lambda folder: CoilRig(),
        "gpio": lambda folder: PinRig(),
    }
}
REAL = {"lamp": real}
