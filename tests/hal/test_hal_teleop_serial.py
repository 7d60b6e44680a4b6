"""The teleop driver: over a scripted port with a stepped clock, and over a pseudo-terminal."""

from __future__ import annotations

import os
import pty
import select
import time
import tty
from contextlib import suppress
from itertools import pairwise

import pytest

from robot import authority
from robot.hal.interfaces import DeviceError, TeleopLink
from robot.hal.teleop.frames import NO_BUTTONS, Button, Status, Sticks, decode, encode_sticks
from robot.hal.teleop.keys import HELP
from robot.hal.teleop.mavlink import COMMAND_ACK, HEARTBEAT, STATUSTEXT
from robot.hal.teleop.port import open_port
from robot.hal.teleop.serial import SerialTeleop

LINE = "track      v +0.12 w -0.30   8.1 V  drives itself"


class Port:
    """A line in the test's hand. room: how many bytes it takes; broken: it has hung up."""

    def __init__(self) -> None:
        self.arrived = b""
        self.said = b""
        self.room = 10**9
        self.broken = False
        self.there = True
        self.opened = 0
        self.closed = 0

    def open(self) -> Port:
        if not self.there:
            raise DeviceError("serial port gone: plug it in")
        self.opened += 1
        self.broken = False
        return self

    def read(self) -> bytes:
        self._check()
        data, self.arrived = self.arrived[:4096], self.arrived[4096:]
        return data

    def write(self, data: bytes) -> int:
        self._check()
        taken = data[: self.room]
        self.said += taken
        self.room -= len(taken)
        return len(taken)

    def close(self) -> None:
        self.closed += 1

    def _check(self) -> None:
        if self.broken:
            raise OSError(5, "Input/output error")


@pytest.fixture
def port() -> Port:
    return Port()


@pytest.fixture
def driver(port: Port) -> SerialTeleop:
    return SerialTeleop(port.open)


def say(driver: SerialTeleop, port: Port, data: bytes, now: float):  # type: ignore[no-untyped-def]
    port.arrived += data
    return driver.latest(now)


def stick(seq: int, v: float = 0.0, buttons: Button = NO_BUTTONS) -> bytes:
    return encode_sticks(Sticks(seq, v, 0.0, buttons))


# ----------------------------------------------------------------------------------------------- hearing


def test_it_is_a_teleop_link_that_heard_nothing(driver: SerialTeleop) -> None:
    assert isinstance(driver, TeleopLink)
    assert driver.latest(0.0) is None
    assert driver.faults(0.0) == ()


def test_a_key_drives_for_a_pulse_then_stands_with_its_time(driver: SerialTeleop, port: Port) -> None:
    word = say(driver, port, b"i", 1.0)
    assert (word.v, word.at, word.kind) == (0.5, 1.0, "keys")
    assert driver.latest(1.4).v == 0.5
    stood = driver.latest(1.41)
    assert (stood.v, stood.w, stood.at, stood.kind) == (0.0, 0.0, 1.0, "keys")


@pytest.mark.parametrize("pulse", [0.04, 0.41, 1.0])
def test_no_pulse_is_longer_than_400_ms(port: Port, pulse: float) -> None:
    with pytest.raises(ValueError, match=r"0\.4"):
        SerialTeleop(port.open, pulse)


def test_a_shorter_pulse_may_be_had(port: Port) -> None:
    driver = SerialTeleop(port.open, 0.2)
    say(driver, port, b"i", 1.0)
    assert driver.latest(1.2).v == 0.5
    assert driver.latest(1.24).v == 0.0


def test_a_frame_drives_no_longer_than_400_ms_and_its_age_tells_the_silence(
    driver: SerialTeleop, port: Port
) -> None:
    say(driver, port, stick(1) + stick(2, v=1.0), 1.0)
    assert driver.latest(1.4).v == 1.0
    assert driver.latest(1.44).v == 0.0
    assert driver.latest(3.0).at == 1.0
    assert authority.decide(driver.latest(1.44), 1.0, "teleop", 1.44, 0.4, 0.2, 1.0).silent


