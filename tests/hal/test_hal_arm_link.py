"""The Modbus link on real wires: addresses, time-outs that bound every call, back-off, plug and replug."""

from __future__ import annotations

import contextlib
import os
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from robot.hal.interfaces import DeviceError
from robot.hal.modbus import ModbusLink, NoAnswerError, RefusedError, asked_patiently, open_modbus_link
from robot.sim.arm_controller import ArmController
from robot.sim.arm_registers import ArmRegisters
from robot.sim.modbus_memory import MemoryModbusClient
from robot.sim.modbus_server import ModbusServer, serve_pty, serve_tcp

TIMEOUT_S = 0.05


@pytest.fixture(params=[serve_tcp, serve_pty], ids=["tcp", "rtu"])
def server(request: pytest.FixtureRequest) -> Iterator[ModbusServer]:
    server = request.param(ArmRegisters(ArmController()))
    yield server
    server.close()


def test_every_function_on_a_real_wire(server: ModbusServer) -> None:
    link = open_modbus_link(server.address)
    assert link.read_inputs(1, 0, 2, 0.0) == [0x4152, 1]
    assert link.read_discretes(1, 0, 7, 0.0) == [False] * 7
    link.write_holdings(1, 0, [7, 9, 50, 400], 0.0)
    assert link.read_holdings(1, 0, 4, 0.0) == [7, 9, 50, 400]
    link.write_coils(1, 4, [True, False, True], 0.0)
    assert link.read_coils(1, 0, 8, 0.0) == [False, False, False, False, True, False, True, False]
    with pytest.raises(RefusedError, match="no such register") as refused:
        link.read_inputs(1, 39, 2, 0.0)
    assert refused.value.code == 2
    with pytest.raises(RefusedError, match="no such register"):
        link.write_holdings(1, 16, [0] * 15, 0.0)
    link.close()


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("", "no address"),
        ("host:", "no address"),
        (":502", "no address"),
        ("127.0.0.1:70000", "no address"),
        ("127.0.0.1:5x", "no address"),
        ("no.such.host.invalid:502", "not known"),
        ("/dev/no-such-port", "check its cable"),
    ],
)
def test_bad_addresses_are_told_with_the_cure(address: str, words: str) -> None:
    with pytest.raises(DeviceError, match=words) as told:
        open_modbus_link(address)
    assert "\n" not in str(told.value)


def test_nobody_listening_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(DeviceError, match="check its cable, its power and the address"):
        open_modbus_link(f"127.0.0.1:{port}")


def test_a_server_that_accepts_and_never_answers_holds_nobody() -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:
        link = open_modbus_link(f"127.0.0.1:{mute.getsockname()[1]}", timeout_s=TIMEOUT_S)
        started = time.monotonic()
        for tick in range(50):
            before = time.monotonic()
            with pytest.raises(NoAnswerError):
                link.read_inputs(1, 0, 10, tick * 0.04)
            assert time.monotonic() - before < TIMEOUT_S + 0.5
        # Eight tries in the first 0.3 s of the run's time, then at 0.8 and 1.8 s: not one a call.
        assert time.monotonic() - started < 11 * TIMEOUT_S + 1.0
        link.close()


def test_a_server_that_hangs_up_and_comes_back() -> None:
    registers = ArmRegisters(ArmController())
    server = serve_tcp(registers)
    port = int(server.address.rpartition(":")[2])
    link = open_modbus_link(server.address, timeout_s=TIMEOUT_S)
    link.read_inputs(1, 0, 1, 0.0)
    server.close()
    for now in (0.1, 0.2, 0.5, 0.6):
        with pytest.raises(NoAnswerError):
            link.read_inputs(1, 0, 1, now)
    server = serve_tcp(registers, port)
    with pytest.raises(NoAnswerError, match="asked again soon"):
        link.read_inputs(1, 0, 1, 0.9)
    assert link.read_inputs(1, 0, 1, 1.0) == [0x4152]
    link.close()
    server.close()


