"""Binary teleop frames: exact bytes, what is refused, sequence numbers, neutral first."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.hal.teleop.frames import (
    NO_BUTTONS,
    Button,
    Status,
    Sticks,
    cobs_decode,
    cobs_encode,
    crc16,
    decode,
    encode_status,
    encode_sticks,
)
from robot.hal.teleop.sticks import Sequence, Stick
from robot.hal.teleop.talkers import FrameTalker

BODIES = st.binary(max_size=254)


def slow_crc(data: bytes) -> int:
    """CRC-16/CCITT-FALSE bit by bit, as its definition says."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1) ^ 0x1021 if crc & 0x8000 else crc << 1
            crc &= 0xFFFF
    return crc


def hand_made(version=1, kind=1, seq=7, v=16384, w=-32767, buttons=1) -> bytes:  # type: ignore[no-untyped-def]
    """A stuffed command built without the codec under test."""
    axes = b"".join(axis.to_bytes(2, "little", signed=True) for axis in (v, w, 0, 0))
    content = bytes([version, kind]) + seq.to_bytes(2, "little") + axes + buttons.to_bytes(2, "little")
    body = content + slow_crc(content).to_bytes(2, "little")
    out = b""
    for part in body.split(b"\0"):
        out += bytes([len(part) + 1]) + part
    return out


def test_a_command_is_these_bytes() -> None:
    frame = encode_sticks(Sticks(seq=1, v=1.0, w=-1.0, buttons=Button.TAKE))
    assert frame.hex(" ") == "00 04 01 01 01 05 ff 7f 01 80 01 01 01 02 02 03 de 40 00"
    assert frame[0] == frame[-1] == 0
    assert 0 not in frame[1:-1]


def test_a_hand_made_command_is_understood() -> None:
    sticks = decode(hand_made())
    assert isinstance(sticks, Sticks)
    assert (sticks.seq, sticks.buttons, sticks.hello) == (7, Button.STOP, False)
    assert (sticks.v, sticks.w) == (pytest.approx(0.5, abs=1e-4), -1.0)
    assert decode(hand_made(kind=3)).hello  # type: ignore[union-attr]
    assert decode(hand_made(v=-32768)).v == -1.0  # type: ignore[union-attr]
    assert decode(hand_made(buttons=0xFFF0)).buttons == NO_BUTTONS  # type: ignore[union-attr]


@pytest.mark.parametrize("wrong", [{"version": 0}, {"version": 2}, {"kind": 0}, {"kind": 4}, {"kind": 255}])
def test_wrong_version_or_type_is_refused(wrong) -> None:  # type: ignore[no-untyped-def]
    assert decode(hand_made(**wrong)) is None


def test_every_flipped_bit_is_noticed() -> None:
    stuffed = hand_made()
    for bit in range(len(stuffed) * 8):
        broken = bytearray(stuffed)
        broken[bit // 8] ^= 1 << bit % 8
        assert decode(bytes(broken)) is None


def test_status_carries_text_and_delay() -> None:
    status = Status(seq=3, heard=65535, age_ms=12, text="teleop  v +0.12 µ")
    assert decode(encode_status(status)[1:-1]) == status
    long = decode(encode_status(Status(1, 2, 10**9, "x" * 1000))[1:-1])
    assert isinstance(long, Status)
    assert long.age_ms == 65535
    assert len(long.text) > 200


@given(BODIES)
@settings(max_examples=60, deadline=None)
def test_stuffing_leaves_no_zero_and_can_be_undone(body: bytes) -> None:
    stuffed = cobs_encode(body)
    assert 0 not in stuffed
    assert len(stuffed) == len(body) + 1
    assert cobs_decode(stuffed) == body


def test_stuffing_as_published() -> None:
    assert cobs_encode(b"\0") == b"\x01\x01"
    assert cobs_encode(b"\0\0") == b"\x01\x01\x01"
    assert cobs_encode(bytes.fromhex("11000000")) == bytes.fromhex("0211010101")
    assert cobs_encode(bytes(range(1, 255))) == b"\xff" + bytes(range(1, 255))
    with pytest.raises(ValueError, match="254"):
        cobs_encode(bytes(255))


@given(st.binary(max_size=300))
@settings(max_examples=60, deadline=None)
def test_any_bytes_may_come(data: bytes) -> None:
    cobs_decode(data)
    assert decode(data) is None
    assert crc16(data) == slow_crc(data)


# ------------------------------------------------------------------------------------------------ sessions


def test_only_newer_numbers_count_round_the_corner() -> None:
    heard = Sequence(16).after(65530, 1.0)
    assert [heard.is_new(seq, 1.1) for seq in (65530, 65529, 65531, 5, 32762, 32761)] == [
        *(False, False, True, True),
        *(False, True),
    ]
    assert heard.is_new(65000, 2.01)
    assert not heard.is_new(65000, 1.99)


def say(talker: FrameTalker, seq: int, now: float, v: float = 0.0, buttons: Button = NO_BUTTONS):  # type: ignore[no-untyped-def]
    return talker.said(Sticks(seq, v, 0.0, buttons), now)


def test_stale_and_repeated_frames_are_dropped() -> None:
    talker = FrameTalker()
    assert say(talker, 10, 0.0) is not None
    assert say(talker, 11, 0.05, v=1.0).v == 1.0
    assert say(talker, 11, 0.1) is None
    assert say(talker, 9, 0.15) is None
    assert say(talker, 12, 0.2).v == 0.0


def test_a_hello_begins_a_session_whatever_the_numbers() -> None:
    talker = FrameTalker()
    say(talker, 5000, 0.0)
    assert talker.said(Sticks(0, hello=True), 0.1) is None
    assert say(talker, 1, 0.15) is not None
    assert talker.heard == (1, 0.15)


def test_a_session_begins_with_the_stick_let_go() -> None:
    talker = FrameTalker()
    assert say(talker, 1, 0.0, v=1.0).v == 0.0
    assert say(talker, 2, 0.05, v=1.0, buttons=Button.TAKE).take is False
    assert say(talker, 3, 0.1).v == 0.0
    assert say(talker, 4, 0.15, v=1.0).v == 1.0
    assert say(talker, 5, 0.54, v=1.0).v == 1.0, "within 0.4 s"
    assert say(talker, 6, 0.95, v=1.0).v == 0.0, "after a silence the stick must be let go first"
    assert say(talker, 7, 1.0).v == 0.0
    assert say(talker, 8, 1.05, v=-1.0).v == -1.0


def test_buttons_act_when_pressed_and_stop_while_it_is_down() -> None:
    talker = FrameTalker()
    words = [say(talker, seq, seq * 0.05, buttons=Button.TAKE) for seq in (1, 2, 3)]
    assert [word.take for word in words] == [True, False, False]
    assert say(talker, 4, 0.2).take is False
    assert say(talker, 5, 0.25, buttons=Button.GIVE).arm
    assert say(talker, 6, 0.3, buttons=Button.RELEASE).release
    both = [
        say(talker, seq, seq * 0.05, v=1.0, buttons=Button.STOP | Button.TAKE | Button.GIVE) for seq in (7, 8)
    ]
    assert [(word.stop, word.v, word.take, word.arm) for word in both] == [(True, 0.0, False, False)] * 2


def test_a_deflected_stick_cannot_take() -> None:
    talker = FrameTalker()
    say(talker, 1, 0.0)
    assert say(talker, 2, 0.05, v=0.5, buttons=Button.TAKE).take is False
    assert Stick().moved(0.5, 0.0, 1.0).may_take(1.1) is False
    assert Stick().moved(0.5, 0.0, 1.0).may_take(1.5) is True