def test_a_person_at_bare_keys_is_not_lost_between_them(driver: SerialTeleop, port: Port) -> None:
    say(driver, port, b"i", 1.0)
    verdict = authority.decide(driver.latest(9.0), 1.0, "teleop", 9.0, 0.4, 0.2, 1.0)
    assert not verdict.silent
    assert verdict.twist.is_zero


@pytest.mark.parametrize("data", [b"i i", b" iii", b"t g ", stick(1) + b" " + stick(2, v=1.0)])
def test_stop_wins_over_everything_in_the_same_look(driver: SerialTeleop, port: Port, data: bytes) -> None:
    word = say(driver, port, data, 1.0)
    assert word.stop
    assert (word.v, word.w) == (0.0, 0.0)


def test_asking_wins_over_sticks_in_the_same_look(driver: SerialTeleop, port: Port) -> None:
    word = say(driver, port, stick(1, buttons=Button.TAKE) + stick(2, v=1.0), 1.0)
    assert word.take


def test_two_looks_at_the_same_moment_lose_no_word(driver: SerialTeleop, port: Port) -> None:
    say(driver, port, b"t", 1.0)
    assert not say(driver, port, b" ", 1.0).stop, "a word of this moment was given already"
    word = driver.latest(1.04)
    assert word.stop
    assert word.at == 1.04


def test_everything_there_is_drained_in_one_look(driver: SerialTeleop, port: Port) -> None:
    frames = b"".join(stick(seq) for seq in range(1, 400))
    word = say(driver, port, frames + stick(400, buttons=Button.STOP) + stick(401), 1.0)
    assert word.stop
    assert port.arrived == b""


def test_noise_is_told_cuts_a_pulse_and_passes(driver: SerialTeleop, port: Port) -> None:
    say(driver, port, b"i", 1.0)
    assert say(driver, port, b"\xaa\x55i", 1.04).v == 0.0
    (fault,) = driver.faults(1.04)
    assert (fault.key, fault.since) == ("teleop.noise", 1.04)
    assert "3 bytes" in fault.evidence
    assert driver.latest(1.08).v == 0.0
    assert driver.faults(2.0)
    assert driver.faults(2.1) == ()


def test_a_key_in_one_read_and_noise_in_the_next_of_the_same_look_is_noise() -> None:
    class Slow(Port):
        def read(self) -> bytes:
            data, self.arrived = self.arrived[:1], self.arrived[1:]
            return data

    slow = Slow()
    driver = SerialTeleop(slow.open)
    assert say(driver, slow, b"i\xff", 1.0) is None
    assert driver.faults(1.0)


def test_noise_between_frames_does_not_jerk(driver: SerialTeleop, port: Port) -> None:
    say(driver, port, stick(1) + stick(2, v=1.0), 1.0)
    assert say(driver, port, b"\xaa", 1.04).v == 1.0
    assert driver.faults(1.04)


# ----------------------------------------------------------------------------------------- losing, finding


def test_a_hang_up_stands_is_told_and_mends_itself(driver: SerialTeleop, port: Port) -> None:
    say(driver, port, b"i", 1.0)
    port.broken = True
    port.there = False
    assert driver.latest(1.04).v == 0.0
    (fault,) = driver.faults(1.04)
    assert fault.key == "teleop.link"
    assert "Input/output" in fault.evidence
    assert port.closed == 1
    driver.latest(2.0)
    assert "plug it in" in driver.faults(2.0)[0].evidence
    assert driver.faults(2.0)[0].since == 1.04
    port.there = True
    for tick in range(200):
        driver.latest(2.0 + tick * 0.04)
    assert driver.faults(10.0) == ()
    assert say(driver, port, b"i", 11.0).v == 0.5


def test_opening_is_tried_with_growing_pauses(port: Port) -> None:
    times: list[float] = []
    now = 0.0

    def open_line() -> Port:
        times.append(now)
        return port.open()

    driver = SerialTeleop(open_line)
    port.broken, port.there = True, False
    for tick in range(1, 1000):
        now = tick * 0.04
        driver.latest(now)
    pauses = [later - earlier for earlier, later in pairwise(times[1:])]
    assert times[1] == pytest.approx(0.54, abs=0.05)
    assert pauses[:4] == pytest.approx([1.0, 2.0, 4.0, 5.0], abs=0.05)
    assert max(pauses) <= 5.05


