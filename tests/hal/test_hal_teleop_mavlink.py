"""Our few MAVLink messages against pymavlink, both ways, and what ground stations may do."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v10 import common as mav1
from pymavlink.dialects.v20 import common as mav2

from robot.hal.teleop import mavlink
from robot.hal.teleop.frames import Button, Sticks, encode_sticks
from robot.hal.teleop.parser import StreamParser, parse_all

ROVER, GCS = 10, 6


class GroundStation:
    """pymavlink's sender."""

    def __init__(self, version: int = 2, system: int = 255, component: int = 190) -> None:
        dialect: Any = mav1 if version == 1 else mav2
        self.version = version
        self._mav = dialect.MAVLink(None, srcSystem=system, srcComponent=component)

    def _packed(self, message: Any) -> bytes:
        data = bytes(
            message.pack(self._mav, force_mavlink1=True) if self.version == 1 else message.pack(self._mav)
        )
        self._mav.seq = (self._mav.seq + 1) % 256
        return data

    def heartbeat(self, kind: int = GCS) -> bytes:
        return self._packed(self._mav.heartbeat_encode(kind, 8, 0, 0, 4))

    def sticks(self, x: int = 0, r: int = 0, target: int = 1) -> bytes:
        return self._packed(self._mav.manual_control_encode(target, x, 0, 500, r, 0))

    def command(self, number: int = 400, arm: float = 1.0, force: float = 0.0, target: int = 1) -> bytes:
        return self._packed(self._mav.command_long_encode(target, 1, number, 0, arm, force, 0, 0, 0, 0, 0))

    def other(self) -> bytes:
        return self._packed(self._mav.param_request_list_encode(1, 1))

    def skip(self, count: int) -> None:
        self._mav.seq = (self._mav.seq + count) % 256


@pytest.fixture(params=[1, 2], ids=["v1", "v2"])
def station(request: pytest.FixtureRequest) -> GroundStation:
    return GroundStation(request.param)


def said(data: bytes):  # type: ignore[no-untyped-def]
    parser = StreamParser()
    words = parser.feed(data, 1.0)
    return parser, words


# ---------------------------------------------------------------------------------- pymavlink speaks to us


def test_sticks_of_pymavlink_are_understood(station: GroundStation) -> None:
    data = station.heartbeat() + station.sticks() + station.sticks(x=500, r=250)
    parser, words = said(data)
    assert [(word.v, word.w, word.kind) for word in words] == [(0.0, 0.0, "mavlink"), (0.5, -0.25, "mavlink")]
    assert parser.speaker == "mavlink"
    assert parser.noise_bytes == 0


@given(x=st.integers(-32768, 32767), r=st.integers(-32768, 32767))
@settings(max_examples=60, deadline=None)
def test_any_stick_is_clipped(x: int, r: int) -> None:
    station = GroundStation()
    _, words = said(station.heartbeat() + station.sticks() + station.sticks(x, r))
    v, w = (0.0 if axis == 32767 else min(max(axis / 1000, -1.0), 1.0) for axis in (x, r))
    expected = (v, -w)
    assert (words[1].v, words[1].w) == pytest.approx(expected)


def test_all_zero_payload_shrinks_to_one_byte_in_v2() -> None:
    station = GroundStation()
    begin = station.heartbeat()
    sticks = station._packed(station._mav.manual_control_encode(0, 0, 0, 0, 0, 0))
    assert len(sticks) == 10 + 1 + 2
    assert len(said(begin + sticks)[1]) == 1


def test_bytes_one_by_one_say_the_same(station: GroundStation) -> None:
    data = station.heartbeat() + station.sticks() + station.other() + station.sticks(x=1000)
    parser = StreamParser()
    words = []
    for index in range(len(data)):
        words += parser.feed(data[index : index + 1], 1.0 + index * 1e-4)
    assert [word.v for word in words] == [0.0, 1.0]
    assert parser.noise_bytes == 0


