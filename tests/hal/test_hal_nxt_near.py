"""Bumper and sonar on the emulated brick: values, rates, and what is told when a sensor fails."""

from __future__ import annotations

import numpy as np
import pytest

from robot.hal.interfaces import DeviceError
from robot.hal.links import MemoryLink
from robot.hal.nxt.brick import Brick
from robot.hal.nxt.near import NxtNear
from robot.hal.nxt.settings import BLUETOOTH_NEAR, USB_NEAR, NearSettings
from robot.messages import Near
from robot.sim.brick_emulator import BrickEmulator
from robot.sim.brick_inputs import TouchSensor, UltrasonicSensor

TICK_S = 0.04


class Bench:
    """Touch on inputs 1 and 2, sonar on 4."""

    def __init__(self, settings: NearSettings = USB_NEAR, bumper: str = "12", sonar: str = "4") -> None:
        self.touches = [TouchSensor(), TouchSensor()]
        self.sonar = UltrasonicSensor(73)
        sensors = {0: self.touches[0], 1: self.touches[1], 3: self.sonar}
        self.brick = BrickEmulator([None] * 3, np.random.default_rng(3), sensors=sensors)
        self.telegrams: list[bytes] = []
        self.near = NxtNear(Brick(MemoryLink(self.handle)), settings.plugged(bumper, sonar))
        self.now = 0.0

    def handle(self, telegram: bytes) -> bytes | None:
        self.telegrams.append(telegram)
        return self.brick.handle(telegram)

    def watch(self, seconds: float) -> Near:
        for _ in range(round(seconds / TICK_S)):
            self.near.read(self.now)
            self.brick.advance(TICK_S)
            self.now = round(self.now + TICK_S, 6)
        return self.near.read(self.now)

    def told(self) -> list[tuple[str, str]]:
        return [(fault.key, fault.evidence) for fault in self.near.faults(self.now)]


def test_opening_says_what_is_plugged_in_where() -> None:
    bench = Bench()
    assert [t.hex() for t in bench.telegrams] == ["0005000120", "0005010120", "0005030b00"]


def test_values_follow_the_sensors() -> None:
    bench = Bench()
    value = bench.watch(0.5)
    assert not value.bumped
    assert value.distance == pytest.approx(0.73)
    bench.touches[1].pressed = True
    bench.sonar.distance_cm = 12
    value = bench.watch(0.4)
    assert value.bumped
    assert value.distance == pytest.approx(0.12)
    bench.touches[1].pressed = False
    bench.sonar.distance_cm = None
    assert bench.watch(0.4) == Near(value.at, False, None) or bench.near.read(bench.now).distance is None
    assert not bench.near.read(bench.now).bumped
    assert bench.told() == []


@pytest.mark.parametrize(("settings", "within_s"), [(USB_NEAR, 0.2), (BLUETOOTH_NEAR, 0.45)])
def test_a_bump_alone_is_felt_soon(settings: NearSettings, within_s: float) -> None:
    for ticks in range(12):
        bench = Bench(settings, bumper="1", sonar="")
        bench.watch(0.5 + ticks * TICK_S)
        bench.touches[0].pressed = True
        assert bench.watch(within_s).bumped


def test_each_read_asks_at_most_once_and_the_sonar_rests_between_its_rounds() -> None:
    bench = Bench()
    bench.watch(0.5)
    bench.telegrams.clear()
    for _ in range(100):  # a loop much faster than the sensors
        before = len(bench.telegrams)
        bench.near.read(bench.now)
        assert sum(t[0] == 0 for t in bench.telegrams[before:]) <= 1
        bench.brick.advance(0.01)
        bench.now = round(bench.now + 0.01, 6)
    writes = [t for t in bench.telegrams if t[1] == 0x0F]
    assert 5 <= len(writes) <= 14
    assert {t.hex() for t in writes} == {"800f0302010242"}


def test_bluetooth_is_left_to_the_wheels() -> None:
    bench = Bench(BLUETOOTH_NEAR)
    bench.watch(1.0)
    bench.telegrams.clear()
    bench.watch(4.0)
    assert 12 <= sum(t[0] == 0 for t in bench.telegrams) <= 20


