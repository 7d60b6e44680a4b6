"""What all mock drivers share: a record of the calls and failures on order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from robot.hal.faultbook import FaultBook
from robot.messages import Fault


@dataclass(frozen=True, slots=True)
class Call:
    """One call of a driver: when, which method, with what."""

    now: float
    method: str
    args: tuple[Any, ...] = ()


@dataclass(slots=True)
class _Failure:
    kind: str
    calls_left: int


class Mock:
    """Base of the mocks. `calls` is everything the driver was told, in order; `closed` counts `close()`."""

    def __init__(self, device: str) -> None:
        self.calls: list[Call] = []
        self.closed = 0
        self._book = FaultBook(device)
        self._failures: dict[str, _Failure] = {}

    def fail(self, method: str, kind: str = "link", after: int = 0) -> None:
        """Let a method fail from its call number `after` (0: the very next) until `mend`.

        A failing call does what the rules ask of a broken device: no exception, no effect, the last value;
        `faults` tells `kind` from then on. Raises ValueError if the device has no such method.
        """
        if not callable(getattr(self, method, None)):
            raise ValueError(f"{type(self).__name__} has no method {method!r} to fail")
        self._failures[method] = _Failure(kind, after)

    def mend(self) -> None:
        """The device works again: no method fails, no fault is open."""
        self._failures.clear()
        for fault in self._book.open:
            self._book.cleared(fault.kind)

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong."""
        return self._book.open

    def close(self) -> None:
        """Count it; a mock keeps nothing."""
        self.closed += 1

    def _works(self, now: float, method: str, *args: Any) -> bool:
        """Record the call; False if it is to have no effect."""
        self.calls.append(Call(now, method, args))
        failure = self._failures.get(method)
        if failure is not None:
            if failure.calls_left <= 0:
                self._book.raised(failure.kind, now, f"{method} fails on order")
                return False
            failure.calls_left -= 1
        return not self.closed
