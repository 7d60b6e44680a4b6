"""A lamp that remembers its level."""

from __future__ import annotations

import math

from robot.hal.mock.script import Mock


class MockLamp(Mock):
    """`level` is how bright it is, 0..1; off after `close`."""

    def __init__(self) -> None:
        super().__init__("lamp")
        self.level = 0.0

    def send(self, level: float, now: float) -> float:
        """Set the level, clipped to 0..1; the old one stays while it fails."""
        if self._works(now, "send", level):
            self.level = 0.0 if math.isnan(level) else max(0.0, min(1.0, level))
        return self.level

    def close(self) -> None:
        """Switch it off."""
        super().close()
        self.level = 0.0
