"""The NXT base before an emulated brick: dead-man, speed, odometry, faults."""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.hal.interfaces import DeviceError
from robot.hal.links import MemoryLink
from robot.hal.nxt.base import NxtBase
from robot.hal.nxt.brick import Brick
from robot.hal.nxt.settings import BLUETOOTH, USB, NxtSettings
from robot.messages import Twist
from robot.sim.brick_emulator import BrickEmulator, Identity
from robot.sim.motor import FreeMotor

TICK_S = 0.04
RADIUS = USB.wheels.radius


class Spy:
    """Stands in the link: keeps every telegram, and adds up each motor's target as the firmware does."""

    def __init__(self, brick: BrickEmulator) -> None:
        self._brick = brick
        self.telegrams: list[bytes] = []
        self.targets = [0, 0, 0]
        self.powers = [0, 0, 0]

    def handle(self, telegram: bytes) -> bytes | None:
        self.telegrams.append(telegram)
        if telegram[1] == 0x21:
            self.targets[telegram[2]] = 0
        if telegram[1] == 0x04:
            port, power, limit = telegram[2], struct.unpack("b", telegram[3:4])[0], telegram[8:12]
            for each in (0, 1, 2) if port == 0xFF else (port,):
                self.powers[each] = power
                self.targets[each] += int(math.copysign(int.from_bytes(limit, "little"), power))
        return self._brick.handle(telegram)

    def lead(self, port: int) -> float:
        """Degrees the motor will still run by itself; what it rolls back first is no part of them."""
        state = self._brick.handle(bytes([0, 6, port]))
        assert state is not None
        tacho = struct.unpack("<i", state[13:17])[0]
        power = self.powers[port]
        sign = math.copysign(1, power)
        return sign * self.targets[port] - max(0.0, sign * tacho) if power else 0.0

    def opcodes(self) -> list[int]:
        return [telegram[1] for telegram in self.telegrams]


class Bench:
    """Base, brick and motors on the bench."""

    def __init__(self, settings_: NxtSettings = USB, seed: int = 3, **brick: object) -> None:
        rng = np.random.default_rng(seed)
        self.motors = [FreeMotor(rng, load_inertia=0.0005) for _ in range(2)]
        self.brick = BrickEmulator([None, *self.motors], rng, **brick)  # type: ignore[arg-type]
        self.spy = Spy(self.brick)
        self.base = NxtBase(Brick(MemoryLink(self.spy.handle)), settings_)
        self.now = 0.0

    def tick(self, twist: Twist | None) -> Twist | None:
        self.base.read(self.now)
        sent = None if twist is None else self.base.send(twist, self.now)
        self.pause(TICK_S)
        return sent

    def drive(self, twist: Twist | None, seconds: float):  # type: ignore[no-untyped-def]
        for _ in range(round(seconds / TICK_S)):
            self.tick(twist)
        return self.base.read(self.now)

    def pause(self, seconds: float) -> None:
        self.now = round(self.now + seconds, 6)
        self.brick.advance(seconds)

    def kinds(self) -> set[str]:
        return {fault.kind for fault in self.base.faults(self.now)}


# ------------------------------------------------------------------------------------------- dead-man


@settings(max_examples=10, deadline=None)
@given(
    words=st.lists(
        st.tuples(st.floats(-0.3, 0.3), st.floats(-1.2, 1.2), st.integers(1, 12)), min_size=2, max_size=6
    ),
)
def test_no_motor_is_ever_told_more_than_its_pulse(words: list[tuple[float, float, int]]) -> None:
    bench = Bench()
    for v, w, ticks in words:
        for _ in range(ticks):
            bench.base.read(bench.now)
            sent = bench.base.send(Twist(v, w), bench.now)
            rates = [abs(math.degrees(rate)) for rate in USB.wheels.rates(sent)]
            for port, rate in zip((1, 2), rates, strict=True):
                assert bench.spy.lead(port) <= rate * 0.3 + 7.0  # the slack for slowing down
            bench.pause(TICK_S)


def test_no_drive_telegram_is_without_limit() -> None:
    bench = Bench()
    for v in (0.2, 0.05, -0.1, 0.001, 0.25):
        bench.drive(Twist(v=v), 0.4)
    drives = [t for t in bench.spy.telegrams if t[1] == 4 and t[3] != 0]
    assert len(drives) > 20
    assert all(int.from_bytes(t[8:12], "little") > 0 for t in drives)


