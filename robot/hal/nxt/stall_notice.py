"""How long a stall is told: until somebody took notice of it, and not for a blink only."""

from __future__ import annotations


class StallNotice:
    """A stall is over when it was acknowledged by a stop and `told_s` have passed since it was first told.

    >>> notice = StallNotice(told_s=1.0)
    >>> notice.told(3.0)
    >>> notice.over(9.0)
    False
    >>> notice.acknowledge()
    >>> notice.over(3.9), notice.over(4.0)
    (False, True)
    """

    def __init__(self, told_s: float) -> None:
        self._told_s = told_s
        self._since: float | None = None
        self._acknowledged = False

    def told(self, now: float) -> None:
        """A wheel stalled (still or again)."""
        self._since = now if self._since is None else self._since
        self._acknowledged = False

    def acknowledge(self) -> None:
        """Somebody stopped the wheels."""
        self._acknowledged = self._since is not None

    def over(self, now: float) -> bool:
        """True once, when it is over."""
        if self._since is None or not self._acknowledged or now < self._since + self._told_s:
            return False
        self._since = None
        return True
