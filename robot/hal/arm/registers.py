"""The register map of the arm's controller as the driver reads it: numbers to registers and back. Pure.

| table | address | what |
|---|---|---|
| input | 0-9 | magic 0x4152, map version 1, state, mode (1: remote), error, warning, heartbeat echo, last command begun, last command ended, how that one ended |
| input | 10-21, 22-33 | six joints; position (x, y, z), orientation (rx, ry, rz): 32 bits each |
| holding | 0-3 | heartbeat, owner token, speed limit in %, watchdog in ms |
| holding | 16-31 | opcode, speed in %, reserved 0, six targets of 32 bits, command number: one write of 16 registers |
| coil | 0-7 | enable, stop, fault reset, gripper closed, four LEDs |
| discrete | 0-6 | powered, e-stop, protective stop, moving, in position, fault, gripper closed |

Angles are signed milli-degrees, positions signed units of 10 um; the order of the two words is a setting.
"""  # noqa: E501

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from robot.hal.interfaces import ArmState

MAGIC: Final = 0x4152
MAP_VERSION: Final = 1
JOINTS: Final = 6

INPUTS: Final = 34
DISCRETES: Final = 7
CONTROL_ADDRESS: Final = 0
CONTROL_COUNT: Final = 4
COMMAND_ADDRESS: Final = 16
STATUS_COUNT: Final = 10

COIL_ENABLE: Final = 0
COIL_STOP: Final = 1
COIL_FAULT_RESET: Final = 2
COIL_GRIPPER: Final = 3

_JOINTS_AT: Final = 10
_POSE_AT: Final = 22
_UNITS_PER_METRE: Final = 100_000.0
_UNITS_PER_RADIAN: Final = math.degrees(1.0) * 1000.0
_NUMBERS: Final = 65535
Triple = tuple[float, float, float]


class State(IntEnum):
    """What the controller is doing."""

    OFF = 0
    ENABLED = 1
    MOVING = 2
    FAULT = 3
    EMERGENCY_STOP = 4
    PROTECTIVE_STOP = 5


class Opcode(IntEnum):
    """What a command asks for."""

    MOVE_JOINTS = 1
    MOVE_LINEAR = 2


RESULTS: Final = {
    0: "none yet",
    1: "done",
    2: "replaced by a newer command",
    3: "stopped",
    4: "stopped: the heartbeat was missing",
    5: "stopped by a fault or a safety stop",
    10: "unknown command",
    11: "the drives are off",
    12: "out of its reach",
    13: "beyond a joint's limit",
    14: "speed out of range",
    15: "the controller has no heartbeat and no owner",
    16: "a stop is under way",
    17: "the controller is not in remote mode",
    18: "refused by the controller",
}
DONE: Final = 1
FIRST_REFUSAL: Final = 10

ERRORS: Final = {
    1: "drive overload",
    2: "following error",
    3: "joint limit",
    4: "collision",
    5: "drive communication",
    6: "gripper",
}


@dataclass(frozen=True, slots=True)
class Status:
    """The first ten input registers."""

    magic: int
    map_version: int
    state: int
    mode: int
    error: int
    warning: int
    echo: int
    begun: int
    ended: int
    result: int

    @property
    def refused(self) -> bool:
        """True if the command that ended last never began."""
        return self.result >= FIRST_REFUSAL


@dataclass(frozen=True, slots=True)
class Report:
    """All the controller tells in one poll."""

    status: Status
    arm: ArmState
    emergency_stop: bool
    protective_stop: bool
    fault: bool
    gripper_closed: bool


def status_of(registers: Sequence[int]) -> Status:
    """Input registers 0-9 as a status; more are ignored.

    >>> status_of([0x4152, 1, 1, 1, 0, 0, 7, 3, 3, 1]).ended
    3
    """
    return Status(*registers[:STATUS_COUNT])


def report_of(inputs: Sequence[int], discretes: Sequence[bool], low_first: bool) -> Report:
    """The poll's registers (34 inputs, 7 discretes) as values in SI units."""
    joints = [word / _UNITS_PER_RADIAN for word in _long_words(inputs[_JOINTS_AT:_POSE_AT], low_first)]
    pose = _long_words(inputs[_POSE_AT:INPUTS], low_first)
    x, y, z = (word / _UNITS_PER_METRE for word in pose[:3])
    rx, ry, rz = (word / _UNITS_PER_RADIAN for word in pose[3:])
    powered, emergency, protective, moving, in_position, fault, gripper = discretes
    status = status_of(inputs)
    return Report(
        status=status,
        arm=ArmState(
            joints=tuple(joints),
            position=(x, y, z),
            orientation=(rx, ry, rz),
            moving=moving,
            in_position=in_position,
            enabled=powered and status.state in (State.ENABLED, State.MOVING),
        ),
        emergency_stop=emergency or status.state == State.EMERGENCY_STOP,
        protective_stop=protective or status.state == State.PROTECTIVE_STOP,
        fault=fault or status.state == State.FAULT,
        gripper_closed=gripper,
    )


def joint_targets(joints: Sequence[float]) -> list[int]:
    """Joint angles (radians) in the map's units."""
    return [round(angle * _UNITS_PER_RADIAN) for angle in joints]


def pose_targets(position: Triple, orientation: Triple) -> list[int]:
    """A pose (metres, radians) in the map's units."""
    return [round(x * _UNITS_PER_METRE) for x in position] + joint_targets(orientation)


def command_block(
    opcode: Opcode, speed_percent: int, targets: Sequence[int], number: int, low_first: bool
) -> list[int]:
    """Holding registers 16-31. Raises ValueError if a target does not fit into 32 bits.

    >>> block = command_block(Opcode.MOVE_JOINTS, 50, [90_000, -1, 0, 0, 0, 0], 7, low_first=False)
    >>> [hex(word) for word in block[:7]], block[-1]
    (['0x1', '0x32', '0x0', '0x1', '0x5f90', '0xffff', '0xffff'], 7)
    """
    words: list[int] = []
    for target in targets:
        if not -(2**31) <= target < 2**31:
            raise ValueError(f"target {target} does not fit into 32 bits")
        high, low = (target >> 16) & 0xFFFF, target & 0xFFFF
        words += [low, high] if low_first else [high, low]
    return [int(opcode), speed_percent, 0, *words, on_wire(number)]


def on_wire(number: int) -> int:
    """A command's number as its register has it: 1..65535 again and again, never 0.

    >>> on_wire(65535), on_wire(65536)
    (65535, 1)
    """
    return (number - 1) % _NUMBERS + 1


def number_of(register: int, least: int) -> int:
    """The smallest command number >= `least` that has this register; `least` itself for register 0.

    >>> number_of(1, 65535)
    65536
    """
    return least if register == 0 else least + (register - on_wire(least)) % _NUMBERS


def newest(begun: int, ended: int) -> int:
    """The later of two command numbers in registers (0: none yet); a refused one ends without beginning.

    >>> newest(65535, 2), newest(7, 6), newest(0, 5)
    (2, 7, 5)
    """
    if begun == 0 or ended == 0:
        return begun or ended
    return ended if 0 < (ended - begun) % _NUMBERS < _NUMBERS // 2 else begun


def _long_words(registers: Sequence[int], low_first: bool) -> list[int]:
    pairs = zip(registers[0::2], registers[1::2], strict=True)
    values = [(b << 16 | a) if low_first else (a << 16 | b) for a, b in pairs]
    return [value - 2**32 if value >= 2**31 else value for value in values]
