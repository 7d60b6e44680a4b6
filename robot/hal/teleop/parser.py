"""Takes one byte stream apart: binary frames, MAVLink messages, and what remains: keys or noise. Pure.

A frame or message counts when its checksum is right. What looks like the beginning of one waits for its end,
0.1 s at most; then, or when the checksum is wrong, its first byte is noise and the rest is looked at again.
Everything else is a burst of keys, or noise. The cost is linear in the number of bytes.
"""

from __future__ import annotations

import re
from typing import Final, Literal

from robot.hal.teleop import frames, mavlink
from robot.hal.teleop.keys import Burst, is_unfinished, read_burst
from robot.hal.teleop.sticks import NEW_SESSION_AFTER_S
from robot.hal.teleop.talkers import FrameTalker, KeyTalker, MavlinkTalker
from robot.messages import TeleopInput

Speaker = Literal["nobody", "keys", "frames", "mavlink"]

PARTIAL_S: Final = 0.1
"""The rest of a frame comes within this, also over radio links; then it will not come."""
ESCAPE_S: Final = 0.04
"""The rest of an arrow key's sequence comes within this; else it was the escape key."""
SAME_BURST_S: Final = 0.010
_KEPT_OF_BURST: Final = 64

_STARTS: Final = re.compile(rb"[\x00\xfd\xfe]")
_NONE, _WAIT = 0, -1


class StreamParser:
    """Parser of one line. `feed` with no bytes lets what waits run out.

    speaker: who was understood last. noise_bytes, noise_at: how much was noise so far, and when the last.

    >>> parser = StreamParser()
    >>> [word.v for word in parser.feed(b"i", now=1.0)], parser.speaker
    ([0.5], 'keys')
    >>> parser.feed(b"i" * 9, now=2.0), parser.noise_bytes
    ([], 9)
    """

    def __init__(self) -> None:
        self.keys = KeyTalker()
        self.frames = FrameTalker()
        self.mavlink = MavlinkTalker()
        self.speaker: Speaker = "nobody"
        self.greeted = False
        self.noise_bytes = 0
        self.noise_at = -1.0
        self._buffer = b""
        self._arrived_at = -1.0
        self._program_at = -NEW_SESSION_AFTER_S
        self._burst = b""
        self._burst_at = -1.0

    def feed(self, data: bytes, now: float) -> list[TeleopInput]:
        """The words in these bytes, oldest first, all `at` now. Never raises, whatever the bytes are."""
        words = []
        if self._buffer and now - self._arrived_at > self._patience():
            words += self._scan(self._buffer, now, self._arrived_at, final=True)
        if data:
            words += self._scan(self._buffer + data, now, now, final=False)
            self._arrived_at = now
        return words

    def _patience(self) -> float:
        return PARTIAL_S if _STARTS.match(self._buffer) else ESCAPE_S

    # ------------------------------------------------------------------------------------------ taking apart

    def _scan(self, data: bytes, now: float, arrived_at: float, final: bool) -> list[TeleopInput]:
        """Take apart all of `data`, or up to what waits for more; final: nothing may wait."""
        words: list[TeleopInput] = []
        loose: list[bytes] = []
        at = 0
        while at < len(data):
            found = _STARTS.search(data, at)
            start = found.start() if found else len(data)
            loose.append(data[at:start])
            at = start
            if found is None:
                break
            end = self._message(data, at, now, words)
            if end == _WAIT and not final:
                break
            if end <= _NONE:
                end = at + 1
                loose.append(data[at:end])
            at = end
        text, self._buffer = b"".join(loose), data[at:]
        cut = len(text)
        if not final and not self._buffer and is_unfinished(text):
            cut = text.rfind(b"\x1b")
            self._buffer = text[cut:]
            if cut == 0 and arrived_at - self._burst_at <= SAME_BURST_S:
                self._burst_at = arrived_at  # no pause yet: what it becomes belongs to what came before
        elif self._buffer:
            return words + self._insisted(text, now, arrived_at)
        return words + self._judge(text[:cut], now, arrived_at)

    def _message(self, data: bytes, at: int, now: float, words: list[TeleopInput]) -> int:
        """Where the message that begins at `at` ends; _NONE if there is none, _WAIT if it is not complete."""
        if data[at] == 0:
            return self._frame(data, at, now, words)
        return self._packet(data, at, now, words)

    def _frame(self, data: bytes, at: int, now: float, words: list[TeleopInput]) -> int:
        limit = at + 1 + frames.MAX_BODY_BYTES + 2
        end = data.find(0, at + 1, limit)
        if end < 0:
            return _WAIT if len(data) < limit else _NONE
        if end == at + 1:
            return end  # one delimiter too many harms nobody
        frame = frames.decode(data[at + 1 : end])
        if frame is None:
            return _NONE
        if isinstance(frame, frames.Sticks):
            self._heard("frames", now)
            self.greeted = self.greeted or frame.hello
            word = self.frames.said(frame, now)
            words.extend([word] if word is not None else [])
        return end + 1

    def _packet(self, data: bytes, at: int, now: float, words: list[TeleopInput]) -> int:
        length = mavlink.packet_length(data, at)
        if length is None:
            return _WAIT
        end = at + length
        if length == 0:
            return _NONE
        if end > len(data):
            return _WAIT
        packet = mavlink.unpack(data[at:end])
        if packet is None:
            return _NONE
        if not mavlink.is_known(packet.number):
            # Its checksum cannot be checked; that the next message begins right behind it must do.
            return end if end == len(data) or _STARTS.match(data, end) else _NONE
        self._heard("mavlink", now)
        word = self.mavlink.said(packet, now)
        words.extend([word] if word is not None else [])
        return end

    def _heard(self, speaker: Speaker, now: float) -> None:
        self.speaker = speaker
        self._program_at = now

    # ---------------------------------------------------------------------------------------- keys and noise

    def _judge(self, text: bytes, now: float, arrived_at: float) -> list[TeleopInput]:
        """What the bytes that belong to no message say."""
        if not text:
            return []
        before, verdict = self._together(text, arrived_at)
        if verdict.noise:
            self.noise_bytes += len(text)
            self.noise_at = now
            return [TeleopInput(now, stop=True, kind="keys")] if verdict.stop else []
        fresh = verdict.keys[len(before.keys) :]
        may_drive = now - self._program_at >= NEW_SESSION_AFTER_S
        if fresh and may_drive:
            self.speaker = "keys"
        return self.keys.said(fresh, now, may_drive)

    def _insisted(self, text: bytes, now: float, arrived_at: float) -> list[TeleopInput]:
        """The same before what may become a message or noise: nobody types so; only a stop counts."""
        if not text or not self._together(text, arrived_at)[1].stop:
            return []
        return [TeleopInput(now, stop=True, kind="keys")]

    def _together(self, text: bytes, arrived_at: float) -> tuple[Burst, Burst]:
        """Verdicts on the burst these bytes belong to: without them and with them."""
        before = self._burst if arrived_at - self._burst_at <= SAME_BURST_S else b""
        self._burst = (before + text)[-_KEPT_OF_BURST:]
        self._burst_at = arrived_at
        return read_burst(before), read_burst(self._burst)


def parse_all(data: bytes) -> list[TeleopInput]:
    """Every word in these bytes, as if they had arrived at once on a quiet line.

    >>> [word.stop for word in parse_all(b"i ")]
    [False, True]
    >>> parse_all(b"\\x00i\\xff")
    []
    """
    parser = StreamParser()
    return parser.feed(data, 0.0) + parser.feed(b"", 1.0)
