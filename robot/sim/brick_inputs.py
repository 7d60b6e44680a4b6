"""The input ports of the brick: touch and ultrasonic sensor, as the host sees them.

A port delivers valid values some time after its mode was set; the ultrasonic sensor is reached through the
low-speed (I2C) commands: write, poll the status until it is no longer pending, read.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field

TYPE_SWITCH, TYPE_LOWSPEED, TYPE_LOWSPEED_9V = 0x01, 0x0A, 0x0B
MODE_BOOLEAN = 0x20
INPUT_COUNT = 4

STATUS_PENDING, STATUS_OUT_OF_RANGE, STATUS_BUS_ERROR, STATUS_CHANNEL_NOT_READY = 0x20, 0xC0, 0xDD, 0xE0
LARGEST_TRANSFER = 16

_SETTLE_MS = 60
_BUS_MS = 4
_RELEASED_RAW, _PRESSED_RAW = 1023, 183


@dataclass(slots=True)
class TouchSensor:
    """A push button."""

    pressed: bool = False

    @property
    def raw(self) -> int:
        """The converter's value, 0..1023."""
        return _PRESSED_RAW if self.pressed else _RELEASED_RAW


@dataclass(slots=True)
class UltrasonicSensor:
    """The LEGO sonar on the low-speed bus at address 2; `distance_cm` None: no echo."""

    distance_cm: int | None = None
    registers: dict[int, bytes] = field(
        default_factory=lambda: {
            0x00: b"V1.0\0\0\0\0",
            0x08: b"LEGO\0\0\0\0",
            0x10: b"Sonar\0\0\0",
            0x14: b"10E-2m\0",
        }
    )

    def transfer(self, written: bytes, wanted: int) -> bytes | None:
        """Answer a bus transfer with `wanted` bytes, None if nobody answers at that address."""
        if not written or written[0] != 0x02:
            return None
        register = written[1] if len(written) > 1 else 0
        if register == 0x42:
            content = bytes([255 if self.distance_cm is None else min(max(self.distance_cm, 0), 255)])
        else:
            content = self.registers.get(register, b"")
        return content[:wanted].ljust(wanted, b"\0")


Sensor = TouchSensor | UltrasonicSensor


@dataclass(slots=True)
class Input:
    """One input port: what the host set, and the low-speed transfer under way."""

    sensor: Sensor | None = None
    kind: int = 0
    mode: int = 0
    settle_ms: int = 0
    bus_ms: int = 0
    bus_failed: bool = False
    answer: bytes = b""

    def set_mode(self, kind: int, mode: int) -> None:
        """SETINPUTMODE: values are invalid until the port has settled."""
        self.kind, self.mode, self.settle_ms = kind, mode, _SETTLE_MS
        self.bus_ms, self.bus_failed, self.answer = 0, False, b""

    def tick(self) -> None:
        """One millisecond passes."""
        self.settle_ms = max(self.settle_ms - 1, 0)
        self.bus_ms = max(self.bus_ms - 1, 0)

    def values(self, port: int) -> bytes:
        """The 13 bytes of GETINPUTVALUES that follow the status."""
        raw = self.sensor.raw if isinstance(self.sensor, TouchSensor) else _RELEASED_RAW
        scaled = int(raw < 512) if self.mode == MODE_BOOLEAN else raw
        return struct.pack(
            "<BBBBBHHhh", port, self.settle_ms == 0, 0, self.kind, self.mode, raw, raw, scaled, raw
        )

    def lowspeed_write(self, written: bytes, wanted: int) -> int:
        """LSWRITE: start a transfer; returns the status."""
        if self.kind not in (TYPE_LOWSPEED, TYPE_LOWSPEED_9V):
            return STATUS_CHANNEL_NOT_READY
        answer = self.sensor.transfer(written, wanted) if isinstance(self.sensor, UltrasonicSensor) else None
        self.bus_failed = answer is None
        self.answer = answer or b""
        self.bus_ms = _BUS_MS
        return 0

    def lowspeed_status(self) -> tuple[int, int]:
        """LSGETSTATUS: status and bytes ready."""
        if self.kind not in (TYPE_LOWSPEED, TYPE_LOWSPEED_9V):
            return STATUS_CHANNEL_NOT_READY, 0
        if self.bus_ms:
            return STATUS_PENDING, 0
        if self.bus_failed:
            return STATUS_BUS_ERROR, 0
        return 0, len(self.answer)

    def lowspeed_read(self) -> tuple[int, bytes]:
        """LSREAD: status and the bytes, which are then gone."""
        status, ready = self.lowspeed_status()
        if status or not ready:
            return status, b""
        answer, self.answer = self.answer, b""
        return 0, answer[:LARGEST_TRANSFER]


class InputModule:
    """The four input ports behind their commands: argument bytes in, (status, reply body) out."""

    def __init__(self, sensors: Mapping[int, Sensor]) -> None:
        strangers = sorted(set(sensors) - set(range(INPUT_COUNT)))
        if strangers:
            raise ValueError(f"input port {strangers[0]} does not exist: use 0 to {INPUT_COUNT - 1}")
        self.ports = tuple(Input(sensors.get(port)) for port in range(INPUT_COUNT))

    def tick(self) -> None:
        """One millisecond passes."""
        for port in self.ports:
            port.tick()

    def set_mode(self, arguments: bytes) -> tuple[int, bytes]:
        """SETINPUTMODE port type mode."""
        if arguments[0] >= INPUT_COUNT:
            return STATUS_OUT_OF_RANGE, b""
        self.ports[arguments[0]].set_mode(arguments[1], arguments[2])
        return 0, b""

    def values(self, arguments: bytes) -> tuple[int, bytes]:
        """GETINPUTVALUES port."""
        if arguments[0] >= INPUT_COUNT:
            return STATUS_OUT_OF_RANGE, bytes(13)
        return 0, self.ports[arguments[0]].values(arguments[0])

    def reset_scaled(self, arguments: bytes) -> tuple[int, bytes]:
        """RESETINPUTSCALEDVALUE port: neither sensor here accumulates anything."""
        return (0 if arguments[0] < INPUT_COUNT else STATUS_OUT_OF_RANGE), b""

    def lowspeed_status(self, arguments: bytes) -> tuple[int, bytes]:
        """LSGETSTATUS port."""
        if arguments[0] >= INPUT_COUNT:
            return STATUS_OUT_OF_RANGE, b"\0"
        status, ready = self.ports[arguments[0]].lowspeed_status()
        return status, bytes([ready])

    def lowspeed_write(self, arguments: bytes) -> tuple[int, bytes]:
        """LSWRITE port sent wanted bytes..."""
        port, sent, wanted = arguments[:3]
        if port >= INPUT_COUNT or max(sent, wanted) > LARGEST_TRANSFER or len(arguments) < 3 + sent:
            return STATUS_OUT_OF_RANGE, b""
        return self.ports[port].lowspeed_write(arguments[3 : 3 + sent], wanted), b""

    def lowspeed_read(self, arguments: bytes) -> tuple[int, bytes]:
        """LSREAD port; the answer is padded to 16 bytes."""
        if arguments[0] >= INPUT_COUNT:
            return STATUS_OUT_OF_RANGE, bytes(1 + LARGEST_TRANSFER)
        status, content = self.ports[arguments[0]].lowspeed_read()
        return status, bytes([len(content)]) + content.ljust(LARGEST_TRANSFER, b"\0")
