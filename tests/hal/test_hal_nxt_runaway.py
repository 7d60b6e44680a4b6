"""No way to run away: whatever goes wrong on the link, the wheels run out their lead, coast, and stand.

The link of these tests takes time like Bluetooth, loses and garbles answers, delays them and breaks; the
control loop is late besides. Where the wheels' targets truly are is counted from the telegrams that reached
the brick, as the firmware counts.
"""

from __future__ import annotations

import math
import struct
from collections import deque
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from robot.hal.nxt.base import NxtBase
from robot.hal.nxt.brick import Brick
from robot.hal.nxt.replies import OutputState
from robot.hal.nxt.settings import BLUETOOTH, USB, NxtSettings
from robot.hal.nxt.wheel import Wheel, WheelSettings
from robot.messages import Twist
from robot.sim.brick_emulator import BrickEmulator
from robot.sim.motor import FreeMotor

TICK_S = 0.04
PULSE_S = 0.3
# Room for slowing down before a target is set anew (5 degrees of the motor), the gears' play (4), and a slow
# motor that jerks rather than turns: 12 degrees are 6 mm on the floor.
SLACK_DEG = 12.0
# A wheel that reached its target floats: measured on this bench, from the rate at which it got there.
COAST_S, COAST_DEG = 0.3, 15.0
PORTS = (1, 2)


class Wire:
    """A half-duplex link in simulated time. mishaps: what becomes of the next answers, '' for nothing."""

    def __init__(self, brick: BrickEmulator, turnaround_s: float) -> None:
        self._brick = brick
        self._turnaround_s = turnaround_s
        self._rng = np.random.default_rng(7)
        self._answers: deque[bytes] = deque()
        self._late: deque[bytes] = deque()
        self._receiving = False
        self.now = 0.0
        self.mishaps: deque[str] = deque()
        self.targets = [0, 0, 0]
        self.powers = [0, 0, 0]

    def seconds(self) -> float:
        return self.now

    def advance(self, seconds: float) -> None:
        self._brick.advance(seconds)
        self.now = round(self.now + seconds, 6)

    def write(self, telegram: bytes) -> None:
        self._turn(receiving=False)
        answer = self._brick.handle(telegram)
        self._count(telegram)
        if answer is None:
            return
        mishap = self.mishaps.popleft() if self.mishaps else ""
        if mishap == "late":
            self._late.append(answer)
        elif mishap == "garbage":
            self._answers.append(self._rng.bytes(int(self._rng.integers(1, 64))))
        elif mishap == "mangled":  # of the right length, and nearly right
            self._answers.append(bytes([answer[0] ^ 1]) + answer[1:])
        elif mishap != "lost":
            self._answers.append(answer)

    def read(self, timeout: float) -> bytes | None:
        if self._answers:
            self._turn(receiving=True)
            return self._answers.popleft()
        self.advance(timeout)
        self._answers.extend(self._late)  # comes after somebody stopped waiting for it
        self._late.clear()
        return None

    def close(self) -> None:
        pass

    def lead_deg(self, port: int) -> float:
        """How far the motor will still run by itself; what it rolls back first is no part of it."""
        state = self._brick.handle(bytes([0, 6, port]))
        assert state is not None
        tacho = struct.unpack("<i", state[13:17])[0]
        power = self.powers[port]
        sign = math.copysign(1, power)
        return sign * self.targets[port] - max(0.0, sign * tacho) if power else 0.0

    def _count(self, telegram: bytes) -> None:
        if telegram[1] == 0x21:
            self.targets[telegram[2]] = 0
        if telegram[1] == 0x04:
            power, limit = struct.unpack("b", telegram[3:4])[0], int.from_bytes(telegram[8:12], "little")
            for each in (0, 1, 2) if telegram[2] == 0xFF else (telegram[2],):
                self.powers[each] = power
                self.targets[each] += limit if power > 0 else -limit

    def _turn(self, receiving: bool) -> None:
        if receiving != self._receiving and self._turnaround_s:
            self.advance(self._turnaround_s)
        self._receiving = receiving


class Bench:
    """A base on a rough wire, driven by a loop that may be late."""

    def __init__(self, transport: NxtSettings, turnaround_s: float, timeout_s: float) -> None:
        rng = np.random.default_rng(3)
        self.motors = [FreeMotor(rng, load_inertia=0.0005, load_torque=0.01) for _ in PORTS]
        self.brick = BrickEmulator([None, *self.motors], rng)
        self.wire = Wire(self.brick, turnaround_s)
        self.settings = transport
        self.base = NxtBase(Brick(self.wire, timeout_s, self.wire.seconds), transport)
        self._sent: deque[tuple[float, Twist]] = deque()

    def tick(self, twist: Twist, late_s: float = 0.0) -> None:
        began = self.wire.now
        self.base.read(began)
        sent = self.base.send(twist, self.wire.now)
        self._sent.append((self.wire.now, sent))
        while self._sent[0][0] < self.wire.now - 1.0:
            self._sent.popleft()
        self.wire.advance(max(0.0, began + TICK_S + late_s - self.wire.now))

    def drive(self, twist: Twist, seconds: float) -> None:
        end = self.wire.now + seconds
        while self.wire.now < end:
            self.tick(twist)

    def fastest(self, index: int) -> float:
        """The highest rate in deg/s this wheel was promised during the last second."""
        return max(
            (abs(math.degrees(self.settings.wheels.rates(t)[index])) for _, t in self._sent), default=0.0
        )

    def check_leads(self) -> None:
        for index, port in enumerate(PORTS):
            assert self.wire.lead_deg(port) <= self.fastest(index) * PULSE_S + SLACK_DEG

    def silence(self) -> list[float]:
        """Nothing is said any more; returns how far each wheel still turns, in degrees."""
        before = [motor.angle for motor in self.motors]
        self.wire.advance(1.3)
        assert all(abs(motor.speed) < 0.05 for motor in self.motors)
        return [abs(math.degrees(m.angle - angle)) for m, angle in zip(self.motors, before, strict=True)]


