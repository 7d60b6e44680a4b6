"""Inputs for parsers: drawn from a corpus of valid ones, spoiled the way links, disks and people spoil them.

Every input follows from the random generator it is given: the same seed gives the same inputs.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Sequence
from typing import Final

Mend = Callable[[random.Random, bytes], bytes]
"""Makes checksums and lengths of a spoiled input right again, or wrong on purpose, so that it gets deeper."""

_BOUNDARIES: Final = (
    0, 1, 2, 0x1F, 0x3F, 0x40, 0x41, 0x7F, 0x80, 0xFE, 0xFF, 0x100, 0x7FFF, 0x8000, 0xFFFF,
    0x10000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF,
)  # fmt: skip
_NUMBERS: Final = tuple(
    text.encode()
    for text in (
        "0", "-0.0", "1", "-1", "0.5", "255", "256", "65535", "65536", "2147483648", "-2147483649",
        "4294967296", "9223372036854775807", "9223372036854775808", "18446744073709551616", "1e308", "1e999",
        "-1e999", "1e-320", "nan", "NaN", "inf", "-inf", "Infinity", "0x7fffffff", "1_000", "1__0", "+5",
        "1979-05-27", "1979-13-41T99:00:00Z", "1" * 400, "7" * 5000, '""', "true", "[]", "{}",
    )
)  # fmt: skip
_NUMBER: Final = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WORD: Final = re.compile(rb"[A-Za-z_]{2,}")
_ODD_TEXT: Final = (
    b'"', b"'", b"`", b'"""', b"\\", b"\\u0000", b"\n", b"\r", b"\0", b"\xff", b"\xc3", "é".encode(), b"=",
    b"[", b"]", b"[[", b"{", b"}", b",", b"#", b":", b";", b".", b'" - at `$', b"a.b.c.d.e", b"[" * 3000,
    b"{" * 1200, b'{"a":' * 1200, b"a." * 150, b"%00", b"..", b"//", b"@", b"\r\n\r\n", b"--", b" ", b"\t",
)  # fmt: skip


class Source:
    """Draws inputs: one in sixteen valid, two in sixteen random bytes, the others spoiled valid ones.

    corpus: valid inputs. text: spoil words, numbers and lines too. mend: see `Mend`, used on half of the
    spoiled. longest: inputs are cut to so many bytes.
    """

    def __init__(
        self, corpus: Sequence[bytes], *, text: bool = False, mend: Mend | None = None, longest: int = 65536
    ) -> None:
        self._corpus = tuple(corpus)
        self._operations = _OPERATIONS + (_TEXT_OPERATIONS if text else ())
        self._mend = mend
        self._longest = longest

    def draw(self, rng: random.Random) -> bytes:
        """The next input."""
        kind = rng.getrandbits(4)
        valid = rng.choice(self._corpus)
        if kind == 0:
            return valid
        if kind <= 2:
            return rng.randbytes(int(rng.expovariate(1 / 24.0)) % 300)[: self._longest]
        data = valid
        for _ in range(_count(rng)):
            data = rng.choice(self._operations)(rng, data, self._corpus)
        if self._mend is not None and rng.getrandbits(1):
            data = self._mend(rng, data)
        if rng.getrandbits(9) == 0:
            data *= 1 + rng.getrandbits(7)
        return data[: self._longest]


def _count(rng: random.Random) -> int:
    """1 half of the time, 2 a quarter of it, ..., 6 at most."""
    bits = rng.getrandbits(5)
    return 6 - bits.bit_length() + (bits == 0)


def _at(rng: random.Random, data: bytes) -> int:
    return int(rng.random() * (len(data) + 1))


def _slice(rng: random.Random, data: bytes) -> tuple[int, int]:
    start = _at(rng, data)
    return start, min(len(data), start + 1 + (rng.getrandbits(6) >> rng.getrandbits(3)))


