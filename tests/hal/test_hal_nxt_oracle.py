"""An independent client (nxt-python) as the oracle: same bytes for the same command, same brick understood.

It is a test's tool only; the robot never imports it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.hal.links import MemoryLink
from robot.hal.nxt import lcp
from robot.hal.nxt.brick import Brick
from robot.sim.brick_emulator import BrickEmulator
from robot.sim.brick_inputs import TouchSensor, UltrasonicSensor
from robot.sim.brick_port import BrickOnPty
from robot.sim.motor import FreeMotor

nxt_brick = pytest.importorskip("nxt.brick")
nxt_error = pytest.importorskip("nxt.error")
nxt_motor = pytest.importorskip("nxt.motor")
nxt_sensor = pytest.importorskip("nxt.sensor")


class Recorder:
    """A socket for the oracle: keeps what it sends; answers as the emulated brick does."""

    type, bsize = "usb", 60

    def __init__(self, brick: BrickEmulator) -> None:
        self._brick = brick
        self._reply: bytes | None = None
        self.sent: list[bytes] = []

    def send(self, telegram: bytes) -> None:
        self.sent.append(bytes(telegram))
        self._reply = self._brick.handle(bytes(telegram))

    def recv(self) -> bytes:
        assert self._reply is not None
        return self._reply

    def close(self) -> None:
        pass


def emulated() -> BrickEmulator:
    rng = np.random.default_rng(3)
    sensors = {0: TouchSensor(), 3: UltrasonicSensor(73)}
    brick = BrickEmulator([FreeMotor(rng) for _ in range(3)], rng, sensors=sensors)
    brick.handle(bytes.fromhex("0005030b00"))
    return brick


def oracle_bytes(act: Callable[[Any], Any]) -> bytes:
    """What the oracle sends for this; that it also understands the answer is part of the test."""
    socket = Recorder(emulated())
    brick = nxt_brick.Brick(socket)
    # The emulated brick may refuse (no program, nothing read yet): the bytes were sent.
    with suppress(nxt_error.ProtocolError):
        act(brick)
    return socket.sent[-1]


@settings(max_examples=60, deadline=None)
@given(
    port=st.integers(0, 2),
    power=st.integers(-100, 100),
    mode=st.sampled_from([0, 1, 3, 5, 7]),
    regulation=st.sampled_from([0, 1, 2]),
    turn=st.integers(-100, 100),
    run=st.sampled_from([0x00, 0x10, 0x20, 0x40]),
    limit=st.integers(0, 2**32 - 1),
)
def test_set_output_state_has_the_oracles_bytes(
    port: int, power: int, mode: int, regulation: int, turn: int, run: int, limit: int
) -> None:
    ours = lcp.set_output_state(port, power, mode, regulation, limit, turn_ratio=turn, run_state=run)
    theirs = oracle_bytes(
        lambda b: b.set_output_state(
            nxt_motor.Port(port),
            power,
            nxt_motor.Mode(mode),
            nxt_motor.RegulationMode(regulation),
            turn,
            nxt_motor.RunState(run),
            limit,
        )
    )
    assert theirs in (ours.telegram, ours.silent)


ASKED: dict[str, tuple[bytes, Callable[[Any], Any]]] = {
    "GETBATTERYLEVEL": (lcp.get_battery_level().telegram, lambda b: b.get_battery_level()),
    "KEEPALIVE": (lcp.keep_alive().telegram, lambda b: b.keep_alive()),
    "STOPPROGRAM": (lcp.stop_program().telegram, lambda b: b.stop_program()),
    "GETVERSION": (lcp.get_version().telegram, lambda b: b.get_firmware_version()),
    "GETDEVICEINFO": (lcp.get_device_info().telegram, lambda b: b.get_device_info()),
    "LSREAD": (lcp.ls_read(3).telegram, lambda b: b.ls_read(nxt_sensor.Port.S4)),
    "LSGETSTATUS": (lcp.ls_get_status(3).telegram, lambda b: b.ls_get_status(nxt_sensor.Port.S4)),
    "GETINPUTVALUES": (lcp.get_input_values(2).telegram, lambda b: b.get_input_values(nxt_sensor.Port.S3)),
    **{
        f"GETOUTPUTSTATE {port}": (
            lcp.get_output_state(port).telegram,
            lambda b, port=port: b.get_output_state(nxt_motor.Port(port)),
        )
        for port in range(3)
    },
}


@pytest.mark.parametrize("name", ASKED)
def test_questions_have_the_oracles_bytes(name: str) -> None:
    ours, act = ASKED[name]
    assert ours == oracle_bytes(act)


TOLD: dict[str, tuple[lcp.Request[None], Callable[[Any], Any]]] = {
    "PLAYTONE": (lcp.play_tone(440, 300), lambda b: b.play_tone(440, 300)),
    "RESETMOTORPOSITION block": (
        lcp.reset_motor_position(1, True),
        lambda b: b.reset_motor_position(nxt_motor.Port.B, True),
    ),
    "RESETMOTORPOSITION rotation": (
        lcp.reset_motor_position(2, False),
        lambda b: b.reset_motor_position(nxt_motor.Port.C, False),
    ),
    "SETINPUTMODE touch": (
        lcp.set_input_mode(0, 0x01, 0x20),
        lambda b: b.set_input_mode(nxt_sensor.Port.S1, nxt_sensor.Type.SWITCH, nxt_sensor.Mode.BOOL),
    ),
    "SETINPUTMODE sonar": (
        lcp.set_input_mode(3, 0x0B, 0x00),
        lambda b: b.set_input_mode(nxt_sensor.Port.S4, nxt_sensor.Type.LOW_SPEED_9V, nxt_sensor.Mode.RAW),
    ),
    "LSWRITE": (
        lcp.ls_write(3, b"\x02\x42", 1),
        lambda b: b.ls_write(nxt_sensor.Port.S4, b"\x02\x42", 1),
    ),
}


@pytest.mark.parametrize("name", TOLD)
def test_orders_have_the_oracles_bytes_with_or_without_a_reply(name: str) -> None:
    ours, act = TOLD[name]
    assert oracle_bytes(act) in (ours.telegram, ours.silent)


def test_both_clients_read_the_same_from_one_brick() -> None:
    emulator = emulated()
    emulator.handle(bytes.fromhex("80 04 01 32 07 01 00 20 5a000000"))
    emulator.advance(1.0)
    theirs, ours = nxt_brick.Brick(Recorder(emulator)), Brick(MemoryLink(emulator.handle))
    assert theirs.get_battery_level() == ours.battery_mv()
    assert theirs.keep_alive() == ours.keep_alive()
    info = ours.device_info()
    name, address, signal, flash = theirs.get_device_info()
    assert (info.name, info.address, info.signal, info.free_flash_bytes) == (
        name,
        address.lower(),
        tuple(signal),
        flash,
    )
    version = ours.version()
    assert theirs.get_firmware_version() == (version.protocol, version.firmware)
    state = ours.output_state(1)
    _, power, _, _, turn, _, limit, tacho, block, rotation = theirs.get_output_state(nxt_motor.Port.B)
    assert (state.power, state.turn_ratio, state.tacho_limit) == (power, turn, limit)
    assert (state.tacho, state.block_tacho, state.rotation) == (tacho, block, rotation)
    assert tacho > 80
    emulator.advance(0.1)
    values = ours.input_values(3)
    _, valid, calibrated, *_, raw, normalized, scaled, own = theirs.get_input_values(nxt_sensor.Port.S4)
    assert (values.valid, values.calibrated, values.raw) == (bool(valid), bool(calibrated), raw)
    assert (values.normalized, values.scaled, values.calibrated_value) == (normalized, scaled, own)


# --------------------------------------------------------------------- over a terminal, framed as Bluetooth


@pytest.fixture
def on_a_terminal() -> Iterator[tuple[Any, BrickEmulator, list[FreeMotor]]]:
    """The oracle's own serial client on an emulated brick whose time passes by itself."""
    devfile = pytest.importorskip("nxt.backend.devfile")
    rng = np.random.default_rng(3)
    motors = [FreeMotor(rng, load_inertia=3e-4) for _ in range(3)]
    sensors = {0: TouchSensor(pressed=True), 3: UltrasonicSensor(73)}
    emulator = BrickEmulator(motors, rng, sensors=sensors)
    over = threading.Event()
    with BrickOnPty(emulator) as port:

        def live() -> None:
            last = time.monotonic()
            while not over.wait(0.005):
                now = time.monotonic()
                with port.lock:
                    emulator.advance(min(now - last, 0.03))
                last = now

        thread = threading.Thread(target=live, daemon=True)
        thread.start()
        brick = devfile.DevFileSock(port.path).connect()
        yield brick, emulator, motors
        over.set()
        thread.join(timeout=5)
        brick.close()


def test_the_oracle_drives_our_brick_over_a_terminal(on_a_terminal) -> None:  # type: ignore[no-untyped-def]
    from nxt.sensor.generic import Touch, Ultrasonic

    brick, emulator, motors = on_a_terminal
    assert brick.get_device_info()[0] == "NXT"
    assert brick.get_battery_level() == pytest.approx(emulator.battery_mv, abs=200)
    motor = brick.get_motor(nxt_motor.Port.B)
    motor.turn(60, 180, timeout=5)
    assert 170 < motor.get_tacho().tacho_count < 330
    assert np.degrees(motors[1].angle) > 165
    sonar, touch = (
        Ultrasonic(brick, nxt_sensor.Port.S4, check_compatible=False),
        Touch(brick, nxt_sensor.Port.S1),
    )
    until(lambda: sonar.get_distance() == 73)
    until(touch.get_sample)


def until(holds: Callable[[], bool]) -> None:
    """The client gives up after a tenth of a second of a busy computer: ask again."""
    end = time.monotonic() + 10
    while time.monotonic() < end:
        with suppress(nxt_error.I2CError):
            if holds():
                return
    raise AssertionError("never read")
