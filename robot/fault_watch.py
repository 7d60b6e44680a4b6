"""Gathers what is wrong: each device's own word, vision's, the pictures' age and content, a silent person."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from robot.messages import Fault, Percepts

FaultSource = Callable[[float], tuple[Fault, ...]]


class HasFaults(Protocol):
    """Anything that can say what is wrong with it."""

    def faults(self, now: float) -> tuple[Fault, ...]:
        """Everything that is wrong at `now`."""
        ...


class FaultWatch:
    """All faults of one tick; remembers only since when those hold that nobody else dates."""

    def __init__(self, sources: Sequence[FaultSource], frame_max_age: float, started: float) -> None:
        self._sources = list(sources)
        self._frame_max_age = frame_max_age
        self._started = started
        self._since: dict[str, float] = {}
        self._own: list[Fault] = []

    def remember(self, fault: Fault) -> None:
        """A mistake of the program itself: it does not go away."""
        self._own.append(fault)

    def gather(self, now: float, percepts: Percepts, silent: bool) -> tuple[Fault, ...]:
        """Everything that is wrong at `now`. silent: the person in charge has not been heard."""
        found = [fault for source in self._sources for fault in source(now)]
        found += self._dated("camera", self._picture_fault(now, percepts), now)
        found += self._dated("teleop", "silent" if silent else None, now)
        return (*found, *self._own)

    def _picture_fault(self, now: float, percepts: Percepts) -> str | None:
        health = percepts.health
        if health is None:
            return "missing" if now - self._started > self._frame_max_age else None
        if health.age(now) > self._frame_max_age:
            return "stale"
        return health.value.fault

    def _dated(self, device: str, kind: str | None, now: float) -> list[Fault]:
        for key in [key for key in self._since if key.startswith(f"{device}.") and key != f"{device}.{kind}"]:
            del self._since[key]
        if kind is None:
            return []
        return [Fault(device, kind, self._since.setdefault(f"{device}.{kind}", now))]
