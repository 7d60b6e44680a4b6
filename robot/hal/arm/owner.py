"""Who commands the controller: one master at a time, by the token in its second holding register. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence

_NOT_SEEN = -1


class Ownership:
    """What was seen of the token. A master whose heartbeat stands still between two looks is dead: its
    controller may be taken.

    token: ours, 1..65535. period_s: how often to look; every `period_s` also while another one owns it.

    >>> ownership = Ownership(token=7, period_s=1.0)
    >>> ownership.seen([41, 9, 100, 300], now=0.0); ownership.free, ownership.other
    (False, 9)
    >>> ownership.seen([41, 9, 100, 300], now=1.0); ownership.free
    True
    """

    def __init__(self, token: int, period_s: float) -> None:
        self._token = token
        self._period_s = period_s
        self._looked_at = -math.inf
        self._beat = _NOT_SEEN
        self.other: int | None = None

    @property
    def free(self) -> bool:
        """True if we may command."""
        return self.other is None

    def due(self, now: float) -> bool:
        """True if it is time to look at the registers."""
        return now - self._looked_at >= self._period_s - 1e-9

    def seen(self, control: Sequence[int], now: float) -> None:
        """Holding registers 0-3 as read: heartbeat and token first."""
        beat, token = control[0], control[1]
        is_ours = token in (0, self._token)
        is_dead = self.other == token and beat == self._beat
        self.other = None if is_ours or is_dead else token
        self._beat = beat
        self._looked_at = now
