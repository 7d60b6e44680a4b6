"""The fuzz bench sees bugs planted in the robot: motion that nothing valid asked for; and its recogniser."""

from __future__ import annotations

import random
import struct
from dataclasses import replace

import pytest

from bench import fuzz_arm, fuzz_codec, fuzz_nxt
from bench.fuzz_codec import COMMAND, frame, frames, messages
from bench.fuzz_harness import Subject, Tally, try_one, watchdog
from bench.fuzz_recogniser import Chunk, justified
from bench.fuzz_teleop import Mavlink, Teleop
from robot.hal.nxt import lcp
from robot.hal.teleop import keys, mavlink
from robot.hal.teleop.parser import parse_all
from robot.hal.teleop.sticks import Stick
from robot.messages import TeleopInput

FULL = 32767


# -------------------------------------------------------- bugs planted in the robot: the bench sees them


def motions(subject: Subject, *inputs: bytes) -> int:
    tally = Tally(subject.name)
    with watchdog():
        for data in inputs:
            try_one(subject, data, tally)
    return tally.counts["motion"]


NEUTRAL = frame(COMMAND, 1)
AHEAD = frame(COMMAND, 2, v=FULL)


def test_a_stick_that_need_not_be_let_go_first_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    assert motions(Teleop(), AHEAD, NEUTRAL + AHEAD) == 0
    moved = Stick.moved
    monkeypatch.setattr(
        Stick, "moved", lambda self, v, w, now: replace(moved(self, v, w, now), v=v, w=w, live=True)
    )
    assert motions(Teleop(), AHEAD) == 1


def test_a_frame_with_a_wrong_checksum_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    spoiled = NEUTRAL + AHEAD[:-3] + bytes([AHEAD[-3] ^ 0x55]) + AHEAD[-2:]
    assert motions(Teleop(), spoiled) == 0
    monkeypatch.setattr("robot.hal.teleop.frames.crc16", _AnyNumber)
    assert motions(Teleop(), spoiled) == 1


class _AnyNumber:
    """Equal to whatever it is compared with: a check that does not check."""

    def __init__(self, data: bytes) -> None:
        pass

    def __eq__(self, other: object) -> bool:
        return True

    def __ne__(self, other: object) -> bool:
        return False

    __hash__ = None  # type: ignore[assignment]


def test_noise_that_drives_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    noise = [b"ii\xff\xfb", b"\x80i", b"iiiiiiiiiiiiii"]
    assert motions(Teleop(), *noise) == 0
    monkeypatch.setattr(keys, "read_burst", lambda burst: keys.Burst(("i",) * burst.count(b"i")))
    monkeypatch.setattr("robot.hal.teleop.parser.read_burst", keys.read_burst)
    assert motions(Teleop(), *noise) == 3


def test_a_ground_station_without_a_valid_checksum_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    heartbeat = fuzz_codec.message(0, struct.pack("<IBBBBB", 0, 6, 8, 0, 4, 3), 1, version=2)
    neutral = fuzz_codec.message(69, struct.pack("<hhhhHB", 0, 0, 500, 0, 0, 1), 2, version=2)
    ahead = fuzz_codec.message(69, struct.pack("<hhhhHB", 800, 0, 500, 0, 0, 1), 3, version=2)
    drives = heartbeat + neutral + ahead
    spoiled = drives[:-1] + bytes([drives[-1] ^ 1])
    assert any(word.v for word in parse_all(drives))
    assert motions(Mavlink(), drives, spoiled) == 0
    monkeypatch.setattr(mavlink, "crc_x25", lambda data, crc=0: _AnyNumber(data))
    assert motions(Mavlink(), spoiled) == 1


def test_an_arm_that_moves_by_itself_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = fuzz_arm.ArmRegisters()
    data = arm.draw(random.Random(3))
    assert motions(arm, data) == 0
    beat = fuzz_arm.ModbusArm._beat

    def beats_and_enables(self: fuzz_arm.ModbusArm, now: float, token: int | None = None) -> None:
        beat(self, now, token)
        self._controller.set_coil(0, True, now)

    monkeypatch.setattr(fuzz_arm.ModbusArm, "_beat", beats_and_enables)
    assert motions(arm, data) == 1


