"""The arm slows for what is near its links, and never for its target."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.arm_guard import ArmGuardSettings, ArmShape, speed_share, to_arm_frame
from robot.hal.interfaces import ArmState
from robot.messages import Points, Timed
from robot.sim.arm_kinematics import LIMITS, forward

COORDINATE = st.floats(-1.5, 1.5)
POINT = st.tuples(COORDINATE, COORDINATE, COORDINATE)
JOINTS = st.tuples(*(st.floats(low, high) for low, high in LIMITS))
SETTINGS = ArmGuardSettings()
# Upright, then bent forward: the flange is at (0.76, 0, 0.54), looking down.
BENT = (0.0, math.radians(30.0), math.radians(80.0), 0.0, math.radians(70.0), 0.0)


def arm_at(joints: tuple[float, ...]) -> ArmState:
    pose = forward(joints)
    x, y, z = (float(v) for v in pose.position)
    return ArmState(joints, (x, y, z), pose.angles, moving=True, in_position=False, enabled=True)


def share(
    points: object, target: tuple[float, float, float] | None = None, arm: ArmState | None = None
) -> float:
    value: Points = np.array(points, dtype=np.float64)
    return speed_share(Timed(value, at=1.0), arm or arm_at(BENT), target, 1.1, SETTINGS)


@settings(deadline=None, max_examples=60)
@given(JOINTS)
def test_the_chain_is_where_the_arm_is(joints: tuple[float, ...]) -> None:
    chain = ArmShape().chain(arm_at(joints))
    lengths = np.linalg.norm(np.diff(chain, axis=0), axis=1)
    # Shoulder, upper arm, elbow to wrist and wrist to flange keep their lengths in every posture.
    assert lengths == pytest.approx(
        [math.hypot(0.075, 0.335), 0.365, math.hypot(0.405, 0.09), 0.08], abs=1e-6
    )


def test_full_speed_far_away_none_near_half_between() -> None:
    flange = arm_at(BENT).position
    radius = ArmShape().radius

    def ahead(distance: float) -> float:
        return share([(flange[0] + radius + distance, 0.0, flange[2])])

    assert ahead(0.6) == 1.0
    assert ahead(0.12) == pytest.approx(0.0, abs=1e-9)
    assert ahead(0.0) == 0.0
    assert ahead(0.31) == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("link", [0, 1, 2, 3])
def test_every_link_is_watched(link: int) -> None:
    chain = ArmShape().chain(arm_at(BENT))
    middle = (chain[link] + chain[link + 1]) / 2
    assert share([middle + np.array([0.0, 0.15, 0.0])]) == 0.0


@settings(deadline=None, max_examples=80)
@given(st.lists(POINT, min_size=1, max_size=6), POINT)
def test_one_more_point_never_makes_it_faster(points: list[object], more: object) -> None:
    assert share([*points, more]) <= share(points) + 1e-12


@settings(deadline=None, max_examples=80)
@given(POINT, st.floats(0.0, 1.0))
def test_nearer_to_the_flange_is_never_faster(point: tuple[float, float, float], step: float) -> None:
    arm = ArmState(BENT, (0.0, 0.0, 2.0), (0.0, 0.0, 0.0), True, False, True)
    flange = np.array(arm.position)
    high = flange + np.abs(np.array(point))  # above all links: the flange is nearest
    nearer = flange + (high - flange) * step
    assert share([nearer], arm=arm) <= share([high], arm=arm) + 1e-9


@settings(deadline=None, max_examples=80)
@given(st.lists(POINT, max_size=5), POINT, st.floats(0.0, 0.099), st.floats(0.0, math.tau))
def test_what_belongs_to_the_target_does_not_count(
    points: list[object], target: tuple[float, float, float], away: float, turn: float
) -> None:
    beside = (target[0] + away * math.cos(turn), target[1] + away * math.sin(turn), target[2])
    others: Points = np.array(points, dtype=np.float64).reshape(-1, 3)
    assert share(np.vstack([others, [beside]]), target) == share(others, target)


def test_beside_the_target_counts() -> None:
    x, y, z = arm_at(BENT).position
    assert share([(x, y + 0.15, z)], (x, y, z)) == 0.0


@settings(deadline=None, max_examples=40)
@given(st.lists(POINT, min_size=1, max_size=5), st.sampled_from([math.nan, math.inf, -math.inf]))
def test_a_point_that_is_none_slows_and_hides_no_other(points: list[object], bad: float) -> None:
    value = share([*points, (bad, 0.0, 0.0)])
    assert value == min(share(points), SETTINGS.blind_share)


@pytest.mark.parametrize("age", [0.51, 100.0, -0.1, math.nan])
def test_without_recent_obstacles_it_is_slow(age: float) -> None:
    arm = arm_at(BENT)
    far: Points = np.array([[5.0, 5.0, 5.0]])
    assert speed_share(None, arm, None, 1.0) == SETTINGS.blind_share
    assert speed_share(Timed(far, at=1.0 - age), arm, None, 1.0) == SETTINGS.blind_share
    assert speed_share(Timed(far, at=0.6), arm, None, 1.0) == 1.0
    assert speed_share(Timed(np.empty((0, 3)), at=0.9), arm, None, 1.0) == 1.0


def test_an_arm_of_unknown_place_stands() -> None:
    lost = ArmState((math.nan,) * 6, (math.nan,) * 3, (math.nan,) * 3, True, False, True)
    assert share([(1.0, 1.0, 1.0)], arm=lost) == 0.0


@settings(deadline=None, max_examples=60)
@given(POINT)
def test_what_stands_on_the_floor_counts_at_any_height(point: tuple[float, float, float]) -> None:
    assert share([point[:2]]) <= share([point]) + 1e-12


def test_slopes_that_do_not_fall_are_refused() -> None:
    with pytest.raises(ValueError, match="below slow_from"):
        ArmGuardSettings(slow_from=0.1, stop_at=0.2)


def test_points_of_the_robot_in_the_arms_frame() -> None:
    points = to_arm_frame(np.array([[1.0, 0.5, 0.7]]), forward=0.2, left=-0.1, up=0.3)
    assert points.tolist() == [[0.8, 0.6, pytest.approx(0.4)]]
