"""What is wrong with one device right now."""

from __future__ import annotations

from robot.messages import Fault


class FaultBook:
    """Open faults of one device, in the order they began. A fault keeps the time it was first seen.

    >>> book = FaultBook("base")
    >>> book.raised("link", 1.0, "no answer")
    >>> book.raised("link", 2.0, "still none")
    >>> book.open
    (Fault(device='base', kind='link', since=1.0, evidence='still none'),)
    >>> book.cleared("link")
    >>> book.open
    ()
    """

    def __init__(self, device: str) -> None:
        self._device = device
        self._open: dict[str, Fault] = {}

    @property
    def open(self) -> tuple[Fault, ...]:
        """The faults that are not over."""
        return tuple(self._open.values())

    def __contains__(self, kind: str) -> bool:
        """True while a fault of this kind is open."""
        return kind in self._open

    def raised(self, kind: str, now: float, evidence: str = "") -> None:
        """The fault is there (still or again); evidence is the newest."""
        since = self._open[kind].since if kind in self._open else now
        self._open[kind] = Fault(self._device, kind, since, evidence)

    def cleared(self, kind: str) -> None:
        """The fault is over (or never was)."""
        self._open.pop(kind, None)
