"""The arm controller's registers: an own reading of the map, sharing nothing with the driver's."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

from robot.sim.arm_controller import ArmController, JointGoal, LineGoal, MoveCommand, Result

ILLEGAL_FUNCTION: Final = 1
ILLEGAL_ADDRESS: Final = 2
ILLEGAL_VALUE: Final = 3
DEVICE_FAILURE: Final = 4
COILS: Final = 8
DISCRETES: Final = 7
HOLDINGS: Final = 32
INPUTS: Final = 40
_WATCHDOG_MS: Final = range(50, 2001)
_Write = Callable[[int, Sequence[int]], int]


class ArmRegisters:
    """What a Modbus master reads and writes of a controller.

    low_first: order of the words of 32-bit values. `storm`: every request is answered by exception 4;
    `silent`: none is answered (both heeded by the servers). While the controller is frozen reads give the
    values of before and writes are taken and forgotten.

    >>> registers = ArmRegisters(ArmController())
    >>> hex(registers.read(4, 0, 1)[0])
    '0x4152'
    """

    def __init__(self, controller: ArmController, low_first: bool = False) -> None:
        self.controller = controller
        self.storm = False
        self.silent = False
        self._low_first = low_first
        self._coils = [False] * COILS
        self._command = [0] * 16
        self._beat = 0
        self._last = self._tables()

    @property
    def leds(self) -> tuple[bool, ...]:
        """The four LEDs on coils 4-7."""
        return tuple(self._coils[4:])

    def read(self, function: int, address: int, count: int) -> list[int]:
        """Registers or bits (0, 1) of function 1, 2, 3 or 4. Raises IndexError beyond the map."""
        if not self.controller.frozen:
            self._last = self._tables()
        table = self._last[function]
        if address < 0 or count < 1 or address + count > len(table):
            raise IndexError(f"function {function} has no {address} to {address + count - 1}")
        return table[address : address + count]

    def write(self, function: int, address: int, values: Sequence[int]) -> int:
        """Function 15 or 16; returns 0 or the number of the Modbus exception."""
        if function == 15 and address >= 0 and 0 < len(values) <= COILS - address:
            return self._obey(self._write_coils, address, values)
        if function == 16 and address >= 0 and 0 < len(values) <= 4 - address:
            return self._obey(self._write_control, address, values)
        if function == 16 and address == 16 and len(values) == 16:
            return self._obey(self._write_command, address, values)
        return ILLEGAL_ADDRESS if function in (15, 16) else ILLEGAL_FUNCTION

    def _obey(self, write: _Write, address: int, values: Sequence[int]) -> int:
        return 0 if self.controller.frozen else write(address, values)

    def _write_coils(self, address: int, values: Sequence[int]) -> int:
        arm = self.controller
        told = {coil: bool(value) for coil, value in enumerate(values, address)}
        for coil, value in told.items():
            self._coils[coil] = value
        if told.get(2):
            arm.reset()
        if told.get(1):
            arm.stop()
        if told.get(0) is True:
            arm.enable()
        elif told.get(0) is False:
            arm.disable()
        arm.grip = self._coils[3]
        return 0

    def _write_control(self, address: int, values: Sequence[int]) -> int:
        arm = self.controller
        control = self._control()
        control[address : address + len(values)] = values
        beat, owner, percent, watchdog_ms = control
        if percent > 100 or watchdog_ms not in _WATCHDOG_MS:
            return ILLEGAL_VALUE
        if arm.owner != 0 and owner not in (0, arm.owner):
            return ILLEGAL_VALUE
        if beat != self._beat:
            arm.beat()
        self._beat = beat
        arm.owner, arm.limit, arm.watchdog_s = owner, percent / 100.0, watchdog_ms / 1000.0
        return 0

    def _write_command(self, address: int, values: Sequence[int]) -> int:
        self._command = list(values)
        opcode, speed, number = values[0], values[1], values[15]
        if opcode not in (1, 2):
            self.controller.refuse(number, Result.UNKNOWN_OPCODE)
        elif not 1 <= speed <= 100:
            self.controller.refuse(number, Result.BAD_SPEED)
        else:
            targets = [self._long(values[at], values[at + 1]) for at in range(3, 15, 2)]
            goal = _joint_goal(targets) if opcode == 1 else _line_goal(targets)
            self.controller.move(MoveCommand(number, goal, speed / 100.0))
        return 0

    def _tables(self) -> dict[int, list[int]]:
        arm = self.controller
        coils = [arm.powered, arm.stopping, False, *self._coils[3:]]
        discretes = [
            arm.powered,
            arm.emergency_stop,
            arm.protective_stop,
            arm.moving,
            arm.in_position,
            arm.error != 0,
            arm.gripper_closed,
        ]
        holdings = [*self._control(), *([0] * 12), *self._command]
        return {1: [int(c) for c in coils], 2: [int(d) for d in discretes], 3: holdings, 4: self._inputs()}

    def _control(self) -> list[int]:
        arm = self.controller
        return [self._beat, arm.owner, round(arm.limit * 100.0), round(arm.watchdog_s * 1000.0)]

    def _inputs(self) -> list[int]:
        arm = self.controller
        warning = 1 if arm.heart_stopped else 0
        head = [0x4152, 1, _state(arm), int(arm.remote), arm.error, warning, self._beat]
        flange = arm.flange
        longs = [
            *(math.degrees(angle) * 1000.0 for angle in arm.joints),
            *(float(x) * 100_000.0 for x in flange.position),
            *(math.degrees(angle) * 1000.0 for angle in flange.angles),
        ]
        words = [word for value in longs for word in self._words(round(value))]
        # Signed tenths of a degree a second.
        speeds = [round(math.degrees(speed) * 10.0) & 0xFFFF for speed in arm.speeds]
        return [*head, arm.begun, arm.ended, int(arm.result), *words, *speeds]

    def _words(self, value: int) -> tuple[int, int]:
        high, low = (value >> 16) & 0xFFFF, value & 0xFFFF
        return (low, high) if self._low_first else (high, low)

    def _long(self, first: int, second: int) -> int:
        high, low = (second, first) if self._low_first else (first, second)
        value = high << 16 | low
        return value - 2**32 if value >= 2**31 else value


def _state(arm: ArmController) -> int:
    """Off, enabled, moving, fault, e-stop, protective stop: 0 to 5."""
    if arm.error:
        return 3
    if arm.emergency_stop:
        return 4
    if arm.protective_stop:
        return 5
    if not arm.powered:
        return 0
    return 2 if arm.moving else 1


def _joint_goal(targets: Sequence[int]) -> JointGoal:
    return JointGoal(tuple(math.radians(target / 1000.0) for target in targets))


def _line_goal(targets: Sequence[int]) -> LineGoal:
    x, y, z = (target / 100_000.0 for target in targets[:3])
    rx, ry, rz = (math.radians(target / 1000.0) for target in targets[3:])
    return LineGoal((x, y, z), (rx, ry, rz))
