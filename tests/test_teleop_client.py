"""The teleop client: its model without a terminal, the gamepad, and the whole way to the driver and back."""

from __future__ import annotations

import fcntl
import io
import os
import pty
import select
import signal
import subprocess
import sys
import termios
import time
import tty
from collections.abc import Callable
from contextlib import suppress

import pytest
from rich.console import Console

from robot import authority
from robot import teleop_model as core
from robot.errors import UserError
from robot.gamepad import EVENT, Gamepad, Pad, moved
from robot.hal.interfaces import DeviceError
from robot.hal.teleop.frames import Button, Status, Sticks, decode
from robot.hal.teleop.port import open_port
from robot.hal.teleop.serial import SerialTeleop
from robot.messages import Fault, Sent, Twist
from robot.status_line import status_line
from robot.teleop_client import Session, run_teleop
from robot.teleop_model import ClientModel
from robot.teleop_screen import render

# ------------------------------------------------------------------------------------------------- model


def frame_of(model: ClientModel, now: float) -> Sticks:
    return core.next_frame(model, now)[1]


def test_a_key_pressed_once_drives_400_ms() -> None:
    model = core.pressed(ClientModel(), "i", 1.0)
    assert core.axes(model, 1.39) == (0.5, 0.0)
    assert core.axes(model, 1.4) == (0.0, 0.0)


def test_a_key_that_repeats_is_let_go_at_once() -> None:
    model = core.pressed(ClientModel(), "u", 1.0)
    for repeat in range(20):
        model = core.pressed(model, "u", 1.5 + repeat * 0.033)
        assert core.axes(model, 1.5 + repeat * 0.033 + 0.03) == (0.5, 0.5)
    end = 1.5 + 19 * 0.033
    assert core.axes(model, end + 0.16) == (0.0, 0.0)


def test_speed_keys_do_not_interrupt_the_drive() -> None:
    model = core.pressed(core.pressed(ClientModel(), "i", 1.0), "q", 1.1)
    assert core.axes(model, 1.2) == (0.55, 0.0)


@pytest.mark.parametrize(
    ("key", "button"),
    [("t", Button.TAKE), ("r", Button.RELEASE), ("g", Button.GIVE), (" ", Button.STOP), ("y", Button.STOP)],
)
def test_keys_press_buttons_for_some_frames(key: str, button: Button) -> None:
    model = core.pressed(ClientModel(), key, 1.0)
    assert [frame_of(model, now).buttons for now in (1.0, 1.05, 1.15)] == [button] * 3
    assert frame_of(model, 1.21).buttons == 0


def test_stop_ends_the_drive_and_nothing_overtakes_it() -> None:
    model = core.pressed(core.pressed(ClientModel(), "i", 1.0), "k", 1.1)
    assert core.axes(model, 1.11) == (0.0, 0.0)
    model = core.pressed(core.pressed(model, "t", 1.12), "i", 1.14)
    frame = frame_of(model, 1.15)
    assert (frame.buttons, frame.v) == (Button.STOP, 0.0)
    assert frame_of(model, 1.35).v == 0.5


def test_taking_needs_the_stick_let_go_and_says_so() -> None:
    model = core.pressed(core.padded(ClientModel(), Pad(True, v=0.9), 1.0), "t", 1.0)
    assert frame_of(model, 1.0).buttons == 0
    assert "let go" in model.note


def test_the_gamepad_drives_asks_and_stops() -> None:
    pad = Pad(True, v=0.25, w=-1.0, held=Button.TAKE | Button.STOP, pressed=Button.STOP)
    model = core.padded(ClientModel(), pad, 1.0)
    assert frame_of(model, 9.0).buttons == Button.STOP, "as long as it is held"
    assert frame_of(model, 9.0).v == 0.0
    model = core.padded(ClientModel(), Pad(True, v=0.25, w=-1.0), 1.0)
    assert core.axes(model, 1.0) == (0.25, -1.0)
    model = core.padded(model, Pad(), 1.1)
    assert core.axes(model, 1.1) == (0.0, 0.0)
    assert "gone" in model.note


def test_numbers_go_up_and_round() -> None:
    model, first = core.next_frame(ClientModel(seq=65534), 0.0)
    _, second = core.next_frame(model, 0.05)
    assert (first.seq, second.seq) == (65535, 0)


