"""The arm's driver under fuzz: a controller whose registers hold anything."""

from __future__ import annotations

import math
import random
import struct
from types import SimpleNamespace
from typing import Any, Final

from bench.fuzz_harness import InvalidMotionError
from bench.fuzz_mutation import Source
from robot.hal.arm.modbus_arm import ModbusArm
from robot.hal.modbus import ModbusLink
from robot.hal.modbus_client import Client

_COMMAND_AT: Final = 16
_SHARE_OF_ERRORS: Final = 5


class ArmRegisters:
    """`ModbusArm.read` over a controller whose registers hold anything; the input is what it tells.

    16-bit words, big-endian, again and again from the first: 34 input registers, 4 holding registers, a word
    of discrete inputs, for as many polls as it lasts. Now and then an exception or a wrong count. Nobody asks
    for a motion, so none may be commanded, and the drives may not be switched on.
    """

    name = "arm"
    documented: tuple[type[Exception], ...] = ()

    def __init__(self) -> None:
        status = struct.pack(">10H", 0x4152, 1, 1, 1, 0, 0, 7, 3, 3, 1)
        joints = struct.pack(">24H", 0, 30000, 0xFFFF, 0x8AD0, 1, 0xADB0, *range(18))
        tail = struct.pack(">4HH", 7, 0x5242, 100, 300, 0x11)
        bad = (
            struct.pack(">10H", 0x4152, 1, state, 1, error, 0, 7, 3, 9, result)
            for state, error, result in ((3, 4, 5), (4, 0, 3), (5, 2, 17), (99, 999, 9999), (2, 0, 0))
        )
        others = [block + joints + struct.pack(">4HH", 9, 41, 0, 100, 0x7F) for block in bad]
        good = status + joints + tail
        self._source = Source([good, good * 2, *others, good + others[0], others[4] + good], longest=4000)

    def draw(self, rng: random.Random) -> bytes:
        """What the registers hold."""
        return self._source.draw(rng)

    def take(self, data: bytes) -> bool:
        """Open on good registers, then read as long as there is something new."""
        controller = _AnyRegisters()
        arm = ModbusArm(ModbusLink(_as_client(controller), "the fuzzed one"))
        controller.commands.clear()
        controller.words = struct.unpack(f">{len(data) // 2}H", data[: len(data) // 2 * 2])
        accepted = False
        for poll in range(1, 3 + len(data) // 160):
            now = 0.1 * poll
            state = arm.read(now)
            numbers = (*state.joints, *state.position, *state.orientation)
            assert len(numbers) == 12, "not six joints and a pose"
            assert all(map(math.isfinite, numbers)), "no finite state"
            faults = arm.faults(now)
            accepted = accepted or not faults
            assert all("\n" not in fault.evidence for fault in faults), "evidence of more than one line"
            arm.progress(1)
        if any(controller.commands):
            raise InvalidMotionError(f"writes {controller.commands[0]} though nobody asked for a motion")
        return accepted


class _AnyRegisters:
    """A pymodbus client, as far as the link uses it, that answers from a list of words."""

    def __init__(self) -> None:
        self.words: tuple[int, ...] = ()
        self.commands: list[str] = []
        self._at = 0

    def connect(self) -> bool:
        return True

    def close(self) -> None:
        """Nothing is held."""

    def read_coils(self, address: int, *, count: int, device_id: int) -> Any:
        return self._bits(1, count)

    def read_discrete_inputs(self, address: int, *, count: int, device_id: int) -> Any:
        return self._bits(2, count)

    def read_holding_registers(self, address: int, *, count: int, device_id: int) -> Any:
        return self._registers(3, count, (7, 0, 100, 300))

    def read_input_registers(self, address: int, *, count: int, device_id: int) -> Any:
        return self._registers(4, count, (0x4152, 1, 1, 1, 0, 0, self._at, 0, 0, 0))

    def write_coils(self, address: int, values: Any, *, device_id: int) -> Any:
        if address == 0 and values[0]:
            self.commands.append("the drives' coil")
        return self._reply(15, [], [])

    def write_registers(self, address: int, values: Any, *, device_id: int) -> Any:
        if address + len(values) > _COMMAND_AT:
            self.commands.append("a motion command")
        return self._reply(16, [], [])

    def _next(self, count: int) -> list[int]:
        words = self.words
        taken = [words[(self._at + number) % len(words)] for number in range(count)]
        self._at += count
        return taken

    def _registers(self, function: int, count: int, start: tuple[int, ...]) -> Any:
        if not self.words:
            return self._reply(function, [*start, *[0] * count][:count], [])
        taken = self._next(count)
        wrong_count = taken[-1] % 31 == 7
        return self._reply(function, taken[:-1] if wrong_count else taken, [])

    def _bits(self, function: int, count: int) -> Any:
        (word,) = self._next(1) if self.words else (0,)
        return self._reply(function, [], [bool(word >> bit & 1) for bit in range((count + 7) // 8 * 8)])

    def _reply(self, function: int, registers: list[int], bits: list[bool]) -> Any:
        last = self.words[self._at % len(self.words)] if self.words else 1
        if last % 64 == _SHARE_OF_ERRORS:
            raise ConnectionError("the line broke")
        refused = last % 64 == _SHARE_OF_ERRORS + 1
        return SimpleNamespace(
            function_code=function | (0x80 if refused else 0),
            exception_code=last % 13,
            registers=registers,
            bits=bits,
            isError=lambda: refused,
        )


def _as_client(registers: _AnyRegisters) -> Client:
    return registers
