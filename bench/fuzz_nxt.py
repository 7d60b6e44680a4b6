"""The brick's parsers under fuzz: replies, the client on a link that lies, serial framing, the emulator."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from bench.fuzz_harness import InvalidMotionError
from bench.fuzz_mutation import Source
from robot.hal.interfaces import DeviceError
from robot.hal.links import MemoryLink
from robot.hal.nxt import lcp
from robot.hal.nxt.brick import Brick
from robot.hal.nxt.serial import SerialLink
from robot.sim.brick_emulator import BrickEmulator
from robot.sim.brick_inputs import Sensor, TouchSensor, UltrasonicSensor
from robot.sim.motor import FreeMotor

_TELEGRAM_MAX: Final = 64

_REQUESTS: Final[tuple[lcp.Request[Any], ...]] = (
    lcp.hold(1),
    lcp.get_output_state(1),
    lcp.reset_motor_position(1, True),
    lcp.reset_count(1),
    lcp.get_battery_level(),
    lcp.keep_alive(),
    lcp.stop_program(),
    lcp.get_version(),
    lcp.get_device_info(),
    lcp.set_input_mode(1, 1, 0x20),
    lcp.get_input_values(1),
    lcp.ls_get_status(1),
    lcp.ls_write(1, b"\x02\x42", 1),
    lcp.ls_read(1),
)

# Written out here, not built by the driver: what a brick answers on the bench.
_REPLIES: Final = tuple(
    bytes.fromhex(text)
    for text in (
        "020400",
        "020600 01 32 07 01 00 20 5a000000 10270000 f0d8ffff 00000080",
        "020a00",
        "022100",
        "020b00 b81e",
        "020d00 c0270900",
        "020100",
        "0201ec",
        "028800 7c01 1d01",
        "029b00 4e58540000000000000000000000 00 00165312345600 00000000 486b0100",
        "020500",
        "020700 01 01 00 01 20 ff03 ff03 0100 0000",
        "020e00 01",
        "020e20",
        "020f00",
        "021000 01 2a000000000000000000000000000000",
        "0206c0",
        "0210dd",
    )
)

_TELEGRAMS: Final = tuple(
    bytes.fromhex(text)
    for text in (
        "0000 6d6f76652e72786500",
        "0001",
        "8003 b801 f401",
        "8004 01 32 07 01 00 20 5a000000",
        "0004 ff 00 07 01 00 20 00000000",
        "0004 02 9c 07 02 64 10 ffffffff",
        "0005 03 0b 00",
        "0006 01",
        "0007 00",
        "0008 00",
        "0009 00 03 616200",
        "000a 01 01",
        "000b",
        "000c",
        "000d",
        "000e 03",
        "000f 03 02 01 02 42",
        "0010 03",
        "0011",
        "0013 00 01 01",
        "0021 ff",
        "0188",
        "019b",
    )
)


class LcpReplies:
    """`Request.parse` of every request; the input is one reply."""

    name = "lcp"
    documented: tuple[type[Exception], ...] = ()

    def __init__(self) -> None:
        self._source = Source(_REPLIES, longest=400)

    def draw(self, rng: random.Random) -> bytes:
        """A reply."""
        return self._source.draw(rng)

    def take(self, data: bytes) -> bool:
        """Let each request read it; only the one it answers may accept it."""
        readers = [request.name for request in _REQUESTS if self._is_read(request, data)]
        opcodes = {request.telegram[1] for request in _REQUESTS if request.name in readers}
        assert len(opcodes) <= 1, f"one reply answers {readers}"
        assert not readers or data[:3] == bytes([2, *opcodes, 0]), "accepted without the head of a good reply"
        return bool(readers)

    def _is_read(self, request: lcp.Request[Any], data: bytes) -> bool:
        try:
            request.parse(data)
        except DeviceError:
            return False
        return True


_ASKS: Final[tuple[Callable[[Brick], object], ...]] = (
    lambda brick: brick.output_state(1),
    lambda brick: brick.battery_mv(),
    lambda brick: brick.keep_alive(),
    lambda brick: brick.version(),
    lambda brick: brick.device_info(),
    lambda brick: brick.stop_program(),
    lambda brick: brick.input_values(1),
    lambda brick: brick.ls_ready_bytes(1),
    lambda brick: brick.ls_read(1),
    lambda brick: brick.reset_count(1),
    lambda brick: brick.set_input_mode(1, 1, 0x20),
)


class BrickClient:
    """`Brick` on a link that answers with the input: telegrams in a row, each behind a length byte.

    Every request is asked once; one telegram answers one request.
    """

    name = "brick"
    documented: tuple[type[Exception], ...] = ()

    def __init__(self) -> None:
        self._source = Source(_REPLIES, longest=255)

    def draw(self, rng: random.Random) -> bytes:
        """Two to five replies."""
        replies = (self._source.draw(rng) for _ in range(2 + rng.getrandbits(2)))
        return b"".join(bytes([len(reply)]) + reply for reply in replies)

    def take(self, data: bytes) -> bool:
        """Ask all there is to ask, as often as replies are there."""
        telegrams = deque(_split(data))
        brick = Brick(MemoryLink(lambda _: telegrams.popleft() if telegrams else None))
        accepted = False
        for ask in _ASKS[len(data) % len(_ASKS) :] + _ASKS[: len(data) % len(_ASKS)]:
            if not telegrams:
                break
            try:
                ask(brick)
                accepted = True
            except DeviceError:
                continue
        return accepted


class SerialFraming:
    """`SerialLink.read` on a port that delivers the input piece by piece."""

    name = "nxt-serial"
    documented: tuple[type[Exception], ...] = ()

    def __init__(self) -> None:
        framed = [len(reply).to_bytes(2, "little") + reply for reply in _REPLIES]
        self._source = Source([*framed, b"".join(framed[:4]), b"".join(framed[4:9])])

    def draw(self, rng: random.Random) -> bytes:
        """Telegrams behind their lengths."""
        return self._source.draw(rng)

    def take(self, data: bytes) -> bool:
        """Read all; out of step the link is opened anew, as the driver does."""
        port = _DrippingPort(data)
        link = SerialLink(lambda: port)
        accepted = False
        # Each look takes a byte at least, or the link starts anew, or nothing is left.
        for _ in range(4 * len(data) + 4):
            try:
                telegram = link.read(0.0)
            except DeviceError:
                link.write(b"")
                continue
            if telegram is None and not port.left:
                return accepted
            if telegram is not None:
                assert 1 <= len(telegram) <= _TELEGRAM_MAX, f"a telegram of {len(telegram)} bytes"
                accepted = True
        raise AssertionError("the link does not come to the end of what came")


class _DrippingPort:
    """Like serial.Serial: gives at most what is asked for, often less."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0
        self.timeout = 0.0

    @property
    def left(self) -> int:
        """Bytes not yet read."""
        return len(self._data) - self._at

    def read(self, size: int) -> bytes:
        assert 0 < size <= _TELEGRAM_MAX + 2, f"asked for {size} bytes at once"
        piece = self._data[self._at : self._at + (size if self._at % 3 else (size + 1) // 2)]
        self._at += len(piece)
        return piece

    def write(self, data: bytes) -> int:
        return len(data)

    def close(self) -> None:
        """Nothing is held."""


class Emulator:
    """`BrickEmulator.handle`: telegrams behind a length byte, a little time after each."""

    name = "brick-emulator"
    documented: tuple[type[Exception], ...] = ()

    def __init__(self) -> None:
        self._source = Source(_TELEGRAMS, longest=200)
        self._rng = np.random.default_rng(1)
        self._motors = [None, FreeMotor(self._rng), FreeMotor(self._rng)]

    def draw(self, rng: random.Random) -> bytes:
        """One to four telegrams."""
        telegrams = (self._source.draw(rng) for _ in range(1 + rng.getrandbits(2)))
        return b"".join(bytes([len(telegram)]) + telegram for telegram in telegrams)

    def take(self, data: bytes) -> bool:
        """A fresh brick hears them; it may only switch an output on for a SETOUTPUTSTATE among them."""
        sensors: dict[int, Sensor] = {0: TouchSensor(), 3: UltrasonicSensor(73)}
        brick = BrickEmulator(self._motors, self._rng, sensors=sensors)
        accepted = may_turn = False
        for telegram in _split(data):
            reply = brick.handle(telegram)
            assert reply is None or (3 <= len(reply) <= _TELEGRAM_MAX and reply[0] == 2), "no LCP reply"
            accepted = accepted or (reply is not None and reply[2] == 0)
            may_turn = may_turn or _sets_output(telegram)
            brick.advance(0.002)
        if not may_turn and any(_is_on(brick, port) for port in range(3)):
            raise InvalidMotionError("an output is on without a SETOUTPUTSTATE")
        return accepted


def _is_on(brick: BrickEmulator, port: int) -> bool:
    """True if the brick says of an output that its mode has the bit for on."""
    reply = brick.handle(bytes([0x00, 0x06, port]))
    return reply is not None and len(reply) == 25 and bool(reply[5] & 1)


def _sets_output(telegram: bytes) -> bool:
    """A whole SETOUTPUTSTATE for a port that is there, that switches an output on."""
    if not 12 <= len(telegram) <= _TELEGRAM_MAX or telegram[0] not in (0x00, 0x80) or telegram[1] != 0x04:
        return False
    return telegram[2] in (0, 1, 2, 0xFF) and bool(telegram[4] & 1)


def _split(data: bytes) -> list[bytes]:
    """Telegrams behind a length byte each; the last may be cut short."""
    telegrams = []
    at = 0
    while at < len(data):
        length = data[at]
        telegrams.append(data[at + 1 : at + 1 + length])
        at += 1 + length
    return telegrams
