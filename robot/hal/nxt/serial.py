"""The brick over Bluetooth as a serial port (/dev/rfcommN): telegrams behind a little-endian u16 length."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from robot.hal.interfaces import DeviceError
from robot.hal.nxt.lcp import MAX_TELEGRAM_BYTES

_HEADER_BYTES: Final = 2
_WRITE_TIMEOUT_S: Final = 0.1


class SerialLink:
    """`Link` over a port like serial.Serial. `open_port` opens it or raises DeviceError.

    A broken link is let go; the next `write` opens the port again.
    """

    def __init__(self, open_port: Callable[[], Any]) -> None:
        self._open_port = open_port
        self._received = bytearray()
        self._closed = False
        self._port: Any = open_port()

    def write(self, telegram: bytes) -> None:
        """Send one telegram. Raises DeviceError if the port is gone or does not take it in time."""
        if self._closed:
            raise DeviceError("the serial link is closed")
        if self._port is None:
            self._port = self._open_port()
        try:
            self._port.write(len(telegram).to_bytes(_HEADER_BYTES, "little") + telegram)
        except OSError as error:
            self._let_go()
            raise DeviceError(f"the brick's serial link broke: {error}") from error

    def read(self, timeout: float) -> bytes | None:
        """Return the next telegram or None; a part of one is kept for the next call.

        Raises DeviceError if the port is gone or the lengths make no sense (all that came is thrown away).
        """
        if not self._fill(_HEADER_BYTES, timeout):
            return None
        length = int.from_bytes(self._received[:_HEADER_BYTES], "little")
        if not 0 < length <= MAX_TELEGRAM_BYTES:
            self._let_go()
            raise DeviceError(f"the serial link is out of step: a telegram of {length} bytes is announced")
        if not self._fill(_HEADER_BYTES + length, timeout):
            return None
        telegram = bytes(self._received[_HEADER_BYTES : _HEADER_BYTES + length])
        del self._received[: _HEADER_BYTES + length]
        return telegram

    def close(self) -> None:
        """Release the port. May be called twice."""
        self._closed = True
        self._let_go()

    def _fill(self, length: int, timeout: float) -> bool:
        if self._port is None:
            raise DeviceError("the brick's serial link is down: check Bluetooth")
        missing = length - len(self._received)
        if missing <= 0:
            return True
        try:
            self._port.timeout = timeout
            self._received += self._port.read(missing)
        except OSError as error:
            self._let_go()
            raise DeviceError(f"the brick's serial link broke: {error}") from error
        return len(self._received) >= length

    def _let_go(self) -> None:
        port, self._port = self._port, None
        self._received.clear()
        if port is not None:
            port.close()


def open_serial_port(path: str) -> Any:
    """Open the port for ourselves alone (serial.Serial). Raises DeviceError with the cure."""
    import serial

    try:
        port = serial.Serial(
            path, baudrate=115200, timeout=0.0, write_timeout=_WRITE_TIMEOUT_S, exclusive=True
        )
        # Half a telegram from before would put us out of step.
        port.reset_input_buffer()
    except serial.SerialException as error:
        raise DeviceError(
            f"the serial port {path} cannot be opened: {error}; bind the brick with `rfcomm bind` first"
        ) from error
    return port