def test_a_brick_that_turns_for_half_a_telegram_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    short = bytes([11]) + bytes.fromhex("8004 01 32 07 01 00 20 5a0000")
    assert motions(fuzz_nxt.Emulator(), short) == 0
    execute = fuzz_nxt.BrickEmulator._execute
    monkeypatch.setattr(
        fuzz_nxt.BrickEmulator,
        "_execute",
        lambda self, kind, opcode, telegram: execute(self, kind, opcode, telegram.ljust(14, b"\0")),
    )
    assert motions(fuzz_nxt.Emulator(), short) == 1


def test_a_reply_read_by_the_wrong_request_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lcp.Request, "parse", lambda self, reply: None)
    with pytest.raises(AssertionError, match="one reply answers"):
        fuzz_nxt.LcpReplies().take(bytes.fromhex("020b00b81e"))


# ----------------------------------------------------------------------------- the recogniser by itself


def word(**said: object) -> TeleopInput:
    return TeleopInput(0.0, **said)  # type: ignore[arg-type]


def test_the_recogniser_finds_the_documented_frame() -> None:
    """The bytes of the protocol's description, which no code of ours made."""
    documented = bytes.fromhex("00 04 01 01 01 03 ff 7f 01 01 01 01 01 02 02 03 f4 ac 00")
    (found,) = frames(b"i" + documented + b"\xff")
    assert (found.start, found.end, found.v, found.w, found.buttons) == (1, 20, FULL, 0, 2)
    assert frames(documented[:-2] + b"\xad\x00") == ()
    assert frame(COMMAND, 1, v=FULL, buttons=2) == documented


def test_the_recogniser_reads_what_pymavlink_sends() -> None:
    from pymavlink.dialects.v20 import common

    for version in (1, 2):
        link = common.MAVLink(None, srcSystem=255, srcComponent=190)
        sent = common.MAVLink_manual_control_message(1, 800, 0, 500, -300, 0)
        data = bytes(sent.pack(link, force_mavlink1=version == 1))
        (found,) = [m for m in messages(b"xx" + data, frozenset()) if m.number == 69]
        assert (found.start, found.end, found.sender) == (2, 2 + len(data), (255, 190))
        spoiled = data[:-1] + bytes([data[-1] ^ 1])
        assert not [m for m in messages(spoiled, frozenset({len(spoiled)})) if m.number == 69]


@pytest.mark.parametrize(
    ("data", "said", "is_justified"),
    [
        (b"i", word(v=0.5, kind="keys"), True),
        (b"t", word(take=True, kind="keys"), True),
        (b"g", word(arm=True, kind="keys"), True),
        (b"\x1b[A", word(v=0.5, kind="keys"), True),
        (b"k", word(v=0.5, kind="keys"), False),
        (b"i", word(take=True, kind="keys"), False),
        (b"i", word(arm=True, kind="keys"), False),
        (b"i\xff", word(v=0.5, kind="keys"), False),
        (b"i\x00", word(v=0.5, kind="keys"), False),
        (b"i" * 9, word(v=0.5, kind="keys"), False),
        (NEUTRAL + AHEAD, word(v=1.0), True),
        (AHEAD, word(v=1.0), False),
        (AHEAD + NEUTRAL, word(v=1.0), False),
        (NEUTRAL + AHEAD, word(v=0.5), False),
        (NEUTRAL + AHEAD, word(take=True), False),
        (frame(COMMAND, 1, buttons=2), word(take=True), True),
        (frame(COMMAND, 1, buttons=8), word(arm=True), True),
        (NEUTRAL + AHEAD, word(v=1.0, kind="mavlink"), False),
        (NEUTRAL + b"i", word(v=0.5, kind="keys"), True),
    ],
)
def test_the_recogniser_says_what_a_word_needs(data: bytes, said: TeleopInput, is_justified: bool) -> None:
    assert justified(said, (Chunk(0.0, data),)) == is_justified


def test_a_key_is_clean_by_what_came_together_with_it() -> None:
    drive = word(v=0.5, kind="keys")
    assert not justified(drive, (Chunk(0.0, b"\xff"), Chunk(0.005, b"i")))
    assert justified(drive, (Chunk(0.0, b"\xff"), Chunk(0.2, b"i")))
    assert justified(drive, (Chunk(0.0, b"\x1b["), Chunk(0.03, b"A")))
    assert not justified(drive, (Chunk(0.0, b"\x1b["), Chunk(0.3, b"A")))