@pytest.mark.parametrize("transport", [USB, BLUETOOTH], ids=["usb", "bluetooth"])
@pytest.mark.parametrize("speed", [0.05, 0.15, 0.25])
def test_a_dead_host_leaves_the_wheels_standing(transport: NxtSettings, speed: float) -> None:
    bench = Bench(transport)
    bench.drive(Twist(v=speed), 2.0)
    angles = [motor.angle for motor in bench.motors]
    bench.brick.cut_link()
    bench.pause(0.75)
    for motor, angle in zip(bench.motors, angles, strict=True):
        assert abs(motor.speed) < 0.02
        # What it turns in 0.3 s, and half a turn of coasting from full speed.
        assert (motor.angle - angle) * RADIUS < speed * 0.3 + 0.6 * speed**2 + 0.004


def test_slowing_down_takes_the_target_back() -> None:
    bench = Bench()
    bench.drive(Twist(v=0.25), 1.5)
    bench.drive(Twist(v=0.02), 0.2)
    assert bench.spy.lead(1) < math.degrees(0.02 / RADIUS) * 0.3 + 8


def test_a_reversal_brakes_before_it_turns_round() -> None:
    bench = Bench()
    bench.drive(Twist(v=0.2), 1.0)
    bench.base.read(bench.now)
    bench.spy.telegrams.clear()
    bench.base.send(Twist(v=-0.2), bench.now)
    # Each wheel: hold, zero the target, and only then the other way.
    assert bench.spy.opcodes() == [0x04, 0x21, 0x04] * 2
    assert [t[3] for t in bench.spy.telegrams if t[1] == 4][::2] == [0, 0]


def test_a_base_that_ran_out_is_braked_when_the_host_still_reads() -> None:
    bench = Bench()
    bench.drive(Twist(v=0.2), 1.0)
    assert bench.spy.powers[1] > 0
    bench.drive(None, 0.4)
    assert bench.spy.powers == [0, 0, 0]


def test_after_a_lost_answer_the_target_is_set_anew() -> None:
    bench = Bench()
    bench.drive(Twist(v=0.2), 1.0)
    bench.brick.silence_link()
    bench.pause(TICK_S)
    bench.base.read(bench.now)  # what the brick got of it nobody knows
    bench.brick.restore_link()
    bench.spy.telegrams.clear()
    bench.base.send(Twist(v=0.2), bench.now)
    assert bench.spy.opcodes().count(0x21) == 2


def test_a_third_motor_is_held_by_the_stop_too() -> None:
    bench = Bench()
    bench.base.stop(bench.now)
    assert bench.spy.telegrams[-1] == bytes.fromhex("8004ff0007010020 00000000")


# --------------------------------------------------------------------------------------------- motion


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_loop_reaches_the_commanded_twist(seed: int) -> None:
    bench = Bench(seed=seed)
    twist = Twist(v=0.15, w=0.3)
    before = bench.drive(twist, 2.0)
    after = bench.drive(twist, 6.0)
    turned = (after.pose.yaw - before.pose.yaw) % math.tau
    assert turned / 6.0 == pytest.approx(0.3, rel=0.05)
    radius = math.dist((after.pose.x, after.pose.y), (before.pose.x, before.pose.y)) / (
        2 * math.sin(turned / 2)
    )
    assert radius == pytest.approx(0.5, rel=0.05)


def test_weak_motors_are_helped() -> None:
    weak = replace(USB, wheel=replace(USB.wheel, degrees_per_second_per_power=12.0))
    unhelped = replace(weak, wheel=replace(weak.wheel, loop_gain=1e-9))
    way = {}
    for name, figures in (("helped", weak), ("unhelped", unhelped)):
        bench = Bench(figures)
        bench.drive(Twist(v=0.2), 4.0)
        start = bench.base.read(bench.now).pose.x
        way[name] = bench.drive(Twist(v=0.2), 4.0).pose.x - start
    assert way["unhelped"] < 0.7
    assert way["helped"] > 0.76


@pytest.mark.parametrize("transport", [USB, BLUETOOTH], ids=["usb", "bluetooth"])
def test_odometry_follows_the_true_shafts(transport: NxtSettings) -> None:
    bench = Bench(transport)
    for index in range(100):
        bench.tick(Twist(v=0.2 * math.sin(index / 10), w=math.cos(index / 7)))
    bench.base.stop(bench.now)
    pose = bench.drive(None, 1.2).pose
    left, right = (motor.angle for motor in bench.motors)
    assert pose.yaw == pytest.approx((right - left) * RADIUS / USB.wheels.track_width, abs=0.03)


