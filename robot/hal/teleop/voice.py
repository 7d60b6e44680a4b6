"""What the robot says back on the line, in the words of whoever spoke last: text, status frames, MAVLink."""

from __future__ import annotations

from typing import Final, TypeVar

from robot.hal.teleop import mavlink
from robot.hal.teleop.frames import Status, encode_status
from robot.hal.teleop.parser import StreamParser

TELL_EVERY_S: Final = 0.5
SAME_AGAIN_S: Final = 5.0
HEARTBEAT_EVERY_S: Final = 1.0
_TEXT_EVERY_S: Final = 5.0
_COLUMNS: Final = 79
_MOST_BYTES: Final = 2048
_INFORMATION: Final = 6
T = TypeVar("T")
_LONG_AGO: Final = -1e9
_GREETING: Final = "robot: ? for help, space stops"


class Voice:
    """Makes the bytes to send; `take(limit)` gives them out whole message by whole message.

    A message that finds no room is dropped: status is worth nothing when it is old.
    """

    def __init__(self, parser: StreamParser) -> None:
        self._parser = parser
        self._waiting = bytearray()
        self._line = ""
        self._shown = ""
        self._shown_at = _LONG_AGO
        self._greeted = False
        self._status_seq = 0
        self._packet_seq = 0
        self._heartbeat_at = _LONG_AGO
        self._text_at = _LONG_AGO
        self._text_state = ""

    def tell(self, line: str, now: float) -> None:
        """A status line: its first word is the robot's state."""
        self._line = " ".join(line.split("\n")).strip()
        match self._parser.speaker:
            case "keys":
                self._show(now)
            case "frames":
                self._status(now)
            case "mavlink":
                self._statustext(now)

    def answer(self, now: float) -> None:
        """What is due by itself: replies to keys, to a hello, to commands, and the heart's beat."""
        if self._parser.speaker == "keys" and not self._greeted:
            self._greeted = True
            self._say(_GREETING)
        for note in _drained(self._parser.keys.notes):
            self._say(note)
        if self._parser.greeted:
            self._parser.greeted = False
            self._status(now)
        for number, payload in _drained(self._parser.mavlink.answers):
            self._send(number, payload)
        if self._parser.speaker == "mavlink" and now - self._heartbeat_at >= HEARTBEAT_EVERY_S:
            self._heartbeat_at = now
            self._send(mavlink.HEARTBEAT, mavlink.heartbeat(self._state == "teleop", self._state == "halted"))

    @property
    def waiting(self) -> bytes:
        """Bytes not sent yet."""
        return bytes(self._waiting)

    def sent(self, count: int) -> None:
        """So many of the waiting bytes went out."""
        del self._waiting[:count]

    @property
    def _state(self) -> str:
        return self._line.partition(" ")[0]

    def _show(self, now: float) -> None:
        """To a terminal: what changed, twice a second at most; the same again now and then."""
        pause = SAME_AGAIN_S if self._line == self._shown else TELL_EVERY_S
        if now - self._shown_at >= pause - 1e-6:
            self._shown, self._shown_at = self._line, now
            self._say(self._line)

    def _say(self, line: str) -> None:
        plain = "".join(c if c.isprintable() else "?" for c in line).encode("ascii", "replace")
        self._queue(plain[:_COLUMNS] + b"\r\n")

    def _status(self, now: float) -> None:
        heard, at = self._parser.frames.heard
        self._status_seq += 1
        self._queue(encode_status(Status(self._status_seq, heard, round((now - at) * 1e3), self._line)))

    def _statustext(self, now: float) -> None:
        """To a ground station: a change of state at once, else every 5 s; radio links are thin."""
        if self._state == self._text_state and now - self._text_at < _TEXT_EVERY_S:
            return
        self._text_state, self._text_at = self._state, now
        text = " ".join(self._line.split())
        self._send(mavlink.STATUSTEXT, mavlink.statustext(_INFORMATION, text, self._parser.mavlink.version))

    def _send(self, number: int, payload: bytes) -> None:
        self._queue(mavlink.pack(number, payload, self._packet_seq, self._parser.mavlink.version))
        self._packet_seq += 1

    def _queue(self, message: bytes) -> None:
        if len(self._waiting) + len(message) <= _MOST_BYTES:
            self._waiting += message


def _drained(items: list[T]) -> list[T]:
    drained, items[:] = items[:], []
    return drained
