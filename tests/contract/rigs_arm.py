"""Rigs of the arm: the Modbus driver before its emulated controller, in memory, over TCP, over a pty."""

from __future__ import annotations

import math

from rig import Make, RealRig, Rig

from robot.hal.arm.modbus_arm import ModbusArm
from robot.hal.arm.settings import ModbusArmSettings
from robot.hal.interfaces import Arm
from robot.hal.modbus import ModbusLink, open_modbus_link
from robot.sim.arm_controller import ArmController
from robot.sim.arm_registers import ArmRegisters
from robot.sim.modbus_memory import MemoryModbusClient
from robot.sim.modbus_server import ModbusServer, serve_pty, serve_tcp

TICK_S = 0.04
# The flange looks up here, so that the contract's poses are near.
START = tuple(math.radians(angle) for angle in (0.0, -30.0, 110.0, 0.0, -80.0, 0.0))


class _ArmRig(Rig[Arm]):
    """Time passes for the controller by the test's hand, also over real wires."""

    registers: ArmRegisters

    def settle(self, seconds: float) -> None:
        """Let the driver look for a while."""
        for _ in range(round(seconds / TICK_S)):
            self.wait(TICK_S)
            self.device.read(self.now)

    def break_down(self) -> None:
        """The controller takes everything and answers nothing any more."""
        self.registers.silent = True
        self.settle(0.4)

    def mend(self) -> None:
        """It answers again; the driver finds out."""
        self.registers.silent = False
        self.settle(2.0)


class MemoryArmRig(_ArmRig):
    """Lockstep."""

    def __init__(self, low_first: bool = False) -> None:
        self.controller = ArmController(START)
        self.registers = ArmRegisters(self.controller, low_first)
        self.client = MemoryModbusClient(self.registers)
        settings = ModbusArmSettings(low_first=low_first)
        super().__init__(ModbusArm(ModbusLink(self.client, "the controller in memory"), settings))

    def wait(self, seconds: float) -> None:
        """The controller lives on."""
        super().wait(seconds)
        self.controller.advance(seconds)


class ServedArmRig(_ArmRig):
    """A real server on a real wire."""

    def __init__(self, registers: ArmRegisters, server: ModbusServer) -> None:
        self.registers = registers
        self.server = server
        super().__init__(_Closing(server))

    def wait(self, seconds: float) -> None:
        """The controller lives on."""
        super().wait(seconds)
        if not self.device.is_closed:
            self.server.advance(seconds)


class _Closing(ModbusArm):
    """Takes its server along when the test ends: a closed arm needs none."""

    def __init__(self, server: ModbusServer) -> None:
        self._server = server
        self.is_closed = False
        # Short, because the tests break the wire on purpose and every time-out is really waited for.
        super().__init__(open_modbus_link(server.address, timeout_s=0.1))

    def close(self) -> None:
        super().close()
        self.is_closed = True
        self._server.close()


def _tcp() -> Rig[Arm]:
    registers = ArmRegisters(ArmController(START))
    return ServedArmRig(registers, serve_tcp(registers))


def _rtu() -> Rig[Arm]:
    registers = ArmRegisters(ArmController(START))
    return ServedArmRig(registers, serve_pty(registers))


def real(address: str) -> Make:
    """An arm on the table: HOST:PORT or a serial port. Clear its surroundings first: it will move."""
    return lambda folder: RealRig(ModbusArm(open_modbus_link(address)))


MAKERS = {
    "arm": {
        "modbus-memory": lambda folder: MemoryArmRig(),
        "modbus-low-first": lambda folder: MemoryArmRig(low_first=True),
        "modbus-tcp": lambda folder: _tcp(),
        "modbus-rtu": lambda folder: _rtu(),
    }
}
REAL = {"arm": real}
