"""LEGO NXT communication protocol (LCP): requests to bytes, replies to frozen values. No I/O.

A telegram is at most 64 bytes, all integers little-endian. Byte 0 says what it is: 00 a direct command, 01 a
system command (80 and 81 the same without a reply), 02 a reply `02 opcode status ...`. Source: LEGO
MINDSTORMS NXT Bluetooth Developer Kit, appendices 1 and 2, and the firmware 1.29.

Each builder returns a `Request`, which holds the bytes and knows how to read the reply:

>>> request = set_output_state(Port.B, -50, Mode.BRAKE | Mode.REGULATED | Mode.ON, Regulation.SPEED, 90)
>>> request.silent.hex(" ")
'80 04 01 ce 07 01 00 20 5a 00 00 00'
>>> get_battery_level().parse(bytes.fromhex("020b00 401f"))
8000
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Final, Generic, TypeVar

from robot.hal.nxt.replies import (
    DeviceInfo,
    InputValues,
    OutputState,
    ProtocolError,
    Status,
    StatusError,
    Version,
)

MAX_TELEGRAM_BYTES: Final = 64
ALL_PORTS: Final = 0xFF

_DIRECT: Final = 0x00
_SYSTEM: Final = 0x01
_REPLY: Final = 0x02
_NO_REPLY: Final = 0x80

R = TypeVar("R")


class Port(IntEnum):
    """Output ports of the brick."""

    A = 0
    B = 1
    C = 2


class Mode(IntFlag):
    """Bits of an output's mode. Without ON the motor coasts; BRAKE shorts it between the pulses."""

    COAST = 0
    ON = 1
    BRAKE = 2
    REGULATED = 4


class Regulation(IntEnum):
    """What the firmware keeps: nothing, the speed of one motor, or two motors in step."""

    IDLE = 0
    SPEED = 1
    SYNC = 2


class RunState(IntEnum):
    """How an output runs."""

    IDLE = 0x00
    RAMP_UP = 0x10
    RUNNING = 0x20
    RAMP_DOWN = 0x40


# --------------------------------------------------------------------------------------- the requests


@dataclass(frozen=True, slots=True)
class Request(Generic[R]):
    """One command. telegram asks for a reply, `silent` does not; `parse` reads it (3 + body_bytes bytes)."""

    name: str
    telegram: bytes
    body_bytes: int
    _read: Callable[[bytes], R]

    @property
    def silent(self) -> bytes:
        """The same command without a reply (for actions only)."""
        return bytes([self.telegram[0] | _NO_REPLY]) + self.telegram[1:]

    def parse(self, reply: bytes) -> R:
        """Read the reply. Raises StatusError if the brick refused, ProtocolError if this is no answer."""
        if len(reply) < 3 or reply[0] != _REPLY or reply[1] != self.telegram[1]:
            raise ProtocolError(f"no reply to {self.name}: {_shown(reply)}")
        if reply[2] != Status.OK:
            raise StatusError(self.name, reply[2])
        if len(reply) != 3 + self.body_bytes:
            raise ProtocolError(
                f"{self.name} is answered in {3 + self.body_bytes} bytes, got {_shown(reply)}"
            )
        return self._read(reply[3:])


def set_output_state(
    port: int,
    power: int,
    mode: int,
    regulation: int,
    tacho_limit: int,
    *,
    turn_ratio: int = 0,
    run_state: int = RunState.RUNNING,
) -> Request[None]:
    """SETOUTPUTSTATE: power -100..100 (clamped: the firmware does not check), limit in degrees, 0 = forever.

    The firmware adds the limit to its previous *target*, not to where the motor is.
    Raises ValueError for a port other than 0-2 or 0xFF and a limit outside 0..2^32-1.
    """
    _check(port in (0, 1, 2, ALL_PORTS), f"output port {port} is not 0, 1, 2 or 255")
    _check(0 <= tacho_limit < 1 << 32, f"tacho limit {tacho_limit} is not in 0..2^32-1")
    body = struct.pack(
        "<BbBBbBI", port, _percent(power), mode, regulation, _percent(turn_ratio), run_state, tacho_limit
    )
    return _action("SETOUTPUTSTATE", _DIRECT, 0x04, body)


def hold(port: int) -> Request[None]:
    """SETOUTPUTSTATE that brakes and keeps the position of one port or of ALL_PORTS."""
    return set_output_state(port, 0, Mode.ON | Mode.BRAKE | Mode.REGULATED, Regulation.SPEED, 0)


def coast(port: int) -> Request[None]:
    """SETOUTPUTSTATE that lets go of one port or of ALL_PORTS."""
    return set_output_state(port, 0, Mode.COAST, Regulation.IDLE, 0, run_state=RunState.IDLE)


def get_output_state(port: int) -> Request[OutputState]:
    """GETOUTPUTSTATE of port 0-2."""
    _check(port in (0, 1, 2), f"output port {port} is not 0, 1 or 2")

    def read(body: bytes) -> OutputState:
        state = OutputState(*struct.unpack("<BbBBbBIiii", body))
        if state.port != port:
            raise ProtocolError(f"asked for the state of output {port}, was told that of {state.port}")
        return state

    return Request("GETOUTPUTSTATE", bytes([_DIRECT, 0x06, port]), 22, read)


def reset_motor_position(port: int, relative: bool) -> Request[None]:
    """RESETMOTORPOSITION: zero the block counter (relative) or the rotation counter of port 0-2."""
    _check(port in (0, 1, 2), f"output port {port} is not 0, 1 or 2")
    return _action("RESETMOTORPOSITION", _DIRECT, 0x0A, bytes([port, int(relative)]))


