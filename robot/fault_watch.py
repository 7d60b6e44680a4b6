"""Gathers what is wrong: each device's own word, vision's, the pictures' age and content, a silent person,
a touching bumper, ticks that come late.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from robot.messages import Fault, Near, Percepts

LATE_TICK = 1.75
"""A tick this many periods after the one before is late."""
LATE_TOLD_S = 1.0
"""Late ticks are told until none came for so long."""

FaultSource = Callable[[float], tuple[Fault, ...]]


class HasFaults(Protocol):
    """Anything that can say what is wrong with it."""

    def faults(self, now: float) -> tuple[Fault, ...]:
        """Everything that is wrong at `now`."""
        ...


class FaultWatch:
    """All faults of one tick; remembers only since when those hold that nobody else dates."""

    def __init__(
        self, sources: Sequence[FaultSource], frame_max_age: float, started: float, period: float = 0.04
    ) -> None:
        self._sources = list(sources)
        self._frame_max_age = frame_max_age
        self._started = started
        self._since: dict[str, float] = {}
        self._own: list[Fault] = []
        self._period = period
        self._gathered_at: float | None = None
        self._late: tuple[float, float] | None = None

    def remember(self, fault: Fault) -> None:
        """A mistake of the program itself: it does not go away. The first of a kind is kept."""
        if all(fault.key != known.key for known in self._own):
            self._own.append(fault)

    def gather(
        self, now: float, percepts: Percepts, silent: bool, near: Near | None = None
    ) -> tuple[Fault, ...]:
        """Everything that is wrong at `now`; called once a tick.

        silent: the person in charge has not been heard. near: bumper and sonar, if there are any.
        """
        found = [fault for source in self._sources for fault in source(now)]
        if any(fault.device == "head" for fault in found):
            # Eyes that point elsewhere than they are said to look like a base that was turned.
            found = [fault for fault in found if fault.key != "base.moved"]
        found += self._dated("camera", self._picture_fault(now, percepts), now)
        found += self._dated("teleop", "silent" if silent else None, now)
        found += self._dated("near", "bump" if near is not None and near.bumped else None, now)
        found += self._late_ticks(now)
        return (*found, *self._own)

    def _late_ticks(self, now: float) -> list[Fault]:
        """Ticks whose predecessor is too long ago: two such within a second are a fault."""
        before, self._gathered_at = self._gathered_at, now
        gap = now - before if before is not None else 0.0
        if self._late is not None and now - self._late[1] > LATE_TOLD_S:
            self._late = None
        if gap <= LATE_TICK * self._period:
            return self._told_late()
        self._late = (self._late[0] if self._late is not None else now, now)
        return self._told_late()

    def _told_late(self) -> list[Fault]:
        if self._late is None or self._late[0] == self._late[1]:
            return []
        return [Fault("loop", "late", self._late[0])]

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
