"""The brick emulator: the protocol's bytes, the firmware's quirks, an independent client on top."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.hal.links import MemoryLink
from robot.sim.brick_emulator import BrickEmulator, Identity
from robot.sim.brick_inputs import TouchSensor, UltrasonicSensor
from robot.sim.motor import FreeMotor

ON_BRAKE_REGULATED = 7
SPEED, SYNC = 1, 2
IDLE, RAMP_UP, RUNNING, RAMP_DOWN = 0, 0x10, 0x20, 0x40


class State(NamedTuple):
    port: int
    power: int
    mode: int
    regulation: int
    turn: int
    run: int
    limit: int
    tacho: int
    block: int
    rotation: int


class Bench:
    """Three free motors on a brick, and words for the telegrams."""

    def __init__(self, seed: int = 1, **brick: Any) -> None:
        rng = np.random.default_rng(seed)
        self.motors = [FreeMotor(rng, load_inertia=3e-4, load_torque=0.02) for _ in range(3)]
        self.brick = BrickEmulator(self.motors, rng, **brick)

    def ask(self, telegram: bytes | str) -> bytes:
        reply = self.brick.handle(bytes.fromhex(telegram) if isinstance(telegram, str) else telegram)
        assert reply is not None
        return reply

    def drive(
        self,
        port: int,
        power: int,
        limit: int = 0,
        *,
        mode: int = ON_BRAKE_REGULATED,
        regulation: int = SPEED,
        turn: int = 0,
        run: int = RUNNING,
    ) -> None:
        telegram = struct.pack("<BBBbBBbBI", 0, 4, port, power, mode, regulation, turn, run, limit)
        assert self.ask(telegram) == b"\x02\x04\x00"

    def hold(self, port: int = 0xFF) -> None:
        self.drive(port, 0)

    def state(self, port: int) -> State:
        reply = self.ask(bytes([0, 6, port]))
        assert len(reply) == 25
        assert reply[:3] == b"\x02\x06\x00"
        return State(*struct.unpack("<BbBBbBIiii", reply[3:]))

    def wait(self, seconds: float) -> None:
        self.brick.advance(seconds)

    def degrees(self, port: int) -> float:
        return math.degrees(self.motors[port].angle)


@pytest.fixture
def bench() -> Bench:
    return Bench()


# ------------------------------------------------------------------------------------------------ telegrams


def test_the_example_telegram_turns_motor_b_backwards_past_ninety_degrees(bench: Bench) -> None:
    assert bench.brick.handle(bytes.fromhex("80 04 01 ce 07 01 00 20 5a000000")) is None
    bench.wait(2.0)
    assert -200 < bench.degrees(1) < -90
    assert bench.state(1)[:4] == (1, -50, 7, 1)
    assert bench.degrees(0) == bench.degrees(2) == 0.0


def test_the_stop_telegram_holds_all_three(bench: Bench) -> None:
    for port in range(3):
        bench.drive(port, 60)
    bench.wait(1.0)
    bench.brick.handle(bytes.fromhex("80 04 ff 00 07 01 00 20 00000000"))
    bench.wait(1.0)
    assert all(abs(motor.speed) < 0.01 for motor in bench.motors)
    # Held: a push is answered.
    bench.motors[0].observe(bench.motors[0].angle + math.radians(60), 0.0)
    before = bench.degrees(0)
    bench.wait(1.0)
    assert bench.degrees(0) < before - 20


@pytest.mark.parametrize(
    ("request_hex", "reply_hex"),
    [
        ("01 88", "02 88 00 7c 01 1d 01"),
        ("00 0b", "02 0b 00 dc 1e"),
        ("00 0d", "02 0d 00 c0 27 09 00"),
        ("00 01", "02 01 ec"),
        ("00 11", "02 11 ec" + " 00" * 20),
        ("00 06 03", "02 06 c0" + " 00" * 22),
        ("00 07 04", "02 07 c0" + " 00" * 13),
        ("00 04 03 32 07 01 00 20 00 00 00 00", "02 04 c0"),
        ("00 0a 07 00", "02 0a c0"),
        ("00 0a 00 01", "02 0a 00"),
        ("00 77", "02 77 be"),
        ("01 77", "02 77 be"),
        ("00 04 01", "02 04 bf"),
        ("00 06", "02 06 bf"),
        ("00 03 b8 01 f4 01", "02 03 00"),
        ("00 00 78 2e 72 78 65 00", "02 00 c0"),
        ("00 0e 00", "02 0e e0 00"),
        ("00 0f 00 02 01 02 42", "02 0f e0"),
    ],
)
def test_replies_byte_by_byte(bench: Bench, request_hex: str, reply_hex: str) -> None:
    assert bench.ask(request_hex) == bytes.fromhex(reply_hex)


def test_device_info_has_33_bytes_name_and_address() -> None:
    bench = Bench(identity=Identity(name="Rover", address=bytes(range(7)), free_flash=4711))
    reply = bench.ask("01 9b")
    assert len(reply) == 33
    assert reply[3:18] == b"Rover".ljust(15, b"\0")
    assert reply[18:25] == bytes(range(7))
    assert struct.unpack("<I", reply[29:]) == (4711,)


@pytest.mark.parametrize("telegram", ["80 0b", "81 9b", "80 77", "80 06 09", "80 04 01"])
def test_no_reply_was_asked_for_none_comes(bench: Bench, telegram: str) -> None:
    assert bench.brick.handle(bytes.fromhex(telegram)) is None


@pytest.mark.parametrize("telegram", [b"", b"\x00", b"\x02\x06\x00", b"\x42\x06\x00"])
def test_what_is_no_request_is_not_answered(bench: Bench, telegram: bytes) -> None:
    assert bench.brick.handle(telegram) is None


@given(telegram=st.binary(max_size=80))
@settings(deadline=None, max_examples=200)
def test_any_bytes_get_a_well_formed_reply_or_none(telegram: bytes) -> None:
    bench = Bench()
    reply = bench.brick.handle(telegram)
    bench.wait(0.005)
    if reply is not None:
        assert reply[:2] == bytes([2, telegram[1]])
        assert 3 <= len(reply) <= 64
        assert telegram[0] < 2


def test_speaks_through_a_memory_link(bench: Bench) -> None:
    link = MemoryLink(bench.brick.handle)
    link.write(b"\x00\x0b")
    assert link.read(0.0) == bytes.fromhex("02 0b 00 dc 1e")


# --------------------------------------------------------------------------------------- motors: the quirks


@pytest.mark.parametrize("power", [20, 35, 50, 80, -20, -50])
def test_regulated_power_is_ten_degrees_a_second_a_percent(bench: Bench, power: int) -> None:
    bench.drive(0, power)
    bench.wait(3.0)
    before = bench.state(0).tacho
    bench.wait(3.0)
    assert (bench.state(0).tacho - before) / 3.0 == pytest.approx(10.0 * power, rel=0.05)


def test_regulation_ticks_every_101_milliseconds(bench: Bench) -> None:
    bench.drive(0, 50)
    bench.wait(0.100)
    assert bench.degrees(0) == 0.0  # braked and without a pulse until the first tick
    bench.wait(0.020)
    assert bench.degrees(0) > 0.0


def test_the_limit_is_cumulative(bench: Bench) -> None:
    """New target = previous target + limit: each overshoot is taken off the next pulse."""
    ends = []
    for _ in range(4):
        bench.drive(1, 50, limit=360)
        bench.wait(2.0)
        ends.append(bench.state(1).tacho)
    overshoots = [end - 360 * (n + 1) for n, end in enumerate(ends)]
    assert all(20 < overshoot < 200 for overshoot in overshoots)
    assert ends[3] - ends[0] == pytest.approx(3 * 360, abs=60)


def test_naive_renewal_builds_a_growing_run_on(bench: Bench) -> None:
    for _ in range(25):  # a second of pulses of 90 degrees, each 40 ms, at 300 degrees a second
        bench.drive(1, 30, limit=90)
        bench.wait(0.04)
    at_silence = bench.state(1).tacho
    bench.wait(10.0)
    assert bench.state(1).tacho - at_silence > 1500
    assert bench.state(1).tacho == pytest.approx(25 * 90, abs=100)


def test_a_stop_leaves_the_old_target_behind(bench: Bench) -> None:
    bench.drive(1, 30, limit=1000)
    bench.wait(0.5)
    bench.hold(1)
    bench.wait(0.5)
    stopped = bench.state(1).tacho
    assert stopped < 250
    bench.drive(1, 30, limit=90)
    bench.wait(6.0)
    assert bench.state(1).tacho == pytest.approx(1090, abs=80)


def test_running_without_limit_takes_the_target_along(bench: Bench) -> None:
    bench.drive(1, 40)
    bench.wait(1.5)
    here = bench.state(1).tacho
    bench.drive(1, 40, limit=200)
    bench.wait(2.0)
    assert bench.state(1).tacho == pytest.approx(here + 200, abs=90)


def test_reset_count_clears_count_and_target(bench: Bench) -> None:
    bench.drive(1, 30, limit=1000)
    bench.wait(0.5)
    bench.hold(1)
    bench.wait(0.5)
    rotation = bench.state(1).rotation
    assert bench.ask("00 21 01") == bytes.fromhex("02 21 00")
    assert bench.state(1).tacho == 0
    assert bench.state(1).rotation == rotation
    bench.drive(1, 30, limit=90)
    bench.wait(3.0)
    assert bench.state(1).tacho == pytest.approx(90, abs=70)
    assert bench.ask("00 21 03") == bytes.fromhex("02 21 c0")
    assert Bench(has_reset_count=False).ask("00 21 01") == bytes.fromhex("02 21 be")


def test_at_the_limit_the_motor_goes_idle_and_coasts(bench: Bench) -> None:
    bench.drive(1, 50, limit=360)
    while bench.state(1).run != IDLE:
        bench.wait(0.001)
    at_limit = bench.state(1).tacho
    assert 360 <= at_limit <= 362
    bench.wait(2.0)
    assert bench.state(1).tacho > at_limit + 20
    # Coasting, not held: a push stays where it was pushed to.
    pushed = bench.motors[1].angle + 1.0
    bench.motors[1].observe(pushed, 0.0)
    bench.wait(1.0)
    assert bench.motors[1].angle == pushed


def test_the_three_counters_are_reset_apart(bench: Bench) -> None:
    bench.drive(2, 50, limit=300)
    bench.wait(2.0)
    tacho = bench.state(2).tacho
    assert bench.state(2)[7:] == (tacho, tacho, tacho)
    bench.ask("00 0a 02 01")
    assert bench.state(2)[7:] == (tacho, 0, tacho)
    bench.ask("00 0a 02 00")
    assert bench.state(2)[7:] == (tacho, 0, 0)


@pytest.mark.parametrize("power", [100, 101, 127])
def test_power_is_not_range_checked(power: int) -> None:
    bench = Bench()
    bench.drive(0, power, mode=1, regulation=0)
    bench.wait(1.0)
    assert bench.state(0).power == power
    assert bench.degrees(0) == pytest.approx(_turned_at_full_power(), abs=1.0)


def _turned_at_full_power() -> float:
    bench = Bench()
    bench.drive(0, 100, mode=1, regulation=0)
    bench.wait(1.0)
    return bench.degrees(0)


def test_power_200_is_a_negative_byte(bench: Bench) -> None:
    bench.ask("00 04 00 c8 01 00 00 20 00 00 00 00")
    bench.wait(0.5)
    assert bench.state(0).power == -56
    assert bench.degrees(0) < -50


def _mismatched() -> Bench:
    bench = Bench(seed=3)
    bench.motors[1].gain, bench.motors[2].gain = 1.05, 0.95
    return bench


def test_sync_keeps_two_unequal_wheels_together() -> None:
    drifts = []
    for mode, regulation in ((3, 0), (ON_BRAKE_REGULATED, SYNC)):
        bench = _mismatched()
        for port in (1, 2):
            bench.drive(port, 50, mode=mode, regulation=regulation)
        bench.wait(3.0)
        drifts.append(abs(bench.state(1).tacho - bench.state(2).tacho))
    assert drifts[0] > 60
    assert drifts[1] < 15


def test_a_third_motor_that_still_carries_the_sync_flag_is_dragged_along() -> None:
    third = []
    for flag in (SYNC, 0):
        bench = _mismatched()
        bench.drive(0, 0, regulation=flag)
        for port in (1, 2):
            bench.drive(port, 50, regulation=SYNC)
        bench.wait(3.0)
        third.append(bench.state(0).tacho)
    assert third[0] > 300
    assert third[1] == 0


def test_sync_with_turn_ratio_100_turns_on_the_spot(bench: Bench) -> None:
    for port in (1, 2):
        bench.drive(port, 50, regulation=SYNC, turn=100)
    bench.wait(3.0)
    one, two = bench.state(1).tacho, bench.state(2).tacho
    assert one * two < 0
    assert abs(one + two) < 0.15 * abs(one)


def test_a_new_sync_run_forgets_the_curve_of_the_one_before(bench: Bench) -> None:
    for port in (1, 2):
        bench.drive(port, 50, regulation=SYNC, turn=100)
    bench.wait(2.0)
    bench.hold()
    bench.wait(0.5)
    bench.ask("00 0a 01 01")
    bench.ask("00 0a 02 01")
    for port in (1, 2):
        bench.drive(port, 50, regulation=SYNC)
    bench.wait(2.0)
    assert bench.state(1).block > 500
    assert abs(bench.state(1).block - bench.state(2).block) < 20


def test_ramps_start_and_stop_more_gently_than_a_plain_run(bench: Bench) -> None:
    bench.drive(0, 80, limit=400, mode=3, regulation=0, run=RAMP_UP)
    bench.drive(1, 80, limit=400, mode=3, regulation=0)
    bench.wait(0.4)
    assert bench.degrees(1) > 100
    assert 0 <= bench.degrees(0) < 0.2 * bench.degrees(1)
    bench.wait(4.0)
    assert bench.state(0).run == IDLE
    assert bench.state(0).tacho >= 400
    # A ramp down changes speed all the way to the limit, then idles there.
    bench.drive(2, 80, mode=3, regulation=0)
    bench.wait(1.0)
    start = bench.state(2).tacho
    bench.drive(2, 0, limit=600, mode=3, regulation=0, run=RAMP_DOWN)
    bench.wait(4.0)
    assert bench.state(2).run == IDLE
    assert 0 <= bench.state(2).tacho - start - 600 < 40


def test_an_empty_port_answers_and_never_turns() -> None:
    rng = np.random.default_rng(0)
    brick = BrickEmulator([None, FreeMotor(rng), None], rng)
    reply = brick.handle(bytes.fromhex("00 04 00 64 07 01 00 20 00000000"))
    brick.advance(1.0)
    assert reply == bytes.fromhex("02 04 00")
    state = brick.handle(b"\x00\x06\x00")
    assert state is not None
    assert state[13:] == bytes(12)


def test_a_brick_has_three_output_ports() -> None:
    with pytest.raises(ValueError, match="None for an empty port"):
        BrickEmulator([None, None], np.random.default_rng(0))


# --------------------------------------------------------------------------------------------------- faults


@pytest.mark.parametrize("switch", ["cut_link", "silence_link"])
def test_motors_run_on_when_the_link_dies(bench: Bench, switch: str) -> None:
    bench.drive(1, 50)
    bench.wait(1.0)
    getattr(bench.brick, switch)()
    before = bench.degrees(1)
    bench.wait(5.0)
    assert bench.degrees(1) - before > 2000
    if switch == "cut_link":
        with pytest.raises(ConnectionError, match="link"):
            bench.brick.handle(b"\x00\x0b")
    else:
        assert bench.brick.handle(b"\x00\x0b") is None
    bench.brick.restore_link()
    assert bench.state(1).tacho > 2000


def test_a_telegram_lost_on_the_way_stops_nothing(bench: Bench) -> None:
    bench.drive(1, 50)
    bench.wait(1.0)
    bench.brick.silence_link()
    bench.brick.handle(bytes.fromhex("80 04 ff 00 07 01 00 20 00000000"))
    before = bench.degrees(1)
    bench.wait(1.0)
    assert bench.degrees(1) - before > 400


def test_stop_program_is_no_emergency_stop(bench: Bench) -> None:
    bench.drive(1, 50)
    bench.wait(1.0)
    assert bench.ask("00 01") == bytes.fromhex("02 01 ec")
    before = bench.degrees(1)
    bench.wait(1.0)
    assert bench.degrees(1) - before > 400


def test_the_end_of_a_program_lets_the_motors_go() -> None:
    bench = Bench(programs=frozenset({"drive.rxe"}))
    assert bench.ask(b"\x00\x00drive.rxe\0") == bytes.fromhex("02 00 00")
    assert bench.ask("00 11")[2:12] == b"\0drive.rxe"
    bench.drive(1, 50)
    bench.wait(1.0)
    assert bench.ask("00 01") == bytes.fromhex("02 01 00")
    bench.wait(2.0)
    assert abs(bench.motors[1].speed) < 0.01


def test_only_keep_alive_and_start_program_keep_the_brick_awake() -> None:
    def minutes_awake(telegram: bytes) -> float:
        rng = np.random.default_rng(0)
        brick = BrickEmulator([None] * 3, rng, sleep_minutes=2, programs=frozenset({"a.rxe"}))
        for step in range(3 * 60):
            if not brick.on:
                return step / 60
            if step % 30 == 0:
                brick.handle(telegram)
            brick.advance(1.0)
        return 3.0

    assert minutes_awake(bytes.fromhex("80 04 ff 00 07 01 00 20 00000000")) == 2.0
    assert minutes_awake(b"\x00\x0b") == 2.0
    assert minutes_awake(b"\x80\x0d") == 3.0
    assert minutes_awake(b"\x80\x00a.rxe\0") == 3.0


def test_power_off_lets_the_motors_coast_and_nobody_answers(bench: Bench) -> None:
    bench.drive(1, 50)
    bench.wait(1.0)
    bench.brick.power_off()
    bench.wait(2.0)
    assert abs(bench.motors[1].speed) < 0.01
    with pytest.raises(ConnectionError, match="switched off"):
        bench.brick.handle(b"\x00\x0b")


def test_garbage_replies_are_random_bytes_but_commands_still_work(bench: Bench) -> None:
    bench.brick.garbage = True
    replies = {bench.ask("00 0b") for _ in range(20)}
    assert len(replies) > 15
    bench.brick.handle(bytes.fromhex("80 04 01 32 07 01 00 20 00000000"))
    bench.wait(1.0)
    assert bench.degrees(1) > 100


def test_a_stalled_motor_stands_still_and_never_reaches_its_limit(bench: Bench) -> None:
    bench.brick.stall(1)
    bench.drive(1, 50, limit=90)
    bench.wait(2.0)
    assert abs(bench.state(1).tacho) <= 4
    assert bench.state(1).run == RUNNING
    bench.brick.release(1)
    bench.wait(2.0)
    assert bench.state(1).tacho > 90
    with pytest.raises(ValueError, match="port A"):
        BrickEmulator([None] * 3, np.random.default_rng(0)).stall(0)


def test_the_battery_sags_under_load_and_with_use(bench: Bench) -> None:
    bench.wait(1.0)
    resting = bench.brick.battery_mv
    assert 7820 < resting < 7900
    bench.brick.stall(0)
    bench.drive(0, 100, mode=1, regulation=0)
    bench.wait(1.0)
    assert bench.brick.battery_mv < resting - 500
    bench.drive(0, 0, mode=0, regulation=0, run=IDLE)
    bench.wait(1.0)
    recovered = bench.brick.battery_mv
    assert resting - 20 < recovered < resting
    bench.brick.set_battery(6200)
    assert struct.unpack("<H", bench.ask("00 0b")[3:])[0] == bench.brick.battery_mv < 6200


def test_a_flat_battery_makes_a_slow_robot(bench: Bench) -> None:
    bench.brick.set_battery(5000)
    bench.drive(0, 100)
    bench.wait(3.0)
    assert math.degrees(bench.motors[0].speed) < 650


# ------------------------------------------------------------------------------------------------- sensors


def test_touch_sensor_is_valid_only_after_the_port_has_settled() -> None:
    touch = TouchSensor()
    bench = Bench(sensors={2: touch})
    bench.ask("00 05 02 01 20")
    assert bench.ask("00 07 02")[4] == 0
    bench.wait(0.1)
    reply = bench.ask("00 07 02")
    assert len(reply) == 16
    assert reply[4] == 1
    assert struct.unpack("<h", reply[12:14]) == (0,)
    touch.pressed = True
    assert struct.unpack("<h", bench.ask("00 07 02")[12:14]) == (1,)


@pytest.mark.parametrize(("distance_cm", "byte"), [(35, 35), (0, 0), (None, 255), (400, 255)])
def test_ultrasonic_is_written_polled_and_read(distance_cm: int | None, byte: int) -> None:
    bench = Bench(sensors={0: UltrasonicSensor(distance_cm)})
    bench.ask("00 05 00 0b 00")
    assert bench.ask("00 0f 00 02 01 02 42") == bytes.fromhex("02 0f 00")
    assert bench.ask("00 0e 00") == bytes.fromhex("02 0e 20 00")
    bench.wait(0.01)
    assert bench.ask("00 0e 00") == bytes.fromhex("02 0e 00 01")
    assert bench.ask("00 10 00") == bytes([2, 0x10, 0, 1, byte]) + bytes(15)
    assert bench.ask("00 0e 00") == bytes.fromhex("02 0e 00 00")


def test_nobody_on_the_bus_is_a_bus_error() -> None:
    bench = Bench()
    bench.ask("00 05 01 0b 00")
    bench.ask("00 0f 01 02 01 02 42")
    bench.wait(0.01)
    assert bench.ask("00 0e 01") == bytes.fromhex("02 0e dd 00")


# ------------------------------------------------------------------------------------- time and determinism


def test_the_size_of_the_time_steps_does_not_matter() -> None:
    def counts(step: float) -> list[int]:
        bench = Bench(seed=7)
        bench.drive(1, 50, limit=500)
        for _ in range(round(2.0 / step)):
            bench.wait(step)
        return [bench.state(port).tacho for port in range(3)]

    assert counts(0.002) == counts(0.01) == counts(0.0005) == counts(0.04)


def test_the_same_seed_gives_the_same_bytes() -> None:
    def transcript(seed: int) -> bytes:
        bench = Bench(seed=seed)
        bench.drive(0, 55)
        bench.drive(1, 50, limit=500)
        replies = []
        for _ in range(50):
            bench.wait(0.04)
            replies += [bench.ask(bytes([0, 6, port])) for port in range(3)] + [bench.ask("00 0b")]
        return b"".join(replies)

    assert transcript(1) == transcript(1)
    assert transcript(1) != transcript(2)


# ------------------------------------------------------------------------------------- an independent client


class EmulatedSocket:
    """What nxt-python talks to: every telegram takes 4 ms of the brick's time."""

    type = "usb"
    bsize = 60

    def __init__(self, brick: BrickEmulator) -> None:
        self._brick = brick
        self._link = MemoryLink(brick.handle)

    def __str__(self) -> str:
        return "emulated brick"

    def send(self, data: bytes) -> None:
        self._brick.advance(0.004)
        self._link.write(data)

    def recv(self) -> bytes:
        reply = self._link.read(0.0)
        assert reply is not None
        return reply

    def close(self) -> None:
        self._link.close()


