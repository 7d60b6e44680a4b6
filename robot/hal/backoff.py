"""When a broken device is tried again: soon at first, then ever more rarely."""

from __future__ import annotations

import math


class Backoff:
    """Tries are `first_s` apart at first, each pause `growth` times the last, at most `most_s`.

    >>> backoff = Backoff(first_s=0.5, most_s=5.0)
    >>> backoff.due(10.0)
    True
    >>> backoff.failed(10.0)
    >>> backoff.due(10.4), backoff.due(10.5)
    (False, True)
    >>> backoff.failed(10.5)
    >>> backoff.due(11.4), backoff.due(11.5)
    (False, True)
    """

    def __init__(self, first_s: float = 0.5, most_s: float = 5.0, growth: float = 2.0) -> None:
        self._growth = growth
        self._first_s = first_s
        self._most_s = most_s
        self._pause_s = first_s
        self._next_at = -math.inf

    def due(self, now: float) -> bool:
        """True if it may be tried now."""
        return now >= self._next_at - 1e-9

    def failed(self, now: float) -> None:
        """The try at this time failed."""
        self._next_at = now + self._pause_s
        self._pause_s = min(self._pause_s * self._growth, self._most_s)

    def worked(self) -> None:
        """It works: the next failure begins with the short pause again."""
        self._pause_s = self._first_s
        self._next_at = -math.inf