def reset_count(port: int) -> Request[None]:
    """Opcode 0x21 (firmware 1.29): zero the tacho count and the target the limits add up on."""
    _check(port in (0, 1, 2, ALL_PORTS), f"output port {port} is not 0, 1, 2 or 255")
    return _action("RESETCOUNT", _DIRECT, 0x21, bytes([port]))


def get_battery_level() -> Request[int]:
    """GETBATTERYLEVEL: millivolts."""
    return Request("GETBATTERYLEVEL", bytes([_DIRECT, 0x0B]), 2, _unsigned)


def keep_alive() -> Request[int]:
    """KEEPALIVE: restart the auto-off timer; the reply is its length in milliseconds (0 = never)."""
    return Request("KEEPALIVE", bytes([_DIRECT, 0x0D]), 4, _unsigned)


def stop_program() -> Request[None]:
    """STOPPROGRAM: refused with NO_PROGRAM if none runs. It is no emergency stop: motors run on."""
    return _action("STOPPROGRAM", _DIRECT, 0x01, b"")


def play_tone(hertz: int, duration_ms: int) -> Request[None]:
    """PLAYTONE: 200..14000 Hz for 0..65535 ms."""
    _check(200 <= hertz <= 14000, f"a tone of {hertz} Hz is not in 200..14000 Hz")
    _check(0 <= duration_ms <= 0xFFFF, f"a tone of {duration_ms} ms is not in 0..65535 ms")
    return _action("PLAYTONE", _DIRECT, 0x03, struct.pack("<HH", hertz, duration_ms))


def get_version() -> Request[Version]:
    """GETVERSION. The bytes come minor first."""
    return Request(
        "GETVERSION", bytes([_SYSTEM, 0x88]), 4, lambda body: Version((body[1], body[0]), (body[3], body[2]))
    )


def get_device_info() -> Request[DeviceInfo]:
    """GETDEVICEINFO."""

    def read(body: bytes) -> DeviceInfo:
        name, address, a, b, c, d, flash = struct.unpack("<15s7s4BI", body)
        text = name.split(b"\0", 1)[0].decode("ascii", "replace")
        return DeviceInfo(text, ":".join(f"{byte:02x}" for byte in address[:6]), (a, b, c, d), flash)

    return Request("GETDEVICEINFO", bytes([_SYSTEM, 0x9B]), 30, read)


def set_input_mode(port: int, sensor_type: int, sensor_mode: int) -> Request[None]:
    """SETINPUTMODE of sensor port 0-3: touch is type 1 mode 0x20, ultrasonic type 0x0B mode 0."""
    _check_sensor(port)
    return _action("SETINPUTMODE", _DIRECT, 0x05, bytes([port, sensor_type, sensor_mode]))


def get_input_values(port: int) -> Request[InputValues]:
    """GETINPUTVALUES of sensor port 0-3."""
    _check_sensor(port)

    def read(body: bytes) -> InputValues:
        values = InputValues(*struct.unpack("<B??BBHHhh", body))
        if values.port != port:
            raise ProtocolError(f"asked for the values of input {port}, was told those of {values.port}")
        return values

    return Request("GETINPUTVALUES", bytes([_DIRECT, 0x07, port]), 13, read)


def ls_get_status(port: int) -> Request[int]:
    """LSGETSTATUS: bytes ready on the sensor bus; refused with PENDING while the bus is busy."""
    _check_sensor(port)
    return Request("LSGETSTATUS", bytes([_DIRECT, 0x0E, port]), 1, lambda body: body[0])


def ls_write(port: int, data: bytes, reply_bytes: int) -> Request[None]:
    """LSWRITE: send 1..16 bytes over the sensor bus, fetch 0..16. Ultrasonic: 02 42, one byte back (cm)."""
    _check_sensor(port)
    _check(1 <= len(data) <= 16, f"the sensor bus takes 1..16 bytes, got {len(data)}")
    _check(0 <= reply_bytes <= 16, f"the sensor bus answers in 0..16 bytes, not {reply_bytes}")
    return _action("LSWRITE", _DIRECT, 0x0F, bytes([port, len(data), reply_bytes]) + data)


def ls_read(port: int) -> Request[bytes]:
    """LSREAD: what came over the sensor bus (the brick pads it to 16 bytes; the padding is cut off here)."""
    _check_sensor(port)

    def read(body: bytes) -> bytes:
        if body[0] > 16:
            raise ProtocolError(f"LSREAD tells of {body[0]} bytes, there can be 16")
        return body[1 : 1 + body[0]]

    return Request("LSREAD", bytes([_DIRECT, 0x10, port]), 17, read)


# --------------------------------------------------------------------------------------------- within


def _action(name: str, kind: int, opcode: int, body: bytes) -> Request[None]:
    return Request(name, bytes([kind, opcode]) + body, 0, lambda _: None)


def _unsigned(body: bytes) -> int:
    return int.from_bytes(body, "little")


def _percent(value: int) -> int:
    return max(-100, min(100, value))


def _check(holds: bool, words: str) -> None:
    if not holds:
        raise ValueError(words)


def _check_sensor(port: int) -> None:
    _check(port in (0, 1, 2, 3), f"input port {port} is not 0, 1, 2 or 3")


def _shown(telegram: bytes) -> str:
    return f"{len(telegram)} bytes {telegram[:8].hex(' ')}" if telegram else "an empty telegram"
