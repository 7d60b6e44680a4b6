"""One Modbus connection for all devices behind it: bounded exchanges, re-opened by itself with back-off.

Function codes 1-4, 15 and 16 only: all that small controllers offer. Over a synchronous pymodbus client, one
exchange at a time; without retries of its own, for a repeated write must be the caller's decision.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from typing import Any, Final, TypeVar

from robot.hal.backoff import Backoff
from robot.hal.interfaces import DeviceError
from robot.hal.modbus_client import Client, Reply, client_for

T = TypeVar("T")

# pymodbus logs every lost telegram with a dump, and without a handler that goes to the person's terminal.
# What is wrong is told as a fault.
logging.getLogger("pymodbus").addHandler(logging.NullHandler())

DEFAULT_TIMEOUT_S: Final = 0.15
PATIENCE_S: Final = 0.3
"""Silence up to this is asked again at every call; then the back-off begins."""


_OPENING_TRIES: Final = 3


class NoAnswerError(DeviceError):
    """Nobody answered, or nothing that fits the question, or it is not yet time to try again."""


class RefusedError(DeviceError):
    """The server answered with a Modbus exception; `code` is its number."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code} ({_EXCEPTIONS.get(code, 'unknown')})")
        self.code = code


_EXCEPTIONS: Final = {
    1: "function not offered",
    2: "no such register",
    3: "value not allowed",
    4: "device failure",
    5: "accepted, takes time",
    6: "device busy",
    10: "gateway: no path",
    11: "gateway: device does not answer",
}


class ModbusLink:
    """The connection; safe to share between threads and devices.

    Every exchange takes the time `now` and either returns within the client's time-out or raises
    `NoAnswerError` or `RefusedError` (both DeviceError). After a failure the connection is dropped, so that
    a late answer cannot be taken for the next one. After `PATIENCE_S` of silence an exchange before the
    back-off is over raises at once. `close()` gives up one share, the last one closes the connection.

    client: not yet connected. name: for the error words, e.g. the address. lock_timeout_s: how long to wait
    for another thread's exchange.
    """

    def __init__(self, client: Client, name: str, lock_timeout_s: float = 2.5 * DEFAULT_TIMEOUT_S) -> None:
        self.name = name
        self._client = client
        self._lock = threading.Lock()
        self._lock_timeout_s = lock_timeout_s
        self._backoff = Backoff()
        self._heard_at: float | None = None
        self._shares = 1

    def share(self) -> ModbusLink:
        """The same link for one more device, which closes it for itself."""
        self._shares += 1
        return self

    def close(self) -> None:
        """Give up one share; the connection ends with the last. More calls than shares do no harm."""
        self._shares -= 1
        if self._shares <= 0:
            self._client.close()

    @property
    def closed(self) -> bool:
        """True when nobody uses it any more."""
        return self._shares <= 0

    def read_coils(self, unit: int, address: int, count: int, now: float) -> list[bool]:
        """Coils from `address` on."""
        ask = self._client.read_coils
        return _bits(
            self._exchange(1, lambda: ask(address, count=count, device_id=unit), now, _bit_count(count))
        )[:count]

    def read_discretes(self, unit: int, address: int, count: int, now: float) -> list[bool]:
        """Discrete inputs from `address` on."""
        ask = self._client.read_discrete_inputs
        return _bits(
            self._exchange(2, lambda: ask(address, count=count, device_id=unit), now, _bit_count(count))
        )[:count]

    def read_holdings(self, unit: int, address: int, count: int, now: float) -> list[int]:
        """Holding registers from `address` on."""
        ask = self._client.read_holding_registers
        return _words(
            self._exchange(3, lambda: ask(address, count=count, device_id=unit), now, _word_count(count))
        )

    def read_inputs(self, unit: int, address: int, count: int, now: float) -> list[int]:
        """Input registers from `address` on."""
        ask = self._client.read_input_registers
        return _words(
            self._exchange(4, lambda: ask(address, count=count, device_id=unit), now, _word_count(count))
        )

    def write_coils(self, unit: int, address: int, values: Sequence[bool], now: float) -> None:
        """Set coils from `address` on."""
        tell = self._client.write_coils
        self._exchange(15, lambda: tell(address, list(values), device_id=unit), now, _anything)

    def write_holdings(self, unit: int, address: int, values: Sequence[int], now: float) -> None:
        """Set holding registers from `address` on, all in one telegram. Each value 0..65535."""
        tell = self._client.write_registers
        self._exchange(16, lambda: tell(address, list(values), device_id=unit), now, _anything)

    # ------------------------------------------------------------------------------------------ inside

    def _exchange(
        self, function: int, ask: Callable[[], Any], now: float, fits: Callable[[Reply], bool]
    ) -> Reply:
        if not self._lock.acquire(timeout=self._lock_timeout_s):
            raise NoAnswerError(f"{self.name} is busy with another exchange")
        try:
            if self.closed:
                raise NoAnswerError(f"{self.name} is closed")
            if not self._backoff.due(now):
                raise NoAnswerError(f"{self.name} does not answer; it is asked again soon")
            reply = self._asked(ask, now)
            if reply.isError():
                self._heard(now)
                raise RefusedError(reply.exception_code)
            if reply.function_code != function or not fits(reply):
                self._failed(now)
                raise NoAnswerError(f"{self.name} answers something else than was asked")
            self._heard(now)
            return reply
        finally:
            self._lock.release()

    def _asked(self, ask: Callable[[], Any], now: float) -> Reply:
        try:
            if not self._client.connect():
                raise ConnectionError("no connection")
            reply: Reply = ask()
        # pymodbus decodes what a stranger sent: whatever it trips over is no answer, never our crash.
        except Exception as error:
            self._failed(now)
            raise NoAnswerError(f"{self.name} does not answer: {_first_line(error)}") from error
        return reply

    def _heard(self, now: float) -> None:
        self._heard_at = now
        self._backoff.worked()

    def _failed(self, now: float) -> None:
        self._client.close()
        if self._heard_at is None:
            self._heard_at = now
        if now - self._heard_at >= PATIENCE_S:
            self._backoff.failed(now)


