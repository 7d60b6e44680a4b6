"""What a teleop stream really holds: an independent reading of the three ways to speak.

It is slow and simple on purpose, shares nothing with robot/hal/teleop, and looks at the whole stream at once.
It decides whether a word that moves, takes or gives had a valid frame, message or clean burst of keys before.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from bench.fuzz_codec import (
    COMMAND,
    COMMAND_LONG,
    GIVE,
    HEARTBEAT,
    MANUAL_CONTROL,
    TAKE,
    Frame,
    Message,
    frames,
    messages,
)
from robot.messages import TeleopInput

BURST_PAUSE_S: Final = 0.010
ESCAPE_PAUSE_S: Final = 0.040
MESSAGE_PAUSE_S: Final = 0.100
MOST_KEYS: Final = 8
NEUTRAL_SHARE: Final = 0.05
GROUND_STATION, ARM_DISARM = 6, 400
_KEY: Final = re.compile(rb"\x1b\[[\x20-\x3f]*[\x40-\x7e]?|\x1bO.?|\x1b|[\x20-\x7e]", re.DOTALL)
_BEGUN: Final = re.compile(rb"\x1b(?:O|\[[\x20-\x3f]*)?\Z")
_CLEAN: Final = re.compile(rb"[\x20-\x7e\r\n\x1b]*")
_ARROWS: Final = tuple(b"\x1b" + lead + arrow for lead in (b"[", b"O") for arrow in (b"A", b"B", b"C", b"D"))
_DRIVES: Final = (b"u", b"i", b"o", b"j", b"l", b"m", b",", b".", *_ARROWS)


@dataclass(frozen=True, slots=True)
class Chunk:
    """Bytes that arrived together, seconds."""

    at: float
    data: bytes


def justified(word: TeleopInput, chunks: Sequence[Chunk]) -> bool:
    """True if this word may move, take or give after these chunks, the last of which is not after it."""
    if word.kind == "frames":
        return _by_frames(word, [frame for _, chain in _chains(chunks) for frame in frames(_joined(chain))])
    if word.kind == "mavlink":
        return _by_messages(word, [message for _, chain in _chains(chunks) for message in _heard(chain)])
    return _by_keys(word, chunks)


def _by_frames(word: TeleopInput, heard: Sequence[Frame]) -> bool:
    commands = [frame for frame in heard if frame.kind == COMMAND]
    if word.take and not any(frame.buttons & TAKE for frame in commands):
        return False
    if word.arm and not any(frame.buttons & GIVE for frame in commands):
        return False
    if not (word.v or word.w):
        return True
    for at, frame in enumerate(commands):
        same = abs(frame.v / 32767 - word.v) < 1e-4 and abs(frame.w / 32767 - word.w) < 1e-4
        if same and any(_is_let_go(c.v / 32767, c.w / 32767) for c in commands[: at + 1]):
            return True
    return False


def _by_messages(word: TeleopInput, heard: Sequence[Message]) -> bool:
    if word.arm:
        return False  # no message gives to autonomy
    if word.take and not any(_arms(message) for message in heard):
        return False
    if not (word.v or word.w):
        return True
    neutral: set[tuple[int, int]] = set()
    stations: set[tuple[int, int]] = set()
    for message in heard:
        payload = message.payload.ljust(33, b"\0")
        if message.number == HEARTBEAT and payload[4] == GROUND_STATION:
            stations.add(message.sender)
        if message.number != MANUAL_CONTROL or payload[10] not in (0, 1):
            continue
        forward, _, _, yaw = struct.unpack_from("<4h", payload)
        v, w = _stick(forward), -_stick(yaw)
        if _is_let_go(v, w):
            neutral.add(message.sender)
        knows = message.sender in stations and message.sender in neutral
        if knows and abs(v - word.v) < 1e-6 and abs(w - word.w) < 1e-6:
            return True
    return False


def _by_keys(word: TeleopInput, chunks: Sequence[Chunk]) -> bool:
    """The burst that ends with the last chunk, without the messages in it, is a few clean keys."""
    return any(_says(word, burst) for burst in _bursts(chunks))


def _says(word: TeleopInput, burst: bytes) -> bool:
    """This burst is clean and holds the key of this word. What may become one key more is not one yet."""
    if not _CLEAN.fullmatch(burst):
        return False
    keys = _KEY.findall(_BEGUN.sub(b"", burst))
    if len(keys) > MOST_KEYS:
        return False
    if word.take:
        return b"t" in keys
    if word.arm:
        return b"g" in keys
    return any(key in _DRIVES for key in keys)


def _bursts(chunks: Sequence[Chunk]) -> Iterator[bytes]:
    """The ways to read what came last without a pause: which of overlapping messages count, and whether the
    beginning of an escape sequence that came a little earlier belongs to it."""
    stream = _joined(chunks)
    begin, early = _last_burst(chunks, stream)
    for one_after_the_other in (True, False):
        belongs = bytearray(len(stream))
        for offset, chain in _chains(chunks):
            found: list[Frame | Message] = [*frames(_joined(chain)), *_heard(chain)]
            free = 0
            for piece in sorted(found, key=lambda piece: piece.start):
                if piece.start < free and one_after_the_other:
                    continue
                free = piece.end
                belongs[offset + piece.start : offset + piece.end] = b"\1" * (piece.end - piece.start)
        for first in {begin, early}:
            yield bytes(stream[at] for at in range(first, len(stream)) if not belongs[at])


def _last_burst(chunks: Sequence[Chunk], stream: bytes) -> tuple[int, int]:
    """Where it begins: by the pauses alone, and with the beginning of an escape sequence before it."""
    begin = len(stream)
    later = None
    for chunk in reversed([chunk for chunk in chunks if chunk.data]):
        if later is not None and later - chunk.at > BURST_PAUSE_S + 1e-9:
            begun = _BEGUN.search(stream, max(0, begin - 64), begin)
            soon = later - chunk.at <= ESCAPE_PAUSE_S + 1e-9
            return begin, begun.start() if begun is not None and soon else begin
        begin -= len(chunk.data)
        later = chunk.at
    return begin, begin


def _stick(value: int) -> float:
    return 0.0 if value == 0x7FFF else min(max(value / 1000.0, -1.0), 1.0)


def _is_let_go(v: float, w: float) -> bool:
    return abs(v) < NEUTRAL_SHARE and abs(w) < NEUTRAL_SHARE


def _arms(message: Message) -> bool:
    if message.number != COMMAND_LONG:
        return False
    payload = message.payload.ljust(33, b"\0")
    (first,) = struct.unpack_from("<f", payload)
    (command,) = struct.unpack_from("<H", payload, 28)
    return bool(command == ARM_DISARM and first == 1.0 and payload[30] in (0, 1))


def _joined(chunks: Sequence[Chunk]) -> bytes:
    return b"".join(chunk.data for chunk in chunks)


def _chains(chunks: Sequence[Chunk]) -> list[tuple[int, list[Chunk]]]:
    """Chunks that followed each other so quickly that a message may reach over them, and where they begin."""
    chains: list[tuple[int, list[Chunk]]] = []
    at = 0
    last = None
    for chunk in chunks:
        if last is None or chunk.at - last > MESSAGE_PAUSE_S + 1e-9:
            chains.append((at, []))
        chains[-1][1].append(chunk)
        at += len(chunk.data)
        last = chunk.at
    return chains


def _heard(chain: Sequence[Chunk]) -> list[Message]:
    edges = set()
    at = 0
    for chunk in chain:
        at += len(chunk.data)
        edges.add(at)
    return list(messages(_joined(chain), frozenset(edges)))
