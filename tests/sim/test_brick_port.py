"""The emulated brick on a pseudo-terminal: our driver in real time, two threads, noise, hang-up."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robot.hal.nxt.base import NxtBase
from robot.hal.nxt.brick import Brick, ReplyTimeoutError
from robot.hal.nxt.near import NxtNear
from robot.hal.nxt.serial import SerialLink, open_serial_port
from robot.hal.nxt.settings import USB, USB_NEAR
from robot.messages import Twist
from robot.sim.brick_emulator import BrickEmulator
from robot.sim.brick_inputs import TouchSensor, UltrasonicSensor
from robot.sim.brick_port import BrickOnPty
from robot.sim.motor import FreeMotor

DEADLINE_S = 10.0


class World:
    """A brick whose time passes by itself, in a thread."""

    def __init__(self, folder: Path) -> None:
        rng = np.random.default_rng(3)
        self.motors = [FreeMotor(rng, load_inertia=0.0005) for _ in range(2)]
        self.touch = TouchSensor()
        self.brick = BrickEmulator(
            [None, *self.motors], rng, sensors={0: self.touch, 3: UltrasonicSensor(42)}
        )
        self.port = BrickOnPty(self.brick, link=folder / "rfcomm0")
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def open(self, reply_timeout: float = 0.5) -> Brick:
        return Brick(SerialLink(lambda: open_serial_port(self.port.path)), reply_timeout, time.monotonic)

    def close(self) -> None:
        self._over.set()
        self._thread.join(timeout=5)
        self.port.close()

    def _run(self) -> None:
        last = time.monotonic()
        while not self._over.wait(0.01):
            now = time.monotonic()
            with self.port.lock:
                self.brick.advance(min(now - last, 0.05))
            last = now


@pytest.fixture
def world(tmp_path: Path) -> Iterator[World]:
    world = World(tmp_path)
    yield world
    world.close()


def until(holds, words: str) -> None:  # type: ignore[no-untyped-def]
    end = time.monotonic() + DEADLINE_S
    while not holds():
        assert time.monotonic() < end, f"never: {words}"
        time.sleep(0.02)


def test_our_driver_drives_over_the_terminal(world: World) -> None:
    base = NxtBase(world.open(), replace(USB, silence_s=2.0))
    start = time.monotonic()

    def drive() -> bool:
        now = time.monotonic() - start
        base.read(now)
        base.send(Twist(v=0.1), now)
        return base.read(now).pose.x > 0.03

    until(drive, "three centimetres driven")
    assert base.exchange_s is not None
    assert 0.0 < base.exchange_s < 0.2
    base.close()


def test_base_and_sensors_share_the_line_from_two_threads(world: World) -> None:
    shared = world.open()
    base = NxtBase(shared, replace(USB, silence_s=2.0))
    near = NxtNear(shared, replace(USB_NEAR, silence_s=2.0).plugged("1", "4"))
    start = time.monotonic()
    felt: list[float | None] = []

    def feel() -> None:
        end = time.monotonic() + DEADLINE_S
        while time.monotonic() < end:
            value = near.read(time.monotonic() - start)
            if value.bumped and value.distance is not None:
                felt.append(value.distance)
                return
            time.sleep(0.01)

    sensing = threading.Thread(target=feel)
    sensing.start()
    while sensing.is_alive():
        now = time.monotonic() - start
        base.read(now)
        base.send(Twist(v=0.05), now)
        world.touch.pressed = now > 0.3
        time.sleep(0.02)
    assert felt == [pytest.approx(0.42)]
    now = time.monotonic() - start
    assert near.faults(now) == base.faults(now) == ()
    base.close()
    near.close()


def test_every_change_of_direction_takes_its_time(world: World) -> None:
    brick = world.open()
    brick.battery_mv()
    world.port.turnaround_s = 0.05
    began = time.monotonic()
    for _ in range(3):
        brick.battery_mv()
    assert time.monotonic() - began >= 6 * 0.05 - 0.01
    began = time.monotonic()
    for _ in range(20):
        brick.hold(1)  # one way only: nothing turns round
    assert time.monotonic() - began < 1.0
    brick.close()


def test_noise_on_the_line_is_an_error_and_passes(world: World) -> None:
    brick = world.open()
    brick.battery_mv()
    world.port.inject(b"\xff\xff" + b"noise" * 20)

    def works() -> bool:
        try:
            return brick.battery_mv() > 7000
        except OSError:
            return False

    assert not all([works() for _ in range(3)])
    until(works, "the line is in step again")
    brick.close()


@pytest.mark.parametrize("how", ["hang_up", "cut_link"])
def test_a_hang_up_is_told_and_the_driver_comes_back_by_itself(world: World, how: str) -> None:
    base = NxtBase(world.open(0.2), USB)
    start = time.monotonic()

    def kinds() -> set[str]:
        now = time.monotonic() - start
        base.read(now)
        return {fault.kind for fault in base.faults(now)}

    assert kinds() == set()
    world.port.hang_up() if how == "hang_up" else world.brick.cut_link()
    until(lambda: kinds() == {"link"}, "link fault")
    until(lambda: not Path(world.port.path).is_symlink(), "the path is gone")
    world.port.restore() if how == "hang_up" else world.brick.restore_link()
    until(lambda: kinds() == set(), "the driver is back")
    base.close()


def test_a_brick_out_of_range_is_silent_and_not_hung_up(world: World) -> None:
    brick = world.open(0.1)
    world.brick.silence_link()
    with pytest.raises(ReplyTimeoutError):
        brick.battery_mv()
    world.brick.restore_link()
    assert brick.battery_mv() > 7000
    brick.close()


def test_a_hung_up_line_without_a_fixed_path_has_none_and_closing_may_be_repeated() -> None:
    port = BrickOnPty(BrickEmulator([None] * 3, np.random.default_rng(1)))
    first = port.path
    assert first.startswith("/dev/")
    port.hang_up()
    with pytest.raises(ConnectionError, match="hung up"):
        _ = port.path
    port.restore()
    assert port.path.startswith("/dev/")
    port.close()
    port.close()
