"""What a contract suite needs of a driver with the world behind it.

A rig has the open `device`, the time `now`, `wait(seconds)` to let time pass, and, where the far end is in
the test's hand, `break_down()` and `mend()`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Generic, TypeVar

from robot.hal.interfaces import DriveBase
from robot.messages import Odometry, Twist

D = TypeVar("D")
TICK_S = 0.04


class Rig(Generic[D]):
    """A driver whose far end is nothing but time."""

    def __init__(self, device: D) -> None:
        self.device = device
        self.now = 0.0

    def wait(self, seconds: float) -> None:
        """Let time pass without a word to the driver."""
        self.now = round(self.now + seconds, 6)

    def break_down(self) -> None:
        """Let the far end fail."""
        raise NotImplementedError

    def mend(self) -> None:
        """Let the far end work again."""
        raise NotImplementedError


class MockRig(Rig[D]):
    """A mock: every method of the kind fails on order."""

    def __init__(self, device: D, methods: tuple[str, ...]) -> None:
        super().__init__(device)
        self._methods = methods

    def break_down(self) -> None:
        """Every call fails."""
        for method in self._methods:
            self.device.fail(method)  # type: ignore[attr-defined]

    def mend(self) -> None:
        """Every call works."""
        self.device.mend()  # type: ignore[attr-defined]


class RealRig(Rig[D]):
    """A device on the table: time passes by itself."""

    def __init__(self, device: D) -> None:
        super().__init__(device)
        self._start = time.monotonic()

    def wait(self, seconds: float) -> None:
        """Wait."""
        time.sleep(seconds)
        self.now = time.monotonic() - self._start


Make = Callable[[Path], "Rig[Any]"]


def drive(rig: Rig[DriveBase], twist: Twist, seconds: float) -> Odometry:
    """The control loop: read and send each tick; returns the odometry at the end."""
    for _ in range(round(seconds / TICK_S)):
        rig.device.read(rig.now)
        rig.device.send(twist, rig.now)
        rig.wait(TICK_S)
    return rig.device.read(rig.now)


def watch(rig: Rig[DriveBase], seconds: float) -> Odometry:
    """Only read."""
    for _ in range(round(seconds / TICK_S)):
        rig.device.read(rig.now)
        rig.wait(TICK_S)
    return rig.device.read(rig.now)
