"""The teleop link over a serial port (`TeleopLink`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from robot.hal.backoff import Backoff
from robot.hal.faultbook import FaultBook
from robot.hal.interfaces import DeviceError
from robot.hal.teleop.parser import StreamParser
from robot.hal.teleop.port import Port
from robot.hal.teleop.sticks import VALID_S
from robot.hal.teleop.voice import Voice
from robot.hal.threaded import decisive
from robot.messages import Fault, TeleopInput

NOISE_LASTS_S: Final = 1.0
"""The line counts as noisy until it was clean for so long."""
_MOST_READS: Final = 4


class SerialTeleop:
    """Reads whoever is at the other end of a serial line; keys, frames and MAVLink as they come.

    Nothing here waits: call `latest` 25 times a second. A stick's word keeps its time `at` and drives for
    pulse_s at most; then the same word is given with v = w = 0, so that an old `at` still tells silence.
    Several words between two looks: a stop wins, then take, release or give, then the newest.

    Args:
        open_port: opens the line; called again, with growing pauses, after it broke. May raise DeviceError.
        pulse_s: how long a key or a deflection drives, 0.05..0.4 s.

    Raises DeviceError if the port cannot be opened the first time, ValueError for a pulse out of range.
    """

    def __init__(self, open_port: Callable[[], Port], pulse_s: float = VALID_S) -> None:
        if not 0.05 <= pulse_s <= VALID_S:
            raise ValueError(f"pulse_s must be within 0.05..{VALID_S}, got {pulse_s}")
        self._open_port = open_port
        self._pulse_s = pulse_s
        self._book = FaultBook("teleop")
        self._closed = False
        self._backoff = Backoff()
        self._word: TeleopInput | None = None
        self._words: list[TeleopInput] = []
        self._listen_afresh()
        self._port: Port | None = open_port()

    def latest(self, now: float) -> TeleopInput | None:
        """The newest word, standing once its time is over; None if nothing was ever heard."""
        if not self._closed:
            self._connect(now)
            self._words += self._heard(now)
            self._speak(now)
        if self._port is None:
            self._words = [word for word in self._words if word.stop]
        if self._words and (self._word is None or now > self._word.at):
            self._word, self._words = replace(decisive(self._words), at=now), []
        if self._word is not None and now - self._word.at > self._pulse_s:
            self._stand()
        return self._word

    def tell(self, line: str, now: float) -> None:
        """Say one status line back, in whatever words the other end speaks. Dropped if it does not listen."""
        if self._port is not None:
            self._voice.tell(line, now)
            self._speak(now)

    def faults(self, now: float) -> tuple[Fault, ...]:
        """teleop.link: the port is broken or gone. teleop.noise: bytes that are no word came lately."""
        if "noise" in self._book and now - self._parser.noise_at > NOISE_LASTS_S:
            self._book.cleared("noise")
        return self._book.open

    def close(self) -> None:
        """Release the port; the last word stands still."""
        self._closed = True
        self._stand()
        if self._port is not None:
            self._port.close()
            self._port = None

    # ------------------------------------------------------------------------------------------------ hearing

    def _heard(self, now: float) -> list[TeleopInput]:
        before = self._parser.noise_bytes
        words: list[TeleopInput] = []
        for _ in range(_MOST_READS):
            data = self._read(now)
            words += self._parser.feed(data, now)
            if not data:
                break
        if self._parser.noise_bytes > before:
            self._book.raised("noise", now, f"{self._parser.noise_bytes} bytes so far that are no word")
            words = [word for word in words if not _is_pulse(word)]
            if self._word is not None and _is_pulse(self._word):
                self._stand()
        return words

    def _read(self, now: float) -> bytes:
        if self._port is None:
            return b""
        try:
            return self._port.read()
        except OSError as error:
            self._lost(now, str(error))
            return b""

    def _speak(self, now: float) -> None:
        if self._port is None:
            return
        self._voice.answer(now)
        waiting = self._voice.waiting
        if not waiting:
            return
        try:
            self._voice.sent(self._port.write(waiting))
        except OSError as error:
            self._lost(now, str(error))

    def _stand(self) -> None:
        if self._word is not None and (self._word.v or self._word.w):
            self._word = replace(self._word, v=0.0, w=0.0)

    # ---------------------------------------------------------------------------------------- losing, finding

    def _listen_afresh(self) -> None:
        self._parser = StreamParser()
        self._voice = Voice(self._parser)

    def _lost(self, now: float, why: str) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None
        self._stand()
        self._book.raised("link", now, why)
        self._backoff.failed(now)

    def _connect(self, now: float) -> None:
        if self._port is not None or not self._backoff.due(now):
            return
        try:
            self._port = self._open_port()
        except DeviceError as error:
            self._backoff.failed(now)
            self._book.raised("link", now, str(error))
            return
        self._backoff.worked()
        self._listen_afresh()
        self._book.cleared("link")


def _is_pulse(word: TeleopInput) -> bool:
    return word.kind == "keys" and bool(word.v or word.w)
