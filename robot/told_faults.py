"""Drills: faults that are told without anything being broken, for rows nothing simulated can provoke."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from robot.errors import UserError
from robot.faults import TABLE
from robot.messages import Fault


@dataclass(frozen=True, slots=True)
class ToldFault:
    """A row of the fault table holds from `at` seconds on, for `duration` seconds (None: for good).

    Raises UserError for what is no row of the table.
    """

    device: str
    kind: str
    at: float
    duration: float | None = None

    def __post_init__(self) -> None:
        if f"{self.device}.{self.kind}" not in TABLE:
            raise UserError(
                f"fault '{self.device}.{self.kind}': no such fault; there are: {', '.join(TABLE)}"
            )
        if not (math.isfinite(self.at) and self.at >= 0.0 and (self.duration is None or self.duration > 0.0)):
            raise UserError(f"fault '{self.device}.{self.kind}': time must be >= 0 s and duration > 0 s")

    def active(self, now: float) -> bool:
        """True while it is told."""
        return self.at <= now + 1e-9 < (math.inf if self.duration is None else self.at + self.duration)


def parse_told(text: str) -> ToldFault:
    """A told fault from 'device.kind@time[:duration]'. Raises UserError.

    >>> parse_told("arm.stopped@5:2")
    ToldFault(device='arm', kind='stopped', at=5.0, duration=2.0)
    """
    return ToldFault(*split_fault(text))


def split_fault(text: str) -> tuple[str, str, float, float | None]:
    """Device, kind, time and duration (None: for good) of 'device.kind@time[:duration]'. Raises UserError."""
    match = re.fullmatch(r"(\w+)\.(\w+)@(\d+\.?\d*)(?::(\d+\.?\d*))?", text)
    if match is None:
        raise UserError(f"--fault {text!r}: write DEVICE.KIND@TIME[:DURATION], e.g. camera.black@5:2")
    device, kind, at, duration = match.groups()
    return device, kind, float(at), float(duration) if duration else None


class Drill:
    """A source of told faults for the fault watch.

    >>> drill = Drill([ToldFault("arm", "stopped", 5.0, 2.0)])
    >>> [fault.key for fault in drill.faults(6.0)], drill.faults(7.5)
    (['arm.stopped'], ())
    """

    def __init__(self, told: Sequence[ToldFault]) -> None:
        self._told = tuple(told)

    def faults(self, now: float) -> tuple[Fault, ...]:
        """Those that hold at `now`."""
        return tuple(
            Fault(fault.device, fault.kind, fault.at, "a drill") for fault in self._told if fault.active(now)
        )
