"""What the brick's voltage means: low is told (and heard), empty halts. No I/O."""

from __future__ import annotations

from typing import Final

from robot.hal.faultbook import FaultBook

_HYSTERESIS_MV: Final = 200


class BatteryWatch:
    """Raises and clears `battery_low` and `battery_empty` in the book; over again 200 mV above the limit."""

    def __init__(self, low_mv: int, empty_mv: int, faults: FaultBook) -> None:
        self._limits = {"battery_low": low_mv, "battery_empty": empty_mv}
        self._faults = faults
        self.millivolts: int | None = None
        """As last read."""

    def judge(self, millivolts: int, now: float) -> bool:
        """Take in a reading; True if the battery has just become low."""
        self.millivolts = millivolts
        was_low = "battery_low" in self._faults
        for kind, limit in self._limits.items():
            if millivolts < limit:
                self._faults.raised(kind, now, f"{millivolts / 1000:.1f} V")
            elif millivolts >= limit + _HYSTERESIS_MV:
                self._faults.cleared(kind)
        return "battery_low" in self._faults and not was_low
