"""The part of MAVLink a driven robot needs: framing of v1 and v2, and the six messages of joystick driving.

    v1   FE length seq system component id         payload crc16
    v2   FD length incompat compat seq system component id24   payload crc16 [signature 13]

The CRC is X.25 over all but the first byte, then over one byte per message (its "CRC extra") that stands for
the message's layout. In v2 zeros at the payload's end are left out. Signatures are skipped, not checked.
https://mavlink.io/en/guide/serialization.html, common.xml.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

from robot.hal.teleop.sticks import clipped

V1_START: Final = 0xFE
V2_START: Final = 0xFD
HEARTBEAT: Final = 0
MANUAL_CONTROL: Final = 69
COMMAND_LONG: Final = 76
COMMAND_ACK: Final = 77
STATUSTEXT: Final = 253
ARM_DISARM: Final = 400
"""MAV_CMD_COMPONENT_ARM_DISARM: parameter 1 arms (1) or disarms (0); parameter 2 = 21196 forces."""
FORCE: Final = 21196.0
ACCEPTED, TEMPORARILY_REJECTED, UNSUPPORTED = 0, 1, 3
"""MAV_RESULT of a command."""
ROBOT_SYSTEM, ROBOT_COMPONENT = 1, 1

_CRC_EXTRA: Final = {HEARTBEAT: 50, MANUAL_CONTROL: 243, COMMAND_LONG: 152, COMMAND_ACK: 143, STATUSTEXT: 83}
_SIZES: Final = {HEARTBEAT: (9, 9), MANUAL_CONTROL: (11, 30), COMMAND_LONG: (33, 33), COMMAND_ACK: (3, 10)}
_SIZES_TEXT: Final = (51, 54)
_HEARTBEAT: Final = struct.Struct("<IBBBBB")
_MANUAL: Final = struct.Struct("<hhhhHB")
_COMMAND: Final = struct.Struct("<7fHBBB")
_ACK_V1: Final = struct.Struct("<HB")
_ACK: Final = struct.Struct("<HBBiBB")
_TEXT: Final = struct.Struct("<B50s")

_V1_HEADER, _V2_HEADER, _CRC, _SIGNATURE = 6, 10, 2, 13
_SIGNED: Final = 0x01
_AXIS_FULL: Final = 1000.0
_AXIS_UNUSED: Final = 0x7FFF
_MAV_TYPE_GCS: Final = 6
_MAV_TYPE_GROUND_ROVER: Final = 10
_MAV_AUTOPILOT_GENERIC: Final = 0
_MANUAL_INPUT_ENABLED, _SAFETY_ARMED = 64, 128
_STATE_STANDBY, _STATE_ACTIVE, _STATE_CRITICAL = 3, 4, 5
_MAVLINK_VERSION: Final = 3


@dataclass(frozen=True, slots=True)
class Packet:
    """A whole message as it came: which, from whom, in which version (1 or 2)."""

    number: int
    seq: int
    system: int
    component: int
    payload: bytes
    version: int


@dataclass(frozen=True, slots=True)
class ManualControl:
    """Sticks of a ground station: v forward, w left, -1..1."""

    target: int
    v: float
    w: float


@dataclass(frozen=True, slots=True)
class LongCommand:
    """A command with its first two parameters and whom it is for."""

    system: int
    component: int
    command: int
    param1: float
    param2: float


# ------------------------------------------------------------------------------------------------ framing


def crc_x25(data: bytes, crc: int = 0xFFFF) -> int:
    """CRC-16/MCRF4XX as MAVLink uses it: polynomial 0x1021 bit-reversed, from 0xFFFF, not inverted.

    >>> hex(crc_x25(b"123456789"))
    '0x6f91'
    """
    for byte in data:
        crc = (crc >> 8) ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc


def _table_entry(index: int) -> int:
    for _ in range(8):
        index = (index >> 1) ^ (0x8408 if index & 1 else 0)
    return index


_TABLE: Final = tuple(_table_entry(index) for index in range(256))


def packet_length(data: bytes, at: int) -> int | None:
    """Bytes of the message at `at`, by its header; 0 if there is none, None if the header is cut off."""
    here = data[at : at + _V2_HEADER]
    if here[0] == V1_START:
        if len(here) < _V1_HEADER:
            return None
        length, number, exact = here[1], here[5], True
        whole = _V1_HEADER + length + _CRC
    else:
        if len(here) >= 3 and here[2] & ~_SIGNED:
            return 0  # it says that it is in a form we cannot read
        if len(here) < _V2_HEADER:
            return None
        length, number, exact = here[1], int.from_bytes(here[7:10], "little"), False
        whole = _V2_HEADER + length + _CRC + (_SIGNATURE if here[2] & _SIGNED else 0)
    shortest, longest = _SIZES.get(number, _SIZES_TEXT if number == STATUSTEXT else (0, 255))
    if length > longest or (exact and length < shortest):
        return 0
    return whole


def unpack(data: bytes) -> Packet | None:
    """The message in exactly these bytes; None if the CRC is wrong. One we do not know has an empty payload.

    Of a message we do not know the CRC cannot be checked: it is told by its number only.
    """
    if data[0] == V1_START:
        version, header = 1, _V1_HEADER
        length, seq, system, component, number = data[1:6]
    else:
        version, header = 2, _V2_HEADER
        length, seq, system, component = data[1], data[4], data[5], data[6]
        number = int.from_bytes(data[7:10], "little")
    extra = _CRC_EXTRA.get(number)
    if extra is None:
        return Packet(number, seq, system, component, b"", version)
    payload = data[header : header + length]
    check = int.from_bytes(data[header + length : header + length + _CRC], "little")
    if crc_x25(data[1 : header + length] + bytes([extra])) != check:
        return None
    return Packet(number, seq, system, component, payload, version)


def is_known(number: int) -> bool:
    """True for messages whose CRC can be checked."""
    return number in _CRC_EXTRA


def pack(
    number: int,
    payload: bytes,
    seq: int,
    version: int,
    system: int = ROBOT_SYSTEM,
    component: int = ROBOT_COMPONENT,
) -> bytes:
    """A whole message. version 1 or 2; KeyError for a number we do not know."""
    if version == 1:
        head = bytes([len(payload), seq & 0xFF, system, component, number])
        start = V1_START
    else:
        payload = payload.rstrip(b"\0") or b"\0"
        head = bytes([len(payload), 0, 0, seq & 0xFF, system, component]) + number.to_bytes(3, "little")
        start = V2_START
    body = head + payload
    return bytes([start]) + body + crc_x25(body + bytes([_CRC_EXTRA[number]])).to_bytes(2, "little")


# ----------------------------------------------------------------------------------------------- messages


def read_manual_control(payload: bytes) -> ManualControl:
    """x is forward; r is the yaw stick, positive to the right as ground stations and autopilots use it.

    (common.xml says counter-clockwise; QGroundControl sends and ArduPilot and PX4 read the opposite.)
    """
    x, _, _, r, _, target = _MANUAL.unpack(_filled(payload, _MANUAL.size))
    return ManualControl(target, _axis(x), 0.0 - _axis(r))


def read_command(payload: bytes) -> LongCommand:
    """A COMMAND_LONG."""
    values = _COMMAND.unpack(_filled(payload, _COMMAND.size))
    return LongCommand(values[8], values[9], values[7], values[0], values[1])


def is_ground_station(payload: bytes) -> bool:
    """True if this HEARTBEAT comes from one that may drive, not from another vehicle on the line."""
    return _filled(payload, _HEARTBEAT.size)[4] == _MAV_TYPE_GCS


def heartbeat(armed: bool, halted: bool) -> bytes:
    """Payload of the robot's own HEARTBEAT: a rover, armed while the ground station has the stick."""
    state = _STATE_CRITICAL if halted else _STATE_ACTIVE if armed else _STATE_STANDBY
    mode = _MANUAL_INPUT_ENABLED | (_SAFETY_ARMED if armed else 0)
    return _HEARTBEAT.pack(0, _MAV_TYPE_GROUND_ROVER, _MAV_AUTOPILOT_GENERIC, mode, state, _MAVLINK_VERSION)


def command_ack(command: int, result: int, system: int, component: int, version: int) -> bytes:
    """Payload of a COMMAND_ACK; in version 1 it names nobody."""
    if version == 1:
        return _ACK_V1.pack(command, result)
    return _ACK.pack(command, result, 0, 0, system, component)


def statustext(severity: int, text: str, version: int) -> bytes:
    """Payload of a STATUSTEXT: severity 0..7 (6 is information), at most 50 bytes of text."""
    payload = _TEXT.pack(severity, text.encode("ascii", "replace")[:50])
    return payload if version == 1 else payload + bytes(3)


def _filled(payload: bytes, size: int) -> bytes:
    return payload[:size].ljust(size, b"\0")


def _axis(value: int) -> float:
    return 0.0 if value == _AXIS_UNUSED else clipped(value / _AXIS_FULL)
