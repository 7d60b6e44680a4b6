"""The arm's registers behind real pymodbus servers: TCP on loopback, RTU on a serial port or a pty."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any, Final, TypeVar

from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.server.base import ModbusBaseServer

from robot.clock import Clock
from robot.sim.arm_registers import ArmRegisters
from robot.sim.modbus_device import arm_device
from robot.sim.pty_pair import PtyPair

T = TypeVar("T")
_PERIOD_S: Final = 0.005
_START_DEADLINE_S: Final = 10.0


class ModbusServer:
    """A server in a thread of its own, serving when the constructor returns; `address` is where.

    serve: opens the server in the thread's loop and returns it with its address. clock: with one the arm
    lives by it, without one time passes only by `advance`. Registers and controller belong to the server's
    thread: reach them by `advance` and `call`. Raises RuntimeError if it cannot be opened.
    """

    def __init__(
        self,
        registers: ArmRegisters,
        serve: Callable[[ArmRegisters], Awaitable[tuple[ModbusBaseServer, str, Callable[[], None]]]],
        clock: Clock | None = None,
    ) -> None:
        self._registers = registers
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="modbus-server", daemon=True)
        self._thread.start()
        self._closed = False
        self._living: asyncio.Task[None] | None = None
        try:
            self._server, self.address, self._cleanup = self._run(_awaited(serve(registers)))
        except BaseException:
            self._end()
            raise
        if clock is not None:
            self._run(self._begin_living(clock))

    def advance(self, seconds: float) -> None:
        """Let the controller's time pass; returns when it has."""
        self.call(lambda: self._registers.controller.advance(seconds))

    def call(self, action: Callable[[], T]) -> T:
        """Do something with registers or controller in the server's thread; returns its result."""

        async def act() -> T:
            return action()

        return self._run(act())

    def close(self) -> None:
        """Let go of clients, port and thread. May be called twice."""
        if self._closed:
            return
        self._closed = True
        self._run(self._shut())
        self._end()

    async def _begin_living(self, clock: Clock) -> None:
        self._living = asyncio.create_task(self._live(clock))

    async def _live(self, clock: Clock) -> None:
        before = clock.now()
        while True:
            await asyncio.sleep(_PERIOD_S)
            now = clock.now()
            self._registers.controller.advance(now - before)
            before = now

    async def _shut(self) -> None:
        if self._living is not None:
            self._living.cancel()
        server: Any = self._server
        await server.shutdown()
        self._cleanup()
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)

    def _end(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(_START_DEADLINE_S)
        self._loop.close()

    def _run(self, work: Coroutine[Any, Any, T]) -> T:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(_START_DEADLINE_S)


def serve_tcp(
    registers: ArmRegisters, port: int = 0, unit: int = 1, clock: Clock | None = None
) -> ModbusServer:
    """Modbus TCP on 127.0.0.1; port 0: any free one. Raises RuntimeError if it is taken."""

    async def serve(registers: ArmRegisters) -> tuple[ModbusBaseServer, str, Callable[[], None]]:
        server = ModbusTcpServer(
            arm_device(registers, unit), address=("127.0.0.1", port), trace_packet=_silencer(registers)
        )
        await server.serve_forever(background=True)
        listening: Any = server.transport
        host, number = listening.sockets[0].getsockname()[:2]
        return server, f"{host}:{number}", lambda: None

    return ModbusServer(registers, serve, clock)


def serve_pty(
    registers: ArmRegisters, baudrate: int = 115200, unit: int = 1, clock: Clock | None = None
) -> ModbusServer:
    """Modbus RTU on a pseudo-terminal; the address is its path."""

    async def serve(registers: ArmRegisters) -> tuple[ModbusBaseServer, str, Callable[[], None]]:
        pair = PtyPair()
        server = _serial(registers, pair.far, baudrate, unit)
        await server.serve_forever(background=True)
        return server, pair.near, pair.close

    return ModbusServer(registers, serve, clock)


def serve_serial(
    registers: ArmRegisters, port: str, baudrate: int = 115200, unit: int = 1, clock: Clock | None = None
) -> ModbusServer:
    """Modbus RTU on a serial port."""

    async def serve(registers: ArmRegisters) -> tuple[ModbusBaseServer, str, Callable[[], None]]:
        server = _serial(registers, port, baudrate, unit)
        await server.serve_forever(background=True)
        return server, port, lambda: None

    return ModbusServer(registers, serve, clock)


def _serial(registers: ArmRegisters, port: str, baudrate: int, unit: int) -> ModbusSerialServer:
    return ModbusSerialServer(
        arm_device(registers, unit), port=port, baudrate=baudrate, trace_packet=_silencer(registers)
    )


def _silencer(registers: ArmRegisters) -> Callable[[bool, bytes], bytes]:
    """Accepts everything and, while the registers are silent, sends nothing."""
    return lambda sending, packet: b"" if sending and registers.silent else packet


async def _awaited(work: Awaitable[T]) -> T:
    return await work
