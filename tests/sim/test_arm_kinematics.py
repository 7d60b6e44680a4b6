"""The emulated arm's geometry and motion: closed form against the chain of links, lines that are straight."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robot.sim.arm_kinematics import LIMITS, SPEEDS, Pose, forward, inverse, pose_of, within_limits
from robot.sim.arm_motion import FULL_SPEED, RAMP_S, JointWay, LineWay, Runner, UnreachableError

JOINTS = st.tuples(*(st.floats(low, high) for low, high in LIMITS))
START = tuple(math.radians(angle) for angle in (0.0, -30.0, 110.0, 0.0, -80.0, 0.0))
ANGLE = st.floats(-3.1, 3.1)


def degrees(*angles: float) -> tuple[float, ...]:
    return tuple(math.radians(angle) for angle in angles)


@pytest.mark.parametrize(
    ("joints", "position", "looks"),
    [
        (degrees(0, 0, 0, 0, 0, 0), (-0.015, 0.0, 1.185), (0, 0, 1)),
        (degrees(90, 0, 0, 0, 0, 0), (0.0, -0.015, 1.185), (0, 0, 1)),
        (degrees(0, 90, 0, 0, 0, 0), (0.925, 0.0, 0.425), (1, 0, 0)),
        (degrees(0, 0, 90, 0, 0, 0), (0.56, 0.0, 0.79), (1, 0, 0)),
        (degrees(0, 0, 90, 0, 90, 0), (0.48, 0.0, 0.71), (0, 0, -1)),
        (degrees(0, 0, 90, 90, 90, 0), (0.48, 0.08, 0.79), (0, 1, 0)),
    ],
)
def test_postures_worked_out_by_hand(joints, position, looks) -> None:  # type: ignore[no-untyped-def]
    pose = forward(joints)
    assert pose.position == pytest.approx(position, abs=1e-9)
    assert pose.rotation[:, 2] == pytest.approx(looks, abs=1e-9)


def test_the_reach_is_that_of_the_850_mm_class() -> None:
    """The wrist's centre from the first axis, stretched out: the sheet says 854 mm."""
    elbow = math.degrees(math.atan2(90, 405))
    pose = forward(degrees(0, 90, elbow, 0, 0, 0))
    wrist = pose.position - 0.08 * pose.rotation[:, 2]
    assert wrist[0] == pytest.approx(0.854, abs=0.001)


@settings(deadline=None, max_examples=150)
@given(JOINTS)
def test_the_inverse_reaches_every_pose_the_arm_can_have(joints: tuple[float, ...]) -> None:
    pose = forward(joints)
    found = inverse(pose, joints)
    assert found is not None
    assert within_limits(found)
    again = forward(found)
    assert again.position == pytest.approx(pose.position, abs=1e-7)
    assert again.rotation == pytest.approx(pose.rotation, abs=1e-6)


@settings(deadline=None, max_examples=80)
@given(JOINTS)
def test_the_inverse_takes_the_posture_nearest_to_where_it_is(joints: tuple[float, ...]) -> None:
    assume(abs(joints[4]) > 0.01)
    found = inverse(forward(joints), joints)
    assert found is not None
    assert max(abs(a - b) for a, b in zip(found, joints, strict=True)) < 1e-5


@pytest.mark.parametrize("position", [(1.0, 0.0, 0.5), (0.0, 0.0, 0.335), (0.0, 0.0, -1.0)])
def test_out_of_reach_has_no_joints(position: tuple[float, float, float]) -> None:
    assert inverse(pose_of(position, (0.0, 0.0, 0.0)), START) is None


@settings(deadline=None, max_examples=60)
@given(st.tuples(ANGLE, ANGLE, ANGLE))
def test_angles_are_rz_ry_rx(angles: tuple[float, float, float]) -> None:
    rotation = pose_of((0.0, 0.0, 0.0), angles).rotation
    expected = Rotation.from_euler("xyz", angles).as_matrix()
    assert rotation == pytest.approx(expected, abs=1e-12)
    back = Pose(np.zeros(3), rotation).angles
    assert pose_of((0.0, 0.0, 0.0), back).rotation == pytest.approx(rotation, abs=1e-9)


