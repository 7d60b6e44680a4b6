"""Real links that fail in the nastiest ways: the loop goes on ticking, for it never waits for a device."""

from __future__ import annotations

import math
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
import pytest

from bench.fault_parts import ScriptedState, StraightBody
from robot.app import devices_of, loop_settings
from robot.chart import RobotChart
from robot.clock import MonotonicClock
from robot.config import ArmSettings, Base, Cameras, Config, Head, LampSettings, TeleopSettings
from robot.hal.factory import open_hardware, reach_of
from robot.hal.hardware import Hardware, behind_workers
from robot.loop import Loop
from robot.messages import Clearance, Percepts, Tick
from robot.pacing import PERIOD
from robot.run_hardware import tick_until
from robot.sim.arm_controller import ArmController
from robot.sim.arm_registers import ArmRegisters
from robot.sim.brick_emulator import BrickEmulator
from robot.sim.brick_port import BrickOnPty
from robot.sim.modbus_server import ModbusServer, serve_tcp
from robot.sim.motor import FreeMotor

WARM_S, WATCHED_S = 0.2, 1.0
TICK_MS = 20.0
"""A tick that waited for one device would take 50 ms at least; a busy computer's may take ten."""


class Floor:
    """Perception that sees nothing, at once."""

    def submit(self, view, wants, now) -> None: ...  # type: ignore[no-untyped-def]

    def collect(self, now: float) -> Percepts:
        return Percepts()

    def faults(self, now: float):  # type: ignore[no-untyped-def]
        return ()

    def forget_target(self) -> None: ...

    def set_down(self) -> None: ...

    def clearance(self, pose, twist, now) -> Clearance:  # type: ignore[no-untyped-def]
        return Clearance(1.0, "range")

    def may_turn(self, pose) -> bool:  # type: ignore[no-untyped-def]
        return True


@dataclass
class FarEnds:
    """Everything at the other end of the links."""

    brick: BrickEmulator
    line: BrickOnPty
    arm: ArmRegisters
    server: ModbusServer
    teleop: int
    ticks: list[Tick] = field(default_factory=list)


class DeafServer:
    """Accepts connections and never says a word."""

    def __init__(self) -> None:
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.port = self._socket.getsockname()[1]
        self._held: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        try:
            while True:
                self._held.append(self._socket.accept()[0])
        except OSError:
            return

    def close(self) -> None:
        self._socket.close()
        for held in self._held:
            held.close()


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[tuple[FarEnds, Hardware, Loop]]:
    """A robot on real ptys and sockets: brick, arm, lamp, teleop; its eyes are a mock."""
    with ExitStack() as closing:
        rng = np.random.default_rng(1)
        motors = [None, FreeMotor(rng, load_inertia=0.0005), FreeMotor(rng, load_inertia=0.0005)]
        brick = BrickEmulator(motors, rng)
        lock = threading.Lock()
        line = closing.enter_context(BrickOnPty(brick, lock=lock, link=tmp_path / "rfcomm0"))
        alive = threading.Event()
        closing.callback(alive.set)

        def live() -> None:
            while not alive.wait(0.005):
                with lock:
                    brick.advance(0.005)

        threading.Thread(target=live, daemon=True).start()
        clock = MonotonicClock()
        registers = ArmRegisters(ArmController())
        server = serve_tcp(registers, clock=clock)
        closing.callback(server.close)
        person, port = os.openpty()
        config = Config(
            cameras=Cameras(driver="mock"),
            head=Head(driver="none"),
            base=Base(driver="nxt-serial", port=str(tmp_path / "rfcomm0")),
            lamp=LampSettings(driver="modbus", device=server.address),
            arm=ArmSettings(driver="modbus", address=server.address),
            teleop=TeleopSettings(driver="serial", port=os.ttyname(port)),
        )
        hardware = behind_workers(open_hardware(config, clock), reach_of(config), clock)
        closing.callback(hardware.close)
        far = FarEnds(brick, line, registers, server, person)
        states = {name: ScriptedState(False) for name in ("idle", "teleop", "halted")}
        loop = Loop(
            clock,
            devices_of(config, hardware),
            Floor(),
            RobotChart(),
            states,
            StraightBody(),
            loop_settings(config),
            [far.ticks.append],
        )
        yield far, hardware, loop


def ticked(far: FarEnds, loop: Loop, seconds: float) -> list[float]:
    """Tick for a while; returns the ticks' own milliseconds."""
    far.ticks.clear()
    return [1e3 * each for each in tick_until(loop, threading.Event(), seconds)]


FAILURES: dict[str, tuple[Callable[[FarEnds], None], str]] = {
    "the brick is switched off": (lambda far: far.brick.power_off(), "base.link"),
    "the brick answers garbage": (lambda far: setattr(far.brick, "garbage", True), "base.link"),
    "the brick is silent": (lambda far: far.brick.silence_link(), "base.link"),
    "noise on the brick's line": (lambda far: far.line.inject(b"\xff" * 600), ""),
    "a storm of Modbus exceptions": (lambda far: setattr(far.arm, "storm", True), "arm.link"),
    "a Modbus server that never answers": (lambda far: setattr(far.arm, "silent", True), "arm.link"),
    "noise on the teleop line": (
        lambda far: void(os.write(far.teleop, bytes(range(256)) * 8)),
        "teleop.noise",
    ),
    "nobody reads the teleop line": (lambda far: void(os.write(far.teleop, b"?")), ""),
}


def void(_: object) -> None:
    """Nothing."""


@pytest.mark.parametrize("name", FAILURES)
def test_the_loop_keeps_its_rate(robot: tuple[FarEnds, Hardware, Loop], name: str) -> None:
    far, _, loop = robot
    ticked(far, loop, WARM_S)
    break_it, fault = FAILURES[name]
    break_it(far)
    taken = ticked(far, loop, WATCHED_S)
    told = {each.key for tick in far.ticks for each in tick.faults}
    assert not fault or fault in told
    gaps = [b.now - a.now for a, b in pairwise(far.ticks)]
    assert len(taken) >= 0.9 * WATCHED_S / PERIOD
    assert sorted(taken)[math.floor(0.95 * len(taken))] < TICK_MS
    assert sorted(gaps)[math.floor(0.95 * len(gaps))] < 1.75 * PERIOD


def test_servers_that_accept_and_never_answer_open_nothing_and_hold_nobody() -> None:
    deaf = DeafServer()
    begun = time.monotonic()
    address = f"127.0.0.1:{deaf.port}"
    for section in (
        {"arm": ArmSettings(driver="modbus", address=address)},
        {"cameras": Cameras(driver="http", left=f"http://{address}", right=f"http://{address}/2")},
        {"head": Head(driver="uvc", device=f"http://{address}")},
    ):
        with pytest.raises(ValueError, match="config key"):
            open_hardware(msgspec.structs.replace(Config(), **section))
    assert time.monotonic() - begun < 8.0
    deaf.close()
