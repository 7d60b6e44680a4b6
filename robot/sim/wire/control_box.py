"""The control box: the arm's controller behind Modbus TCP, with the robot's lamp on its first LED coil."""

from __future__ import annotations

from robot.clock import MonotonicClock
from robot.sim.arm_controller import ArmController
from robot.sim.arm_registers import ArmRegisters
from robot.sim.modbus_server import serve_tcp


class ControlBox:
    """Serves lamp and arm in real time. `close` when done.

    Switches for faults: `unplug` (it takes calls and answers nobody), `plug`.

    >>> box = ControlBox()
    >>> box.address.startswith("127.0.0.1:"), box.lamp
    (True, 0.0)
    >>> box.close()
    """

    def __init__(self) -> None:
        self._registers = ArmRegisters(ArmController())
        self._server = serve_tcp(self._registers, clock=MonotonicClock())

    @property
    def address(self) -> str:
        """HOST:PORT"""
        return self._server.address

    @property
    def lamp(self) -> float:
        """What the robot last asked of the lamp: 0 or 1."""
        return float(self._registers.leds[0])

    def unplug(self) -> None:
        """Answer nobody."""
        self._registers.silent = True

    def plug(self) -> None:
        """Answer again."""
        self._registers.silent = False

    def close(self) -> None:
        """End the server. May be called twice."""
        self._server.close()