def test_arm_takes_disarm_releases_forced_disarm_stops(station: GroundStation) -> None:
    parser, words = said(station.heartbeat() + station.command(arm=1.0))
    assert [word.take for word in words] == [True]
    (word,) = parser.feed(station.command(arm=0.0), 1.1)
    assert (word.release, word.stop) == (True, False)
    (word,) = parser.feed(station.command(arm=0.0, force=21196.0), 1.2)
    assert (word.release, word.stop) == (False, True)
    results = [payload[2] for _, payload in parser.mavlink.answers]
    assert results == [0, 0, 0]


def test_arming_with_a_deflected_stick_is_rejected_for_now(station: GroundStation) -> None:
    parser, words = said(station.heartbeat() + station.sticks(x=800) + station.command())
    assert not any(word.take or word.v for word in words)
    assert parser.mavlink.answers[0][1][:3] == bytes([400 & 255, 400 >> 8, 1])


@pytest.mark.parametrize("wrong", [{"number": 176}, {"arm": 2.0}, {"arm": float("nan")}])
def test_other_commands_are_unsupported(station: GroundStation, wrong: dict[str, Any]) -> None:
    parser, words = said(station.heartbeat() + station.command(**wrong))
    assert words == []
    assert parser.mavlink.answers[0][1][2] == 3


def test_what_is_for_another_vehicle_is_left_alone(station: GroundStation) -> None:
    parser, words = said(station.heartbeat() + station.command(target=9) + station.sticks(target=9))
    assert words == []
    assert parser.mavlink.answers == []


def test_sticks_need_a_living_ground_station(station: GroundStation) -> None:
    assert said(station.sticks())[1] == []
    assert said(station.heartbeat(ROVER) + station.sticks())[1] == []
    parser, _ = said(station.heartbeat() + station.sticks())
    for tenth in range(1, 31):
        assert parser.feed(station.sticks(), 1.0 + tenth / 10)
    assert parser.feed(station.sticks(), 4.05) == []


def test_repeated_and_stale_messages_are_dropped(station: GroundStation) -> None:
    parser, _ = said(station.heartbeat() + station.sticks())
    old, new = station.sticks(x=700), station.sticks(x=300)
    assert [word.v for word in parser.feed(new + new + old, 1.1)] == [0.3]
    station.skip(100)
    assert len(parser.feed(station.sticks(), 1.2)) == 1
    station.skip(156 - 20)
    assert parser.feed(station.sticks(), 1.3) == []
    assert len(parser.feed(station.sticks(), 2.3)) == 1, "after a second of silence anything is new"


def test_a_silence_needs_the_stick_let_go_again(station: GroundStation) -> None:
    parser, _ = said(station.heartbeat() + station.sticks())
    assert parser.feed(station.sticks(x=900), 1.2)[0].v == 0.9
    assert parser.feed(station.sticks(x=900), 1.7)[0].v == 0.0
    parser.feed(station.sticks(), 1.8)
    assert parser.feed(station.sticks(x=900), 1.9)[0].v == 0.9


def test_the_station_that_armed_drives_alone() -> None:
    one, two = GroundStation(system=255), GroundStation(system=254)
    parser, _ = said(one.heartbeat() + two.heartbeat() + one.sticks() + two.sticks() + one.command())
    assert parser.feed(two.sticks(x=1000), 1.1) == []
    assert parser.feed(one.sticks(x=1000), 1.2)[0].v == 1.0
    parser.feed(two.sticks(), 1.3)
    assert parser.feed(two.command(), 1.35)[0].take
    assert parser.feed(one.sticks(), 1.4) == []
    assert parser.feed(one.command(arm=0.0, force=21196.0), 1.5)[0].stop, "stop from anyone"
    assert parser.feed(one.sticks(), 1.6), "nobody drives alone any more"


