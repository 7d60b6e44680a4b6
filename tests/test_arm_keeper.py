"""The arm stands when the robot must stand, and slows down for what comes near and is not the target."""

from __future__ import annotations

import numpy as np
import pytest

from robot.arm_guard import ArmGuardSettings
from robot.arm_keeper import ArmKeeper
from robot.hal.mock import MockArm
from robot.messages import FreeSpace, HeadPose, Odometry, Percepts, Range, Situation, Timed

NONE = np.zeros(0)


def situation(now: float, *obstacles: tuple[float, float], target: tuple[float, float] | None = None):  # type: ignore[no-untyped-def]
    points = np.array(obstacles, dtype=float).reshape(-1, 2)
    seen = None if target is None else Timed(Range(1.0, 0.01, (*target, 0.3), 10.0), now)
    percepts = Percepts(free_space=Timed(FreeSpace(NONE, NONE, NONE, points), now), target=seen)
    return Situation(now, percepts, Odometry(), HeadPose())


def moving_arm() -> MockArm:
    arm = MockArm()
    arm.enable(0.0)
    assert arm.move_joints((1.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.5, 0.0)
    return arm


def told(arm: MockArm, method: str) -> list[object]:
    return [call.args for call in arm.calls if call.method == method]


def test_nothing_near_leaves_the_arm_its_speed() -> None:
    arm = moving_arm()
    ArmKeeper(arm, ArmGuardSettings()).act(situation(0.04), stop=False)
    assert told(arm, "limit_speed") == [(1.0,)]
    assert not told(arm, "stop")


def test_what_comes_near_slows_it_and_the_target_does_not() -> None:
    arm = moving_arm()
    keeper = ArmKeeper(arm, ArmGuardSettings(), forward=0.1)
    keeper.act(situation(0.04, (0.9, 0.0)), stop=False)
    slow = keeper.share
    assert 0.0 < slow < 1.0
    keeper.act(situation(0.08, (0.9, 0.0), target=(0.9, 0.0)), stop=False)
    assert keeper.share == 1.0


def test_a_stop_is_told_at_once_and_again_while_it_moves() -> None:
    arm = moving_arm()
    arm.fail("stop", "link")
    keeper = ArmKeeper(arm, ArmGuardSettings())
    keeper.act(situation(0.04), stop=True)
    keeper.act(situation(0.08), stop=True)
    assert len(told(arm, "stop")) == 2, "it still moves"
    arm.mend()
    keeper.act(situation(0.12), stop=True)
    keeper.act(situation(0.16), stop=True)
    assert len(told(arm, "stop")) == 3, "it stands: nothing more to say"


def test_an_order_given_during_a_stop_moves_nothing() -> None:
    arm = moving_arm()
    keeper = ArmKeeper(arm, ArmGuardSettings())
    for tick in range(1, 26):
        keeper.act(situation(0.04 * tick), stop=True)
        arm.move_joints((1.0, 0.0, 0.0, 0.0, 0.0, 0.0), 1.0, 0.04 * tick)
    assert arm.read(1.1).joints[0] < 0.1
    keeper.act(situation(1.2), stop=False)
    assert keeper.share == 1.0


def test_a_stop_is_told_to_an_arm_that_stands_too() -> None:
    """Its state may be old: the first stop never waits for it."""
    arm = MockArm()
    ArmKeeper(arm, ArmGuardSettings()).act(situation(0.04), stop=True)
    assert len(told(arm, "stop")) == 1


def test_without_eyes_it_creeps() -> None:
    arm = moving_arm()
    keeper = ArmKeeper(arm, ArmGuardSettings(blind_share=0.1))
    keeper.act(Situation(0.04, Percepts(), Odometry(), HeadPose()), stop=False)
    assert keeper.share == pytest.approx(0.1)
