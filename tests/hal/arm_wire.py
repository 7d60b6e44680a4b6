"""The arm's driver before its emulated controller, on a wire that is listened to and loses telegrams."""

from __future__ import annotations

import math
from collections.abc import Callable

from robot.hal.arm.modbus_arm import ModbusArm
from robot.hal.arm.settings import ModbusArmSettings
from robot.hal.interfaces import ArmState
from robot.hal.modbus import ModbusLink
from robot.sim.arm_controller import ArmController
from robot.sim.arm_registers import ArmRegisters
from robot.sim.modbus_memory import MemoryModbusClient

START = tuple(math.radians(angle) for angle in (0.0, -30.0, 110.0, 0.0, -80.0, 0.0))
READY = (0.1, -0.2, 0.3, 0.0, 0.4, 0.0)
TICK_S = 0.04


class TappedClient(MemoryModbusClient):
    """Keeps every request's PDU; loses the answer to those that `loses(pdu)` picks (the far end obeys)."""

    def __init__(self, registers: ArmRegisters) -> None:
        super().__init__(registers)
        self.requests: list[bytes] = []
        self.loses: Callable[[bytes], bool] = lambda pdu: False

    def send(self, request: bytes, addr: tuple[str, int] | None = None) -> int:
        self.requests.append(request[7:])
        sent = super().send(request, addr)
        if self.loses(request[7:]):
            self._replies.clear()
        return sent


class ArmWire:
    """Driver, wire and controller with one time."""

    def __init__(self, settings: ModbusArmSettings | None = None, open_now: bool = True) -> None:
        self.settings = settings or ModbusArmSettings()
        self.controller = ArmController(START)
        self.registers = ArmRegisters(self.controller, self.settings.low_first)
        self.client = TappedClient(self.registers)
        self.now = 0.0
        if open_now:
            self.arm = self.open()

    def open(self) -> ModbusArm:
        """One more driver on a link of its own."""
        return ModbusArm(ModbusLink(self.client, "the controller"), self.settings)

    def wait(self, seconds: float) -> None:
        """Nobody says a word."""
        self.now = round(self.now + seconds, 6)
        self.controller.advance(seconds)

    def run(self, seconds: float) -> ArmState:
        """Time passes while the driver reads each tick."""
        state = self.arm.read(self.now)
        for _ in range(round(seconds / TICK_S)):
            self.wait(TICK_S)
            state = self.arm.read(self.now)
        return state

    def ready(self) -> None:
        """Drives on."""
        self.arm.enable(self.now)
        self.arm.read(self.now)

    @property
    def faults(self) -> set[str]:
        """Keys of the open faults."""
        return {fault.key for fault in self.arm.faults(self.now)}

    @property
    def evidence(self) -> str:
        """Words of the open faults."""
        return "; ".join(fault.evidence for fault in self.arm.faults(self.now))


def is_command(pdu: bytes) -> bool:
    """A motion command: function 16 on register 16."""
    return pdu[:3] == bytes([16, 0, 16])
