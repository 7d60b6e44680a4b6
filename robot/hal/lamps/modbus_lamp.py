"""A lamp on a coil of a Modbus box, e.g. of the arm's controller."""

from __future__ import annotations

from robot.hal.interfaces import DeviceError
from robot.hal.lamps.lamp import WrittenLamp
from robot.hal.modbus import ModbusLink, asked_patiently


class ModbusLamp(WrittenLamp):
    """A `LampDevice` that is on above level 0.5 and off below; `send` returns 1 or 0.

    link: give it one of its own, or `link.share()` of one that other devices use; it is closed with the lamp.
    coil: 0..65535. unit: Modbus unit number. Opening darkens the lamp; raises DeviceError (and closes the
    link) if the box does not answer or has no such coil.
    """

    def __init__(self, link: ModbusLink, coil: int, unit: int = 1) -> None:
        super().__init__()
        self._link = link
        self._coil = coil
        self._unit = unit
        try:
            asked_patiently(lambda: self._write(0.0, 0.0))
        except DeviceError as error:
            link.close()
            raise DeviceError(f"lamp on coil {coil} of {link.name}: {error}; check lamp.coil") from error

    def _offered(self, level: float) -> float:
        return 1.0 if level > 0.5 else 0.0

    def _write(self, level: float, now: float) -> None:
        self._link.write_coils(self._unit, self._coil, [level > 0.5], now)

    def _release(self) -> None:
        self._link.close()