@pytest.fixture
def client_bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Any, Bench]]:
    """nxt-python's Brick on the emulator, its sleeps turned into emulated time."""
    import nxt.brick
    import nxt.motor
    import nxt.sensor.digital

    bench = Bench(sensors={3: UltrasonicSensor(73), 0: TouchSensor(pressed=True)})
    now = [0.0]

    def sleep(seconds: float) -> None:
        now[0] += seconds
        bench.wait(seconds)

    time = SimpleNamespace(sleep=sleep, time=lambda: now[0])
    monkeypatch.setattr(nxt.motor, "time", time)
    monkeypatch.setattr(nxt.sensor.digital, "time", time)
    brick = nxt.brick.Brick(EmulatedSocket(bench.brick))
    yield brick, bench
    brick.close()


def test_nxt_python_reads_battery_device_and_version(client_bench: tuple[Any, Bench]) -> None:
    brick, bench = client_bench
    assert brick.get_battery_level() == bench.brick.battery_mv
    name, address, _, flash = brick.get_device_info()
    assert (name, address, flash) == ("NXT", "00:16:53:00:00:01", 93_000)
    assert brick.get_firmware_version() == ((1, 124), (1, 29))
    assert brick.keep_alive() == 600_000


def test_nxt_python_turns_a_motor_and_reads_its_tacho(client_bench: tuple[Any, Bench]) -> None:
    import nxt.motor

    brick, bench = client_bench
    motor = brick.get_motor(nxt.motor.Port.B)
    motor.turn(70, 360)
    bench.wait(1.0)
    tacho = motor.get_tacho()
    assert 350 < tacho.tacho_count < 520
    assert tacho.tacho_count == pytest.approx(bench.degrees(1), abs=6)
    motor.turn(-70, 360)
    bench.wait(1.0)
    assert abs(motor.get_tacho().tacho_count) < 160
    motor.reset_position(relative=True)
    assert motor.get_tacho().block_tacho_count == 0


def test_nxt_python_notices_a_blocked_motor(client_bench: tuple[Any, Bench]) -> None:
    import nxt.motor

    brick, bench = client_bench
    bench.brick.stall(0)
    with pytest.raises(nxt.motor.BlockedException):
        brick.get_motor(nxt.motor.Port.A).turn(70, 360)


def test_nxt_python_reads_both_sensors(client_bench: tuple[Any, Bench]) -> None:
    import nxt.sensor
    from nxt.sensor.generic import Touch, Ultrasonic

    brick, bench = client_bench
    sonar = Ultrasonic(brick, nxt.sensor.Port.S4)
    assert sonar.get_distance() == 73
    assert sonar.get_sensor_info().product_id == "LEGO"
    assert sonar.get_measurement_units() == "10E-2m"
    touch = Touch(brick, nxt.sensor.Port.S1)
    bench.wait(0.1)
    assert touch.get_sample() is True


def test_nxt_python_sees_the_refusals(client_bench: tuple[Any, Bench]) -> None:
    import nxt.error

    brick, _ = client_bench
    with pytest.raises(nxt.error.NoActiveProgramError):
        brick.stop_program()
    with pytest.raises(nxt.error.NoActiveProgramError):
        brick.get_current_program_name()
