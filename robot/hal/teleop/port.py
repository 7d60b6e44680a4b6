"""A serial port that never lets anybody wait."""

from __future__ import annotations

import os
from contextlib import suppress
from typing import Any, Final, Protocol

from robot.hal.interfaces import DeviceError

BAUD_RATE: Final = 115200
_MOST_BYTES: Final = 4096
_WRITE_TIMEOUT_S: Final = 0.1


class Port(Protocol):
    """A byte stream both ways. Methods raise OSError when it is broken; none waits."""

    def read(self) -> bytes:
        """What has arrived, 4096 bytes at most; empty if nothing."""
        ...

    def write(self, data: bytes) -> int:
        """Hand bytes over; returns how many were taken, perhaps none."""
        ...

    def close(self) -> None:
        """Release the port. May be called twice."""
        ...


class SerialPort:
    """`Port` over serial.Serial."""

    def __init__(self, serial: Any) -> None:
        self._serial = serial

    def read(self) -> bytes:
        """What has arrived. Raises OSError after a hang-up."""
        waiting = self._serial.in_waiting  # also tells a hang-up
        return bytes(self._serial.read(min(waiting, _MOST_BYTES))) if waiting else b""

    def write(self, data: bytes) -> int:
        """Hand bytes over to the kernel.

        Not by serial.Serial.write: with a write_timeout of 0 it spins for ever on a full buffer, with any
        other it waits. Its file descriptor is non-blocking already.
        """
        try:
            return os.write(self._serial.fileno(), data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Release the port, also if it is broken."""
        with suppress(OSError):
            self._serial.close()


def open_port(path: str, baudrate: int = BAUD_RATE) -> SerialPort:
    """Open a serial port for ourselves alone. Raises DeviceError with the cure.

    Without pyserial's exclusive lock a second program (a getty, a terminal) would steal bytes: every other
    stop, perhaps.
    """
    import serial

    try:
        return SerialPort(
            serial.Serial(
                path, baudrate=baudrate, timeout=0.0, write_timeout=_WRITE_TIMEOUT_S, exclusive=True
            )
        )
    except (OSError, ValueError) as error:
        raise DeviceError(
            f"serial port {path} cannot be opened: {_why(error)}; {_cure(path, error)}"
        ) from error


def _why(error: Exception) -> str:
    number = getattr(error, "errno", None)
    return os.strerror(number) if number else str(error)


def _cure(path: str, error: Exception) -> str:
    if not os.path.exists(path):
        return "plug it in, or name another port"
    if isinstance(error, PermissionError) or getattr(error, "errno", None) == 13:
        return "join the group that owns it (dialout) and log in again"
    return "end the other program that uses it, check the baud rate"
