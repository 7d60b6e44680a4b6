"""A Modbus client whose server is in the same process: lockstep needs no thread, no socket and no waiting.

Both ends speak whole Modbus TCP telegrams. The far end uses pymodbus' inside (`SimCore`, framers), which may
change with any version: nothing else does, and tests/sim/test_arm_modbus.py holds it (pymodbus 3.16).
"""

from __future__ import annotations

from collections import deque
from typing import Any

from pymodbus.client.base import ModbusBaseSyncClient
from pymodbus.framer import FramerSocket, FramerType
from pymodbus.pdu import DecodePDU, ExceptionResponse
from pymodbus.simulator.simcore import SimCore
from pymodbus.transport import CommParams, CommType

from robot.sim.arm_registers import ArmRegisters
from robot.sim.modbus_device import arm_device

_GATEWAY_NO_RESPONSE = 11


class MemoryModbusClient(ModbusBaseSyncClient):
    """A synchronous client of the registers, heeding their `silent`. `cut`: nobody takes the connection.

    >>> from robot.sim.arm_controller import ArmController
    >>> from robot.sim.arm_registers import ArmRegisters
    >>> client = MemoryModbusClient(ArmRegisters(ArmController()))
    >>> client.read_input_registers(0, count=2, device_id=1).registers
    [16722, 1]
    """

    def __init__(self, registers: ArmRegisters, unit: int = 1) -> None:
        params = CommParams(comm_type=CommType.TCP, host="memory", timeout_connect=0.1)
        super().__init__(FramerType.SOCKET, 0, params, None, None, None)
        self._registers = registers
        self._core = SimCore(arm_device(registers, unit))
        self._far_framer = FramerSocket(DecodePDU(True))
        self._replies: deque[bytes] = deque()
        self.cut = False

    @property
    def connected(self) -> bool:
        """True if the far end is there."""
        return not self.cut

    def connect(self) -> bool:
        """True if the far end is there."""
        return not self.cut

    def close(self) -> None:
        """What was not read is gone."""
        self._replies.clear()

    def send(self, request: bytes, addr: tuple[str, int] | None = None) -> int:
        """Let the far end answer at once."""
        if self.cut:
            raise ConnectionError("the in-memory Modbus connection is cut")
        reply = self._answer(request)
        if not self._registers.silent:
            self._replies.append(reply)
        return len(request)

    def recv(self, size: int | None) -> bytes:
        """The oldest reply; b"" means that none came in time."""
        return self._replies.popleft() if self._replies else b""

    def _answer(self, request: bytes) -> bytes:
        _, pdu = self._far_framer.handleFrame(request, 0, 0)
        if pdu is None:
            return b""
        response: Any
        if pdu.dev_id not in self._core.device_ids():
            response = ExceptionResponse(pdu.function_code, _GATEWAY_NO_RESPONSE)
        else:
            response = _stepped(pdu.datastore_update(self._core, pdu.dev_id))  # type: ignore[arg-type]
        response.transaction_id, response.dev_id = pdu.transaction_id, pdu.dev_id
        return self._far_framer.buildFrame(response)


def _stepped(answering: Any) -> Any:
    """The result of a coroutine that never really waits."""
    try:
        answering.send(None)
    except StopIteration as finished:
        return finished.value
    raise RuntimeError("a device that answers from memory must not wait")