def usb() -> Bench:
    return Bench(USB, turnaround_s=0.0, timeout_s=0.05)


def bluetooth(shortest_s: float = 0.125) -> Bench:
    pace = replace(BLUETOOTH.pace, shortest_s=shortest_s)
    return Bench(replace(BLUETOOTH, pace=pace), turnaround_s=0.03, timeout_s=0.15)


BENCHES = {"usb": usb, "bluetooth": bluetooth, "bluetooth at 5 Hz": lambda: bluetooth(0.2)}

MISHAPS = st.lists(st.sampled_from(["", "", "", "lost", "garbage", "mangled", "late"]), max_size=8)
LATENESS = st.sampled_from([0.0, 0.0, 0.0, 0.03, 0.1, 0.25])
WORDS = st.tuples(
    st.floats(-0.25, 0.25), st.floats(-1.2, 1.2), st.integers(1, 14), MISHAPS, LATENESS, st.booleans()
)


@pytest.mark.parametrize("name", BENCHES)
@settings(max_examples=8, deadline=None)
@given(words=st.lists(WORDS, min_size=1, max_size=6))
@example(words=[(0.25, 0.0, 14, [], 0.0, False), (-0.25, 0.0, 2, ["lost"], 0.25, False)])
@example(words=[(0.25, 0.0, 14, [], 0.0, False), (0.02, 0.0, 3, ["late", "late"], 0.1, False)])
@example(
    words=[
        (0.0, 0.0, 6, [], 0.0, False),
        (-0.125, 0.0, 6, [], 0.0, False),
        (0.0, 1.0, 2, ["late"], 0.0, False),
        (0.25, 0.0, 8, [], 0.0, False),
    ]
)
@example(
    words=[
        (0.0, 0.0, 3, [], 0.0, False),
        (0.0, 0.0, 9, ["", "", "", "", "", "lost"], 0.0, True),
        (0.0, 0.0, 5, [], 0.0, False),
        (0.25, 0.0, 1, [], 0.0, False),
    ]
)
def test_after_any_silence_a_wheel_turns_its_lead_and_coasts_and_stands(
    name: str, words: list[tuple[float, float, int, list[str], float, bool]]
) -> None:
    bench = BENCHES[name]()
    for v, w, ticks, mishaps, late_s, cut in words:
        bench.wire.mishaps.extend(mishaps)
        if cut:
            bench.brick.cut_link()
        for _ in range(ticks):
            bench.tick(Twist(v, w), late_s)
            if not cut:
                bench.check_leads()
        bench.brick.restore_link()
    fastest = [bench.fastest(index) for index in range(2)]
    for travel, rate in zip(bench.silence(), fastest, strict=True):
        assert travel <= rate * PULSE_S + SLACK_DEG + rate * COAST_S + COAST_DEG


@pytest.mark.parametrize("speed", [0.08, 0.1, 0.12, 0.2])
@pytest.mark.parametrize("late_s", [0.0, 0.05, 0.35])
def test_wheels_that_falter_on_a_slow_link_are_no_stall(speed: float, late_s: float) -> None:
    bench = bluetooth(0.2)
    while bench.wire.now < 5.0:
        bench.tick(Twist(v=speed), late_s)
        assert bench.base.faults(bench.wire.now) == ()


@pytest.mark.parametrize(("name", "within_s"), [("usb", 0.3), ("bluetooth", 0.5)])
def test_a_stall_is_told_soon_whenever_it_begins(name: str, within_s: float) -> None:
    for phase in range(10):
        bench = BENCHES[name]()
        bench.drive(Twist(v=0.2), 1.6 + phase * TICK_S)
        bench.wire.advance(0.013 * (phase % 3))
        began = bench.wire.now
        bench.brick.stall(PORTS[phase % 2])
        while not bench.base.faults(bench.wire.now):
            bench.tick(Twist(v=0.2))
            assert bench.wire.now - began <= within_s
        assert {fault.kind for fault in bench.base.faults(bench.wire.now)} == {"stall"}


def test_a_wheel_told_to_slow_down_is_not_taken_to_be_fast() -> None:
    wheel = Wheel(1, WheelSettings(lead_share=0.9, lead_slack_deg=100.0))

    def reading(rotation: int, now: float) -> None:
        wheel.observed(OutputState(1, 40, 7, 1, 0, 0x20, 100, rotation, rotation, rotation), now)

    def told(rate: float, now: float) -> int:
        order = wheel.order(rate, now)
        if order is None:
            return 0
        wheel.ordered(order, now)
        return order.limit

    reading(0, 0.0)
    told(400.0, 0.0)
    reading(120, 0.6)  # 200 degrees a second
    assert told(400.0, 0.6) > 0
    told(100.0, 0.65)
    # Half a second at the new rate is 60 degrees; at the old one it would be at its target.
    assert told(100.0, 1.2) <= 1