def test_an_unplugged_sonar_is_told_with_its_input_and_the_bumper_works_on() -> None:
    bench = Bench(sonar="3")
    bench.touches[0].pressed = True
    value = bench.watch(1.0)
    assert [key for key, _ in bench.told()] == ["near.sensor"]
    assert "input 3" in bench.told()[0][1]
    assert "plugged in" in bench.told()[0][1]
    assert value.bumped
    assert value.distance is None
    assert bench.now - value.at < 0.3


def test_a_sonar_unplugged_and_replugged_while_running() -> None:
    bench = Bench()
    bench.watch(0.5)
    port = bench.brick._inputs.ports[3]
    port.sensor = None
    assert bench.watch(0.5).distance is None
    assert [key for key, _ in bench.told()] == ["near.sensor"]
    port.sensor = bench.sonar
    assert bench.watch(0.5).distance == pytest.approx(0.73)
    assert bench.told() == []


def test_values_that_stay_invalid_are_told() -> None:
    bench = Bench(sonar="")
    bench.watch(0.3)
    handle = bench.brick.handle

    def invalid(telegram: bytes) -> bytes | None:
        reply = handle(telegram)
        return reply[:4] + b"\0" + reply[5:] if reply and telegram[1] == 0x07 and telegram[2] == 1 else reply

    bench.brick.handle = invalid  # type: ignore[method-assign]
    bench.watch(0.2)
    assert bench.told() == []  # a moment is no fault
    bench.watch(0.6)
    assert bench.told() == [("near.sensor", "input 2: no valid values")]
    bench.brick.handle = handle  # type: ignore[method-assign]
    bench.watch(0.3)
    assert bench.told() == []


def test_a_sonar_that_never_answers_is_told() -> None:
    bench = Bench(bumper="")
    bench.watch(0.3)
    handle = bench.brick.handle
    bench.brick.handle = lambda t: b"\x02\x0e\x20\x00" if t[1] == 0x0E else handle(t)  # type: ignore[method-assign]
    bench.watch(0.9)
    assert [key for key, _ in bench.told()] == ["near.sensor"]
    assert "pending" in bench.told()[0][1]


def test_a_brick_that_was_off_is_told_again_what_is_plugged_in() -> None:
    bench = Bench()
    bench.watch(0.5)
    for port in range(4):  # what a restart leaves
        bench.brick.handle(bytes([0x80, 0x05, port, 0, 0]))
    bench.touches[0].pressed = True
    value = bench.watch(1.2)
    assert value.bumped
    assert value.distance == pytest.approx(0.73)
    assert bench.told() == []


def test_a_silent_brick_is_asked_ever_more_rarely() -> None:
    bench = Bench()
    bench.watch(0.5)
    bench.brick.silence_link()
    bench.watch(0.5)
    assert [key for key, _ in bench.told()] == ["near.link"]
    bench.telegrams.clear()
    bench.watch(20.0)
    assert 3 <= len(bench.telegrams) <= 12
    bench.brick.restore_link()
    assert bench.watch(6.0).distance == pytest.approx(0.73)
    assert bench.told() == []


def test_one_lost_answer_is_no_fault() -> None:
    bench = Bench()
    bench.watch(0.5)
    bench.brick.silence_link()
    bench.watch(TICK_S)
    bench.brick.restore_link()
    bench.watch(0.5)
    assert bench.told() == []


def test_no_sensor_and_one_input_named_twice_are_refused() -> None:
    with pytest.raises(DeviceError, match=r"base\.bumper_ports"):
        Bench(bumper="", sonar="")
    with pytest.raises(DeviceError, match="share an input"):
        Bench(bumper="14", sonar="4")


def test_a_silent_brick_cannot_be_opened_and_is_released() -> None:
    link = MemoryLink(lambda telegram: None)
    with pytest.raises(DeviceError, match="no answer to SETINPUTMODE"):
        NxtNear(Brick(link), USB_NEAR.plugged("1", ""))
    assert link.cut