def _flip(rng: random.Random, data: bytes, corpus: Sequence[bytes]) -> bytes:
    if not data:
        return data
    at = int(rng.random() * len(data))
    return data[:at] + bytes([data[at] ^ (1 << rng.getrandbits(3))]) + data[at + 1 :]


def _overwrite(rng: random.Random, data: bytes, corpus: Sequence[bytes]) -> bytes:
    at = _at(rng, data)
    return data[:at] + bytes([rng.getrandbits(8)]) + data[at + 1 :]


def _cut(rng: random.Random, data: bytes, corpus: Sequence[bytes]) -> bytes:
    start, end = _slice(rng, data)
    return data[:start] + data[end:]


def _truncate(rng: random.Random, data: bytes, corpus: Sequence[bytes]) -> bytes:
    return data[: _at(rng, data)]


def _insert(rng: random.Random, data: bytes, corpus: Sequence[bytes]) -> bytes:
    at = _at(rng, data)
    return data[:at] + rng.randbytes(1 + rng.getrandbits(3)) + data[at:]


def _duplicate(rng: random.Random, data: bytes, corpus: Sequence[bytes]) -> bytes:
    start, end = _slice(rng, data)
    return data[:end] + data[start:end] * (1 + (rng.getrandbits(4) >> rng.getrandbits(2))) + data[end:]


def _splice(rng: random.Random, data: bytes, corpus: Sequence[bytes]) -> bytes:
    other = rng.choice(corpus)
    return data[: _at(rng, data)] + other[_at(rng, other) :]


def _append(rng: random.Random, data: bytes, corpus: Sequence[bytes]) -> bytes:
    return data + rng.choice(corpus)


def _lie(rng: random.Random, data: bytes, corpus: Sequence[bytes]) -> bytes:
    """A number at a bound, or about as long as the input, where perhaps a length stands."""
    at = _at(rng, data)
    size = (1, 1, 2, 4)[rng.getrandbits(2)]
    value = rng.choice(_BOUNDARIES) if rng.getrandbits(1) else len(data) + rng.getrandbits(2) - 2
    encoded = (value & ((1 << 8 * size) - 1)).to_bytes(size, "little" if rng.getrandbits(1) else "big")
    return data[:at] + encoded + data[at + size :]


def _other_number(rng: random.Random, data: bytes, corpus: Sequence[bytes]) -> bytes:
    return _replaced(rng, data, _NUMBER, _NUMBERS)


def _other_word(rng: random.Random, data: bytes, corpus: Sequence[bytes]) -> bytes:
    return _replaced(rng, data, _WORD, _WORD.findall(rng.choice(corpus)) or [b"x"])


def _odd_text(rng: random.Random, data: bytes, corpus: Sequence[bytes]) -> bytes:
    at = _at(rng, data)
    return data[:at] + rng.choice(_ODD_TEXT) + data[at:]


def _lines(rng: random.Random, data: bytes, corpus: Sequence[bytes]) -> bytes:
    """Drop, repeat or move a line."""
    lines = data.split(b"\n")
    line = lines.pop(int(rng.random() * len(lines)))
    for _ in range(rng.getrandbits(2) % 3):
        lines.insert(int(rng.random() * (len(lines) + 1)), line)
    return b"\n".join(lines)


def _replaced(
    rng: random.Random, data: bytes, pattern: re.Pattern[bytes], replacements: Sequence[bytes]
) -> bytes:
    # Not to scan a long input again and again: from somewhere on, or else from its beginning.
    found = pattern.search(data, _at(rng, data)) or pattern.search(data)
    if found is None:
        return data
    return data[: found.start()] + rng.choice(replacements) + data[found.end() :]


_OPERATIONS: Final = (
    _flip, _flip, _overwrite, _cut, _truncate, _insert, _duplicate, _splice, _append, _lie, _lie,
)  # fmt: skip
_TEXT_OPERATIONS: Final = (_other_number,) * 5 + (_other_word,) * 4 + (_odd_text,) * 2 + (_lines,) * 3