def test_a_serial_port_unplugged_and_replugged(tmp_path: Path) -> None:
    registers = ArmRegisters(ArmController())
    port = tmp_path / "ttyUSB0"
    server = serve_pty(registers)
    port.symlink_to(server.address)
    link = open_modbus_link(str(port), timeout_s=TIMEOUT_S)
    assert link.read_inputs(1, 0, 1, 0.0) == [0x4152]
    server.close()
    os.unlink(port)
    for now in (0.1, 0.4):
        with pytest.raises(NoAnswerError):
            link.read_inputs(1, 0, 1, now)
    server = serve_pty(registers)
    port.symlink_to(server.address)
    assert link.read_inputs(1, 0, 1, 1.0) == [0x4152]
    link.close()
    server.close()


def test_a_late_answer_is_not_taken_for_the_next() -> None:
    """The connection of an unanswered question is dropped: what comes late finds nobody."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(5.0)
        done = threading.Event()
        connections = []

        def serve() -> None:
            for words in (b"\x00\x11", b"\x00\x22"):
                connection, _ = listener.accept()
                connections.append(connection)
                request = connection.recv(100)
                if words == b"\x00\x11":
                    done.wait(10.0)
                header = request[:2] + b"\0\0\0\x05" + request[6:8] + b"\x02"
                with contextlib.suppress(OSError):
                    connection.sendall(header + words)

        thread = threading.Thread(target=serve)
        thread.start()
        link = open_modbus_link(f"127.0.0.1:{listener.getsockname()[1]}", timeout_s=TIMEOUT_S)
        link._heard_at = 0.0  # as if it had answered before: no back-off yet
        with pytest.raises(NoAnswerError):
            link.read_inputs(1, 0, 1, 0.0)
        done.set()
        link._client.comm_params.timeout_connect = 5.0  # type: ignore[attr-defined]
        assert link.read_inputs(1, 0, 1, 0.1) == [0x22]
        thread.join(10.0)
        link.close()
        for connection in connections:
            connection.close()


def test_an_answer_of_another_length_is_none() -> None:
    link = ModbusLink(MemoryModbusClient(ArmRegisters(ArmController())), "a liar")
    ask = link._client.read_input_registers
    link._client.read_input_registers = lambda address, count, device_id: ask(  # type: ignore[method-assign]
        address, count=count - 1, device_id=device_id
    )
    with pytest.raises(NoAnswerError, match="something else"):
        link.read_inputs(1, 0, 4, 0.0)


def test_a_shared_link_closes_with_its_last_user() -> None:
    link = ModbusLink(MemoryModbusClient(ArmRegisters(ArmController())), "shared")
    other = link.share()
    link.close()
    assert other.read_inputs(1, 0, 1, 0.0) == [0x4152]
    other.close()
    other.close()
    with pytest.raises(NoAnswerError, match="closed"):
        link.read_inputs(1, 0, 1, 0.0)


def test_two_threads_never_mix_their_answers(server: ModbusServer) -> None:
    link = open_modbus_link(server.address, timeout_s=2.0)
    link.write_holdings(1, 0, [11, 0, 100, 300], 0.0)
    wrong: list[list[int]] = []

    def ask(address: int, expected: int) -> None:
        for _ in range(40):
            words = link.read_holdings(1, address, 1, 0.0)
            if words != [expected]:
                wrong.append(words)

    threads = [threading.Thread(target=ask, args=pair) for pair in ((0, 11), (3, 300), (2, 100))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20.0)
    assert wrong == []
    link.close()


def test_one_lost_telegram_does_not_look_like_a_missing_device() -> None:
    left = [NoAnswerError("lost"), NoAnswerError("lost")]

    def ask() -> str:
        if left:
            raise left.pop()
        return "here"

    assert asked_patiently(ask) == "here"
    left += [NoAnswerError("lost")] * 3
    with pytest.raises(NoAnswerError):
        asked_patiently(ask)