# ------------------------------------------------------------------------------------------------ motion


def drive(runner: Runner, share: float, dt: float = 0.01) -> list[tuple[float, ...]]:
    places = [runner.joints]
    for _ in range(5000):
        runner.advance(dt, share)
        places.append(runner.joints)
        if runner.done:
            return places
    raise AssertionError("it never arrived")


@settings(deadline=None, max_examples=40)
@given(JOINTS, JOINTS, st.sampled_from([0.1, 0.5, 1.0]))
def test_joints_arrive_together_within_their_speeds(start, goal, share) -> None:  # type: ignore[no-untyped-def]
    way = JointWay(start, goal)
    places = drive(Runner(way, start), share)
    assert places[-1] == pytest.approx(goal, abs=1e-5)
    rates = np.abs(np.diff(np.array(places), axis=0)) / 0.01
    assert (rates <= np.array(SPEEDS) * share * 1.001 + 1e-9).all()
    # The ramps take as long as they take at that speed; the rest goes at full share.
    ideal = way.duration / share + RAMP_S * share
    if way.duration > share * share * RAMP_S:
        assert (len(places) - 1) * 0.01 == pytest.approx(ideal, abs=0.08)


def test_a_line_is_straight_and_even() -> None:
    start = forward(START)
    goal = pose_of((0.3257, 0.1, 0.84), (0.0, 0.0, 0.5))
    way = LineWay(START, goal)
    places = [forward(joints) for joints in drive(Runner(way, START), 0.5)]
    direction = goal.position - start.position
    length = float(np.linalg.norm(direction))
    shares = [float((p.position - start.position) @ direction) / length**2 for p in places]
    assert shares == sorted(shares)
    for share, place in zip(shares, places, strict=True):
        assert np.linalg.norm(place.position - start.position - share * direction) < 1e-9
        assert place.angles == pytest.approx((0.0, 0.0, 0.5 * share), abs=1e-9)
    speeds = np.linalg.norm(np.diff([p.position for p in places], axis=0), axis=1) / 0.01
    assert speeds.max() <= 0.5 * FULL_SPEED * 1.001
    assert places[-1].position == pytest.approx(goal.position, abs=1e-9)


@pytest.mark.parametrize("turn", [math.pi, 3.0, -3.0])
def test_half_a_turn_on_a_line(turn: float) -> None:
    joints = degrees(0, 0, 90, 0, 60, -90)
    here = forward(joints)
    spun = here.rotation @ Rotation.from_euler("z", turn).as_matrix()
    places = drive(Runner(LineWay(joints, Pose(here.position, spun)), joints), 1.0)
    assert forward(places[-1]).rotation == pytest.approx(spun, abs=1e-6)


@pytest.mark.parametrize(
    ("position", "angles"), [((1.5, 0.0, 0.5), (0.0, 0.0, 0.0)), ((0.075, 0.0, 0.42), (0.0, 0.0, 0.0))]
)
def test_a_line_out_of_reach_or_through_the_base_is_refused(position, angles) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(UnreachableError):
        LineWay(START, pose_of(position, angles))


def test_told_to_stop_it_stands_within_100_ms_and_goes_on_from_there() -> None:
    goal = degrees(90, -30, 110, 0, -80, 0)
    runner = Runner(JointWay(START, goal), START)
    for _ in range(30):
        runner.advance(0.01, 1.0)
    assert not runner.standing
    for _ in range(10):
        runner.advance(0.01, 0.0)
    assert runner.standing
    held = runner.joints
    runner.advance(1.0, 0.0)
    assert runner.joints == held
    assert drive(runner, 1.0)[-1] == goal
