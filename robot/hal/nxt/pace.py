"""How long exchanges with a brick take, as measured, and how often they may be made. No I/O, no clock."""

from __future__ import annotations

import statistics
from collections import deque
from dataclasses import dataclass
from typing import Final

_SAMPLES: Final = 31
_RATE_WINDOW_S: Final = 3.0


@dataclass(frozen=True, slots=True)
class PaceSettings:
    """How often one driver may use the link.

    share: most part 0..1 of all time that its exchanges may take. shortest_s, longest_s: bounds of the period
    between its polls, however fast or slow the link is measured.
    """

    share: float
    shortest_s: float
    longest_s: float

    def period(self, median_s: float | None, exchanges: int = 1) -> float:
        """Seconds between polls of so many exchanges each, at this median time of one (None: not known yet).

        >>> bluetooth = PaceSettings(share=0.4, shortest_s=0.125, longest_s=0.2)
        >>> [round(bluetooth.period(median), 3) for median in (None, 0.002, 0.06, 0.3)]
        [0.125, 0.125, 0.15, 0.2]
        """
        needed = 0.0 if median_s is None else exchanges * median_s / self.share
        return min(max(needed, self.shortest_s), self.longest_s)


class ExchangeTimes:
    """The last exchanges' durations in seconds.

    >>> times = ExchangeTimes()
    >>> for seconds in (0.003, 0.004, 0.1):
    ...     times.took(seconds)
    >>> times.median_s
    0.004
    """

    def __init__(self) -> None:
        self._recent: deque[float] = deque(maxlen=_SAMPLES)

    def took(self, seconds: float) -> None:
        """One exchange was answered after so long."""
        self._recent.append(seconds)

    @property
    def median_s(self) -> float | None:
        """Median duration, None before the first."""
        return statistics.median(self._recent) if self._recent else None


class RateMeter:
    """How often something happened lately.

    >>> meter = RateMeter()
    >>> for tick in range(50):
    ...     meter.happened(tick * 0.04)
    >>> meter.rate_hz(2.0)
    25.0
    """

    def __init__(self) -> None:
        self._times: deque[float] = deque()

    def happened(self, at: float) -> None:
        """It happened at this time; times never fall."""
        self._times.append(at)
        self._forget(at)

    def rate_hz(self, now: float) -> float | None:
        """Times a second during the last 3 s; None before the second time."""
        self._forget(now)
        if len(self._times) < 2:
            return None
        return round((len(self._times) - 1) / (self._times[-1] - self._times[0]), 2)

    def _forget(self, now: float) -> None:
        while self._times and now - self._times[0] > _RATE_WINDOW_S:
            self._times.popleft()