def test_the_delay_is_the_way_there_and_back_without_the_robots_pause() -> None:
    model, frame = core.next_frame(ClientModel(), 1.0)
    model, _ = core.next_frame(model, 1.05)
    model = core.heard(model, Status(1, frame.seq, age_ms=30, text="x"), 1.042)
    assert model.delay_s == pytest.approx(0.012)
    assert model.heard(2.5)
    assert not model.heard(2.6)


def test_status_lines_are_read_as_the_robot_writes_them() -> None:
    fault = Fault("base", "stall", 1.0)
    text = status_line("teleop", Sent(Twist(0.12, -0.3), None, 0.0, "unseen floor: blind speed"), 8.1, ())
    line = core.read_line(text)
    assert line == core.RobotLine("teleop", 0.12, -0.3, 8.1, "you drive", "unseen floor: blind speed")
    halted = core.read_line(status_line("halted", Sent(Twist(), None, 0.0), None, (fault,)))
    assert halted is not None
    assert (halted.state, halted.volts) == ("halted", None)
    assert halted.trouble == "base.stall"


@pytest.mark.parametrize("text", ["", "hello", "teleop v x w y", "a  v +1.2.3 w -0.1  8 V x", "\0\xff"])
def test_other_lines_are_none(text: str) -> None:
    assert core.read_line(text) is None


def test_the_farewell_stops_first_and_then_releases() -> None:
    model, frames = core.farewell(core.pressed(ClientModel(), "i", 1.0), 1.0)
    held = [frame.buttons for frame in frames]
    assert held[:3] == [Button.STOP] * 3
    assert Button.RELEASE in held
    assert 0 in held[3 : held.index(Button.RELEASE)]
    assert all(frame.v == frame.w == 0.0 for frame in frames)
    assert [frame.seq for frame in frames] == list(range(1, len(frames) + 1))
    assert model.seq == len(frames)


# ------------------------------------------------------------------------------------------------ screen


def shown(model: ClientModel, link: str = "", now: float = 1.0) -> str:
    console = Console(file=io.StringIO(), width=80, record=True)
    console.print(render(model, "/dev/ttyUSB0", link, now))
    return console.export_text()


def test_the_screen_shows_what_a_driver_needs() -> None:
    model, _ = core.next_frame(ClientModel(), 0.95)
    text = "teleop     v +0.12 w -0.30   8.1 V  you drive  (blind: 0.08 m/s)"
    model = core.pressed(core.heard(model, Status(1, 1, 5, text), 1.0), "u", 1.0)
    page = shown(model)
    for words in (
        "TELEOP",
        "you drive",
        "+0.12 m/s",
        "-0.30 rad/s",
        "8.1 V",
        "blind: 0.08",
        "45 ms",
        "key u",
    ):
        assert words in page
    assert "50% ahead" in page
    assert "50% left" in page


def test_the_screen_keeps_its_size_whatever_it_says() -> None:
    model = core.heard(ClientModel(), Status(1, 1, 5, "idle  v +0.00 w +0.00  ? V  x  ! " + "w" * 300), 1.0)
    pages = [shown(ClientModel()), shown(model), shown(model, link="broken " * 40), shown(model, now=99.0)]
    assert len({page.count("\n") for page in pages}) == 1
    assert max(len(line) for page in pages for line in page.splitlines()) <= 80
    assert "no answer for 98 s" in pages[3]
    assert "[" in shown(core.pressed(ClientModel(), "[", 1.0)), "keys are no markup"


# ----------------------------------------------------------------------------------------------- gamepad


def event(value: int, kind: int, number: int) -> bytes:
    return EVENT.pack(123, value, kind, number)


LET_GO = event(0, 0x82, 0) + event(0, 0x82, 1)


def test_an_event_is_eight_bytes() -> None:
    assert EVENT.size == 8
    assert event(-2, 2, 1) == bytes([123, 0, 0, 0, 0xFE, 0xFF, 2, 1])


def test_the_left_stick_drives_with_a_dead_zone() -> None:
    pad = moved(Pad(present=True), LET_GO)
    assert moved(pad, event(-32767, 2, 1)).v == 1.0
    assert moved(pad, event(32767, 2, 1)).v == -1.0
    assert moved(pad, event(-32767, 2, 0)).w == 1.0
    assert moved(pad, event(3000, 2, 0)).w == 0.0
    assert moved(pad, event(-32768, 2, 0)).w == 1.0
    assert 0.0 < moved(pad, event(-5000, 2, 0)).w < 0.1
    assert moved(pad, event(32767, 2, 4)) == Pad(True, live=True, axes={0: 0, 1: 0, 4: 32767})


