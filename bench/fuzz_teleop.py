"""The teleop line under fuzz: keys, frames and MAVLink mixed, cut anywhere, with any pauses between.

The one thing that counts most: no word moves, takes or gives unless the independent recogniser finds what
asked for it.
"""

from __future__ import annotations

import random
import struct
import zlib
from itertools import pairwise
from typing import Final

from bench import fuzz_codec as codec
from bench.fuzz_codec import COMMAND, COMMAND_LONG, HEARTBEAT, HELLO, MANUAL_CONTROL
from bench.fuzz_harness import InvalidMotionError
from bench.fuzz_mutation import Source
from bench.fuzz_recogniser import ARM_DISARM, Chunk, justified
from robot.hal.teleop.parser import StreamParser, parse_all
from robot.messages import TeleopInput

_PAUSES_S: Final = (
    0.0,
    0.001,
    0.008,
    0.012,
    0.03,
    0.05,
    0.09,
    0.12,
    0.3,
    0.5,
    0.9,
    1.1,
    2.0,
    3.5,
    0.004,
    0.04,
)
_LONGEST: Final = 4096
"""More at once no line delivers between two looks."""
_KEPT_BYTES: Final = 700
"""A message and a burst at most may wait in the parser."""

_KEYS: Final = (
    b"i", b"u", b"t", b"g", b"r", b" ", b"k", b"?", b"q", b"z", b"\x1b[A", b"\x1bOD", b"\x1b[1;5C", b"\x1b",
    b"ii", b"tij", b"\r", b"i\r\n", b"\x03", b"iiiiiiiii", b"y", b"\x7f",
)  # fmt: skip


class Teleop:
    """`StreamParser.feed` and `parse_all`; keys and binary frames."""

    name = "teleop"
    documented: tuple[type[Exception], ...] = ()

    def __init__(self) -> None:
        self._source = Source(_key_and_frame_streams(), mend=_mend, longest=_LONGEST)

    def draw(self, rng: random.Random) -> bytes:
        """A stream."""
        return self._source.draw(rng)

    def take(self, data: bytes) -> bool:
        """Feed it in pieces, and once whole; True if any word came out."""
        whole = parse_all(data)
        for word in whole:
            _check(word, (Chunk(0.0, data),))
        return _fed(data) or bool(whole)


class Mavlink(Teleop):
    """The same parser; MAVLink messages, with keys and frames between."""

    name = "mavlink"

    def __init__(self) -> None:
        self._source = Source(_mavlink_streams(), mend=_mend, longest=_LONGEST)


def pieces(data: bytes) -> list[Chunk]:
    """Cuts and pauses that follow from the bytes alone, so that the input says all."""
    dice = zlib.crc32(data)
    cuts = sorted({0, len(data), *((dice >> shift) % (len(data) + 1) for shift in (0, 7, 13)[: dice % 4])})
    chunks = []
    now = 0.0
    for number, (start, end) in enumerate(pairwise(cuts)):
        chunks.append(Chunk(now, data[start:end]))
        now += _PAUSES_S[dice >> (4 * number + 9) & 15]
    return chunks


def _fed(data: bytes) -> bool:
    parser = StreamParser()
    chunks: list[Chunk] = []
    any_word = False
    for chunk in pieces(data):
        for at, piece in ((chunk.at, b""), (chunk.at, chunk.data)):
            words = parser.feed(piece, at)
            any_word = any_word or bool(words)
            if piece:
                chunks.append(chunk)
            for word in words:
                _check(word, chunks)
    last = (chunks[-1].at if chunks else 0.0) + 1.0
    for word in parser.feed(b"", last):
        _check(word, chunks)
    kept = len(parser._buffer) + len(parser._burst)
    assert kept <= _KEPT_BYTES, f"{kept} bytes are kept"
    return any_word


def _check(word: TeleopInput, chunks: tuple[Chunk, ...] | list[Chunk]) -> None:
    assert max(abs(word.v), abs(word.w)) <= 1.0, f"axes out of range: {word}"
    assert not (word.stop and (word.v or word.w or word.take or word.arm)), f"stops and goes: {word}"
    if (word.v or word.w or word.take or word.arm) and not justified(word, chunks):
        raise InvalidMotionError(f"{word}, but nothing valid asked for it")


# ------------------------------------------------------------------------------------------------- corpora


