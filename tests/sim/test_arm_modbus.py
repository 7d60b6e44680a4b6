"""The registers behind pymodbus: a foreign client sees the same over TCP, over RTU and in memory."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pymodbus
import pytest
from pymodbus.client import ModbusSerialClient, ModbusTcpClient

from robot.clock import MonotonicClock
from robot.sim.arm_controller import ArmController
from robot.sim.arm_registers import ArmRegisters
from robot.sim.modbus_memory import MemoryModbusClient
from robot.sim.modbus_server import serve_pty, serve_serial, serve_tcp


def test_the_inside_used_is_of_the_version_it_was_written_for() -> None:
    assert pymodbus.__version__.startswith("3.16."), "check robot/sim/modbus_memory.py, then raise this"


@pytest.fixture(params=["tcp", "rtu", "memory"])
def far(request: pytest.FixtureRequest) -> Iterator[tuple[ArmRegisters, Any]]:
    """The registers and a pymodbus client of them."""
    registers = ArmRegisters(ArmController())
    if request.param == "memory":
        yield registers, MemoryModbusClient(registers)
        return
    server = serve_tcp(registers) if request.param == "tcp" else serve_pty(registers)
    client: Any
    if request.param == "tcp":
        host, port = server.address.split(":")
        client = ModbusTcpClient(host, port=int(port), timeout=2.0, retries=0)
    else:
        client = ModbusSerialClient(server.address, baudrate=115200, timeout=2.0, retries=0)
    client.connect()
    yield registers, client
    client.close()
    server.close()


def test_every_table(far: tuple[ArmRegisters, Any]) -> None:
    registers, client = far
    assert client.read_input_registers(0, count=40, device_id=1).registers == registers.read(4, 0, 40)
    assert not client.write_registers(0, [3, 7, 80, 300], device_id=1).isError()
    assert client.read_holding_registers(0, count=4, device_id=1).registers == [3, 7, 80, 300]
    assert not client.write_coils(0, [True, False, False, True], device_id=1).isError()
    assert client.read_coils(0, count=8, device_id=1).bits[:8] == [True, False, False, True, *[False] * 4]
    assert client.read_discrete_inputs(0, count=7, device_id=1).bits[:7] == [True, *[False] * 6]
    assert registers.controller.powered


def test_what_it_does_not_offer(far: tuple[ArmRegisters, Any]) -> None:
    _, client = far
    assert client.write_register(0, 1, device_id=1).exception_code == 1
    assert client.write_coil(0, True, device_id=1).exception_code == 1
    assert client.mask_write_register(address=0, device_id=1).exception_code == 1
    assert client.read_input_registers(40, count=1, device_id=1).exception_code == 2
    assert client.read_holding_registers(20, count=20, device_id=1).exception_code == 2
    assert client.write_registers(16, [0] * 8, device_id=1).exception_code == 2
    assert client.write_registers(2, [101], device_id=1).exception_code == 3


def test_a_storm_answers_everything_by_an_exception(far: tuple[ArmRegisters, Any]) -> None:
    registers, client = far
    registers.storm = True
    assert client.read_input_registers(0, count=1, device_id=1).exception_code == 4
    assert client.write_coils(0, [True], device_id=1).exception_code == 4
    assert not registers.controller.powered
    registers.storm = False
    assert not client.read_input_registers(0, count=1, device_id=1).isError()


def test_another_unit_is_not_there() -> None:
    client = MemoryModbusClient(ArmRegisters(ArmController()), unit=3)
    assert client.read_coils(0, count=1, device_id=3).bits[0] is False
    assert client.read_coils(0, count=1, device_id=1).exception_code == 11


def test_with_a_clock_the_arm_lives_by_itself() -> None:
    registers = ArmRegisters(ArmController())
    server = serve_tcp(registers, clock=MonotonicClock())
    server.call(lambda: registers.write(15, 3, [1]))
    waited = threading.Event()
    for _ in range(500):
        if server.call(lambda: registers.controller.gripper_closed):
            break
        waited.wait(0.01)
    assert server.call(lambda: registers.controller.gripper_closed)
    server.close()


def test_closing_twice_leaves_no_thread_and_frees_the_port() -> None:
    registers = ArmRegisters(ArmController())
    before = threading.active_count()
    server = serve_tcp(registers)
    port = int(server.address.split(":")[1])
    server.close()
    server.close()
    assert threading.active_count() == before
    serve_tcp(registers, port).close()


def test_what_cannot_be_opened_is_told() -> None:
    registers = ArmRegisters(ArmController())
    server = serve_tcp(registers)
    with pytest.raises(RuntimeError, match="address"):
        serve_tcp(registers, int(server.address.split(":")[1]))
    with pytest.raises((RuntimeError, OSError)):
        serve_serial(registers, "/dev/no-such-port")
    server.close()
