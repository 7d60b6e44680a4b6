"""The telegrams are those of the protocol, byte for byte, and no reply whatever breaks the codec."""

from __future__ import annotations

from contextlib import suppress

import nxt.brick
import nxt.motor
import nxt.sensor
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.hal.nxt import lcp
from robot.hal.nxt.replies import OutputState, ProtocolError, Status, StatusError

FULL = lcp.Mode.ON | lcp.Mode.BRAKE | lcp.Mode.REGULATED
EVERY_REQUEST = [
    lcp.hold(lcp.ALL_PORTS),
    lcp.get_output_state(1),
    lcp.reset_motor_position(1, True),
    lcp.reset_count(1),
    lcp.get_battery_level(),
    lcp.keep_alive(),
    lcp.stop_program(),
    lcp.play_tone(440, 100),
    lcp.get_version(),
    lcp.get_device_info(),
    lcp.set_input_mode(3, 0x0B, 0),
    lcp.get_input_values(3),
    lcp.ls_get_status(3),
    lcp.ls_write(3, b"\x02\x42", 1),
    lcp.ls_read(3),
]


def test_drive_telegram_of_the_kit() -> None:
    request = lcp.set_output_state(lcp.Port.B, -50, FULL, lcp.Regulation.SPEED, 90)
    assert request.silent == bytes.fromhex("80 04 01 ce 07 01 00 20 5a000000")
    assert request.telegram == bytes.fromhex("00 04 01 ce 07 01 00 20 5a000000")


def test_hold_all_and_coast_telegrams() -> None:
    assert lcp.hold(lcp.ALL_PORTS).silent == bytes.fromhex("80 04 ff 00 07 01 00 20 00000000")
    assert lcp.coast(lcp.Port.C).silent == bytes.fromhex("80 04 02 00 00 00 00 00 00000000")


@pytest.mark.parametrize(
    ("request_", "telegram"),
    [
        (lcp.get_output_state(2), "00 06 02"),
        (lcp.reset_motor_position(1, relative=True), "00 0a 01 01"),
        (lcp.reset_motor_position(1, relative=False), "00 0a 01 00"),
        (lcp.reset_count(0), "00 21 00"),
        (lcp.get_battery_level(), "00 0b"),
        (lcp.keep_alive(), "00 0d"),
        (lcp.stop_program(), "00 01"),
        (lcp.get_version(), "01 88"),
        (lcp.get_device_info(), "01 9b"),
        (lcp.get_input_values(0), "00 07 00"),
        (lcp.ls_get_status(3), "00 0e 03"),
        (lcp.ls_write(3, b"\x02\x42", 1), "00 0f 03 02 01 02 42"),
        (lcp.ls_read(3), "00 10 03"),
    ],
)
def test_request_bytes(request_: lcp.Request[object], telegram: str) -> None:
    assert request_.telegram == bytes.fromhex(telegram)


def test_silent_requests_without_arguments_of_the_table() -> None:
    assert lcp.play_tone(523, 500).silent == bytes.fromhex("80 03 0b02 f401")
    assert lcp.set_input_mode(1, 0x0B, 0).silent == bytes.fromhex("80 05 01 0b 00")


# ------------------------------------------------------------------- an independent client as an oracle


class Sniffer:
    """The socket nxt-python talks to: keeps what it sends, answers what it is given."""

    def __init__(self, reply: bytes = b"") -> None:
        self.sent: list[bytes] = []
        self.reply = reply

    def send(self, telegram: bytes) -> None:
        self.sent.append(telegram)

    def recv(self) -> bytes:
        return self.reply

    def close(self) -> None:
        pass


@settings(max_examples=50, deadline=None)
@given(
    port=st.sampled_from(list(nxt.motor.Port)),
    power=st.integers(-100, 100),
    turn=st.integers(-100, 100),
    run=st.sampled_from(list(nxt.motor.RunState)),
    regulation=st.sampled_from(list(nxt.motor.RegulationMode)),
    limit=st.integers(0, 2**32 - 1),
)
def test_set_output_state_equals_nxt_python(port, power, turn, run, regulation, limit) -> None:  # type: ignore[no-untyped-def]
    sniffer = Sniffer()
    mode = nxt.motor.Mode.ON | nxt.motor.Mode.REGULATED
    nxt.brick.Brick(sniffer).set_output_state(port, power, mode, regulation, turn, run, limit)
    ours = lcp.set_output_state(
        port.value, power, mode.value, regulation.value, limit, turn_ratio=turn, run_state=run.value
    )
    assert ours.silent == sniffer.sent[0]


def test_output_state_reads_as_nxt_python_reads_it() -> None:
    reply = bytes.fromhex("02 06 00 01 ce 07 01 00 20 5a000000 f6ffffff 0a000000 e8030000")
    sniffer = Sniffer(reply)
    theirs = nxt.brick.Brick(sniffer).get_output_state(nxt.motor.Port.B)
    request = lcp.get_output_state(1)
    ours = request.parse(reply)
    assert request.telegram == sniffer.sent[0]
    assert (ours.power, ours.tacho_limit, ours.tacho, ours.block_tacho, ours.rotation) == (
        theirs[1],
        theirs[6],
        theirs[7],
        theirs[8],
        theirs[9],
    )
    assert ours == OutputState(1, -50, 7, 1, 0, 0x20, 90, -10, 10, 1000)


