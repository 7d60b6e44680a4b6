"""The simulated lamp on the head: a level that really lights the room, unless it is dead."""

from __future__ import annotations

import math

from robot.messages import Fault


class SimLamp:
    """A `LampDevice`; `light` is what it really gives, 0..1.

    >>> lamp = SimLamp()
    >>> lamp.send(1.7, now=0.0), lamp.light
    (1.0, 1.0)
    """

    def __init__(self) -> None:
        self._level = 0.0
        self._broken: dict[str, float] = {}

    def break_with(self, kinds: frozenset[str], now: float) -> None:
        """Set the faults at work from now on: 'dead' gives no light, 'link' hears nothing."""
        self._broken = {kind: self._broken.get(kind, now) for kind in sorted(kinds)}

    @property
    def light(self) -> float:
        """Share of full light it gives now."""
        return 0.0 if "dead" in self._broken else self._level

    def send(self, level: float, now: float) -> float:
        """Set the level; returns the one in force, 0..1. A dead lamp takes the level and stays dark."""
        if math.isfinite(level) and "link" not in self._broken:
            self._level = min(max(level, 0.0), 1.0)
        return self._level

    def faults(self, now: float) -> tuple[Fault, ...]:
        """A lost link only: a burnt-out lamp does not know it; one sees it in the pictures."""
        since = self._broken.get("link")
        return () if since is None else (Fault("lamp", "link", since, "no answer"),)

    def close(self) -> None:
        """Switch the light off."""
        self._level = 0.0