def test_every_flipped_bit_is_noticed(station: GroundStation) -> None:
    begin = station.heartbeat() + station.sticks()
    good = station.sticks(x=700)
    for bit in range(8, len(good) * 8):  # the start byte makes it no message at all
        broken = bytearray(good)
        broken[bit // 8] ^= 1 << bit % 8
        words = parse_all(begin + bytes(broken))
        assert [word.v for word in words if not word.stop] == [0.0], bit


def test_a_valid_message_behind_noise_is_found(station: GroundStation) -> None:
    begin = station.heartbeat() + station.sticks()
    for noise in (
        b"\xfe",
        b"\xfd",
        b"\xfe\x09\x01\x01\x01\x00",
        b"\x00\x05\x12",
        b"\xff" * 40,
        b"\xfe\xfe\xfd",
    ):
        parser = StreamParser()
        words = parser.feed(begin + noise + station.sticks() * 1, 1.0)
        words += parser.feed(b"", 1.2)
        assert len(words) == 2, noise
        assert parser.noise_bytes >= 1


@pytest.mark.parametrize(
    "noise",
    [
        b"\xfe\x05\x01\x01\x01\x63",  # like a message nobody knows, with a frame where its payload would be
        b"\xfe\xff\x01\x01\x01\x00",  # like a HEARTBEAT of 255 bytes
        b"\xfd\xff\x80\x01\x01\x01\x01\x63\x00\x00",  # a form of MAVLink we cannot read
    ],
)
def test_noise_that_looks_like_a_message_swallows_no_frame(noise: bytes) -> None:
    (word,) = StreamParser().feed(noise + encode_sticks(Sticks(1, buttons=Button.STOP)), 1.0)
    assert word.stop


@given(st.binary(max_size=80))
@settings(max_examples=100, deadline=None)
def test_random_messages_never_raise(data: bytes) -> None:
    for start in (b"\xfe", b"\xfd"):
        assert not any(word.v or word.w or word.take for word in parse_all(start + data))


# -------------------------------------------------------------------------------- we speak to pymavlink


def parsed(data: bytes, version: int) -> list[Any]:
    dialect: Any = mav1 if version == 1 else mav2
    return list(dialect.MAVLink(None).parse_buffer(data) or [])


def test_pymavlink_understands_us(station: GroundStation) -> None:
    version = station.version
    data = mavlink.pack(mavlink.HEARTBEAT, mavlink.heartbeat(True, False), 7, version)
    data += mavlink.pack(mavlink.COMMAND_ACK, mavlink.command_ack(400, 1, 255, 190, version), 8, version)
    data += mavlink.pack(mavlink.STATUSTEXT, mavlink.statustext(6, "track  v +0.12", version), 9, version)
    beat, ack, text = parsed(data, version)
    assert (beat.type, beat.autopilot, beat.base_mode, beat.system_status, beat.mavlink_version) == (
        10,
        0,
        192,
        4,
        3,
    )
    assert (ack.command, ack.result) == (400, 1)
    assert (text.severity, text.text) == (6, "track  v +0.12")
    assert [message.get_seq() for message in (beat, ack, text)] == [7, 8, 9]
    assert {message.get_srcSystem() for message in (beat, ack, text)} == {1}


def test_disarmed_and_halted_show_in_the_heartbeat() -> None:
    (idle,) = parsed(mavlink.pack(0, mavlink.heartbeat(False, False), 0, 2), 2)
    (halted,) = parsed(mavlink.pack(0, mavlink.heartbeat(False, True), 0, 2), 2)
    assert (idle.base_mode, idle.system_status) == (64, 3)
    assert (halted.base_mode, halted.system_status) == (64, 5)


@given(st.binary(max_size=40))
@settings(max_examples=40, deadline=None)
def test_checksum_is_x25(data: bytes) -> None:
    assert mavlink.crc_x25(data) == mav2.x25crc(data).crc
