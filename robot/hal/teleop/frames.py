"""Binary teleop frames: `00 COBS(body) 00`, little-endian, CRC-16/CCITT-FALSE over all before it.

    command, hello   version u8, type u8, seq u16, axes i16 x 4, buttons u16, crc u16          (16 bytes)
    status           version u8, type u8, seq u16, heard u16, age u16 (ms), text UTF-8, crc u16

Axes are -32767..32767 for -1..1: forward, left, and two that are reserved. A client sends hello once, then
commands at 20 Hz with a seq that grows by one; the robot answers with status. `heard` is the seq it heard
last and `age` how long ago, so that a client can tell the line's delay without a common clock.

Both delimiters are needed: a frame ends what was before it, and a lone key may follow it.
COBS: Cheshire and Baker, Consistent Overhead Byte Stuffing, IEEE/ACM Trans. Networking 7 (2), 1999.
"""

from __future__ import annotations

import binascii
import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Final

VERSION: Final = 1
MAX_BODY_BYTES: Final = 254
"""Of a body before stuffing; so a stuffed one has 255 at most."""

_HEADER: Final = struct.Struct("<BBH")
_STICKS: Final = struct.Struct("<4hH")
_STATUS: Final = struct.Struct("<HH")
_CRC_BYTES: Final = 2
_FULL: Final = 32767
_MAX_TEXT_BYTES: Final = MAX_BODY_BYTES - _HEADER.size - _STATUS.size - _CRC_BYTES


class FrameType(IntEnum):
    """What a frame is."""

    COMMAND = 1
    STATUS = 2
    HELLO = 3


class Button(IntFlag):
    """Bits of a command's buttons; others are ignored."""

    STOP = 1
    TAKE = 2
    RELEASE = 4
    GIVE = 8


NO_BUTTONS: Final = Button(0)


@dataclass(frozen=True, slots=True)
class Sticks:
    """A command or hello: forward and left -1..1, the buttons held down."""

    seq: int
    v: float = 0.0
    w: float = 0.0
    buttons: Button = NO_BUTTONS
    hello: bool = False


@dataclass(frozen=True, slots=True)
class Status:
    """What the robot says: a line of text, the seq it heard last and how many milliseconds ago."""

    seq: int
    heard: int
    age_ms: int
    text: str


def encode_sticks(sticks: Sticks) -> bytes:
    """The whole frame with its delimiters. Axes beyond -1..1 are clipped.

    >>> encode_sticks(Sticks(seq=1, v=1.0, buttons=Button.TAKE)).hex(" ")
    '00 04 01 01 01 03 ff 7f 01 01 01 01 01 02 02 03 f4 ac 00'
    """
    kind = FrameType.HELLO if sticks.hello else FrameType.COMMAND
    payload = _STICKS.pack(_axis(sticks.v), _axis(sticks.w), 0, 0, sticks.buttons)
    return _framed(_HEADER.pack(VERSION, kind, sticks.seq & 0xFFFF) + payload)


def encode_status(status: Status) -> bytes:
    """The whole frame with its delimiters; the text is cut to what fits."""
    text = status.text.encode("utf-8", "replace")[:_MAX_TEXT_BYTES]
    head = _HEADER.pack(VERSION, FrameType.STATUS, status.seq & 0xFFFF)
    return _framed(head + _STATUS.pack(status.heard & 0xFFFF, min(max(status.age_ms, 0), 0xFFFF)) + text)


def decode(stuffed: bytes) -> Sticks | Status | None:
    """What lies between two delimiters; None unless length, version, type and CRC are right."""
    body = cobs_decode(stuffed)
    if body is None or len(body) < _HEADER.size + _CRC_BYTES:
        return None
    content, check = body[:-_CRC_BYTES], int.from_bytes(body[-_CRC_BYTES:], "little")
    if crc16(content) != check:
        return None
    version, kind, seq = _HEADER.unpack_from(content)
    if version != VERSION:
        return None
    payload = content[_HEADER.size :]
    if kind in (FrameType.COMMAND, FrameType.HELLO) and len(payload) == _STICKS.size:
        v, w, _, _, buttons = _STICKS.unpack(payload)
        known = Button(buttons & (Button.STOP | Button.TAKE | Button.RELEASE | Button.GIVE))
        return Sticks(seq, _share(v), _share(w), known, kind == FrameType.HELLO)
    if kind == FrameType.STATUS and len(payload) >= _STATUS.size:
        heard, age_ms = _STATUS.unpack_from(payload)
        return Status(seq, heard, age_ms, payload[_STATUS.size :].decode("utf-8", "replace"))
    return None


def crc16(data: bytes) -> int:
    """CRC-16/CCITT-FALSE: polynomial 0x1021, from 0xFFFF.

    >>> hex(crc16(b"123456789"))
    '0x29b1'
    """
    return binascii.crc_hqx(data, 0xFFFF)


def cobs_encode(body: bytes) -> bytes:
    """Stuff at most 254 bytes so that no zero is left; no delimiters. Raises ValueError for a longer body.

    >>> cobs_encode(bytes.fromhex("11 22 00 33")).hex(" ")
    '03 11 22 02 33'
    """
    if len(body) > MAX_BODY_BYTES:
        raise ValueError(f"a frame's body has {MAX_BODY_BYTES} bytes at most, not {len(body)}")
    return b"".join(bytes([len(part) + 1]) + part for part in body.split(b"\0"))


def cobs_decode(stuffed: bytes) -> bytes | None:
    """Undo `cobs_encode`; None for what it cannot have made."""
    if not 0 < len(stuffed) <= MAX_BODY_BYTES + 1 or 0 in stuffed:
        return None
    parts = []
    at = 0
    while at < len(stuffed):
        code = stuffed[at]
        part = stuffed[at + 1 : at + code]
        if len(part) != code - 1:
            return None
        parts.append(part)
        at += code
    return b"\0".join(parts)


def _framed(content: bytes) -> bytes:
    return b"\0" + cobs_encode(content + crc16(content).to_bytes(_CRC_BYTES, "little")) + b"\0"


def _axis(share: float) -> int:
    if share != share:
        return 0
    return round(min(max(share, -1.0), 1.0) * _FULL)


def _share(axis: int) -> float:
    return max(axis / _FULL, -1.0)
