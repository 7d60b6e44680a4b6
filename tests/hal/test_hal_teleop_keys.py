"""Keys of a bare terminal, and what is noise instead."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.hal.teleop.frames import Sticks, encode_sticks
from robot.hal.teleop.keys import HELP, Speeds, read_burst
from robot.hal.teleop.parser import StreamParser, parse_all

PRINTABLE = [chr(code) for code in range(0x20, 0x7F)]
DRIVING = "uiojlm,."
QUIET = "qzwxec?"  # speeds and help: neither drive nor stop
ASKING = "trg"


def moves(words) -> bool:  # type: ignore[no-untyped-def]
    return any(word.v or word.w for word in words)


def stops(words) -> bool:  # type: ignore[no-untyped-def]
    return any(word.stop for word in words)


@pytest.mark.parametrize(
    ("key", "v", "w"),
    [
        ("u", 0.5, 0.5),
        ("i", 0.5, 0.0),
        ("o", 0.5, -0.5),
        ("j", 0.0, 0.5),
        ("l", 0.0, -0.5),
        ("m", -0.5, -0.5),
        (",", -0.5, 0.0),
        (".", -0.5, 0.5),
        ("\x1b[A", 0.5, 0.0),
        ("\x1b[B", -0.5, 0.0),
        ("\x1b[C", 0.0, -0.5),
        ("\x1b[D", 0.0, 0.5),
        ("\x1bOA", 0.5, 0.0),
        ("i\r\n", 0.5, 0.0),
    ],
)
def test_keys_that_drive(key: str, v: float, w: float) -> None:
    (word,) = parse_all(key.encode())
    assert (word.v, word.w, word.kind) == (v, w, "keys")
    assert not any((word.stop, word.take, word.release, word.arm))


def test_keys_that_ask() -> None:
    assert [parse_all(key)[0].take for key in (b"t",)] == [True]
    assert parse_all(b"r")[0].release
    assert parse_all(b"g")[0].arm


@pytest.mark.parametrize("key", [key for key in PRINTABLE if key not in DRIVING + QUIET + ASKING])
def test_every_other_key_stops(key: str) -> None:
    (word,) = parse_all(key.encode())
    assert word.stop
    assert not word.take


@pytest.mark.parametrize(
    "sequence", [b"\x1b", b"\x03", b"\x1b[3~", b"\x1b[15~", b"\x1bOP", b"\x1b[H", b"\x1bi"]
)
def test_escape_and_keys_without_a_meaning_stop(sequence: bytes) -> None:
    words = parse_all(sequence)
    assert stops(words)


def test_speeds_grow_and_shrink_within_bounds() -> None:
    parser = StreamParser()
    now = 0.0
    for keys, v, w in (("q", 0.55, 0.55), ("w", 0.605, 0.55), ("c", 0.605, 0.495), ("q" * 20, 1.0, 1.0)):
        for key in keys:
            now += 0.1
            assert parser.feed(key.encode(), now) == []
        now += 0.1
        (word,) = parser.feed(b"u", now)
        assert (word.v, word.w) == (pytest.approx(v, abs=2e-3), pytest.approx(w, abs=2e-3))
    speeds = Speeds()
    for _ in range(40):
        speeds = speeds.after("z") or speeds
    assert speeds == Speeds(0.1, 0.1)


def test_help_fits_a_terminal() -> None:
    assert len(HELP) <= 12
    assert max(map(len, HELP)) <= 79


def test_stop_among_keys_is_heard() -> None:
    words = parse_all(b"iii i")
    assert stops(words)


# ------------------------------------------------------------------------------------------------- noise


@pytest.mark.parametrize(
    "noise", [b"i\xff", b"\xffi", b"i\x80i", b"\x00i", b"i\x00", b"\x00i\x00", b"\x07i", b"\xfei", b"i\xfd"]
)
def test_a_key_among_unprintable_bytes_is_noise(noise: bytes) -> None:
    parser = StreamParser()
    words = parser.feed(noise, 0.0) + parser.feed(b"", 1.0)
    assert words == []
    assert parser.noise_bytes >= 1
    assert parser.speaker == "nobody"


def test_more_than_eight_keys_at_once_are_noise() -> None:
    assert len(parse_all(b"i" * 8)) == 8
    parser = StreamParser()
    assert parser.feed(b"i" * 9, 0.0) == []
    assert parser.noise_bytes == 9
    assert len(parse_all(b"\x1b[A" * 3)) == 3, "an arrow is one key"
    assert parse_all(b"\x1b[A" * 9) == []


def test_a_burst_goes_on_over_reads_until_a_pause() -> None:
    parser = StreamParser()
    assert len(parser.feed(b"iiiii", 0.0)) == 5
    assert parser.feed(b"iiiii", 0.005) == []
    assert len(parser.feed(b"i", 0.05)) == 1
    parser = StreamParser()
    parser.feed(b"\xff", 0.0)
    assert parser.feed(b"i", 0.008) == []
    assert len(parser.feed(b"i", 0.03)) == 1


@pytest.mark.parametrize(
    "panic", [b" " * 30, b"kkkkkkkkkkkkk", b"iiiiiiiiiiii iiiii", b"\0 \0", b"\0 ", b"asdf jkl; asdf"]
)
def test_a_person_leaning_on_stop_is_heard(panic: bytes) -> None:
    words = parse_all(panic)
    assert stops(words)
    assert not moves(words)


def test_an_arrow_cut_in_two_is_still_an_arrow() -> None:
    parser = StreamParser()
    assert parser.feed(b"\x1b", 0.0) == []
    assert parser.feed(b"[", 0.01) == []
    (word,) = parser.feed(b"A", 0.02)
    assert word.v == 0.5
    parser.feed(b"\x1b", 1.0)
    assert stops(parser.feed(b"", 1.06)), "nothing followed: the escape key"


def test_a_stop_behind_half_a_frame_is_not_lost() -> None:
    parser = StreamParser()
    frame = encode_sticks(Sticks(1))
    for half in (frame[:9], b"\xfe\x21\x00", b"\0"):
        parser = StreamParser()
        assert parser.feed(half, 0.0) == []
        assert stops(parser.feed(b" ", 0.12))


def test_keys_do_not_drive_while_a_program_speaks() -> None:
    parser = StreamParser()
    parser.feed(encode_sticks(Sticks(1)), 0.0)
    assert not moves(parser.feed(b"i", 0.5))
    assert stops(parser.feed(b" ", 0.6))
    assert parser.speaker == "frames"
    assert moves(parser.feed(b"i", 1.1))
    assert parser.speaker == "keys"


@given(st.binary(min_size=1, max_size=60))
@settings(max_examples=300, deadline=None)
def test_no_motion_unless_every_byte_is_a_key(data: bytes) -> None:
    words = parse_all(data)
    if moves(words):
        assert len(read_burst(data).keys) <= 8
        assert all(byte in b"\r\n\x1b" or 0x20 <= byte < 0x7F for byte in data)


@given(st.lists(st.tuples(st.binary(max_size=40), st.floats(0.0, 0.3)), max_size=12))
@settings(max_examples=150, deadline=None)
def test_any_bytes_in_any_pieces_never_raise(pieces) -> None:  # type: ignore[no-untyped-def]
    parser = StreamParser()
    now = 0.0
    for data, pause in pieces:
        now += pause
        for word in parser.feed(data, now):
            assert word.at == now
            assert -1.0 <= word.v <= 1.0
            assert -1.0 <= word.w <= 1.0
    assert len(parser._buffer) <= 300
