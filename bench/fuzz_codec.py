"""Binary frames and MAVLink messages, read and written for the fuzz bench only.

Slow and simple on purpose; shares nothing with robot/hal/teleop, so that the two are independent readings.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Final

COMMAND, HELLO, STATUS = 1, 3, 2
TAKE, RELEASE, GIVE = 2, 4, 8
HEARTBEAT, MANUAL_CONTROL, COMMAND_LONG, STATUSTEXT = 0, 69, 76, 253
CRC_EXTRA: Final = {HEARTBEAT: 50, MANUAL_CONTROL: 243, COMMAND_LONG: 152, 77: 143, STATUSTEXT: 83}


@dataclass(frozen=True, slots=True)
class Frame:
    """A valid binary frame: where it lies, its sticks -32767..32767 and buttons (0 for a status)."""

    start: int
    end: int
    kind: int
    v: int = 0
    w: int = 0
    buttons: int = 0


@dataclass(frozen=True, slots=True)
class Message:
    """A MAVLink message whose checksum is right (or cannot be known: number -1)."""

    start: int
    end: int
    number: int
    sender: tuple[int, int]
    payload: bytes


# ------------------------------------------------------------------------------------------------- frames


@lru_cache(maxsize=8)
def frames(stream: bytes) -> tuple[Frame, ...]:
    """Every valid frame between two neighbouring zeros; zeros before it are its own."""
    return tuple(_frames(stream))


def _frames(stream: bytes) -> Iterator[Frame]:
    zeros = [at for at, byte in enumerate(stream) if byte == 0]
    for left, right in pairwise(zeros):
        body = unstuffed(stream[left + 1 : right])
        if len(body) < 6 or body[0] != 1 or _ccitt(body[:-2]) != body[-2:]:
            continue
        while left > 0 and stream[left - 1] == 0:
            left -= 1
        if body[1] in (COMMAND, HELLO) and len(body) == 16:
            v, w, _, _, buttons = struct.unpack_from("<4hH", body, 4)
            yield Frame(left, right + 1, body[1], v, w, buttons)
        elif body[1] == 2 and len(body) >= 10:
            yield Frame(left, right + 1, 2)


def unstuffed(stuffed: bytes) -> bytes:
    """COBS undone byte by byte; empty for what is none."""
    if not 0 < len(stuffed) <= 255:
        return b""
    body = bytearray()
    left = stuffed[0] - 1
    for byte in stuffed[1:]:
        if left == 0:
            body.append(0)
            left = byte - 1
        else:
            body.append(byte)
            left -= 1
    return bytes(body) if left == 0 else b""


def _ccitt(content: bytes) -> bytes:
    """CRC-16 bit by bit, little-endian."""
    register = 0xFFFF
    for byte in content:
        for bit in range(7, -1, -1):
            top = (register >> 15) ^ (byte >> bit & 1)
            register = (register << 1 & 0xFFFF) ^ (0x1021 if top else 0)
    return register.to_bytes(2, "little")


def frame(kind: int, seq: int, v: int = 0, w: int = 0, buttons: int = 0) -> bytes:
    """A valid command or hello on the wire."""
    return framed(struct.pack("<BBH4hH", 1, kind, seq & 0xFFFF, v, w, 0, 0, buttons))


def framed(content: bytes) -> bytes:
    """Content with a right CRC, stuffed, between delimiters."""
    checked = content + _ccitt(content)
    return b"\0" + b"".join(bytes([len(p) + 1]) + p for p in checked[:254].split(b"\0")) + b"\0"


# ----------------------------------------------------------------------------------------------- MAVLink


@lru_cache(maxsize=8)
def messages(stream: bytes, edges: frozenset[int]) -> tuple[Message, ...]:
    """Every message with a right checksum, wherever it begins.

    One of an unknown number cannot be checked: it counts if it ends with a chunk or before another start.
    edges: where chunks end in the stream.
    """
    return tuple(_messages(stream, edges))


def _messages(stream: bytes, edges: frozenset[int]) -> Iterator[Message]:
    for start, byte in enumerate(stream):
        if byte not in (0xFE, 0xFD):
            continue
        head = 6 if byte == 0xFE else 10
        if len(stream) < start + head:
            continue
        length = stream[start + 1]
        signed = byte == 0xFD and stream[start + 2] & 1
        if byte == 0xFD and stream[start + 2] > 1:
            continue
        end = start + head + length + 2 + (13 if signed else 0)
        if end > len(stream):
            continue
        at = start + (3 if byte == 0xFE else 5)
        sender = stream[at], stream[at + 1]
        number = (
            stream[start + 5] if byte == 0xFE else int.from_bytes(stream[start + 7 : start + 10], "little")
        )
        payload = stream[start + head : start + head + length]
        check = stream[start + head + length : start + head + length + 2]
        extra = CRC_EXTRA.get(number)
        if extra is None:
            if end in edges or stream[end] in (0, 0xFD, 0xFE):
                yield Message(start, end, -1, sender, b"")
        elif x25(stream[start + 1 : start + head + length] + bytes([extra])) == check:
            yield Message(start, end, number, sender, payload)


def x25(data: bytes) -> bytes:
    """The checksum of MAVLink's own C library, in its shifts, little-endian."""
    register = 0xFFFF
    for byte in data:
        low = byte ^ (register & 0xFF)
        low ^= low << 4 & 0xFF
        register = (register >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4)
        register &= 0xFFFF
    return register.to_bytes(2, "little")


def message(
    number: int, payload: bytes, seq: int, version: int, sender: tuple[int, int] = (255, 190)
) -> bytes:
    """A valid message on the wire; in version 2 without the zeros at its end."""
    if version == 1:
        head = bytes([len(payload), seq & 0xFF, *sender, number & 0xFF])
        start = b"\xfe"
    else:
        payload = payload.rstrip(b"\0") or b"\0"
        head = bytes([len(payload), 0, 0, seq & 0xFF, *sender]) + number.to_bytes(3, "little")
        start = b"\xfd"
    return start + head + payload + x25(head + payload + bytes([CRC_EXTRA[number]]))
