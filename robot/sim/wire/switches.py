"""Faults of the wire: what is broken in the scene's list is broken at the far end of the drivers' links.

What sits inside a device (a stuck head, a black picture, a stalled wheel) the simulated devices break by
themselves; here are the cables.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from robot.sim.injected import InjectedFault, active_kinds


@dataclass(slots=True)
class Switch:
    """One cable: `off` and `on` are called when its fault begins and when it is over."""

    device: str
    kind: str
    off: Callable[[], None]
    on: Callable[[], None]
    is_off: bool = field(default=False, init=False)

    def follow(self, broken: bool) -> None:
        """Pull or plug the cable if that is news."""
        if broken != self.is_off:
            self.is_off = broken
            (self.off if broken else self.on)()


def follow(switches: list[Switch], faults: tuple[InjectedFault, ...], now: float) -> None:
    """Let all cables be as the faults at `now` (seconds of the world) say."""
    for switch in switches:
        switch.follow(switch.kind in active_kinds(faults, switch.device, now))
