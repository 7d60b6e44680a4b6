"""The motor model: published figures, the split between coil and shaft, the encoder."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.sim.motor import DEAD_BAND, FreeMotor, Motor, effective_duty


def _nominal(motor: FreeMotor) -> FreeMotor:
    motor.gain = 1.0
    return motor


def _run(motor: FreeMotor, seconds: float) -> None:
    for _ in range(round(seconds / 0.002)):
        motor.advance(0.002)


def _unloaded_speed(power: int, braked: bool = True, volts: float = 8.0) -> float:
    motor = _nominal(FreeMotor(np.random.default_rng(0)))
    motor.drive(power, braked, volts)
    _run(motor, 2.0)
    return math.degrees(motor.speed)


def test_full_power_on_eight_volts_gives_a_thousand_degrees_a_second() -> None:
    assert _unloaded_speed(100) == pytest.approx(1000.0, abs=5.0)
    assert _unloaded_speed(-100) == pytest.approx(-1000.0, abs=5.0)


def test_stall_torque_is_half_a_newton_metre_on_nine_volts() -> None:
    motor = Motor(np.random.default_rng(0))
    motor.gain = 1.0
    motor.drive(100, True, 9.0)
    motor.advance(0.01)
    assert motor.torque(0.0) == pytest.approx(0.5, rel=1e-9)
    assert motor.current_amperes == pytest.approx(2.0, rel=1e-9)


def test_dead_band_is_twelve_percent() -> None:
    assert DEAD_BAND == 0.12
    assert _unloaded_speed(12) == 0.0
    assert _unloaded_speed(-12) == 0.0
    assert 0 < _unloaded_speed(14) < 60
    assert -60 < _unloaded_speed(-14) < 0


def test_a_weaker_battery_turns_slower() -> None:
    assert _unloaded_speed(100, volts=6.0) < 0.8 * _unloaded_speed(100, volts=8.0)


def test_floating_pulses_turn_faster_unloaded_but_do_not_brake() -> None:
    # Without load a floating motor is never held back between the pulses, so its curve is not a line.
    assert _unloaded_speed(40, braked=False) > 1.3 * _unloaded_speed(40, braked=True)
    assert _unloaded_speed(-40, braked=False) == pytest.approx(-_unloaded_speed(40, braked=False))
    stopping = {}
    for braked in (True, False):
        motor = _nominal(FreeMotor(np.random.default_rng(0)))
        motor.drive(50, True, 8.0)
        _run(motor, 1.0)
        start = motor.angle
        motor.drive(0, braked, 8.0)
        _run(motor, 2.0)
        stopping[braked] = math.degrees(motor.angle - start)
        assert abs(motor.speed) < 1e-3
    assert 5 < stopping[True] < 30
    assert 40 < stopping[False] < 90


@given(power=st.integers(-128, 127))
def test_duty_is_odd_bounded_and_monotonic(power: int) -> None:
    duty = effective_duty(power)
    assert -1.0 <= duty <= 1.0
    assert effective_duty(-power) == -duty
    assert effective_duty(power + 1) >= duty


def test_command_reaches_the_coil_after_the_latency() -> None:
    motor = Motor(np.random.default_rng(3))
    assert 0.002 <= motor.latency_s <= 0.004
    motor.latency_s = 0.03
    motor.drive(100, True, 8.0)
    motor.advance(0.029)
    assert motor.torque(0.0) == 0.0
    motor.advance(0.002)
    assert motor.torque(0.0) > 0.3


def test_torque_opposes_the_shaft_when_idle_and_is_zero_at_rest() -> None:
    motor = Motor(np.random.default_rng(1))
    assert motor.torque(0.0) == 0.0
    assert motor.torque(5.0) < 0.0 < motor.torque(-5.0)


def test_a_jammed_motor_stands_and_draws_current() -> None:
    motor = FreeMotor(np.random.default_rng(1))
    motor.drive(100, True, 8.0)
    motor.jammed = True
    _run(motor, 1.0)
    assert motor.encoder_degrees in (-3, -2, -1, 0, 1, 2, 3)
    assert motor.current_amperes == pytest.approx(2.0 * 8.0 / 9.0, rel=0.1)
    motor.jammed = False
    _run(motor, 1.0)
    assert motor.encoder_degrees > 500


@given(seed=st.integers(0, 10_000), degrees=st.floats(-5000, 5000))
@settings(deadline=None, max_examples=60)
def test_encoder_is_whole_degrees_within_play_and_edge_error(seed: int, degrees: float) -> None:
    motor = Motor(np.random.default_rng(seed))
    motor.observe(math.radians(degrees), 0.0)
    count = motor.encoder_degrees
    assert isinstance(count, int)
    assert abs(count - degrees) <= 1.0 + 0.5 * math.degrees(motor.backlash_rad) + 0.8


@given(seed=st.integers(0, 1000), start=st.floats(-800, 800))
@settings(deadline=None, max_examples=30)
def test_encoder_never_steps_back_while_the_shaft_turns_forward(seed: int, start: float) -> None:
    motor = Motor(np.random.default_rng(seed))
    counts = []
    for step in range(200):
        motor.observe(math.radians(start + 0.25 * step), 1.0)
        counts.append(motor.encoder_degrees)
    assert all(b - a in (0, 1, 2) for a, b in itertools.pairwise(counts))
    assert counts[-1] - counts[0] == pytest.approx(0.25 * 199, abs=2.5)


def test_reversing_crosses_the_backlash_before_the_shaft_moves() -> None:
    motor = Motor(np.random.default_rng(4))
    motor.latency_s = 0.0
    motor.observe(math.radians(100.5), 0.0)
    counts = []
    for power in (60, -60):
        motor.drive(power, True, 8.0)
        for _ in range(50):
            motor.torque(0.0)
            motor.advance(0.002)
        counts.append(motor.encoder_degrees)
    assert counts[0] - counts[1] == pytest.approx(math.degrees(motor.backlash_rad), abs=1.6)


def test_motors_differ_but_the_same_seed_makes_the_same_motor() -> None:
    def speeds(seed: int) -> list[float]:
        rng = np.random.default_rng(seed)
        motors = [FreeMotor(rng) for _ in range(3)]
        for motor in motors:
            motor.drive(60, True, 8.0)
            _run(motor, 0.5)
        return [motor.speed for motor in motors]

    assert speeds(5) == speeds(5)
    assert len({round(s, 6) for s in speeds(5)}) == 3
    assert all(0.9 < s / np.mean(speeds(5)) < 1.1 for s in speeds(5))