def test_a_motor_built_in_backwards_drives_forward() -> None:
    bench = Bench(replace(USB, wheel=replace(USB.wheel, forward=-1)))
    odometry = bench.drive(Twist(v=0.2), 1.5)
    assert odometry.pose.x > 0.2
    assert all(motor.angle < -5 for motor in bench.motors)
    assert bench.kinds() == set()


def test_a_wheel_that_stands_in_the_curve_is_held() -> None:
    bench = Bench()
    # v = w track/2: the left wheel is the centre of the turn.
    bench.drive(Twist(v=0.06, w=0.8), 1.0)
    assert abs(math.degrees(bench.motors[0].angle)) < 5
    assert math.degrees(bench.motors[1].angle) > 100


def test_bluetooth_asks_rarely_and_one_motor_at_a_time() -> None:
    bench = Bench(BLUETOOTH)
    bench.spy.telegrams.clear()
    for _ in range(25):
        before = len(bench.spy.telegrams)
        bench.base.read(bench.now)
        assert bench.spy.opcodes()[before:].count(0x06) <= 1
        bench.base.send(Twist(v=0.1), bench.now)
        bench.pause(TICK_S)
    assert 5 <= bench.spy.opcodes().count(0x06) <= 8


def test_reading_polls_each_motor_once() -> None:
    bench = Bench()
    bench.base.read(0.0)
    bench.spy.telegrams.clear()
    bench.base.read(0.04)
    assert sorted(t[2] for t in bench.spy.telegrams if t[1] == 0x06) == [1, 2]


def test_the_brick_is_kept_awake() -> None:
    bench = Bench(sleep_minutes=1)
    for _ in range(100):
        bench.base.read(bench.now)
        bench.pause(1.0)
    assert bench.brick.on
    assert bench.kinds() == set()


# --------------------------------------------------------------------------------------------- faults


@pytest.mark.parametrize("from_standing", [True, False])
def test_a_stalled_wheel_is_seen_within_0_4_s_and_held(from_standing: bool) -> None:
    bench = Bench()
    if not from_standing:
        bench.drive(Twist(v=0.2), 1.0)
    bench.brick.stall(1)
    bench.drive(Twist(v=0.2), 0.4)
    assert [(f.key, f.evidence) for f in bench.base.faults(bench.now)] == [("base.stall", "left wheel")]
    assert bench.base.send(Twist(v=0.2), bench.now) == Twist()
    assert bench.spy.powers[1:] == [0, 0]


def test_a_stall_is_over_when_it_was_acknowledged_and_a_second_passed() -> None:
    bench = Bench()
    bench.brick.stall(2)
    bench.drive(Twist(v=0.2), 3.0)
    assert bench.kinds() == {"stall"}  # nobody stopped: it stands
    bench.brick.release(2)
    bench.base.stop(bench.now)
    bench.pause(0.1)
    assert bench.kinds() == set()  # told for three seconds already
    assert bench.drive(Twist(v=0.2), 1.0).pose.x > 0.1


def test_a_slow_wheel_is_no_stall() -> None:
    for speed in (0.005, 0.02, 0.05):
        bench = Bench()
        bench.drive(Twist(v=speed), 4.0)
        assert bench.kinds() == set()


def test_battery_faults_have_hysteresis() -> None:
    bench = Bench()
    volts = bench.base.battery_volts()
    assert volts is not None
    assert volts == pytest.approx(7.9, abs=0.2)
    told = []
    for millivolts in (7500, 6700, 6850, 6200, 6400, 6600, 7500):
        bench.brick.set_battery(millivolts)
        bench.drive(None, 5.2)
        told.append(bench.kinds())
    low, both = {"battery_low"}, {"battery_low", "battery_empty"}
    assert told == [set(), low, low, both, both, low, set()]


def test_one_lost_answer_is_no_fault() -> None:
    bench = Bench()
    bench.drive(Twist(v=0.2), 1.0)
    bench.brick.silence_link()
    bench.tick(Twist(v=0.2))
    bench.brick.restore_link()
    odometry = bench.drive(Twist(v=0.2), 1.0)
    assert bench.kinds() == set()
    assert odometry.twist.v == pytest.approx(0.2, abs=0.03)