def test_a_stick_held_when_plugged_in_does_not_drive() -> None:
    pad = moved(Pad(present=True), event(0, 0x82, 0) + event(-32767, 0x82, 1))
    assert (pad.v, pad.w) == (0.0, 0.0)
    pad = moved(pad, event(-20000, 2, 1))
    assert pad.v == 0.0
    pad = moved(pad, event(0, 2, 1) + event(-32767, 2, 1))
    assert pad.v == 1.0


def test_buttons_are_pressed_once_and_held() -> None:
    pad = moved(Pad(present=True), event(1, 1, 0) + event(1, 1, 1) + event(0, 1, 0))
    assert (pad.pressed, pad.held) == (Button.TAKE | Button.STOP, Button.STOP)
    pad = moved(pad, b"")
    assert (pad.pressed, pad.held) == (0, Button.STOP)
    assert moved(Pad(present=True), event(1, 0x81, 0)).pressed == 0, "down already when it was opened"
    assert moved(pad, event(1, 1, 9)).pressed == 0
    assert moved(pad, b"\x01\x02\x03") == pad


def test_an_unplugged_gamepad_is_neutral_and_found_again() -> None:
    ends: list[int] = []

    def plug_in(path: str) -> int:
        ours, theirs = os.pipe()
        os.set_blocking(ours, False)
        ends.append(theirs)
        return ours

    gamepad = Gamepad("js", plug_in)
    gamepad.read(0.0)
    os.write(ends[-1], LET_GO + event(-32767, 2, 1))
    assert gamepad.read(0.1).v == 1.0
    assert gamepad.read(0.2).v == 1.0
    os.close(gamepad._fd or 0)  # what ENODEV after an unplug does: reading fails
    assert gamepad.read(0.3) == Pad()
    assert gamepad.read(1.5).present
    assert gamepad.read(1.6).v == 0.0
    gamepad.close()
    gamepad.close()
    for end in ends:
        os.close(end)


def test_no_gamepad_is_no_error(tmp_path) -> None:  # type: ignore[no-untyped-def]
    gamepad = Gamepad(str(tmp_path / "js0"))
    assert gamepad.read(0.0) == gamepad.read(2.0) == Pad()


# ------------------------------------------------------------------------------- client to driver and back


class Pipe:
    """A line in memory with two ends, as the driver and the client want it."""

    def __init__(self) -> None:
        self.a, self.b = bytearray(), bytearray()
        self.broken = False

    def end(self, mine: bytearray, other: bytearray) -> PipeEnd:
        return PipeEnd(self, mine, other)


class PipeEnd:
    def __init__(self, pipe: Pipe, mine: bytearray, other: bytearray) -> None:
        self._pipe, self._mine, self._other = pipe, mine, other

    def read(self) -> bytes:
        if self._pipe.broken:
            raise OSError(5, "Input/output error")
        data = bytes(self._mine)
        self._mine.clear()
        return data

    def write(self, data: bytes) -> int:
        if self._pipe.broken:
            raise OSError(5, "Input/output error")
        self._other.extend(data)
        return len(data)

    def close(self) -> None:
        self._mine.clear()


