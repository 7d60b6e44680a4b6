"""Which vision stages run on a picture: the most overdue first, as many as fit into one control tick.

Rates come from the config; the governor lowers them when the measured costs do not fit into the share of a
core that vision may use. Times are those of the run's clock, given with each call.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from robot.config import Stage
from robot.governor import StagePlan, governed_rates

BATCH_BUDGET = 0.039  # a batch takes no longer than one control tick, or the next frame's track comes late
LOWEST_SHARE = {"track": 0.2, "recognize": 0.2, "review": 0.2}  # what the governor leaves of each rate
DUE = 0.9  # share of its period after which a stage is due: a tick is too coarse to wait for all of it


@dataclass(frozen=True, slots=True)
class Budget:
    """What the governor decided: the rates in force and whether they are below the wanted ones."""

    rates_hz: Mapping[str, float]
    lowered: bool


URGENT = "track"


class VisionSchedule:
    """Remembers what each stage costs and when it was last begun.

    >>> plan = VisionSchedule({"look": Stage(rate_hz=5.0, cost_s=0.01)}, max_load=0.9)
    >>> plan.begun(["look"], now=1.0)
    >>> rates = plan.budget(["look"]).rates_hz
    >>> plan.due(["look"], rates, now=1.1), plan.due(["look"], rates, now=1.2)
    ([], ['look'])
    """

    def __init__(self, stages: Mapping[str, Stage], max_load: float) -> None:
        self._max_load = max_load
        self._costs = {name: stage.cost_s for name, stage in stages.items()}
        self._wanted_hz = {name: stage.rate_hz for name, stage in stages.items()}
        self._last_start: dict[str, float] = {}

    def budget(self, active: Iterable[str]) -> Budget:
        """The rates in force if these stages are wanted."""
        plans = {
            name: StagePlan(
                self._wanted_hz[name], self._wanted_hz[name] * LOWEST_SHARE.get(name, 1.0), self._costs[name]
            )
            for name in active
        }
        rates = governed_rates(plans, self._max_load)
        return Budget(rates, any(rates[name] < self._wanted_hz[name] for name in plans))

    def due(self, active: Sequence[str], rates_hz: Mapping[str, float], now: float) -> list[str]:
        """The most overdue stages, as many as fit into one tick (the first always does); the track first.

        Where the track is due, the others leave room for it: a late health check must not cost it a picture.
        """
        lateness = {name: (now - self._last_start.get(name, -10.0)) * rates_hz[name] for name in active}
        due = sorted(
            (name for name in active if lateness[name] > DUE), key=lambda name: -round(lateness[name], 3)
        )
        chosen: list[str] = []
        spent = 0.0
        reserved = self._costs[URGENT] if URGENT in due else 0.0
        for name in due:
            reserved = 0.0 if name == URGENT else reserved
            if not chosen or spent + self._costs[name] <= BATCH_BUDGET - reserved:
                chosen.append(name)
                spent += self._costs[name]
        # What follows the target decides the very next command; the rest of the batch may come after it.
        return sorted(chosen, key=lambda name: name != URGENT)

    def begun(self, stages: Iterable[str], now: float) -> None:
        """These stages are run on the picture of `now`."""
        for name in stages:
            self._last_start[name] = now

    def account(self, stage: str, seconds: float) -> None:
        """Learn what a stage costs; the slow average keeps the governor from hunting."""
        self._costs[stage] += 0.2 * (seconds - self._costs[stage])
