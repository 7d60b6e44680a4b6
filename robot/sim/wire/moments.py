"""Which picture a claim speaks of: drivers know when a picture was taken, the referee its number."""

from __future__ import annotations

from collections import deque

NEAR_S = 0.02
"""Half a period: farther from every moment than this is no moment."""
NO_MOMENT = -1
_REMEMBERED = 40_000  # 26 minutes
_ASKED = 250


class Moments:
    """Remembers when the last pictures were shown.

    >>> moments = Moments()
    >>> moments.add(7, 1.00)
    >>> moments.add(8, 1.04)
    >>> moments.nearest(1.015), moments.nearest(1.2), moments.unmatched
    (7, -1, 1)
    """

    def __init__(self) -> None:
        self._shown: deque[tuple[float, int]] = deque(maxlen=_ASKED)
        self._times: deque[float] = deque(maxlen=_REMEMBERED)
        self.unmatched = 0
        """Claims about a picture that never was."""

    def add(self, seq: int, at: float) -> None:
        """Picture `seq` shows the moment `at`."""
        self._shown.append((at, seq))
        self._times.append(at)

    @property
    def times(self) -> tuple[float, ...]:
        """When pictures were taken, ascending."""
        return tuple(self._times.copy())

    def nearest(self, at: float) -> int:
        """Number of the picture taken then; NO_MOMENT if there was none, which no referee can judge."""
        moment, seq = min(
            self._shown, key=lambda shown: abs(shown[0] - at), default=(float("inf"), NO_MOMENT)
        )
        if abs(moment - at) > NEAR_S:
            self.unmatched += 1
            return NO_MOMENT
        return seq