def test_other_requests_and_replies_equal_nxt_python() -> None:
    def both(reply: str, call: str, *args: object) -> tuple[bytes, object]:
        sniffer = Sniffer(bytes.fromhex(reply))
        value = getattr(nxt.brick.Brick(sniffer), call)(*args)
        return sniffer.sent[0], value

    sent, value = both("020b00 401f", "get_battery_level")
    assert (sent, value) == (lcp.get_battery_level().telegram, 8000)
    assert lcp.get_battery_level().parse(bytes.fromhex("020b00401f")) == 8000

    sent, value = both("020d00 c0270900", "keep_alive")
    assert (sent, value) == (lcp.keep_alive().telegram, 600_000)
    assert lcp.keep_alive().parse(bytes.fromhex("020d00c0270900")) == 600_000

    sent, value = both("028800 7c01 1d01", "get_firmware_version")
    version = lcp.get_version().parse(bytes.fromhex("0288007c011d01"))
    assert (sent, value) == (lcp.get_version().telegram, (version.protocol, version.firmware))
    assert version.firmware == (1, 29)

    info = "029b00" + b"NXT\0".ljust(15, b"\0").hex() + "001653010203" + "00" + "01020304" + "486b0100"
    sent, value = both(info, "get_device_info")
    ours = lcp.get_device_info().parse(bytes.fromhex(info))
    assert sent == lcp.get_device_info().telegram
    assert isinstance(value, tuple)
    assert (ours.name, ours.address.upper(), ours.signal, ours.free_flash_bytes) == (
        value[0],
        value[1].upper(),
        value[2],
        value[3],
    )

    values = "020700 02 01 00 01 20 ff03 ff03 0100 0000"
    sent, value = both(values, "get_input_values", nxt.sensor.Port.S3)
    touch = lcp.get_input_values(2).parse(bytes.fromhex(values))
    assert sent == lcp.get_input_values(2).telegram
    assert isinstance(value, tuple)
    assert (touch.valid, touch.raw, touch.scaled) == (value[1], value[5], value[7]) == (True, 1023, 1)

    sent, _ = both("", "play_tone", 440, 250)
    assert sent == lcp.play_tone(440, 250).silent
    sent, value = both("021000 01 2a" + "00" * 15, "ls_read", nxt.sensor.Port.S4)
    assert (sent, value) == (lcp.ls_read(3).telegram, b"\x2a")
    assert lcp.ls_read(3).parse(bytes.fromhex("02100001 2a" + "00" * 15)) == b"\x2a"


# --------------------------------------------------------------------------------- limits and bad replies


def test_power_is_clamped_because_the_firmware_does_not() -> None:
    assert lcp.set_output_state(0, 250, FULL, 1, 10).telegram[3] == 100
    assert lcp.set_output_state(0, -250, FULL, 1, 10).telegram[3] == 256 - 100


@pytest.mark.parametrize(
    "build",
    [
        lambda: lcp.set_output_state(3, 10, FULL, 1, 10),
        lambda: lcp.set_output_state(0, 10, FULL, 1, -1),
        lambda: lcp.set_output_state(0, 10, FULL, 1, 1 << 32),
        lambda: lcp.get_output_state(lcp.ALL_PORTS),
        lambda: lcp.reset_count(3),
        lambda: lcp.reset_motor_position(-1, True),
        lambda: lcp.play_tone(100, 10),
        lambda: lcp.play_tone(440, 70_000),
        lambda: lcp.get_input_values(4),
        lambda: lcp.ls_write(0, b"", 1),
        lambda: lcp.ls_write(0, b"x" * 17, 1),
        lambda: lcp.ls_write(0, b"x", 17),
    ],
)
def test_senseless_requests_are_refused(build) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ValueError, match=r"\d"):
        build()


def test_refusals_say_what_and_why() -> None:
    with pytest.raises(StatusError, match=r"STOPPROGRAM.*no program.*EC") as caught:
        lcp.stop_program().parse(bytes.fromhex("0201ec"))
    assert caught.value.status == Status.NO_PROGRAM
    with pytest.raises(StatusError, match="0x77"):
        lcp.stop_program().parse(bytes.fromhex("020177"))


@pytest.mark.parametrize(
    "reply",
    ["", "02", "020b", "020b00", "020b0040", "020b00401f00", "020600401f", "000b00401f", "ff0b00401f"],
)
def test_short_long_and_foreign_replies_are_refused(reply: str) -> None:
    with pytest.raises(ProtocolError):
        lcp.get_battery_level().parse(bytes.fromhex(reply))


def test_state_of_another_port_is_no_answer() -> None:
    reply = bytes.fromhex("02 06 00 02 ce 07 01 00 20") + bytes(16)
    with pytest.raises(ProtocolError, match=r"output 1.*2"):
        lcp.get_output_state(1).parse(reply)


@settings(max_examples=300, deadline=None)
@given(request=st.sampled_from(EVERY_REQUEST), tail=st.binary(max_size=70), framed=st.booleans())
def test_no_reply_crashes_the_codec(request: lcp.Request[object], tail: bytes, framed: bool) -> None:
    # Framed replies get past the header, so that the bodies are tried too.
    reply = bytes([0x02, request.telegram[1], 0x00]) + tail if framed else tail
    with suppress(ProtocolError):
        request.parse(reply)


@settings(max_examples=100, deadline=None)
@given(request=st.sampled_from(EVERY_REQUEST), data=st.data())
def test_bodies_of_the_right_length_never_crash(request: lcp.Request[object], data: st.DataObject) -> None:
    size = request.body_bytes
    body = data.draw(st.binary(min_size=size, max_size=size))
    with suppress(ProtocolError):
        request.parse(bytes([0x02, request.telegram[1], 0x00]) + body)