@pytest.mark.parametrize("way", ["silence_link", "cut_link", "power_off", "garbage"])
def test_a_lost_brick_is_a_link_fault_within_0_3_s(way: str) -> None:
    bench = Bench()
    bench.drive(Twist(v=0.2), 1.0)
    last = bench.base.read(bench.now)
    if way == "garbage":
        bench.brick.garbage = True
    else:
        getattr(bench.brick, way)()
    bench.drive(Twist(v=0.2), 0.28)
    assert bench.kinds() == {"link"}
    assert bench.base.read(bench.now) == last
    assert bench.base.send(Twist(v=0.2), bench.now) == Twist()


def test_a_dead_link_is_not_tried_at_every_tick() -> None:
    bench = Bench()
    bench.brick.silence_link()
    bench.drive(Twist(v=0.2), 1.0)
    bench.spy.telegrams.clear()
    bench.drive(Twist(v=0.2), 2.0)
    bench.base.stop(bench.now)
    assert 2 <= len(bench.spy.telegrams) <= 10


def test_a_brick_switched_off_and_on_does_not_move_the_pose() -> None:
    bench = Bench()
    before = bench.drive(Twist(v=0.2), 3.0).pose
    bench.brick.cut_link()
    bench.drive(None, 1.0)
    bench.brick.restore_link()
    for port in (1, 2):
        bench.brick.handle(bytes([0x80, 0x0A, port, 0]))  # counts from zero again
    after = bench.drive(None, 1.0)
    # The gears' play, not the half metre the count fell back by.
    assert math.dist((after.pose.x, after.pose.y), (before.x, before.y)) < 0.005
    assert bench.kinds() == set()
    assert bench.drive(Twist(v=0.2), 1.5).pose.x > before.x + 0.15


def test_a_refusing_brick_is_told() -> None:
    bench = Bench()
    handle = bench.spy.handle
    bench.spy.handle = lambda t: b"\x02\x06\xde" if t[1] == 0x06 else handle(t)  # type: ignore[method-assign]
    base = NxtBase(Brick(MemoryLink(bench.spy.handle)))
    base.read(0.0)
    assert [fault.key for fault in base.faults(0.0)] == ["base.refused"]
    assert "buffer" in base.faults(0.0)[0].evidence


# -------------------------------------------------------------------------------------------- opening


def test_opening_stops_what_runs_and_clears_what_was_counted() -> None:
    rng = np.random.default_rng(5)
    motors = [FreeMotor(rng), FreeMotor(rng)]
    brick = BrickEmulator([None, *motors], rng)
    brick.handle(bytes.fromhex("80 04 01 64 07 01 00 20 00000000"))
    brick.handle(bytes.fromhex("80 04 02 64 07 01 00 20 e8030000"))
    brick.advance(1.0)
    base = NxtBase(Brick(MemoryLink(brick.handle)))
    brick.advance(0.5)
    assert all(abs(motor.speed) < 0.05 for motor in motors)
    assert base.read(0.0).pose.x == 0.0


def test_old_firmware_is_refused_with_the_cure() -> None:
    rng = np.random.default_rng(5)
    brick = BrickEmulator([None] * 3, rng, has_reset_count=False, identity=Identity(firmware=(1, 5)))
    link = MemoryLink(brick.handle)
    with pytest.raises(DeviceError, match=r"firmware 1\.05 .*update it to 1\.29"):
        NxtBase(Brick(link))
    assert link.cut


def test_a_silent_brick_is_refused_in_one_line() -> None:
    with pytest.raises(DeviceError, match="no answer to GETVERSION") as caught:
        NxtBase(Brick(MemoryLink(lambda telegram: None)))
    assert "\n" not in str(caught.value)


def test_same_brick_same_bytes() -> None:
    def run() -> list[bytes]:
        bench = Bench()
        bench.drive(Twist(0.2, 0.3), 1.0)
        bench.drive(Twist(-0.1, 0.0), 1.0)
        return bench.spy.telegrams

    assert run() == run()


def test_opening_ends_a_program_that_would_drive_against_us() -> None:
    bench = Bench(programs=frozenset({"Demo.rxe"}))
    bench.brick.handle(b"\x80\x00" + b"Demo.rxe".ljust(20, b"\0"))
    NxtBase(Brick(MemoryLink(bench.brick.handle)))
    assert bench.brick.handle(b"\x00\x01") == bytes.fromhex("0201ec")  # none runs any more


def test_opening_ends_with_the_motors_held() -> None:
    # A zeroed motor floats, so the hold has to come after it.
    opcodes = Bench().spy.opcodes()
    assert opcodes.index(0x04) < opcodes.index(0x21)
    assert 0x04 in opcodes[len(opcodes) - opcodes[::-1].index(0x21) :]


