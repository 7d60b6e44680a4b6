"""What all lamp drivers do alike: write a level when it changes and now and then again, tell failures."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Final

from robot.hal.faultbook import FaultBook
from robot.messages import Fault

REFRESH_S: Final = 0.4
"""A level is written again after this, so that a lamp that vanished or forgot it is noticed within 0.5 s."""


class WrittenLamp:
    """A `LampDevice` whose subclass writes a level by `_write` (DeviceError or OSError if it cannot).

    `send` never raises. Fault: `link`, from the first failed write to the next good one.
    """

    def __init__(self) -> None:
        self._faults = FaultBook("lamp")
        self._level = 0.0
        self._written_at = -math.inf
        self._closed = False

    def send(self, level: float, now: float) -> float:
        """Set the level, clipped to 0..1 (nan: dark); returns the one it has: the old one on failure."""
        if self._closed:
            return 0.0
        wanted = self._offered(min(max(level, 0.0), 1.0) if level == level else 0.0)
        is_due = now - self._written_at >= REFRESH_S - 1e-9
        if wanted == self._level and not is_due and "link" not in self._faults:
            return self._level
        try:
            self._write(wanted, now)
        except OSError as error:
            self._faults.raised("link", now, str(error))
            return self._level
        self._faults.cleared("link")
        self._level = wanted
        self._written_at = now
        return wanted

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong."""
        return self._faults.open

    def close(self) -> None:
        """Switch it off and let it go. May be called twice."""
        if self._closed:
            return
        self._closed = True
        # A lamp that is gone nobody can switch off any more, and closing must not fail for that.
        with suppress(OSError):
            self._write(0.0, max(self._written_at, 0.0))
        self._level = 0.0
        self._release()

    def _offered(self, level: float) -> float:
        """The nearest level this lamp can have."""
        return level

    def _write(self, level: float, now: float) -> None:
        """Make it so. Raises OSError."""
        raise NotImplementedError

    def _release(self) -> None:
        """Let go of what is open."""
