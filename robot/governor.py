"""How often each vision stage runs: the wanted rates, or lower ones when there is not time for all. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class StagePlan:
    """A stage's wanted rate, the lowest it may be brought to, and the time one run takes (seconds)."""

    wanted_hz: float
    lowest_hz: float
    cost: float


def governed_rates(stages: Mapping[str, StagePlan], max_load: float) -> dict[str, float]:
    """Rates in Hz whose summed load (rate x cost) fits into `max_load`, if the lowest rates allow it.

    Every stage keeps its lowest rate; the time that is left is shared in proportion to what each wanted
    above it. A stage whose lowest rate is its wanted one (the guard's need) is never slowed.

    >>> governed_rates({"a": StagePlan(10, 10, 0.05), "b": StagePlan(10, 1, 0.1)}, 0.9)
    {'a': 10, 'b': 4.0}
    """
    wanted = sum(plan.wanted_hz * plan.cost for plan in stages.values())
    if wanted <= max_load:
        return {name: plan.wanted_hz for name, plan in stages.items()}
    lowest = sum(plan.lowest_hz * plan.cost for plan in stages.values())
    share = max(0.0, (max_load - lowest) / (wanted - lowest)) if wanted > lowest else 0.0
    return {
        name: plan.lowest_hz
        if plan.lowest_hz == plan.wanted_hz
        else round(plan.lowest_hz + share * (plan.wanted_hz - plan.lowest_hz), 6)
        for name, plan in stages.items()
    }
