"""Plain keys of any terminal, as in teleop_twist_keyboard, and the rule that tells keys from noise. Pure.

A burst is what arrived without a pause. Only a burst of at most 8 keys and nothing else can move the robot
(an arrow key is one key of three bytes). A longer one, or one with other bytes in it, is noise; yet space or
k stops also in a long burst of printable bytes, for a person who leans on the key must be heard.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

MAX_BURST_KEYS: Final = 8
MOTIONS: Final[dict[str, tuple[int, int]]] = {
    "u": (1, 1),
    "i": (1, 0),
    "o": (1, -1),
    "j": (0, 1),
    "l": (0, -1),
    "m": (-1, -1),
    ",": (-1, 0),
    ".": (-1, 1),
    "up": (1, 0),
    "left": (0, 1),
    "right": (0, -1),
    "down": (-1, 0),
}
"""Forward and left of each key that drives. Backwards m and . turn as in teleop_twist_keyboard."""

_MAX_BURST_BYTES: Final = 3 * MAX_BURST_KEYS
_ARROWS: Final = {b"A": "up", b"B": "down", b"C": "right", b"D": "left"}
_STOPS: Final = b" k"
_LINE_ENDS: Final = b"\r\n"
_ESCAPE: Final = 0x1B
_INTERRUPT: Final = 0x03
_STEP_UP, _STEP_DOWN = 1.1, 0.9
_SLOWEST, _FASTEST = 0.1, 1.0

HELP: Final = (
    "  u  i  o    drive; each key a pulse of 0.4 s, hold it to keep going",
    "  j  k  l    arrow keys drive too",
    "  m  ,  .    space, k, any other key: STOP",
    "  t take the stick (let go first)      r release it; acknowledge a halt",
    "  g give to autonomy (arm)             ? this help",
    "  q/z all speeds up/down    w/x forward only    e/c turning only",
)
"""What `?` shows."""


class Ask(Enum):
    """What a key asks for besides driving."""

    STOP = "stop"
    TAKE = "take"
    RELEASE = "release"
    GIVE = "give"
    HELP = "help"


_ASKS: Final = {"t": Ask.TAKE, "r": Ask.RELEASE, "g": Ask.GIVE, "?": Ask.HELP, " ": Ask.STOP, "k": Ask.STOP}


@dataclass(frozen=True, slots=True)
class Speeds:
    """How much of the robot's top speed a key asks for, 0.1..1.

    >>> Speeds().after("q")
    Speeds(forward=0.55, turning=0.55)
    """

    forward: float = 0.5
    turning: float = 0.5

    def after(self, key: str) -> Speeds | None:
        """The speeds after this key; None if it is not one that changes them."""
        factors = {
            "q": (_STEP_UP, _STEP_UP),
            "z": (_STEP_DOWN, _STEP_DOWN),
            "w": (_STEP_UP, 1.0),
            "x": (_STEP_DOWN, 1.0),
            "e": (1.0, _STEP_UP),
            "c": (1.0, _STEP_DOWN),
        }.get(key)
        if factors is None:
            return None
        return Speeds(_within(self.forward * factors[0]), _within(self.turning * factors[1]))


@dataclass(frozen=True, slots=True)
class Burst:
    """What a burst says. keys: names oldest first, empty for noise. stop: it says stop, noise or not."""

    keys: tuple[str, ...] = ()
    stop: bool = False
    noise: bool = False


def read_burst(burst: bytes) -> Burst:
    """Judge a burst: every byte that came without a pause and belongs to no valid frame.

    >>> read_burst(b"i").keys
    ('i',)
    >>> read_burst(b"i\\xff").keys
    ()
    """
    keys = None if len(burst) > _MAX_BURST_BYTES else _keys(burst)
    if keys is None or len(keys) > MAX_BURST_KEYS:
        return Burst(stop=_insists_on_stop(burst), noise=True)
    return Burst(keys, any(asked(key) is Ask.STOP for key in keys))


def asked(key: str) -> Ask | None:
    """What a key asks for; None for one that drives or sets speeds. A key without a meaning stops.

    >>> asked("y").name
    'STOP'
    """
    if key in MOTIONS or Speeds().after(key) is not None:
        return None
    return _ASKS.get(key, Ask.STOP)


def is_unfinished(burst: bytes) -> bool:
    """True if the burst ends in the beginning of an escape sequence: the rest may be under way."""
    at = burst.rfind(_ESCAPE)
    if at < 0:
        return False
    rest = burst[at + 1 :]
    return rest in (b"", b"O") or (rest[:1] == b"[" and all(0x20 <= byte < 0x40 for byte in rest[1:]))


def _keys(burst: bytes) -> tuple[str, ...] | None:
    """Names of the keys in the burst; None if a byte of it is no key."""
    if len(burst) == 1 and burst[0] == _INTERRUPT:
        return ("interrupt",)
    names = []
    at = 0
    while at < len(burst):
        byte = burst[at]
        if byte == _ESCAPE:
            length = _escape_length(burst[at:])
            sequence = burst[at : at + length]
            if not all(0x20 <= each < 0x7F for each in sequence[1:]):
                return None  # no terminal sends such a sequence
            arrow = _ARROWS.get(sequence[2:]) if sequence[:2] in (b"\x1b[", b"\x1bO") else None
            names.append(arrow or "escape")
            at += length
            continue
        at += 1
        if byte in _LINE_ENDS:
            continue  # a terminal that sends whole lines
        if not 0x20 <= byte < 0x7F:
            return None
        names.append(chr(byte))
    return tuple(names)


def _escape_length(sequence: bytes) -> int:
    """Bytes of the escape sequence at the beginning (ECMA-48: CSI parameters, then one final byte)."""
    if sequence[1:2] == b"O":
        return min(3, len(sequence))
    if sequence[1:2] != b"[":
        return 1
    at = 2
    while at < len(sequence) and 0x20 <= sequence[at] < 0x40:
        at += 1
    return min(at + 1, len(sequence))


def _insists_on_stop(burst: bytes) -> bool:
    """True for printable bytes with space or k among them; a break on the line adds zeros to it."""
    text = burst.replace(b"\0", b"")
    return all(0x20 <= byte < 0x7F for byte in text) and any(byte in _STOPS for byte in text)


def _within(share: float) -> float:
    return round(min(max(share, _SLOWEST), _FASTEST), 3)
