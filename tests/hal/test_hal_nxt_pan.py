"""The pan motor on an emulated brick: short pulses, gear, a jammed head, and a base that shares the brick."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from robot.hal.interfaces import DeviceError
from robot.hal.links import MemoryLink
from robot.hal.nxt.base import NxtBase
from robot.hal.nxt.brick import Brick
from robot.hal.nxt.pan import NxtPan
from robot.hal.nxt.settings import USB, USB_PAN, PanSettings
from robot.messages import HeadPose, Twist
from robot.sim.brick_emulator import BrickEmulator
from robot.sim.motor import FreeMotor

TICK_S = 0.04
GEARED = replace(USB_PAN, gear=3.0)


class Bench:
    """Pan motor on C; wheels on A and B if a base shares the brick."""

    def __init__(self, settings: PanSettings = GEARED) -> None:
        rng = np.random.default_rng(3)
        self.motors = [FreeMotor(rng, load_inertia=0.0004, load_torque=0.01) for _ in range(3)]
        self.brick = BrickEmulator(self.motors, rng)
        self.telegrams: list[bytes] = []
        self.link = MemoryLink(self.handle)
        self.shared = Brick(self.link)
        self.pan = NxtPan(self.shared, settings)
        self.now = 0.0

    def handle(self, telegram: bytes) -> bytes | None:
        self.telegrams.append(telegram)
        return self.brick.handle(telegram)

    def look(self, pan_deg: float, seconds: float, also=lambda: None) -> float:  # type: ignore[no-untyped-def]
        for _ in range(round(seconds / TICK_S)):
            self.pan.read(self.now)
            also()
            self.pan.send(HeadPose(math.radians(pan_deg)), self.now)
            self.brick.advance(TICK_S)
            self.now = round(self.now + TICK_S, 6)
        return math.degrees(self.pan.read(self.now).pan)

    def kinds(self) -> list[str]:
        return [fault.key for fault in self.pan.faults(self.now)]


@pytest.mark.parametrize("gear", [1.0, 3.0, -3.0, 12.0])
def test_the_motor_turns_gear_times_the_head(gear: float) -> None:
    bench = Bench(replace(USB_PAN, gear=gear))
    assert bench.look(30, 2.5) == pytest.approx(30, abs=3.5 / abs(gear) + 0.1)
    assert math.degrees(bench.motors[2].angle) == pytest.approx(30 * gear, abs=6)


def test_every_order_ends_within_its_pulse_and_at_the_goal() -> None:
    bench = Bench()
    target = 0
    for goal in (60, -60, -40, 0):
        for _ in range(40):
            bench.telegrams.clear()
            bench.look(goal, TICK_S)
            for t in bench.telegrams:
                target = 0 if t[1] == 0x21 else target
                if t[1] == 0x04 and t[3] != 0:
                    power = t[3] - 256 if t[3] > 127 else t[3]
                    limit = int.from_bytes(t[8:12], "little")
                    assert 1 <= limit <= GEARED.rate_deg_s * GEARED.pulse_s
                    assert abs(power) <= GEARED.rate_deg_s / 10
                    target += limit if power > 0 else -limit
            state = bench.brick.handle(b"\x00\x06\x02")
            assert state is not None
            tacho = int.from_bytes(state[13:17], "little", signed=True)
            assert abs(target - tacho) <= GEARED.rate_deg_s * GEARED.pulse_s + 10


def test_a_new_goal_every_tick_is_followed() -> None:
    bench = Bench()
    for index in range(100):
        bench.look(40 * math.sin(index / 25), TICK_S)
    assert bench.kinds() == []
    assert math.degrees(bench.pan.read(bench.now).pan) == pytest.approx(40 * math.sin(99 / 25), abs=14)


def test_a_jammed_head_is_told_held_and_tried_again_until_it_moves() -> None:
    bench = Bench()
    bench.look(20, 1.5)
    bench.brick.stall(2)
    bench.look(-40, 0.9)
    assert bench.kinds() == ["head.stuck"]
    bench.telegrams.clear()
    bench.look(-40, 0.6)
    assert all(t[1] == 0x06 for t in bench.telegrams)  # it does not push
    bench.look(-40, 3.0)
    assert bench.kinds() == ["head.stuck"]
    bench.brick.release(2)
    assert bench.look(-40, 3.0) == pytest.approx(-40, abs=2)
    assert bench.kinds() == []


def test_a_head_whose_goal_moves_all_the_time_is_seen_to_be_jammed() -> None:
    bench = Bench()
    bench.brick.stall(2)
    for index in range(30):
        bench.look(30 + index, TICK_S)
    assert bench.kinds() == ["head.stuck"]


def test_a_stop_of_all_motors_stops_the_head_until_the_next_send() -> None:
    bench = Bench()
    bench.pan.send(HeadPose(math.radians(70)), bench.now)
    bench.shared.hold_all()  # before it has moved at all
    bench.brick.advance(0.3)
    still = bench.motors[2].angle
    bench.brick.advance(0.3)
    assert bench.motors[2].angle == pytest.approx(still, abs=0.02)
    bench.now += 0.6
    bench.look(70, 0.5)  # at once, not when it was found to be stuck
    assert math.degrees(bench.motors[2].angle - still) > 30
    assert bench.look(70, 2.0) == pytest.approx(70, abs=2)
    assert bench.kinds() == []


def test_base_and_head_share_the_brick_and_the_last_one_closes_it() -> None:
    bench = Bench()
    base = NxtBase(bench.shared, replace(USB, left_port=0, right_port=1, hold_ports=(0, 1)))

    def stop_all_the_time() -> None:
        base.read(bench.now)
        base.stop(bench.now)

    assert bench.look(50, 2.0, stop_all_the_time) == pytest.approx(50, abs=2)  # a stop of the wheels only

    def drive() -> None:
        base.read(bench.now)
        base.send(Twist(v=0.2), bench.now)

    bench.look(-20, 2.0, drive)
    assert base.read(bench.now).pose.x > 0.3
    assert base.faults(bench.now) == ()
    base.close()
    bench.brick.advance(0.3)
    assert all(abs(motor.speed) < 0.02 for motor in bench.motors[:2])
    assert not bench.link.cut
    assert bench.look(10, 2.0) == pytest.approx(10, abs=2)
    bench.pan.close()
    assert bench.link.cut


def test_a_brick_switched_off_and_on_does_not_turn_the_head() -> None:
    bench = Bench()
    before = bench.look(40, 2.0)
    bench.brick.cut_link()
    bench.look(40, 0.5)
    assert bench.kinds() == ["head.link"]
    bench.brick.restore_link()
    bench.brick.handle(bytes([0x80, 0x0A, 2, 0]))  # counts from zero again
    bench.brick.handle(bytes([0x80, 0x21, 2]))
    angle = bench.motors[2].angle
    assert bench.look(40, 2.0) == pytest.approx(before, abs=2)
    assert math.degrees(bench.motors[2].angle - angle) == pytest.approx(0, abs=8)


def test_a_gear_of_zero_is_refused() -> None:
    with pytest.raises(DeviceError, match="pan_gear is 0"):
        NxtPan(Brick(MemoryLink(lambda telegram: None)), replace(USB_PAN, gear=0.0))


def test_a_silent_brick_cannot_be_opened_and_is_released() -> None:
    link = MemoryLink(lambda telegram: None)
    with pytest.raises(DeviceError, match="pan motor on C"):
        NxtPan(Brick(link))
    assert link.cut
