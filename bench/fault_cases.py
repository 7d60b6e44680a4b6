"""The cases of the fault matrix, generated from the fault table, and what comes out of one."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from bench.fault_injectors import INJECTORS, Injector
from bench.fault_rig import VARIANTS
from robot import faults
from robot.chart import AUTONOMOUS, LEAVES
from robot.faults import TABLE, Action
from robot.messages import Fault


@dataclass(frozen=True, slots=True)
class Case:
    """One row, brought about in one way, in one state, with the drivers plain or behind workers."""

    key: str
    injector: Injector
    state: str
    variant: str

    def __str__(self) -> str:
        return f"{self.key} ({self.injector.name}) in {self.state}, {self.variant}"

    @property
    def action(self) -> Action:
        """What the table asks for in this state."""
        device, kind = self.key.split(".")
        if self.key == "teleop.link" and self.state == "teleop":
            return Action.STOP  # by teleop.silent: nobody is heard any more
        return faults.action(Fault(device, kind, since=0.0), self.state)

    @property
    def drives(self) -> bool:
        """True if the wheels turn when the fault comes."""
        return self.state == "teleop" or (self.state in AUTONOMOUS and not self.injector.spoilt)

    @property
    def person_drives_on(self) -> bool:
        """True if a person at the stick is to drive on slowly."""
        return self.state == "teleop" and self.action is Action.CARRY_ON and self.row.action > Action.CARRY_ON

    @property
    def row(self) -> faults.Row:
        """The table's."""
        return TABLE[self.key]


@dataclass(frozen=True, slots=True)
class Outcome:
    """Seconds from the fault until it was noticed, stop was ordered, the wheels stood, the arm stood.

    NaN where there is nothing to measure. broken: what did not hold, in words.
    """

    case: Case
    detected_s: float
    stopped_s: float = math.nan
    wheels_stand_s: float = math.nan
    arm_stands_s: float = math.nan
    broken: tuple[str, ...] = ()


def cases(
    states: Sequence[str] = LEAVES, variants: Sequence[str] = VARIANTS, every_way: bool = True
) -> Iterator[Case]:
    """The matrix, generated from the table. every_way: not only the first injector of each row."""
    for key in TABLE:
        for injector in INJECTORS[key][: None if every_way else 1]:
            for state in states:
                for variant in variants:
                    if state in injector.states and variant in injector.variants:
                        yield Case(key, injector, state, variant)
