"""The guard: stops on any doubt, never faster than asked for, never farther than is free."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.guard import GuardInput, GuardLimits, guard, safe_speed
from robot.messages import Clearance, Command, HeadPose, Near, Sent, Twist

LIMITS = GuardLimits()
NOW = 10.0
speeds = st.floats(-0.5, 0.5)
rates = st.floats(-3.0, 3.0)
ages = st.floats(0.0, 0.5)
distances = st.floats(0.0, 3.0)
any_number = st.floats(allow_nan=True, allow_infinity=True)


def free(distance: float, limited_by: str = "obstacle") -> Callable[[Twist], Clearance]:
    return lambda twist: Clearance(distance, limited_by)


def command(v: float, w: float = 0.0, expires_at: float = NOW + 0.2) -> Command:
    return Command(Twist(v, w), HeadPose(0.1, 0.2), 0.5, expires_at)


CRUISING = GuardInput(
    now=NOW, period=0.04, previous=Twist(0.25), free_space_at=NOW - 0.1, clearance=free(3.0), turn_free=True
)


def test_a_good_command_passes_untouched() -> None:
    sent = guard(command(0.25, 0.0), CRUISING, LIMITS)
    assert sent == Sent(Twist(0.25, 0.0), HeadPose(0.1, 0.2), 0.5, None)


# ------------------------------------------------------------------------------------------------ stops


def test_an_expired_command_stops_and_moves_no_head() -> None:
    sent = guard(command(0.2, expires_at=NOW), CRUISING, LIMITS)
    assert (sent.twist, sent.head, sent.limited_by) == (Twist(), None, "command expired")
    assert guard(command(0.2, expires_at=math.nan), CRUISING, LIMITS).twist.is_zero


def test_a_stop_fault_stops_everyone_and_says_which() -> None:
    for teleop in (False, True):
        sent = guard(command(0.2, 1.0), replace(CRUISING, stop="base.link", teleop=teleop), LIMITS)
        assert sent.twist.is_zero
        assert sent.limited_by == "stop: base.link"


@pytest.mark.parametrize("now", [math.nan, math.inf])
def test_a_clock_that_is_none_stops(now: float) -> None:
    assert guard(command(0.2), replace(CRUISING, now=now), LIMITS).twist.is_zero


@settings(deadline=None, max_examples=300)
@given(any_number, any_number, any_number, any_number, any_number, st.none() | any_number, st.booleans())
def test_whatever_comes_in_what_goes_out_is_within_command_and_limits(
    v: float, w: float, distance: float, period: float, previous: float, seen_at: float | None, teleop: bool
) -> None:
    state = replace(
        CRUISING, previous=Twist(previous, previous), period=period, free_space_at=seen_at,
        clearance=free(distance), teleop=teleop,
    )  # fmt: skip
    sent = guard(command(v, w), state, LIMITS)
    assert math.isfinite(sent.twist.v)
    assert math.isfinite(sent.twist.w)
    if not (math.isfinite(v) and math.isfinite(w)):
        assert sent.twist.is_zero
        assert sent.limited_by
        return
    assert abs(sent.twist.v) <= min(abs(v), LIMITS.max_speed) * (1 + 1e-9)
    assert abs(sent.twist.w) <= min(abs(w), LIMITS.max_turn) * (1 + 1e-9)
    assert sent.twist.v * v >= 0.0
    assert sent.twist.w * w >= 0.0
    if sent.twist != Twist(v, w):
        assert sent.limited_by


@pytest.mark.parametrize("distance", [math.nan, math.inf, -math.inf, -1.0, 0.0, LIMITS.margin])
def test_no_free_distance_or_none_that_is_a_number_stops_the_wheels(distance: float) -> None:
    sent = guard(command(0.2, 0.0), replace(CRUISING, clearance=free(distance)), LIMITS)
    assert sent.twist.is_zero
    assert sent.limited_by


# --------------------------------------------------------------------------------------- free distance


@settings(deadline=None, max_examples=200)
@given(st.floats(0.01, 0.25), distances, st.floats(0.0, 0.3))
def test_the_stopping_distance_stays_within_the_free_distance(v: float, distance: float, age: float) -> None:
    state = replace(CRUISING, clearance=free(distance), free_space_at=NOW - age)
    sent = guard(command(v), state, LIMITS).twist.v
    needed = sent * (age + LIMITS.latency) + sent**2 / (2 * LIMITS.max_acceleration)
    assert needed <= max(distance - LIMITS.margin, 0.0) + 1e-9


@settings(deadline=None, max_examples=200)
@given(speeds, rates, distances, distances, ages)
def test_less_free_distance_is_never_faster(v: float, w: float, one: float, other: float, age: float) -> None:
    state = replace(CRUISING, previous=Twist(v, w), free_space_at=NOW - age)
    less, more = sorted((one, other))
    slow = guard(command(v, w), replace(state, clearance=free(less)), LIMITS).twist
    fast = guard(command(v, w), replace(state, clearance=free(more)), LIMITS).twist
    assert abs(slow.v) <= abs(fast.v) + 1e-12


@settings(deadline=None, max_examples=200)
@given(speeds, rates, distances, ages, ages)
def test_an_older_look_is_never_faster(v: float, w: float, distance: float, one: float, other: float) -> None:
    state = replace(CRUISING, previous=Twist(v, w), clearance=free(distance))
    newer, older = sorted((one, other))
    slow = guard(command(v, w), replace(state, free_space_at=NOW - older), LIMITS).twist
    fast = guard(command(v, w), replace(state, free_space_at=NOW - newer), LIMITS).twist
    assert abs(slow.v) <= abs(fast.v) + 1e-12


@settings(deadline=None, max_examples=100)
@given(st.floats(1e-6, 10.0), st.floats(0.0, 1.0), st.floats(0.05, 10.0))
def test_safe_speed_uses_the_distance_up_exactly(distance: float, delay: float, acceleration: float) -> None:
    v = safe_speed(distance, delay, 0.0, acceleration)
    assert v * delay + v * v / (2 * acceleration) == pytest.approx(distance, rel=1e-9)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0])
def test_safe_speed_of_no_distance_is_none(bad: float) -> None:
    assert safe_speed(bad, 0.1, 0.1, 0.6) == 0.0
    assert safe_speed(1.0, 0.1, 0.1, bad) == 0.0


def test_safe_speed_bears_any_size() -> None:
    assert math.isfinite(safe_speed(1e308, 0.0, 0.0, 1e308))
    assert safe_speed(1.0, 1e308, 0.0, 0.6) == pytest.approx(0.0, abs=1e-9)
    assert safe_speed(5e-324, 0.0, 0.0, 4.0) == 0.0


def test_a_curve_that_is_slowed_keeps_its_shape() -> None:
    state = replace(CRUISING, previous=Twist(0.2, 0.5), clearance=free(0.1))
    sent = guard(command(0.2, 0.5), state, LIMITS)
    assert 0.0 < sent.twist.v < 0.2
    assert sent.twist.w / sent.twist.v == pytest.approx(2.5)
    assert sent.limited_by == "obstacle in 0.10 m"


def test_the_way_is_asked_for_the_twist_that_would_be_sent_and_once() -> None:
    asked: list[Twist] = []

    def clearance(twist: Twist) -> Clearance:
        asked.append(twist)
        return Clearance(3.0, "range")

    sent = guard(command(-1.0, 0.5), replace(CRUISING, previous=Twist(-0.25), clearance=clearance), LIMITS)
    assert asked == [sent.twist]
    assert sent.twist.v == pytest.approx(-0.25)


# ----------------------------------------------------------------------------------- stale, turning


@pytest.mark.parametrize("seen_at", [None, NOW - 0.31, NOW + 0.5, math.nan])
def test_without_fresh_free_space_nothing_translates(seen_at: float | None) -> None:
    for v in (0.2, -0.2):
        sent = guard(command(v), replace(CRUISING, previous=Twist(v), free_space_at=seen_at), LIMITS)
        assert sent.twist.is_zero
        assert "free space" in str(sent.limited_by)


def test_what_may_not_be_driven_may_still_be_turned_if_there_is_room() -> None:
    for blocked in (replace(CRUISING, free_space_at=None), replace(CRUISING, clearance=free(0.0))):
        state = replace(blocked, previous=Twist(0.2, 0.5))
        assert guard(command(0.2, 0.5), state, LIMITS).twist == Twist(0.0, 0.5)
        assert guard(command(0.2, 0.5), replace(state, turn_free=False), LIMITS).twist.is_zero


def test_turning_on_the_spot_needs_room_but_no_fresh_look() -> None:
    state = replace(CRUISING, previous=Twist(0.0, 0.6), free_space_at=None)
    assert guard(command(0.0, 0.6), state, LIMITS) == Sent(Twist(0.0, 0.6), HeadPose(0.1, 0.2), 0.5, None)
    crowded = guard(command(0.0, 0.6), replace(state, turn_free=False), LIMITS)
    assert crowded.twist.is_zero
    assert crowded.limited_by == "no room to turn"


# ------------------------------------------------------------------------------------- limits, ramps


def test_speed_and_turning_are_limited_together() -> None:
    sent = guard(command(0.5, 1.0), replace(CRUISING, previous=Twist(0.25, 0.5)), LIMITS)
    assert sent.twist == Twist(0.25, 0.5)
    assert sent.limited_by == "speed limit"
    turned = guard(command(0.1, 10.0), replace(CRUISING, previous=Twist(0.1, LIMITS.max_turn)), LIMITS)
    assert turned.twist.w == pytest.approx(LIMITS.max_turn)
    assert turned.twist.v == pytest.approx(0.01 * LIMITS.max_turn)


def test_speed_is_gathered_within_the_acceleration_and_lost_at_once() -> None:
    start = guard(command(0.25), replace(CRUISING, previous=Twist()), LIMITS)
    assert start.twist.v == pytest.approx(0.6 * 0.04)
    assert start.limited_by == "acceleration"
    assert guard(command(0.05), CRUISING, LIMITS).twist.v == 0.05
    assert guard(command(0.0), CRUISING, LIMITS).twist.v == 0.0


def test_reversing_starts_again_from_standing() -> None:
    back = guard(command(-0.2), CRUISING, LIMITS)
    assert back.twist.v == pytest.approx(-0.6 * 0.04)


@pytest.mark.parametrize("state", [
    replace(CRUISING, stop="camera.black"), replace(CRUISING, clearance=free(0.0)),
    replace(CRUISING, free_space_at=None),
])  # fmt: skip
def test_stopping_for_safety_is_never_a_ramp(state: GuardInput) -> None:
    assert guard(command(0.25), state, LIMITS).twist.v == 0.0


# -------------------------------------------------------------------------------------------- teleop


def test_a_person_without_vision_drives_slowly_and_is_told() -> None:
    blind = replace(CRUISING, teleop=True, free_space_at=None, clearance=free(0.0))
    sent = guard(command(0.25, 0.5), replace(blind, previous=Twist(0.25, 0.5)), LIMITS)
    assert sent.twist.v == pytest.approx(0.08)
    assert sent.twist.w == pytest.approx(0.16)
    assert "blind speed" in str(sent.limited_by)


def test_a_person_is_stopped_by_an_obstacle_and_slowed_by_unseen_floor() -> None:
    seeing = replace(CRUISING, teleop=True)
    assert guard(command(0.25), replace(seeing, clearance=free(0.03)), LIMITS).twist.is_zero
    unseen = guard(command(0.25), replace(seeing, clearance=free(0.03, "unknown")), LIMITS)
    assert unseen.twist.v == pytest.approx(0.08)


# ------------------------------------------------------------------------------------------- the rest


def test_head_and_lamp_that_are_no_numbers_are_not_sent() -> None:
    odd = Command(Twist(), HeadPose(math.nan, 0.0), math.nan, NOW + 1.0)
    sent = guard(odd, CRUISING, LIMITS)
    assert (sent.head, sent.lamp) == (None, 0.0)
    assert guard(Command(lamp=7.0, expires_at=NOW + 1.0), CRUISING, LIMITS).lamp == 1.0


@pytest.mark.parametrize("bad", [{"margin": -0.1}, {"max_speed": math.nan}, {"max_acceleration": 0.0}])
def test_limits_that_make_no_sense_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="guard"):
        GuardLimits(**bad)


# --------------------------------------------------------------------------------------- bumper and sonar


@pytest.mark.parametrize("teleop", [False, True])
def test_where_the_bumper_touches_nothing_drives_forwards(teleop: bool) -> None:
    touching = replace(CRUISING, near=Near(NOW - 0.05, bumped=True), teleop=teleop)
    sent = guard(command(0.2), touching, LIMITS)
    assert sent.twist.is_zero
    assert sent.limited_by == "the bumper touches"
    assert guard(command(-0.02), touching, LIMITS).twist.v < 0.0


def test_the_sonar_slows_down_and_stops_before_what_the_eyes_missed() -> None:
    limits = GuardLimits(sonar_inset=0.05)

    def speed(distance: float) -> float:
        return guard(command(0.25), replace(CRUISING, near=Near(NOW, distance=distance)), limits).twist.v

    assert speed(2.0) == pytest.approx(0.25)
    assert 0.0 < speed(0.16) < 0.25
    assert speed(0.1) == 0.0


@settings(deadline=None, max_examples=200)
@given(st.floats(0.0, 3.0), speeds, rates, ages, st.booleans())
def test_near_sensors_only_take_away(distance: float, v: float, w: float, age: float, bumped: bool) -> None:
    without = guard(command(v, w), CRUISING, LIMITS).twist
    sent = guard(command(v, w), replace(CRUISING, near=Near(NOW - age, bumped, distance)), LIMITS).twist
    assert abs(sent.v) <= abs(without.v)
    assert abs(sent.w) <= abs(without.w)


def test_old_readings_say_nothing() -> None:
    old = replace(CRUISING, near=Near(NOW - 0.6, bumped=True, distance=0.0))
    assert guard(command(0.25), old, LIMITS).twist.v == pytest.approx(0.25)
