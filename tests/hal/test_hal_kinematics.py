"""Wheel rates, limits and arcs."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.hal.kinematics import Limits, Wheels, arc, limited
from robot.hal.nxt.odometry import WheelOdometry
from robot.hal.nxt.wheel import Sample, between, top_up
from robot.messages import Pose2, Twist

WHEELS = Wheels(radius=0.028, track_width=0.15)
LIMITS = Limits(speed=0.25, turn=1.2, wheel_rate=14.0)
speeds = st.floats(-3.0, 3.0)


@settings(max_examples=50, deadline=None)
@given(v=speeds, w=speeds)
def test_twist_to_rates_and_back(v: float, w: float) -> None:
    twist = WHEELS.twist(*WHEELS.rates(Twist(v, w)))
    assert (twist.v, twist.w) == pytest.approx((v, w), abs=1e-9)


@settings(max_examples=100, deadline=None)
@given(v=speeds, w=speeds)
def test_limits_hold_and_the_curve_keeps_its_shape(v: float, w: float) -> None:
    twist = limited(Twist(v, w), LIMITS, WHEELS)
    assert abs(twist.v) <= 0.25 + 1e-9
    assert abs(twist.w) <= 1.2 + 1e-9
    assert max(abs(rate) for rate in WHEELS.rates(twist)) <= 14.0 + 1e-9
    assert twist.v * w == pytest.approx(v * twist.w, abs=1e-9)
    assert twist.v * v >= 0
    at_limit = max(
        abs(twist.v) / 0.25, abs(twist.w) / 1.2, max(abs(rate) for rate in WHEELS.rates(twist)) / 14.0
    )
    assert twist == Twist(v, w) or at_limit == pytest.approx(1.0)


def test_a_base_that_may_not_turn_does_not_move_in_a_curve() -> None:
    still = Limits(speed=0.2, turn=0.0)
    assert limited(Twist(0.1, 0.1), still, WHEELS) == Twist()
    assert limited(Twist(0.1, 0.0), still, WHEELS) == Twist(0.1, 0.0)


def test_wheels_without_size_are_refused() -> None:
    with pytest.raises(ValueError, match="positive"):
        Wheels(radius=0.0, track_width=0.1)


@settings(max_examples=50, deadline=None)
@given(way=st.floats(-1, 1), turn=st.floats(-3, 3), x=speeds, yaw=speeds)
def test_an_arc_is_the_limit_of_many_small_steps(way: float, turn: float, x: float, yaw: float) -> None:
    stepped = Pose2(x, 0.0, yaw)
    for _ in range(2000):
        middle = stepped.yaw + turn / 4000
        stepped = Pose2(
            stepped.x + way / 2000 * math.cos(middle),
            stepped.y + way / 2000 * math.sin(middle),
            stepped.yaw + turn / 2000,
        )
    exact = arc(Pose2(x, 0.0, yaw), way, turn)
    assert (exact.x, exact.y) == pytest.approx((stepped.x, stepped.y), abs=1e-5)
    assert math.remainder(exact.yaw - stepped.yaw, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_a_nearly_straight_arc_keeps_its_digits() -> None:
    end = arc(Pose2(), 1.0, 2e-7)
    assert end.x == pytest.approx(1.0, abs=1e-12)
    assert end.y == pytest.approx(1e-7, rel=1e-6)


# --------------------------------------------------------------------------------------------- odometry


def degrees(metres: float) -> float:
    return math.degrees(metres / WHEELS.radius)


def test_odometry_of_a_full_turn_comes_back() -> None:
    odometry = WheelOdometry(WHEELS)
    # A circle of radius 0.5 m in 40 steps.
    for index in range(41):
        share = index / 40 * math.tau
        left, right = (degrees(share * (0.5 + side * 0.075)) for side in (-1, 1))
        value = odometry.update(Sample(left, index * 0.04), Sample(right, index * 0.04))
    assert (value.pose.x, value.pose.y, value.pose.yaw) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert value.twist.w == pytest.approx(math.tau / 1.6)
    assert value.twist.v == pytest.approx(0.5 * math.tau / 1.6)
    assert value.at == pytest.approx(1.6)


def test_wheels_read_in_turn_give_a_straight_line() -> None:
    odometry = WheelOdometry(WHEELS)

    def sample(at: float) -> Sample:
        return Sample(degrees(0.2 * at), at)

    odometry.update(sample(0.0), sample(0.0))
    for index in range(1, 9):
        late, later = index * 0.3, index * 0.3 + 0.15
        value = odometry.update(sample(late), sample(late - 0.15))
        assert abs(value.pose.yaw) < 1e-9
        assert value.at == pytest.approx(late - 0.15)
        value = odometry.update(sample(late), sample(later))
        assert abs(value.pose.yaw) < 1e-9
        assert value.pose.x == pytest.approx(0.2 * late)


def test_a_restart_keeps_the_pose() -> None:
    odometry = WheelOdometry(WHEELS)
    odometry.update(Sample(0.0, 0.0), Sample(0.0, 0.0))
    before = odometry.update(Sample(500.0, 1.0), Sample(500.0, 1.0)).pose
    odometry.restart()
    after = odometry.update(Sample(0.0, 2.0), Sample(0.0, 2.0))
    assert after.pose == before
    assert after.twist.is_zero


def test_between_two_samples() -> None:
    assert between(Sample(10.0, 1.0), Sample(20.0, 2.0), 1.25) == Sample(12.5, 1.25)
    assert between(Sample(10.0, 1.0), Sample(10.0, 1.0), 1.0) == Sample(10.0, 1.0)


# ------------------------------------------------------------------------------------------ tacho target


@settings(max_examples=200, deadline=None)
@given(
    target=st.integers(-500, 500),
    tacho=st.integers(-500, 500),
    direction=st.sampled_from([-1, 1]),
    lead=st.floats(1, 200),
)
def test_a_topped_up_target_is_never_beyond_the_lead(
    target: int, tacho: int, direction: int, lead: float
) -> None:
    limit = top_up(target, tacho, direction, lead, ceiling=lead + 20)
    ahead = direction * (target - tacho)
    if ahead > lead + 20:
        assert limit is None
    elif ahead > lead - 1:
        assert limit == 0
    else:
        assert limit is not None
        assert lead - 1 - 1e-9 <= ahead + limit <= lead + 1e-9
