"""What a run in real time is judged by: ticks missed, and how long it takes from picture or word to wheels.

Pure: all times are given, in seconds of `time.monotonic()`.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

PERIOD = 0.04
LATE = 1.5
"""An interval between ticks of more periods than this has lost at least one."""
SAME_MOMENT_S = 0.02


@dataclass(frozen=True, slots=True)
class Decision:
    """One control tick: when it began, when it gave the base its order, and on which pictures that rests.

    track_at, floor_at: captures of the pictures whose track (and range) and whose free floor this tick was
    the first to act on. stopped_by: the first fault that made it stop. All None where there is none.
    """

    at: float
    ordered_at: float
    state: str
    driving: bool
    track_at: float | None = None
    floor_at: float | None = None
    stopped_by: str | None = None


class Telegram(Protocol):
    """A motor command as it arrived at the brick."""

    @property
    def at(self) -> float:
        """When."""
        ...

    @property
    def port(self) -> int:
        """Of which motor."""
        ...

    @property
    def power(self) -> int:
        """How fast, in percent."""
        ...

    @property
    def stops(self) -> bool:
        """Whether it stops all motors."""
        ...


def missed_ticks(begun: Sequence[float]) -> int:
    """How many ticks an even rate would have had in the gaps between these.

    >>> missed_ticks([0.0, 0.04, 0.085, 0.17])
    1
    """
    gaps = [b - a for a, b in pairwise(begun)]
    return sum(round(gap / PERIOD) - 1 for gap in gaps if gap > LATE * PERIOD)


def with_news(telegrams: Sequence[Telegram]) -> list[float]:
    """Times of those that change a motor's power; a renewal of the old one says nothing new.

    A stop changes all motors.
    """
    power: dict[int, int] = {}
    times = []
    for telegram in telegrams:
        if telegram.stops:
            power.clear()
        elif power.get(telegram.port) == telegram.power:
            continue
        else:
            power[telegram.port] = telegram.power
        times.append(telegram.at)
    return times


def capture_to_telegram(
    decisions: Sequence[Decision],
    telegrams: Sequence[Telegram],
    moments: Sequence[float],
    picture: Callable[[Decision], float | None],
) -> list[float]:
    """Seconds from the capture of each picture to the first motor command with news that rests on it.

    A command belongs to the last order given before it came; an order that changed no motor's power gives no
    figure. moments: when pictures were truly taken, ascending; the driver's
    own estimate counts where none is near. picture: which picture of a decision is meant.
    """
    times = with_news(telegrams)
    figures = []
    for decision, following in pairwise(decisions):
        used = picture(decision)
        if used is None or not decision.driving:
            continue
        k = bisect_left(times, decision.ordered_at)
        if k < len(times) and times[k] < following.ordered_at:
            figures.append(times[k] - true_moment(used, moments))
    return figures


def true_moment(estimate: float, moments: Sequence[float]) -> float:
    """The moment of a picture nearest to the driver's estimate, or that if none is near.

    >>> true_moment(1.07, [1.0, 1.06, 1.1]), true_moment(2.0, [1.0])
    (1.06, 2.0)
    """
    k = bisect_left(moments, estimate)
    near = min(moments[max(k - 1, 0) : k + 1], key=lambda moment: abs(moment - estimate), default=None)
    return estimate if near is None or abs(near - estimate) > SAME_MOMENT_S else near


def order_to_telegram(decisions: Sequence[Decision], telegrams: Sequence[Telegram]) -> list[float]:
    """Seconds from each order that drives to the first command with news that came before the next order."""
    times = with_news(telegrams)
    figures = []
    for decision, following in pairwise(decisions):
        k = bisect_left(times, decision.ordered_at)
        if decision.driving and k < len(times) and times[k] < following.ordered_at:
            figures.append(times[k] - decision.ordered_at)
    return figures


def request_to_stop(asked: Sequence[float], telegrams: Sequence[Telegram]) -> list[float | None]:
    """Seconds from each request to the first telegram that stops all motors; None after a second."""
    stops = [telegram.at for telegram in telegrams if telegram.stops]
    figures: list[float | None] = []
    for at in asked:
        k = bisect_left(stops, at)
        figures.append(stops[k] - at if k < len(stops) and stops[k] - at < 1.0 else None)
    return figures


def fault_stops(decisions: Sequence[Decision]) -> list[float]:
    """When ticks began that were the first to know of a stop fault while the wheels were being driven."""
    return [
        now.at
        for before, now in pairwise(decisions)
        if before.driving and before.stopped_by is None and now.stopped_by is not None
    ]


def in_ms(seconds: Sequence[float]) -> dict[str, float | int | None]:
    """Count, median, 99th percentile and worst in milliseconds."""
    if not seconds:
        return {"n": 0, "median": None, "p99": None, "worst": None}
    median, p99, worst = 1e3 * np.percentile(seconds, [50, 99, 100])
    return {
        "n": len(seconds),
        "median": round(float(median), 2),
        "p99": round(float(p99), 2),
        "worst": round(float(worst), 2),
    }
