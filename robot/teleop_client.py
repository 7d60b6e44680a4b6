"""`robot teleop PORT`: drive the robot from a terminal, with keys or a gamepad, over a serial line."""

from __future__ import annotations

import os
import select
import signal
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from types import FrameType
from typing import Final, Protocol

from rich.console import Console
from rich.live import Live

from robot import teleop_model as core
from robot.clock import Clock, MonotonicClock
from robot.errors import UserError
from robot.gamepad import Gamepad, Pad
from robot.hal.interfaces import DeviceError
from robot.hal.teleop.frames import MAX_BODY_BYTES, Status, Sticks, decode, encode_sticks
from robot.hal.teleop.keys import is_unfinished, read_burst
from robot.hal.teleop.port import BAUD_RATE, Port, open_port
from robot.teleop_model import FRAME_EVERY_S, ClientModel
from robot.teleop_screen import render

DONE, LINK_LOST = 0, 3
_LOOK_EVERY_S: Final = 0.02
_SHOW_EVERY_S: Final = 0.1
_HELLO_EVERY_S: Final = 1.0
_REOPEN_EVERY_S: Final = 1.0
_END_KEYS: Final = b"\x03\x04"  # Ctrl-C where it makes no signal, Ctrl-D


class Pads(Protocol):
    """Where the gamepad is read."""

    def read(self, now: float) -> Pad:
        """How it stands."""
        ...

    def close(self) -> None:
        """Release it."""
        ...


class Session:
    """The client's end of the line: model, port and gamepad together; `step` moves it on and never waits.

    A line that breaks is opened again each second; the robot stops by itself meanwhile. `link` says what is
    wrong with it, empty if nothing is.
    """

    def __init__(self, open_line: Callable[[], Port], pads: Pads | None = None) -> None:
        self.model = ClientModel()
        self.link = ""
        self._open_line = open_line
        self._pads = pads
        self._port: Port | None = open_line()
        self._reopen_at = 0.0
        self._frame_at = -FRAME_EVERY_S
        self._hello_at = -_HELLO_EVERY_S
        self._received = b""
        self._keys = b""

    def step(self, typed: bytes, now: float) -> bool:
        """Take in keys, gamepad and the robot's answers, send what is due. False when the person ends it."""
        for name in self._names(typed):
            self.model = core.pressed(self.model, name, now)
        if self._pads is not None:
            self.model = core.padded(self.model, self._pads.read(now), now)
        self._listen(now)
        if now - self._frame_at >= FRAME_EVERY_S:
            self._frame_at = now
            self._next(now)
        return not any(byte in _END_KEYS for byte in typed)

    def end(self, clock: Clock, pause: Callable[[float], None]) -> None:
        """Stop and release, whatever happened before; then let go of the line."""
        self.model, frames = core.farewell(self.model, clock.now())
        for frame in frames:
            if self._port is not None:
                self._send(frame, clock.now())
                pause(FRAME_EVERY_S)
        if self._port is not None:
            self._port.close()
            self._port = None
        if self._pads is not None:
            self._pads.close()

    # ------------------------------------------------------------------------------------------------ inside

    def _names(self, typed: bytes) -> tuple[str, ...]:
        """Keys typed; an arrow key's sequence that is cut off waits for its rest until the next look."""
        burst, self._keys = self._keys + typed, b""
        if typed and is_unfinished(burst) and len(burst) <= 3:
            self._keys = burst
            return ()
        verdict = read_burst(burst)
        return (" ",) if verdict.stop else verdict.keys

    def _next(self, now: float) -> None:
        if self._port is None and not self._reopened(now):
            return
        if not self.model.heard(now) and now - self._hello_at >= _HELLO_EVERY_S:
            self._hello_at = now
            self.model, frame = core.hello(self.model, now)
        else:
            self.model, frame = core.next_frame(self.model, now)
        self._send(frame, now)

    def _send(self, frame: Sticks, now: float) -> None:
        """One frame; it is dropped if the line does not take it: the next one is newer."""
        if self._port is None:
            return
        try:
            self._port.write(encode_sticks(frame))
        except OSError as error:
            self._lost(now, error)

    def _listen(self, now: float) -> None:
        if self._port is None:
            return
        try:
            self._received += self._port.read()
        except OSError as error:
            self._lost(now, error)
            return
        *bodies, rest = self._received.split(b"\0")
        self._received = rest[-MAX_BODY_BYTES - 1 :]
        for body in bodies:
            frame = decode(body)
            if isinstance(frame, Status):
                self.model = core.heard(self.model, frame, now)

    def _lost(self, now: float, error: OSError) -> None:
        if self._port is not None:
            self._port.close()
        self._port = None
        self._received = b""
        self._reopen_at = now + _REOPEN_EVERY_S
        self.link = f"the line broke: {error.strerror or error}; trying again"

    def _reopened(self, now: float) -> bool:
        if now < self._reopen_at:
            return False
        try:
            self._port = self._open_line()
        except DeviceError as error:
            self._reopen_at = now + _REOPEN_EVERY_S
            self.link = str(error)
            return False
        self.link = ""
        self._hello_at = now - _HELLO_EVERY_S
        return True


