"""An emulated brick behind a pseudo-terminal, framed as over Bluetooth: for real time and for other clients.

Each telegram carries its length in front, two bytes little-endian. A thread serves it; whoever lets the
brick's time pass meanwhile holds `lock`:

    with BrickOnPty(brick) as port:
        driver = NxtBase(Brick(SerialLink(lambda: open_serial_port(port.path)), 0.15, clock))
        while running:
            with port.lock:
                brick.advance(0.002)
"""

from __future__ import annotations

import os
import select
import threading
import tty
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Final

from robot.sim.brick_emulator import BrickEmulator

_LENGTH_BYTES: Final = 2
_TELEGRAM_MAX: Final = 64
_LOOK_S: Final = 0.02


class BrickOnPty:
    """Serves a brick until closed. While the brick is gone (link cut, switched off) its line is hung up.

    turnaround_s: wait at every change of direction, Bluetooth has about 0.03; may be changed while running.
    lock: held around every telegram; give one of your own if the world has one already. link: a path that
    always points at the present terminal, like /dev/rfcommN, and is not there while the line is hung up;
    without it a line that comes back has another `path`.
    """

    def __init__(
        self,
        brick: BrickEmulator,
        turnaround_s: float = 0.0,
        *,
        lock: threading.Lock | None = None,
        link: Path | None = None,
    ) -> None:
        self.turnaround_s = turnaround_s
        self.lock = lock or threading.Lock()
        self._brick = brick
        self._link = link
        self._hung_up = False
        self._line: _Line | None = None
        self._line_lock = threading.Lock()
        self._answered_last = False
        self._closing = threading.Event()
        self._connect()
        self._thread = threading.Thread(target=self._serve, name="brick-pty", daemon=True)
        self._thread.start()

    @property
    def path(self) -> str:
        """Where a driver opens it. Raises ConnectionError while the line is hung up and has no fixed path."""
        if self._link is not None:
            return str(self._link)
        line = self._line
        if line is None:
            raise ConnectionError("the brick's line is hung up")
        return line.path

    def hang_up(self) -> None:
        """Break the connection, whatever the brick does: the driver's end reads a hang-up."""
        self._hung_up = True
        self._disconnect()

    def restore(self) -> None:
        """Take calls again after `hang_up`; a driver has to open the port anew."""
        self._hung_up = False
        if self._brick.reachable:
            self._connect()

    def inject(self, noise: bytes) -> None:
        """Put raw bytes on the line towards the driver, without any frame."""
        line = self._line
        if line is not None:
            line.write(noise)

    def close(self) -> None:
        """Hang up and end the thread. May be called twice."""
        self._closing.set()
        self._thread.join(timeout=2.0)
        self._disconnect()

    def __enter__(self) -> BrickOnPty:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # ------------------------------------------------------------------------------------------ the line

    def _connect(self) -> None:
        with self._line_lock:
            if self._line is not None or self._closing.is_set():
                return
            self._line = _Line()
            self._answered_last = False
            if self._link is not None:
                _point(self._link, self._line.path)

    def _disconnect(self) -> None:
        with self._line_lock:
            line, self._line = self._line, None
            if line is None:
                return
            if self._link is not None:
                self._link.unlink(missing_ok=True)
            line.close()

    # ---------------------------------------------------------------------------------------- the thread

    def _serve(self) -> None:
        while not self._closing.is_set():
            self._follow_the_brick()
            line = self._line
            if line is None:
                self._closing.wait(_LOOK_S)
                continue
            for telegram in line.telegrams(_LOOK_S):
                self._answer(line, telegram)

    def _follow_the_brick(self) -> None:
        with self.lock:
            reachable = self._brick.reachable
        if not reachable:
            self._disconnect()
        elif not self._hung_up:
            self._connect()

    def _answer(self, line: _Line, telegram: bytes) -> None:
        self._turn_round(answering=False)
        with self.lock:
            try:
                reply = self._brick.handle(telegram)
            except ConnectionError:
                return
        if reply is not None:
            self._turn_round(answering=True)
            line.write(len(reply).to_bytes(_LENGTH_BYTES, "little") + reply)

    def _turn_round(self, answering: bool) -> None:
        if answering != self._answered_last and self.turnaround_s > 0:
            self._closing.wait(self.turnaround_s)
        self._answered_last = answering


class _Line:
    """One pair of pseudo-terminal ends; both are kept open so that the driver may come and go."""

    def __init__(self) -> None:
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        self.path = os.ttyname(self._theirs)
        self._received = bytearray()
        self._lock = threading.Lock()
        self._closed = False

    def telegrams(self, timeout: float) -> list[bytes]:
        """What came whole within the time; what has no sensible length is thrown away."""
        with suppress(OSError, ValueError):
            if select.select([self._ours], [], [], timeout)[0]:
                with self._lock:
                    if not self._closed:
                        self._received += os.read(self._ours, 4096)
        return list(iter(self._next, b""))

    def _next(self) -> bytes:
        length = int.from_bytes(self._received[:_LENGTH_BYTES], "little")
        if len(self._received) < _LENGTH_BYTES:
            return b""
        if not 0 < length <= _TELEGRAM_MAX:
            self._received.clear()
            return b""
        end = _LENGTH_BYTES + length
        if len(self._received) < end:
            return b""
        telegram = bytes(self._received[_LENGTH_BYTES:end])
        del self._received[:end]
        return telegram

    def write(self, content: bytes) -> None:
        """Send; what a driver that never reads leaves no room for is lost."""
        with suppress(OSError), self._lock:
            if not self._closed:
                os.write(self._ours, content)

    def close(self) -> None:
        with self._lock:
            if self._closed:
                return
            self._closed = True
            for end in (self._ours, self._theirs):
                with suppress(OSError):
                    os.close(end)


def _point(link: Path, target: str) -> None:
    """Let the link name the target, at once and never half."""
    waiting = link.with_name(link.name + ".new")
    waiting.unlink(missing_ok=True)
    waiting.symlink_to(target)
    waiting.replace(link)
