"""The arm's registers as a pymodbus device: all that the servers and the in-memory client have in common."""

from __future__ import annotations

from typing import Final

from pymodbus.constants import ExcCodes
from pymodbus.simulator import DataType, SimData, SimDevice

from robot.sim.arm_registers import COILS, DEVICE_FAILURE, DISCRETES, HOLDINGS, INPUTS, ArmRegisters

_READS: Final = (1, 2, 3, 4)
_WRITES: Final = (15, 16)


def arm_device(registers: ArmRegisters, unit: int = 1) -> SimDevice:
    """A device that offers functions 1-4, 15 and 16 on the registers."""

    async def action(
        function: int,
        start: int,
        address: int,
        count: int,
        memory: list[int],
        values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        return _exchange(registers, function, address, memory, values)

    bits = [SimData(0, count=16, values=False, datatype=DataType.BITS)]
    return SimDevice(
        id=unit,
        simdata=(
            bits,
            bits,
            [SimData(0, count=HOLDINGS, values=0, datatype=DataType.REGISTERS)],
            [SimData(0, count=INPUTS, values=0, datatype=DataType.REGISTERS)],
        ),
        action=action,
    )


def _exchange(
    registers: ArmRegisters,
    function: int,
    address: int,
    memory: list[int],
    values: list[int] | list[bool] | None,
) -> ExcCodes | None:
    """Called by pymodbus before it reads from or writes to its memory of the function's table."""
    if registers.storm:
        return ExcCodes(DEVICE_FAILURE)
    if values is not None and function in _WRITES:
        refused = registers.write(function, address, [int(value) for value in values])
        return ExcCodes(refused) if refused else None
    if function in _READS:
        size = {1: COILS, 2: DISCRETES, 3: HOLDINGS, 4: INPUTS}[function]
        memory[:] = _as_memory(function, registers.read(function, 0, size))
        return None
    return None if function in _WRITES else ExcCodes.ILLEGAL_FUNCTION


def _as_memory(function: int, values: list[int]) -> list[int]:
    if function in (3, 4):
        return values
    return [sum(bit << place for place, bit in enumerate(values))]
