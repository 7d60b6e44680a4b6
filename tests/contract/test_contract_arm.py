"""What every arm does besides (see test_contract_devices.py), whatever stands behind it."""

from __future__ import annotations

import math

import pytest

from robot.faults import TABLE

READY = (0.1, -0.2, 0.3, 0.0, 0.4, 0.0)
TICK_S = 0.04


def run(rig, seconds):  # type: ignore[no-untyped-def]
    state = rig.device.read(rig.now)
    for _ in range(round(seconds / TICK_S)):
        rig.wait(TICK_S)
        state = rig.device.read(rig.now)
    return state


def test_numbers_rise_and_the_last_command_counts(arm) -> None:  # type: ignore[no-untyped-def]
    arm.device.enable(arm.now)
    first = arm.device.move_joints((0.5, *READY[1:]), 0.5, arm.now)
    run(arm, 0.2)
    second = arm.device.move_joints(READY, 1.0, arm.now)
    assert second > first > 0
    state = run(arm, 3.0)
    assert state.in_position
    assert state.joints == pytest.approx(READY, abs=1e-3)


def test_half_the_limit_takes_about_twice_the_time(arm) -> None:  # type: ignore[no-untyped-def]
    arm.device.enable(arm.now)
    taken = []
    for share, goal in ((1.0, READY), (0.5, (-1.4, *READY[1:])), (1.0, READY)):
        arm.device.limit_speed(share, arm.now)
        arm.device.move_joints(goal, 0.5, arm.now)
        begun = arm.now
        while not run(arm, TICK_S).in_position:
            assert arm.now - begun < 8.0
        taken.append(arm.now - begun)
    assert 1.6 < taken[1] / taken[2] < 2.2


@pytest.mark.parametrize("share", [-1.0, 3.0])
def test_limits_beyond_0_and_1_are_clipped(arm, share) -> None:  # type: ignore[no-untyped-def]
    arm.device.enable(arm.now)
    before = arm.device.read(arm.now).joints
    arm.device.limit_speed(share, arm.now)
    arm.device.move_joints(READY, 1.0, arm.now)
    state = run(arm, 3.0)
    assert state.joints == pytest.approx(before if share < 0 else READY, abs=1e-3)


def test_a_stop_while_it_stands_is_nothing(arm) -> None:  # type: ignore[no-untyped-def]
    arm.device.enable(arm.now)
    arm.device.stop(arm.now)
    run(arm, 0.2)
    assert arm.device.move_joints(READY, 1.0, arm.now) > 0
    assert run(arm, 3.0).in_position


def test_a_broken_arm_stands_soon_and_stays_there(breakable_arm) -> None:  # type: ignore[no-untyped-def]
    """Behind a dead link the controller's own watchdog stops it."""
    rig = breakable_arm
    rig.device.enable(rig.now)
    rig.device.move_joints((1.5, *READY[1:]), 0.2, rig.now)
    run(rig, 0.4)
    rig.break_down()
    assert {fault.key for fault in rig.device.faults(rig.now)} <= TABLE.keys()
    run(rig, 0.4)
    rig.mend()
    if not hasattr(rig, "registers"):
        return  # a mock's link is never dead, only its methods
    state = run(rig, 0.2)
    later = run(rig, 0.5)
    assert not state.moving
    assert not state.in_position
    assert later.joints == state.joints
    assert math.dist(later.joints, (1.5, *READY[1:])) > 0.3
