"""The one source of time. Everything that needs the time is given a clock or the time itself."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Seconds since an arbitrary start; never goes backwards."""

    def now(self) -> float:
        """Return the time in seconds."""
        ...


class MonotonicClock:
    """The computer's monotonic clock, counted from the clock's creation."""

    def __init__(self) -> None:
        self._start = time.monotonic()

    def now(self) -> float:
        """Return seconds since this clock was made."""
        return time.monotonic() - self._start


class SteppedClock:
    """A clock that stands still until it is told to step: lockstep runs and tests.

    Ticks are counted, not summed, so that a long run has no rounding drift.

    >>> clock = SteppedClock(period=0.04)
    >>> clock.step()
    >>> clock.now()
    0.04
    """

    def __init__(self, period: float = 0.04) -> None:
        if period <= 0:
            raise ValueError(f"period must be positive, got {period}")
        self.period = period
        self.ticks = 0

    def now(self) -> float:
        """Return the time of the current tick in seconds."""
        return round(self.ticks * self.period, 9)

    def step(self) -> None:
        """Advance by one period."""
        self.ticks += 1
