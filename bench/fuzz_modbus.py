"""Modbus replies under fuzz: raw bytes through pymodbus' client as our link uses it."""

from __future__ import annotations

import logging
import random
import struct
from collections import deque
from types import SimpleNamespace
from typing import Any, Final

from pymodbus.client import ModbusSerialClient, ModbusTcpClient

from bench.fuzz_mutation import Source
from robot.hal.interfaces import DeviceError
from robot.hal.modbus import ModbusLink

_INPUTS: Final = 34
_COMMAND_AT: Final = 16
_UNIT: Final = 1


class _TcpFarEnd(ModbusTcpClient):
    """pymodbus' own TCP client; only the socket under it is replaced."""

    def __init__(self) -> None:
        super().__init__("memory", timeout=0.0, retries=0)
        self.waiting: deque[bytes] = deque()

    def connect(self) -> bool:
        """Always there; every connection counts its telegrams anew."""
        self.socket = self.socket or _NO_SOCKET
        return True

    def close(self) -> None:
        """Forget what was not read."""
        self.socket = None
        self.waiting.clear()

    def send(self, request: Any, addr: Any = None) -> int:
        """Nobody reads it."""
        return len(request)

    def recv(self, size: int | None) -> bytes:
        """The next piece of the reply; b"" when the time-out is over."""
        return self.waiting.popleft() if self.waiting else b""


class _SerialFarEnd(ModbusSerialClient):
    """The same for RTU."""

    def __init__(self) -> None:
        super().__init__("/dev/null", timeout=0.0, retries=0)
        self.waiting: deque[bytes] = deque()

    def connect(self) -> bool:
        """Always there."""
        self.socket = self.socket or _NO_SOCKET
        return True

    def close(self) -> None:
        """Forget what was not read."""
        self.socket = None
        self.waiting.clear()

    def send(self, request: bytes, addr: Any = None) -> int:
        """Nobody reads it."""
        return len(request)

    def recv(self, size: int | None) -> bytes:
        """The next piece."""
        return self.waiting.popleft() if self.waiting else b""


_NO_SOCKET: Any = SimpleNamespace(close=lambda: None)

_PDUS: Final = (
    bytes([4, 68]) + struct.pack(">34H", 0x4152, 1, 1, 1, 0, 0, 7, 3, 3, 1, *range(24)),
    bytes([4, 20]) + struct.pack(">10H", 0x4152, 1, 1, 1, 0, 0, 7, 3, 3, 1),
    bytes([3, 8]) + struct.pack(">4H", 7, 0x5242, 100, 300),
    bytes([2, 1, 0x11]),
    bytes([1, 1, 0x10]),
    struct.pack(">BHH", 15, 0, 2),
    struct.pack(">BHH", 16, 16, 16),
    *(
        bytes([0x80 | function, code])
        for function, code in ((4, 2), (2, 4), (16, 3), (15, 6), (3, 11), (1, 99))
    ),
)


class ModbusReplies:
    """`ModbusLink` over pymodbus' framer and decoder; the reply is the input, cut in two now and then.

    The first byte says which question is asked. Whatever comes, only DeviceError may, or the asked-for count.
    """

    documented: tuple[type[Exception], ...] = ()

    def __init__(self, rtu: bool) -> None:
        logging.getLogger("pymodbus").setLevel(logging.CRITICAL)
        self.name = "modbus-rtu" if rtu else "modbus-tcp"
        self._client: Any = _SerialFarEnd() if rtu else _TcpFarEnd()
        frames = [_rtu(pdu) if rtu else _tcp(pdu) for pdu in _PDUS]
        questions = (0, 1, 2, 3, 4, 5, 6, 0, 3, 6, 5, 2, 4)
        self._source = Source(
            [bytes([question]) + reply for question, reply in zip(questions, frames, strict=True)],
            mend=_mend_rtu if rtu else _mend_tcp,
            longest=2000,
        )

    def draw(self, rng: random.Random) -> bytes:
        """A question's number and the reply to it."""
        return self._source.draw(rng)

    def take(self, data: bytes) -> bool:
        """Ask, and see what the link makes of the answer."""
        client = self._client
        client.close()
        client.connect()
        client.transaction.next_tid = 0
        reply = data[1:]
        cut = len(reply) // 2 if len(data) % 3 == 0 else len(reply)
        client.waiting.extend(piece for piece in (reply[:cut], reply[cut:]) if piece)
        link = ModbusLink(client, "the fuzzed one")
        try:
            _ask(link, data[0] if data else 0)
        except DeviceError as error:
            if "\n" in str(error):
                raise AssertionError("words of more than one line") from error
            return False
        return True


def _ask(link: ModbusLink, question: int) -> None:
    match question % 7:
        case 0:
            _are_words(link.read_inputs(_UNIT, 0, _INPUTS, 0.0), _INPUTS)
        case 1:
            _are_words(link.read_inputs(_UNIT, 0, 10, 0.0), 10)
        case 2:
            _are_words(link.read_holdings(_UNIT, 0, 4, 0.0), 4)
        case 3:
            assert len(link.read_discretes(_UNIT, 0, 7, 0.0)) == 7
        case 4:
            assert len(link.read_coils(_UNIT, 0, 8, 0.0)) == 8
        case 5:
            link.write_coils(_UNIT, 0, [False, True], 0.0)
        case _:
            link.write_holdings(_UNIT, _COMMAND_AT, [0] * 16, 0.0)


def _are_words(values: list[int], count: int) -> None:
    assert len(values) == count, "not as many registers as were asked for"
    assert all(0 <= value <= 0xFFFF for value in values), "no registers"


# ------------------------------------------------------------------------------------------------ framing


def _tcp(pdu: bytes) -> bytes:
    return struct.pack(">HHHB", 1, 0, len(pdu) + 1, _UNIT) + pdu


def _rtu(pdu: bytes) -> bytes:
    body = bytes([_UNIT]) + pdu
    return body + _crc(body)


def _mend_tcp(rng: random.Random, data: bytes) -> bytes:
    """The question, then the right head before whatever the PDU became."""
    return data[:1] + _tcp(data[8:260])


def _mend_rtu(rng: random.Random, data: bytes) -> bytes:
    return data[:1] + data[1:-2] + _crc(data[1:-2])


def _crc(data: bytes) -> bytes:
    """Modbus' CRC-16, little-endian, bit by bit."""
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    return register.to_bytes(2, "little")
