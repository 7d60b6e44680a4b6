"""The mocks record, follow their script and fail on order."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.hal.mock import Call, MockArm, MockBase, MockCamera, MockHead, MockLamp, MockTeleop
from robot.hal.mock.camera import wall_pair
from robot.messages import Fault, HeadPose, Pose2, TeleopInput, Twist


def test_calls_are_recorded_in_order_with_their_time() -> None:
    base = MockBase()
    base.send(Twist(0.1, 0.2), 1.0)
    base.read(1.04)
    base.stop(1.08)
    assert base.calls == [
        Call(1.0, "send", (Twist(0.1, 0.2),)),
        Call(1.04, "read"),
        Call(1.08, "stop"),
    ]


def test_a_method_fails_from_the_ordered_call_until_mended() -> None:
    lamp = MockLamp()
    lamp.fail("send", kind="dead", after=2)
    assert [lamp.send(level, at) for at, level in enumerate((0.1, 0.2, 0.3, 0.4))] == [0.1, 0.2, 0.2, 0.2]
    assert lamp.faults(4.0) == (Fault("lamp", "dead", 2, "send fails on order"),)
    lamp.mend()
    assert lamp.faults(4.0) == ()
    assert lamp.send(0.5, 5.0) == 0.5


def test_only_what_is_there_can_fail() -> None:
    with pytest.raises(ValueError, match="fly"):
        MockBase().fail("fly")


def test_the_base_integrates_arcs_exactly() -> None:
    base = MockBase()
    for index in range(25):
        base.send(Twist(v=0.2, w=math.pi / 4), index * 0.08)
    pose = base.read(2.0).pose
    radius = 0.2 / (math.pi / 4)
    assert (pose.x, pose.y, pose.yaw) == pytest.approx((radius, radius, math.pi / 2))


def test_the_base_stands_after_its_pulse() -> None:
    base = MockBase(pulse_s=0.2)
    base.send(Twist(v=0.1), 0.0)
    assert base.read(0.1).twist == Twist(v=0.1)
    assert base.read(0.2).twist == Twist()
    assert base.read(9.0).pose == Pose2(pytest.approx(0.02), 0.0, 0.0)


def test_a_base_that_cannot_be_read_drives_on() -> None:
    base = MockBase()
    base.fail("read")
    base.send(Twist(v=0.1), 0.0)
    assert base.read(0.2).pose.x == 0.0
    base.mend()
    assert base.read(0.3).pose.x == pytest.approx(0.03)


def test_time_that_goes_back_moves_nothing() -> None:
    base = MockBase()
    base.send(Twist(v=0.1), 1.0)
    base.read(1.2)
    assert base.read(1.1).pose.x == pytest.approx(0.02)


def test_the_camera_plays_its_pairs_round_at_its_rate() -> None:
    pairs = [wall_pair(64, 48, disparity_px=d) for d in (2, 4, 6)]
    camera = MockCamera(pairs, rate_hz=10.0)
    seen = [camera.latest(at) for at in (0.0, 0.05, 0.1, 0.29, 0.31)]
    assert [frame.seq for frame in seen if frame] == [0, 0, 1, 2, 3]
    assert seen[-1] is not None
    assert seen[-1].left is pairs[0][0]
    assert seen[-1].captured_at == 0.3


def test_a_wall_pair_has_the_disparity_it_says() -> None:
    left, right = wall_pair(96, 64, disparity_px=8)
    assert left.shape == right.shape == (64, 96, 3)
    np.testing.assert_array_equal(left[:, 8:], right[:, :-8])
    assert left.std() > 20


def test_a_camera_without_pictures_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one pair"):
        MockCamera([])


def test_the_head_turns_at_its_rate() -> None:
    head = MockHead()
    head.send(HeadPose(pan=1.0), 0.0)
    assert head.read(0.1).pan == pytest.approx(math.radians(18.0))
    assert head.read(1.0).pan == 1.0


def test_arm_numbers_rise_and_speed_counts() -> None:
    arm = MockArm()
    arm.enable(0.0)
    assert arm.move_joints((math.pi / 2, 0, 0, 0, 0, 0), 0.5, 0.0) == 1
    assert arm.read(1.0).joints[0] == pytest.approx(math.pi / 4)
    assert arm.read(2.0).in_position
    assert arm.move_joints((0.0,), 0.5, 2.0) == 0  # six axes, not one
    assert arm.move_linear((0.4, 0.0, 0.6), (0.0, 0.0, 0.0), 1.0, 2.0) == 2
    arm.grip(True, 2.0)
    assert arm.gripped


def test_teleop_says_its_script_and_what_is_added() -> None:
    teleop = MockTeleop([TeleopInput(at=1.0, v=0.5)])
    assert teleop.latest(0.5) is None
    assert teleop.latest(2.0) == TeleopInput(at=1.0, v=0.5)
    teleop.say(TeleopInput(at=1.5, stop=True))
    assert teleop.latest(2.0) == TeleopInput(at=1.5, stop=True)
    teleop.tell("halted", 2.0)
    assert teleop.lines == ["halted"]