def test_a_motion_that_came_right_before_the_hang_up_does_not_drive(port: Port) -> None:
    class Dying(Port):
        def read(self) -> bytes:
            data = super().read()
            self.broken = not data
            return data

        def write(self, data: bytes) -> int:
            raise OSError(5, "Input/output error")

    dying = Dying()
    driver = SerialTeleop(dying.open)
    word = say(driver, dying, b"i", 1.0)
    assert word is None or word.v == 0.0
    assert driver.faults(1.0)


def test_after_a_hang_up_the_stick_must_be_let_go_first(driver: SerialTeleop, port: Port) -> None:
    say(driver, port, stick(1) + stick(2, v=1.0), 1.0)
    port.broken = True
    driver.latest(1.04)
    driver.latest(1.6)
    assert driver.faults(1.6) == ()
    assert say(driver, port, stick(3, v=1.0), 1.64).v == 0.0


def test_closed_it_stands_and_stays_silent(driver: SerialTeleop, port: Port) -> None:
    say(driver, port, b"i", 1.0)
    driver.close()
    driver.close()
    assert port.closed == 1
    port.arrived = b"i"
    port.said = b""
    assert driver.latest(1.04).v == 0.0
    driver.tell(LINE, 1.04)
    assert port.said == b""
    assert port.opened == 1


def test_a_port_that_is_not_there_at_the_start_is_an_error(port: Port) -> None:
    port.there = False
    with pytest.raises(DeviceError, match="plug it in"):
        SerialTeleop(port.open)


# ---------------------------------------------------------------------------------------------- answering


def tell_each_tick(driver: SerialTeleop, seconds: float, line: str = LINE, start: float = 1.0) -> None:
    for tick in range(1, round(seconds / 0.04) + 1):
        now = start + tick * 0.04
        driver.latest(now)
        driver.tell(line.replace("0.12", f"0.{tick % 90 + 10}"), now)


def test_nobody_spoke_nothing_is_said(driver: SerialTeleop, port: Port) -> None:
    tell_each_tick(driver, 2.0)
    assert port.said == b""


def test_a_terminal_gets_lines_twice_a_second_at_most(driver: SerialTeleop, port: Port) -> None:
    say(driver, port, b"t", 1.0)
    assert port.said == b"robot: ? for help, space stops\r\n"
    port.said = b""
    tell_each_tick(driver, 4.0)
    lines = port.said.split(b"\r\n")
    assert lines[-1] == b""
    assert 7 <= len(lines) - 1 <= 9
    assert all(line.startswith(b"track      v +0.") and len(line) <= 79 for line in lines[:-1])


def test_a_line_that_does_not_change_is_not_repeated_all_the_time(driver: SerialTeleop, port: Port) -> None:
    say(driver, port, b"t", 1.0)
    port.said = b""
    tell_each_tick(driver, 8.0, line="idle  nothing new")
    assert port.said.count(b"\r\n") == 2


def test_no_status_can_upset_a_terminal(driver: SerialTeleop, port: Port) -> None:
    say(driver, port, b"t", 1.0)
    port.said = b""
    driver.tell("track \x1b[2J \x07 µ\r\nnext " + "x" * 200, 1.04)
    assert port.said.endswith(b"\r\n")
    assert all(0x20 <= byte < 0x7F for byte in port.said[:-2])
    assert len(port.said) <= 81


def test_the_question_mark_prints_the_help(driver: SerialTeleop, port: Port) -> None:
    word = say(driver, port, b"?", 1.0)
    assert word is None
    assert port.said.decode().splitlines()[1:] == list(HELP)


def test_speed_keys_are_answered(driver: SerialTeleop, port: Port) -> None:
    say(driver, port, b"q", 1.0)
    assert b"speed: forward 55%, turning 55%\r\n" in port.said


def test_a_hello_and_frames_are_answered_with_status(driver: SerialTeleop, port: Port) -> None:
    say(driver, port, encode_sticks(Sticks(41, hello=True)), 1.0)
    first = decode(port.said.strip(b"\0"))
    assert isinstance(first, Status)
    assert first.heard == 41
    port.said = b""
    say(driver, port, stick(42), 1.04)
    driver.tell(LINE, 1.1)
    status = decode(port.said.strip(b"\0"))
    assert isinstance(status, Status)
    assert (status.heard, status.age_ms, status.text) == (42, 60, LINE)