def run_teleop(port: str, gamepad: bool = True, baudrate: int = BAUD_RATE) -> int:
    """Drive over `port` until Ctrl-C; 0, or 3 if the line was broken at the end.

    Stop and release are sent at the end, also after SIGTERM, a closed terminal or a mistake of the program.
    Raises UserError if there is no terminal or the port cannot be opened.
    """
    if not sys.stdin.isatty():
        raise UserError("robot teleop reads keys from a terminal: run it in one, not in a pipe")
    pads = Gamepad() if gamepad else None
    clock = MonotonicClock()
    try:
        session = Session(lambda: open_port(port, baudrate), pads)
    except DeviceError as error:
        raise UserError(f"teleop: {error}") from error
    with ExitStack() as ending:  # last entered, first left: the robot stands before the terminal is mended
        ending.enter_context(ended_by_signals())
        ending.enter_context(keys_at_once(sys.stdin.fileno()))
        ending.callback(_end_undisturbed, session, clock)
        with suppress(KeyboardInterrupt):
            _drive(session, clock, port)
    return LINK_LOST if session.link else DONE


def _drive(session: Session, clock: Clock, port: str) -> None:
    shown_at = -_SHOW_EVERY_S
    with Live(console=Console(), auto_refresh=False, transient=True) as live:
        while session.step(_typed(_LOOK_EVERY_S), clock.now()):
            now = clock.now()
            if now - shown_at >= _SHOW_EVERY_S:
                shown_at = now
                live.update(render(session.model, port, session.link, now), refresh=True)


def _typed(wait_s: float) -> bytes:
    """Keys typed within this time. Raises KeyboardInterrupt when the terminal is gone."""
    fd = sys.stdin.fileno()
    ready, _, _ = select.select([fd], [], [], wait_s)
    if not ready:
        return b""
    data = os.read(fd, 64)
    if not data:
        raise KeyboardInterrupt
    return data


def _end_undisturbed(session: Session, clock: Clock) -> None:
    """Say stop and release, even while the person hammers on Ctrl-C."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    session.end(clock, time.sleep)


@contextmanager
def keys_at_once(fd: int) -> Iterator[None]:
    """The terminal gives each key at once and shows none; afterwards it is as before."""
    before = termios.tcgetattr(fd)
    tty.setcbreak(fd, termios.TCSANOW)
    try:
        yield
    finally:
        with suppress(termios.error):
            termios.tcsetattr(fd, termios.TCSAFLUSH, before)


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """SIGTERM and SIGHUP end like Ctrl-C; afterwards all signals mean what they meant before."""

    def end(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGHUP, end)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