class World:
    """Client, line and driver, with the authority's verdict as the robot's state, on one stepped clock."""

    def __init__(self, state: str = "track") -> None:
        self.pipe = Pipe()
        self.t = 0.0
        self.state = state
        self.twist = Twist()
        self.events: list[str] = []
        self._handled = -1.0
        self._held = False
        self.driver = SerialTeleop(lambda: self.pipe.end(self.pipe.a, self.pipe.b))
        self.session = Session(self._open)

    def _open(self) -> PipeEnd:
        if self.pipe.broken:
            raise DeviceError("serial port gone: plug it in")
        return self.pipe.end(self.pipe.b, self.pipe.a)

    def now(self) -> float:
        return self.t

    def pause(self, seconds: float) -> None:
        """The robot lives on."""
        for _ in range(round(seconds / 0.01)):
            self.t = round(self.t + 0.01, 6)
            if round(self.t * 100) % 4 == 0:
                self._robot()

    def drive(self, seconds: float, typed: Callable[[int], bytes] = lambda step: b"") -> bool:
        """The client's loop, 50 steps a second."""
        going = True
        for step in range(round(seconds / 0.02)):
            self.pause(0.02)
            going = self.session.step(typed(step), self.t) and going
        return going

    def type(self, keys: bytes) -> bool:
        return self.drive(0.3, lambda step: keys if step == 0 else b"")

    def _robot(self) -> None:
        word = self.driver.latest(self.t)
        down = any(fault.kind == "link" for fault in self.driver.faults(self.t))
        verdict = authority.decide(
            word, self._handled, self.state, self.t, 0.4, 0.2, 1.0, link_down=down, held=self._held
        )
        self._held, self.twist = verdict.held, verdict.twist
        if word is not None:
            self._handled = max(self._handled, word.at)
        if verdict.event is not None:
            self.events.append(verdict.event.name)
            self.state = {"teleop_taken": "teleop", "teleop_resumed": "recognize", "armed": "search"}.get(
                verdict.event.name, "idle"
            )
        self.driver.tell(status_line(self.state, Sent(self.twist, None, 0.0), 8.1, ()), self.t)


def test_take_drive_let_go_release() -> None:
    world = World()
    world.drive(0.5)
    assert world.session.model.robot is not None
    assert world.session.model.robot.state == "track"
    world.type(b"t")
    assert world.events == ["teleop_taken"]
    world.drive(0.3, lambda step: b"u")
    assert world.twist == Twist(pytest.approx(0.1, abs=1e-3), pytest.approx(0.5, abs=1e-3))
    world.drive(0.6)
    assert world.twist.is_zero
    world.type(b"r")
    assert world.events == ["teleop_taken", "teleop_released"]
    assert world.driver.faults(world.t) == ()


def test_give_back_to_autonomy() -> None:
    world = World()
    world.drive(0.3)
    world.type(b"t")
    world.type(b"g")
    assert world.state == "recognize"


def test_stop_holds_and_the_next_key_drives_again() -> None:
    world = World()
    world.drive(0.3)
    world.type(b"t")
    world.drive(0.3, lambda step: b"i")
    world.drive(0.08, lambda step: b"k" if step == 0 else b"")
    assert world.twist.is_zero
    assert world.state == "teleop"
    world.drive(0.5)
    world.drive(0.3, lambda step: b"i")
    assert world.twist.v > 0


def test_stop_ends_autonomy_without_taking() -> None:
    world = World()
    world.drive(0.3)
    world.type(b" ")
    assert world.events == ["disarmed"]


@pytest.mark.parametrize("state", ["teleop", "track", "idle", "halted"])
def test_the_end_leaves_the_robot_standing_and_released(state: str) -> None:
    world = World()
    world.drive(0.5)
    if state == "teleop":
        world.type(b"t")
        world.drive(0.2, lambda step: b"i")
        assert world.twist.v > 0
    else:
        world.state = state
    world.session.end(world, world.pause)
    world.pause(0.2)
    assert world.twist.is_zero
    assert world.state == "idle"
    assert "armed" not in world.events


def test_a_client_that_dies_is_a_silent_person_within_half_a_second() -> None:
    world = World()
    world.drive(0.3)
    world.type(b"t")
    world.drive(0.2, lambda step: b"i")
    assert world.twist.v > 0
    world.pause(0.48)
    assert world.twist.is_zero
    assert world.state == "teleop", "never back to autonomy by itself"


def test_a_broken_line_is_shown_tried_again_and_needs_no_new_start() -> None:
    world = World()
    world.drive(0.5)
    world.pipe.broken = True
    world.drive(0.1)
    assert "broke" in world.session.link
    world.drive(1.2)
    assert "plug it in" in world.session.link
    world.pipe.broken = False
    world.drive(4.0)
    assert world.session.link == ""
    assert world.session.model.heard(world.t)
    world.type(b"t")
    assert world.state == "teleop"


def test_ctrl_d_ends_and_an_arrow_cut_in_two_does_not() -> None:
    world = World()
    world.drive(0.3)
    world.type(b"t")
    pieces = {0: b"\x1b", 1: b"[A"}
    world.drive(0.2, lambda step: pieces.get(step, b""))
    assert world.twist.v > 0
    assert world.type(b"i")
    assert not world.type(b"\x04")


