"""Watches a robot on the wire: tells the referee what it claims, notes when it decided on which picture."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot import faults
from robot.hal.interfaces import DriveBase
from robot.messages import Fault, Odometry, Tick, Timed, Twist
from robot.run_sim import Claims
from robot.sim.wire.launch import WorldChannel, WorldGoneError
from robot.wire_figures import Decision

REMEMBERED = 40_000  # ticks: 26 minutes
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


class TimedBase:
    """A `DriveBase` that notes when it was last given an order, and passes everything on."""

    def __init__(self, base: DriveBase) -> None:
        self._base = base
        self.ordered_at = time.monotonic()
        """`time.monotonic()` of the last `send` or `stop`."""

    def send(self, twist: Twist, now: float) -> Twist:
        """As the base."""
        self.ordered_at = time.monotonic()
        return self._base.send(twist, now)

    def stop(self, now: float) -> None:
        """As the base."""
        self.ordered_at = time.monotonic()
        self._base.stop(now)

    def read(self, now: float) -> Odometry:
        """As the base."""
        return self._base.read(now)

    def battery_volts(self) -> float | None:
        """As the base."""
        return self._base.battery_volts()

    def faults(self, now: float) -> tuple[Fault, ...]:
        """As the base."""
        return self._base.faults(now)

    def close(self) -> None:
        """As the base."""
        self._base.close()


@dataclass(frozen=True, slots=True)
class Memory:
    """Resident bytes of this process at a time."""

    at: float
    rss: int


class DecisionLog:
    """The last decisions. Its memory is taken at once, so that it does not look like a leak.

    >>> log = DecisionLog(size=2)
    >>> for at in (1.0, 2.0, 3.0):
    ...     log.add(Decision(at, at, "track", driving=True))
    >>> [decision.at for decision in log.all()]
    [2.0, 3.0]
    """

    def __init__(self, size: int = REMEMBERED) -> None:
        self._numbers = np.ones((size, 5))
        self._words: list[str] = []
        self._count = 0

    def add(self, decision: Decision) -> None:
        """Keep it, and forget the oldest if there is no room."""
        d = decision
        times = (d.at, d.ordered_at, _number(d.track_at), _number(d.floor_at))
        words = self._word(f"{d.state} {int(d.driving)} {d.stopped_by or ''}")
        self._numbers[self._count % len(self._numbers)] = (*times, words)
        self._count += 1

    def all(self) -> list[Decision]:
        """All that are kept, oldest first."""
        size = len(self._numbers)
        first = max(0, self._count - size)
        return [self._decision(self._numbers[k % size]) for k in range(first, self._count)]

    def _decision(self, row: NDArray[np.float64]) -> Decision:
        at, ordered_at, track_at, floor_at, word = row.tolist()
        state, driving, stopped_by = self._words[int(word)].split(" ", 2)
        return Decision(
            at, ordered_at, state, driving == "1", _time(track_at), _time(floor_at), stopped_by or None
        )

    def _word(self, word: str) -> int:
        """Its number; there are few different ones."""
        if word not in self._words:
            self._words.append(word)
        return self._words.index(word)


class Witness:
    """An observer of the loop.

    began: `time.monotonic()` at zero of the run's clock. over: called once the referee has seen enough, or
    the world is gone (`gone` tells).
    """

    def __init__(self, world: WorldChannel, base: TimedBase, began: float, over: Callable[[], None]) -> None:
        self._world, self._base, self._began, self._over = world, base, began, over
        self._claims = Claims()
        self._memory_at = 0.0
        self._acted_on: dict[str, float] = {}
        self.decisions = DecisionLog()
        self.memory: list[Memory] = []
        """Once a second."""
        self.gone: WorldGoneError | None = None

    def __call__(self, tick: Tick) -> None:
        """Note one tick, and claim what it claims."""
        self.decisions.add(self._decision(tick))
        if tick.now - self._memory_at >= 1.0:
            self._memory_at = tick.now
            self.memory.append(Memory(self._began + tick.now, resident_bytes()))
        try:
            self._claim(tick)
            if self._world.done:
                self._over()
        except WorldGoneError as error:
            self.gone = error
            self._over()

    def _claim(self, tick: Tick) -> None:
        claim = self._claims.of(tick)
        track = tick.percepts.track
        seen_at = self._began + track.at if claim.found and track is not None else None
        self._world.claim(claim, seen_at)

    def _decision(self, tick: Tick) -> Decision:
        return Decision(
            at=self._began + tick.now,
            ordered_at=self._base.ordered_at,
            state=tick.state,
            driving=not tick.sent.twist.is_zero,
            track_at=self._newly("track", _at(tick.percepts.track)),
            floor_at=self._newly("floor", _at(tick.percepts.free_space)),
            stopped_by=next((f.key for f in tick.faults if faults.row(f).action >= faults.Action.STOP), None),
        )

    def _newly(self, name: str, at: float | None) -> float | None:
        """The capture time behind a percept if no tick before acted on it."""
        if at is None or self._acted_on.get(name) == at:
            return None
        self._acted_on[name] = at
        return self._began + at


def resident_bytes() -> int:
    """What this process holds in memory now; 0 where the system does not tell."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * _PAGE_BYTES
    except (OSError, ValueError, IndexError):
        return 0


def _at(percept: Timed[Any] | None) -> float | None:
    return None if percept is None else percept.at


def _number(at: float | None) -> float:
    return math.nan if at is None else at


def _time(number: float) -> float | None:
    return None if math.isnan(number) else number
