"""A picture belongs to where the robot was when it was taken, not to where it is when it arrives."""

import math

import pytest

from robot.messages import HeadPose, Odometry, Pose2, Twist
from robot.pose_history import PoseHistory


def history(count=10, period=0.04):
    poses = PoseHistory()
    for index in range(count):
        at = index * period
        poses.add(Odometry(Pose2(x=0.25 * at, yaw=at), Twist(0.25, 1.0), at), HeadPose(pan=2.0 * at), at)
    return poses


def test_between_two_readings_it_is_between_them():
    poses = history()
    assert poses.base(0.1).x == pytest.approx(0.025)
    assert poses.base(0.1).yaw == pytest.approx(0.1)
    assert poses.head(0.1).pan == pytest.approx(0.2)


def test_at_a_reading_it_is_that_reading():
    poses = history()
    assert poses.base(0.36) == Pose2(x=0.09, yaw=0.36)
    assert poses.head(0.36) == HeadPose(pan=0.72)


def test_a_turn_through_the_back_is_not_unwound():
    poses = PoseHistory()
    poses.add(Odometry(Pose2(yaw=math.pi - 0.1), at=0.0), HeadPose(), 0.0)
    poses.add(Odometry(Pose2(yaw=-math.pi + 0.1), at=1.0), HeadPose(), 1.0)
    assert abs(poses.base(0.5).yaw) == pytest.approx(math.pi)


def test_a_picture_newer_than_the_wheels_is_carried_on_a_little():
    poses = history()
    assert poses.base(0.40).x == pytest.approx(0.09 + 0.25 * 0.04, abs=1e-3)
    assert poses.base(9.0) == poses.base(0.46)
    assert poses.head(9.0).pan == pytest.approx(0.72)


def test_a_picture_older_than_all_readings_gets_the_oldest_kept():
    poses = history(count=100)
    assert poses.base(0.0).x == pytest.approx(0.25 * (99 * 0.04 - 2.0), abs=0.011)


def test_readings_that_stand_still_while_time_goes_on_are_kept_once():
    poses = PoseHistory()
    for index in range(5):
        poses.add(Odometry(Pose2(x=1.0), at=0.0), HeadPose(), 0.04 * index)
    assert poses.base(0.1).x == 1.0


def test_asked_before_any_reading_it_says_so():
    with pytest.raises(ValueError, match="no reading"):
        PoseHistory().base(0.0)
