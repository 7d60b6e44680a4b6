"""What a stick's deflection is worth: numbers, and who may drive after a silence. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

VALID_S: Final = 0.4
"""A deflection counts no longer than this after it was heard."""
NEW_SESSION_AFTER_S: Final = 1.0
"""After such a silence any sequence number is taken: the sender may have started anew."""
NEUTRAL: Final = 0.05
"""Less deflection counts as let go."""


def clipped(share: float) -> float:
    """Within -1..1; 0 for what is no number."""
    return min(max(share, -1.0), 1.0) if share == share else 0.0


def is_neutral(v: float, w: float) -> bool:
    """True if the stick is let go."""
    return abs(v) < NEUTRAL and abs(w) < NEUTRAL


@dataclass(frozen=True, slots=True)
class Sequence:
    """Sequence numbers of one sender: only newer ones are taken, in a window of half the range.

    bits: width of the number. last, at: the newest taken and when; None before the first.

    >>> heard = Sequence(bits=16).after(65535, 0.0)
    >>> heard.is_new(0, 0.1), heard.is_new(65535, 0.1), heard.is_new(65000, 0.1), heard.is_new(65000, 1.2)
    (True, False, False, True)
    """

    bits: int
    last: int | None = None
    at: float = 0.0

    def is_new(self, seq: int, now: float) -> bool:
        """True if `seq` follows what was heard, or nothing was heard for a second."""
        if self.last is None or now - self.at > NEW_SESSION_AFTER_S:
            return True
        ahead = (seq - self.last) % (1 << self.bits)
        return 0 < ahead < 1 << (self.bits - 1)

    def after(self, seq: int, now: float) -> Sequence:
        """The same having taken `seq`."""
        return Sequence(self.bits, seq, now)


@dataclass(frozen=True, slots=True)
class Stick:
    """A stick that must be let go once before it drives: at the beginning and after every silence.

    >>> stick = Stick().moved(1.0, 0.0, now=0.0)       # deflected from the start: does not drive
    >>> stick.v, stick.live
    (0.0, False)
    >>> stick.moved(0.0, 0.0, now=0.1).moved(1.0, 0.0, now=0.2).v
    1.0
    """

    v: float = 0.0
    w: float = 0.0
    live: bool = False
    deflected: bool = False
    at: float = -VALID_S * 2

    def moved(self, v: float, w: float, now: float) -> Stick:
        """The stick after a new word of it. deflected: it is not let go, whether it drives or not."""
        neutral = is_neutral(v, w)
        live = neutral or (self.live and now - self.at <= VALID_S)
        return Stick(v if live else 0.0, w if live else 0.0, live, not neutral, now)

    def may_take(self, now: float) -> bool:
        """True unless it was last heard deflected, a moment ago."""
        return not self.deflected or now - self.at > VALID_S