# ----------------------------------------------------------------------- what cannot be stopped, and rates


@pytest.mark.parametrize("way", ["silence_link", "cut_link", "power_off"])
def test_a_wheel_that_stood_when_the_link_broke_is_stranded(way: str) -> None:
    bench = Bench()
    bench.drive(Twist(v=0.2), 1.0)
    bench.brick.stall(2)
    bench.drive(Twist(v=0.2), 0.16)  # too short for a stall
    assert bench.kinds() == set()
    getattr(bench.brick, way)()
    bench.drive(Twist(v=0.2), 0.4)
    told = {fault.kind: fault.evidence for fault in bench.base.faults(bench.now)}
    assert told.keys() == {"link", "stranded"}
    assert told["stranded"] == "right wheel"


def test_a_stall_whose_hold_never_arrived_is_stranded() -> None:
    bench = Bench()
    bench.drive(Twist(v=0.2), 1.0)
    bench.brick.stall(1)
    handle = bench.brick.handle

    def dies_at_the_hold(telegram: bytes) -> bytes | None:
        if telegram == bytes.fromhex("8004ff000701002000000000"):
            bench.brick.silence_link()
        return handle(telegram)

    bench.brick.handle = dies_at_the_hold  # type: ignore[method-assign]
    bench.drive(Twist(v=0.2), 1.0)
    assert bench.kinds() == {"stall", "link", "stranded"}
    bench.brick.restore_link()
    bench.brick.handle = handle  # type: ignore[method-assign]
    bench.brick.release(1)
    bench.base.stop(bench.now)
    bench.drive(None, 2.0)
    assert bench.kinds() == set()


def test_a_turning_wheel_is_not_stranded() -> None:
    for transport in (USB, BLUETOOTH):
        for ticks in range(1, 12):
            bench = Bench(transport)
            bench.drive(Twist(v=0.15), ticks * TICK_S)
            bench.brick.cut_link()
            bench.drive(Twist(v=0.15), 0.4)
            assert bench.kinds() == {"link"}


def test_the_first_low_voltage_beeps_once() -> None:
    bench = Bench()
    bench.brick.set_battery(6600)
    bench.drive(None, 16.0)
    assert [t for t in bench.spy.telegrams if t[1] == 0x03] == [bytes.fromhex("8003b8012c01")]


def test_the_measured_rate_is_told_and_fits_the_link() -> None:
    for transport, low, high in ((USB, 20.0, 50.0), (BLUETOOTH, 5.0, 8.0)):
        bench = Bench(transport)
        bench.drive(Twist(v=0.1), 3.0)
        rate = bench.base.measured_rate_hz
        assert rate is not None
        assert low <= rate <= high
        bench.brick.cut_link()
        bench.drive(None, 0.5)
        assert bench.base.measured_rate_hz is None


def test_a_usb_base_asked_faster_than_it_likes_keeps_to_fifty_a_second() -> None:
    bench = Bench()
    bench.spy.telegrams.clear()
    for _ in range(200):
        bench.base.read(bench.now)
        bench.pause(0.005)
    assert bench.spy.opcodes().count(0x06) == pytest.approx(2 * 50, abs=4)


def test_a_dead_link_is_tried_ever_more_rarely_but_at_least_every_five_seconds() -> None:
    bench = Bench()
    bench.brick.silence_link()
    bench.drive(None, 20.0)
    tries = []
    for _ in range(500):
        bench.spy.telegrams.clear()
        bench.tick(None)
        if bench.spy.telegrams:
            tries.append(bench.now)
    pauses = [after - before for before, after in pairwise(tries)]
    assert all(4.9 <= pause <= 5.1 for pause in pauses)
    assert len(pauses) >= 2


@pytest.mark.parametrize("transport", [USB, BLUETOOTH], ids=["usb", "bluetooth"])
def test_wheels_that_falter_are_no_stall(transport: NxtSettings) -> None:
    bench = Bench(transport)
    for _ in range(12):
        bench.drive(Twist(v=0.12), 0.4)
        bench.pause(0.28)  # a late loop: the pulse runs out
        bench.base.send(Twist(v=0.12), bench.now)
    assert bench.kinds() == set()


def test_wheels_only_are_held_if_the_third_motor_is_somebody_elses() -> None:
    bench = Bench(replace(USB, hold_ports=(1, 2)))
    bench.spy.telegrams.clear()
    bench.base.stop(bench.now)
    assert [t.hex() for t in bench.spy.telegrams] == [f"80040{p}000701002000000000" for p in (1, 2)]