def test_a_wild_paste_only_stops() -> None:
    world = World()
    world.drive(0.3)
    world.type(b"t")
    world.drive(0.1, lambda step: b"iiiiiiiiiiiiiiiiiiiii" if step == 0 else b"")
    assert world.twist.is_zero


# ---------------------------------------------------------------------------------------- a real terminal


def test_without_a_terminal_it_says_so(monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr("sys.stdin", io.StringIO())
    with pytest.raises(UserError, match="terminal"):
        run_teleop("/dev/null")


def _take_terminal(fd: int) -> Callable[[], None]:
    """In the child: make this the controlling terminal, so that Ctrl-C is a signal."""

    def take() -> None:
        os.setsid()
        fcntl.ioctl(fd, termios.TIOCSCTTY, 0)

    return take


@pytest.mark.parametrize("ending", ["ctrl-c", "sigterm", "sighup"])
def test_the_program_says_goodbye_and_mends_the_terminal(ending: str) -> None:
    line, line_end = pty.openpty()
    screen, terminal = pty.openpty()
    tty.setraw(line)
    tty.setraw(line_end)
    before = termios.tcgetattr(terminal)
    program = (
        "import sys; from robot.teleop_client import run_teleop; sys.exit(run_teleop(sys.argv[1], False))"
    )
    child = subprocess.Popen(
        [sys.executable, "-c", program, os.ttyname(line_end)],
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
        preexec_fn=_take_terminal(terminal),
    )
    try:
        received = _read_until(line, screen, lambda frames: len(frames) > 3)
        assert received[0].hello
        if ending == "ctrl-c":
            os.write(screen, b"\x03")
        else:
            child.send_signal(signal.SIGTERM if ending == "sigterm" else signal.SIGHUP)
        received = _read_until(
            line, screen, lambda frames: any(Button.RELEASE in frame.buttons for frame in frames)
        )
        assert Button.STOP in [frame.buttons for frame in received]
        _drain_until_exit(child, line, screen)
        assert child.returncode == 0
        assert termios.tcgetattr(terminal) == before
    finally:
        child.kill()
        child.wait()
        for fd in (line, line_end, screen, terminal):
            with suppress(OSError):
                os.close(fd)


def _read_until(line: int, screen: int, enough: Callable[[list[Sticks]], bool]) -> list[Sticks]:
    deadline = time.monotonic() + 40.0
    data = b""
    while time.monotonic() < deadline:
        for fd in select.select([line, screen], [], [], 0.5)[0]:
            chunk = os.read(fd, 65536)
            data += chunk if fd == line else b""
        frames = [frame for body in data.split(b"\0") if isinstance(frame := decode(body), Sticks)]
        if enough(frames):
            return frames
    raise AssertionError("the client did not say it within 40 s")


def _drain_until_exit(child: subprocess.Popen[bytes], line: int, screen: int) -> None:
    deadline = time.monotonic() + 40.0
    while child.poll() is None and time.monotonic() < deadline:
        for fd in select.select([line, screen], [], [], 0.05)[0]:
            os.read(fd, 65536)


def test_over_a_pseudo_terminal() -> None:
    far, near = pty.openpty()
    tty.setraw(far)
    tty.setraw(near)
    far_path = os.ttyname(near)
    driver = SerialTeleop(lambda: open_port(far_path))
    session = Session(lambda: FdPort(far))
    session.step(b"", 0.0)
    session.step(b"", 0.05)
    assert select.select([near], [], [], 5.0)[0]
    driver.latest(0.1)
    driver.tell("idle       v +0.00 w +0.00   8.1 V  idle", 0.1)
    deadline = time.monotonic() + 10.0
    while session.model.robot is None and time.monotonic() < deadline:
        select.select([far], [], [], 1.0)
        session.step(b"", 0.15)
    assert session.model.robot is not None
    assert session.model.robot.state == "idle"
    driver.close()
    os.close(far)
    os.close(near)


class FdPort:
    """The bare end of a pseudo-terminal."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        os.set_blocking(fd, False)

    def read(self) -> bytes:
        with suppress(BlockingIOError):
            return os.read(self._fd, 4096)
        return b""

    def write(self, data: bytes) -> int:
        return os.write(self._fd, data)

    def close(self) -> None:
        os.set_blocking(self._fd, True)
