"""What the brick answers: values, or a status byte and the error it becomes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from robot.hal.interfaces import DeviceError


class Status(IntEnum):
    """Status byte of a reply."""

    OK = 0x00
    PENDING = 0x20
    MAILBOX_EMPTY = 0x40
    FAILED = 0xBD
    UNKNOWN_OPCODE = 0xBE
    INSANE_PACKET = 0xBF
    OUT_OF_RANGE = 0xC0
    BUS_ERROR = 0xDD
    BUFFER_FULL = 0xDE
    BAD_CHANNEL = 0xDF
    CHANNEL_BUSY = 0xE0
    NO_PROGRAM = 0xEC
    BAD_SIZE = 0xED
    BAD_MAILBOX = 0xEE
    BAD_FIELD = 0xEF
    BAD_INPUT = 0xF0
    OUT_OF_MEMORY = 0xFB
    BAD_ARGUMENTS = 0xFF


STATUS_WORDS: Final[dict[int, str]] = {
    Status.PENDING: "a transaction on the sensor bus is still pending",
    Status.MAILBOX_EMPTY: "the mailbox is empty",
    Status.FAILED: "the request failed",
    Status.UNKNOWN_OPCODE: "the firmware does not know the command",
    Status.INSANE_PACKET: "the telegram makes no sense to the brick",
    Status.OUT_OF_RANGE: "a value is out of range",
    Status.BUS_ERROR: "the sensor bus failed: is the sensor plugged in?",
    Status.BUFFER_FULL: "the brick's buffer is full",
    Status.BAD_CHANNEL: "the port is not set up for this",
    Status.CHANNEL_BUSY: "the port is busy or not set up",
    Status.NO_PROGRAM: "no program is running",
    Status.BAD_SIZE: "illegal size",
    Status.BAD_MAILBOX: "illegal mailbox",
    Status.BAD_FIELD: "illegal field",
    Status.BAD_INPUT: "bad input or output port",
    Status.OUT_OF_MEMORY: "the brick's memory is full",
    Status.BAD_ARGUMENTS: "bad arguments",
}


class ProtocolError(DeviceError):
    """A reply that does not answer the request: foreign, too short, too long or without sense."""


class StatusError(ProtocolError):
    """The brick answered, but refused. `status` is the byte it gave."""

    def __init__(self, command: str, status: int) -> None:
        self.status = status
        words = STATUS_WORDS.get(status, "a status byte this program does not know")
        super().__init__(f"the brick refuses {command}: {words} (status 0x{status:02X})")


@dataclass(frozen=True, slots=True)
class OutputState:
    """GETOUTPUTSTATE. Counters in degrees of the motor shaft.

    tacho counts since the last reset of the count (the limit is measured on it), block_tacho since the
    last reset of the block, rotation since the last reset of the rotation counter.
    """

    port: int
    power: int
    mode: int
    regulation: int
    turn_ratio: int
    run_state: int
    tacho_limit: int
    tacho: int
    block_tacho: int
    rotation: int


@dataclass(frozen=True, slots=True)
class Version:
    """GETVERSION: protocol and firmware as (major, minor)."""

    protocol: tuple[int, int]
    firmware: tuple[int, int]


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """GETDEVICEINFO: name, Bluetooth address (aa:bb:...), signal strengths, free flash in bytes."""

    name: str
    address: str
    signal: tuple[int, int, int, int]
    free_flash_bytes: int


@dataclass(frozen=True, slots=True)
class InputValues:
    """GETINPUTVALUES. Trust `scaled` only if `valid`."""

    port: int
    valid: bool
    calibrated: bool
    sensor_type: int
    sensor_mode: int
    raw: int
    normalized: int
    scaled: int
    calibrated_value: int