def _key_and_frame_streams() -> list[bytes]:
    frame = codec.frame
    full = 32767
    session = [
        frame(HELLO, 1),
        frame(COMMAND, 2),
        frame(COMMAND, 3, buttons=2),
        frame(COMMAND, 4, v=full),
        frame(COMMAND, 5, v=-full, w=full // 3),
        frame(COMMAND, 6, v=900, w=-900),
        frame(COMMAND, 7, v=full, buttons=1),
        frame(COMMAND, 8, buttons=8),
        frame(COMMAND, 9, buttons=4),
    ]
    status = codec.framed(struct.pack("<BBHHH", 1, 2, 7, 3, 40) + b"search 0.2 m/s")
    return [
        *_KEYS,
        *session,
        status,
        b"".join(session[1:4]),
        b"".join(session),
        session[1] + session[3] + b"i",
        session[3] + session[1] + session[4],
        b"ij" + session[1] + b"l",
        b"\0\0" + session[1] + session[3],
        frame(COMMAND, 65535) + frame(COMMAND, 0, v=full),
    ]


def _mavlink_streams() -> list[bytes]:
    streams: list[bytes] = []
    for version in (1, 2):

        def message(number: int, payload: bytes, seq: int, version: int = version) -> bytes:
            return codec.message(number, payload, seq, version)

        heartbeat = message(HEARTBEAT, struct.pack("<IBBBBB", 0, 6, 8, 0, 4, 3), 1)
        other = message(HEARTBEAT, struct.pack("<IBBBBB", 0, 10, 3, 0, 4, 3), 1)
        neutral = message(MANUAL_CONTROL, struct.pack("<hhhhHB", 0, 0, 500, 0, 0, 1), 2)
        ahead = message(MANUAL_CONTROL, struct.pack("<hhhhHB", 800, 0, 500, -300, 0, 1), 3)
        strange = message(MANUAL_CONTROL, struct.pack("<hhhhHB", 0x7FFF, 0, 0, -32768, 0, 0), 4)
        arm = message(COMMAND_LONG, _command(ARM_DISARM, 1.0), 5)
        disarm = message(COMMAND_LONG, _command(ARM_DISARM, 0.0), 6)
        forced = message(COMMAND_LONG, _command(ARM_DISARM, 0.0, 21196.0), 7)
        unknown = message(COMMAND_LONG, _command(512, 148.0), 8)
        text = message(253, bytes([6]) + b"Hello".ljust(50, b"\0"), 9)
        streams += [
            heartbeat, neutral, ahead, arm, disarm, forced, unknown, text, b"i", b" ",
            heartbeat + neutral + ahead, heartbeat + neutral + ahead + strange,
            heartbeat + neutral + arm + ahead, other + neutral + ahead,
            heartbeat + ahead + neutral, heartbeat + arm + disarm,
            heartbeat + neutral + b"i" + ahead, codec.frame(COMMAND, 1) + heartbeat + neutral + ahead,
        ]  # fmt: skip
    signed = bytearray(codec.message(MANUAL_CONTROL, struct.pack("<hhhhHB", 1, 0, 0, 0, 0, 1), 1, 2))
    signed[2] = 1
    return [*streams, bytes(signed) + bytes(13)]


def _command(command: int, first: float, second: float = 0.0) -> bytes:
    return struct.pack("<7fHBBB", first, second, 0, 0, 0, 0, 0, command, 1, 1, 0)


def _mend(rng: random.Random, data: bytes) -> bytes:
    """Give what begins like a frame or a message somewhere a right checksum."""
    starts = [at for at, byte in enumerate(data[:400]) if byte in (0, 0xFD, 0xFE)]
    if not starts:
        return data
    at = rng.choice(starts)
    if data[at] == 0:
        end = data.find(0, at + 1)
        body = b"" if end < 0 else codec.unstuffed(data[at + 1 : end])
        return data if len(body) < 3 else data[:at] + codec.framed(body[:-2]) + data[end + 1 :]
    head = 6 if data[at] == 0xFE else 10
    if len(data) < at + head:
        return data
    number = data[at + 5] if head == 6 else int.from_bytes(data[at + 7 : at + 10], "little")
    end = at + head + data[at + 1]
    extra = codec.CRC_EXTRA.get(number, 0)
    return data[:end] + codec.x25(data[at + 1 : end] + bytes([extra])) + data[end + 2 :]
