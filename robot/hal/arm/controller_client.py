"""The exchanges with the arm's controller, one method each: values in, values out."""

from __future__ import annotations

from collections.abc import Sequence

from robot.hal.arm import registers as map_
from robot.hal.arm.registers import Report, Status
from robot.hal.interfaces import DeviceError
from robot.hal.modbus import ModbusLink


class ControllerClient:
    """Every method is one bounded exchange (`poll`: two) and raises DeviceError as `ModbusLink` does."""

    def __init__(self, link: ModbusLink, unit: int, low_first: bool) -> None:
        self._link = link
        self._unit = unit
        self._low_first = low_first

    @property
    def name(self) -> str:
        """For error words."""
        return self._link.name

    def poll(self, now: float) -> Report:
        """Everything it tells. Raises DeviceError with the cure if it is no such controller."""
        inputs = self._link.read_inputs(self._unit, 0, map_.INPUTS, now)
        self._check_identity(map_.status_of(inputs))
        discretes = self._link.read_discretes(self._unit, 0, map_.DISCRETES, now)
        return map_.report_of(inputs, discretes, self._low_first)

    def status(self, now: float) -> Status:
        """What became of the commands."""
        return map_.status_of(self._link.read_inputs(self._unit, 0, map_.STATUS_COUNT, now))

    def control(self, now: float) -> list[int]:
        """Heartbeat, owner token, speed limit in %, watchdog in ms as they stand."""
        return self._link.read_holdings(self._unit, map_.CONTROL_ADDRESS, map_.CONTROL_COUNT, now)

    def write_control(self, beat: int, owner: int, percent: int, watchdog_ms: int, now: float) -> None:
        """The heartbeat with all that goes with it, in one telegram."""
        values = [beat, owner, percent, watchdog_ms]
        self._link.write_holdings(self._unit, map_.CONTROL_ADDRESS, values, now)

    def command(self, block: Sequence[int], now: float) -> None:
        """One motion command, its number last (see registers.command_block)."""
        self._link.write_holdings(self._unit, map_.COMMAND_ADDRESS, block, now)

    def set_coil(self, coil: int, value: bool, now: float) -> None:
        """One coil."""
        self._link.write_coils(self._unit, coil, [value], now)

    def stop(self, now: float) -> None:
        """Stop the motion under way."""
        self.set_coil(map_.COIL_STOP, True, now)

    def switch_off(self, now: float) -> None:
        """Stop, and drives off, in one telegram."""
        self._link.write_coils(self._unit, map_.COIL_ENABLE, [False, True], now)

    def close(self) -> None:
        """Give the link back."""
        self._link.close()

    def _check_identity(self, status: Status) -> None:
        if status.magic != map_.MAGIC:
            raise DeviceError(
                f"{self.name}: input register 0 is 0x{status.magic:04x}, not 0x{map_.MAGIC:04x}:"
                " no arm controller with this robot's register map; check address, unit and its program"
            )
        if status.map_version != map_.MAP_VERSION:
            raise DeviceError(
                f"{self.name}: register map version {status.map_version}, not {map_.MAP_VERSION}:"
                " load the controller program that belongs to this robot"
            )