def test_a_ground_station_gets_heartbeats_acks_and_text(driver: SerialTeleop, port: Port) -> None:
    dialect = pytest.importorskip("pymavlink.dialects.v20.common")
    mav = dialect.MAVLink(None, srcSystem=255, srcComponent=190)

    def packed(message) -> bytes:  # type: ignore[no-untyped-def]
        data = bytes(message.pack(mav))
        mav.seq = (mav.seq + 1) % 256
        return data

    say(driver, port, packed(mav.heartbeat_encode(6, 8, 0, 0, 4)), 1.0)
    say(driver, port, packed(mav.command_long_encode(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)), 1.04)
    tell_each_tick(driver, 3.0, line=LINE.replace("track", "teleop"))
    heard = dialect.MAVLink(None).parse_buffer(port.said)
    numbers = [message.get_msgId() for message in heard]
    assert numbers.count(HEARTBEAT) in (3, 4, 5)
    assert numbers.count(COMMAND_ACK) == 1
    assert numbers.count(STATUSTEXT) == 1
    assert [message.base_mode & 128 for message in heard if message.get_msgId() == HEARTBEAT][-1] == 128
    assert [message.get_seq() for message in heard] == list(range(len(heard)))


def test_who_does_not_listen_holds_nobody_and_gets_whole_messages(driver: SerialTeleop, port: Port) -> None:
    say(driver, port, b"t", 1.0)
    port.said, port.room = b"", 10
    tell_each_tick(driver, 60.0)
    assert len(port.said) == 10
    port.room = 10**9
    driver.latest(62.0)
    assert len(port.said) <= 2048
    assert all(line.startswith(b"track") for line in port.said.split(b"\r\n")[:-1])


# --------------------------------------------------------------------------------------- a real terminal


@pytest.fixture
def wire():  # type: ignore[no-untyped-def]
    """The person's and the robot's end of a pseudo-terminal."""
    far, near = pty.openpty()
    tty.setraw(far)
    tty.setraw(near)
    yield far, near
    for end in (far, near):
        with suppress(OSError):
            os.close(end)


def typed(wire, data: bytes) -> None:  # type: ignore[no-untyped-def]
    """Type, and wait until the kernel has carried it over."""
    far, near = wire
    os.write(far, data)
    assert select.select([near], [], [], 5.0)[0]


def test_over_a_pseudo_terminal(wire) -> None:  # type: ignore[no-untyped-def]
    far, near = wire
    driver = SerialTeleop(lambda: open_port(os.ttyname(near)))
    typed(wire, b"i")
    assert driver.latest(1.0).v == 0.5
    assert os.read(far, 100) == b"robot: ? for help, space stops\r\n"
    os.close(far)  # the cable is pulled
    driver.latest(1.04)
    assert driver.faults(1.04)[0].key == "teleop.link"
    driver.close()


def test_a_terminal_that_never_reads_holds_nobody(wire) -> None:  # type: ignore[no-untyped-def]
    path = os.ttyname(wire[1])
    driver = SerialTeleop(lambda: open_port(path))
    typed(wire, b"t")
    begun = time.perf_counter()
    tell_each_tick(driver, 600.0)
    assert time.perf_counter() - begun < 5.0, "15,000 ticks with 94 kB nobody takes"
    typed(wire, b" ")
    assert driver.latest(700.0).stop
    assert driver.faults(700.0) == ()
    driver.close()


def test_the_port_is_ours_alone(wire) -> None:  # type: ignore[no-untyped-def]
    path = os.ttyname(wire[1])
    port = open_port(path)
    with pytest.raises(DeviceError, match=path):
        open_port(path)
    port.close()
    open_port(path).close()


def test_a_missing_port_is_named_with_the_cure(tmp_path) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(DeviceError, match=r"ttyX.*plug it in") as error:
        open_port(str(tmp_path / "ttyX"))
    assert "\n" not in str(error.value)