def open_modbus_link(
    address: str, baudrate: int = 115200, timeout_s: float = DEFAULT_TIMEOUT_S
) -> ModbusLink:
    """A link to `HOST:PORT` (Modbus TCP; port 502 if left out) or to a serial port (Modbus RTU, 8N1).

    Raises DeviceError with the cure if nobody listens there. timeout_s: for each exchange. A host's name is
    looked up here, once: later a name server could hold everybody up.

    >>> open_modbus_link("")
    Traceback (most recent call last):
    robot.hal.interfaces.DeviceError: no address: name HOST:PORT or a serial port, e.g. 192.168.0.10:502
    """
    client = client_for(address, baudrate, timeout_s)
    if not client.connect():
        cure = (
            "check its cable, and that nobody else has it open (and that you are in the group dialout)"
            if "/" in address
            else "check its cable, its power and the address"
        )
        raise DeviceError(f"Modbus: {address} cannot be opened: {cure}")
    return ModbusLink(client, f"Modbus {address}", 2.5 * timeout_s)


def asked_patiently(ask: Callable[[], T]) -> T:
    """What `ask` returns, for opening a device: one lost telegram must not look like a missing device.

    Raises what `ask` does: NoAnswerError only after the third time in a row.
    """
    for _ in range(_OPENING_TRIES - 1):
        try:
            return ask()
        except NoAnswerError:
            continue
    return ask()


def _word_count(count: int) -> Callable[[Reply], bool]:
    return lambda reply: len(reply.registers) == count


def _bit_count(count: int) -> Callable[[Reply], bool]:
    return lambda reply: (count + 7) // 8 * 8 == len(reply.bits)


def _anything(reply: Reply) -> bool:
    return True


def _words(reply: Reply) -> list[int]:
    return list(reply.registers)


def _bits(reply: Reply) -> list[bool]:
    return [bool(bit) for bit in reply.bits]


def _first_line(error: Exception) -> str:
    return (str(error) or type(error).__name__).splitlines()[0]
