"""What every camera, head, lamp, arm and teleop link does, whatever stands behind it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.faults import TABLE
from robot.hal.interfaces import Arm, LampDevice, PanTilt, StereoCamera, TeleopLink
from robot.messages import HeadPose


def assert_told(rig) -> None:  # type: ignore[no-untyped-def]
    """The device says that it is broken, in words the fault table knows."""
    faults = rig.device.faults(rig.now)
    assert faults
    assert {fault.key for fault in faults} <= TABLE.keys()
    assert all(0.0 <= fault.since <= rig.now for fault in faults)


def wait_a_tick(rig) -> None:  # type: ignore[no-untyped-def]
    rig.wait(0.04)


# --------------------------------------------------------------------------------------------- camera


def frames(rig, ticks):  # type: ignore[no-untyped-def]
    seen = []
    for _ in range(ticks):
        seen.append(rig.device.latest(rig.now))
        wait_a_tick(rig)
    return seen


def test_camera_gives_pairs_of_equal_colour_pictures(camera) -> None:  # type: ignore[no-untyped-def]
    assert isinstance(camera.device, StereoCamera)
    frame = frames(camera, 5)[-1]
    assert frame is not None
    assert frame.left.shape == frame.right.shape
    assert frame.left.shape[2] == 3
    assert frame.left.dtype == frame.right.dtype == np.uint8
    assert camera.device.faults(camera.now) == ()


def test_camera_frames_are_of_the_past_and_never_go_back(camera) -> None:  # type: ignore[no-untyped-def]
    start = camera.now
    seen = [frame for frame in frames(camera, 10) if frame is not None]
    times = [frame.captured_at for frame in seen]
    numbers = [frame.seq for frame in seen]
    assert times == sorted(times)
    assert numbers == sorted(numbers)
    assert len(set(numbers)) > 2
    assert max(times) <= start + 10 * 0.04


def test_camera_asked_twice_gives_the_same_frame(camera) -> None:  # type: ignore[no-untyped-def]
    frames(camera, 3)
    assert camera.device.latest(camera.now) is camera.device.latest(camera.now)


def test_broken_camera_keeps_its_last_frame(breakable_camera) -> None:  # type: ignore[no-untyped-def]
    rig = breakable_camera
    frames(rig, 1)
    rig.break_down()
    last = rig.device.latest(rig.now)  # a camera with a thread of its own may have shown one more
    assert last is not None
    again = frames(rig, 2)[-1]
    assert again is last
    assert_told(rig)
    rig.mend()
    assert frames(rig, 4)[-1].seq > last.seq
    assert rig.device.faults(rig.now) == ()


def test_closed_camera_is_quiet(camera) -> None:  # type: ignore[no-untyped-def]
    last = frames(camera, 2)[-1]
    camera.device.close()
    camera.device.close()
    assert frames(camera, 2)[-1] is last


# ----------------------------------------------------------------------------------------------- head


def look(rig, pose, seconds):  # type: ignore[no-untyped-def]
    for _ in range(round(seconds / 0.04)):
        asked = rig.device.send(pose, rig.now)
        wait_a_tick(rig)
    return asked


def test_head_goes_where_it_says_it_goes(head) -> None:  # type: ignore[no-untyped-def]
    assert isinstance(head.device, PanTilt)
    asked = look(head, HeadPose(pan=0.5, tilt=0.3), 1.0)
    at = head.device.read(head.now)
    assert (at.pan, at.tilt) == pytest.approx((asked.pan, asked.tilt), abs=0.03)


def test_head_keeps_its_limits_and_signs(live_head) -> None:  # type: ignore[no-untyped-def]
    asked = live_head.device.send(HeadPose(pan=-9.0, tilt=9.0), live_head.now)
    assert -math.pi <= asked.pan < -0.5
    assert 0.2 < asked.tilt <= math.pi / 2
    assert live_head.device.send(HeadPose(0.4, 0.2), live_head.now) == HeadPose(0.4, 0.2)


def test_head_takes_time_to_turn(live_head) -> None:  # type: ignore[no-untyped-def]
    look(live_head, HeadPose(), 0.4)
    look(live_head, HeadPose(pan=1.0), 0.08)
    assert 0.0 <= live_head.device.read(live_head.now).pan < 0.9


def test_head_survives_what_is_no_number(head) -> None:  # type: ignore[no-untyped-def]
    asked = look(head, HeadPose(math.nan, math.inf), 0.4)
    at = head.device.read(head.now)
    assert all(math.isfinite(value) for value in (asked.pan, asked.tilt, at.pan, at.tilt))


def test_broken_head_stays_and_is_told(breakable_head) -> None:  # type: ignore[no-untyped-def]
    rig = breakable_head
    look(rig, HeadPose(pan=0.3), 1.0)
    before = rig.device.read(rig.now)
    rig.break_down()
    assert look(rig, HeadPose(pan=-0.5), 0.4).pan == pytest.approx(0.3)
    assert rig.device.read(rig.now) == before
    assert_told(rig)
    rig.mend()
    look(rig, HeadPose(pan=-0.5), 1.0)
    assert rig.device.read(rig.now).pan == pytest.approx(-0.5, abs=0.03)
    assert rig.device.faults(rig.now) == ()


def test_closed_head_is_quiet(head) -> None:  # type: ignore[no-untyped-def]
    head.device.close()
    head.device.close()
    before = head.device.read(head.now)
    look(head, HeadPose(pan=0.7), 0.4)
    assert head.device.read(head.now) == before


# ----------------------------------------------------------------------------------------------- lamp


def test_lamp_level_is_within_0_and_1(lamp) -> None:  # type: ignore[no-untyped-def]
    assert isinstance(lamp.device, LampDevice)
    for level in (-1.0, 0.0, 0.5, 1.0, 7.0, math.inf, math.nan):
        assert 0.0 <= lamp.device.send(level, lamp.now) <= 1.0
    assert lamp.device.send(0.0, lamp.now) == 0.0
    assert lamp.device.faults(lamp.now) == ()


def test_lamp_gives_what_is_asked(live_lamp) -> None:  # type: ignore[no-untyped-def]
    assert live_lamp.device.send(1.0, live_lamp.now) == 1.0
    assert live_lamp.device.send(0.0, live_lamp.now) == 0.0


def test_broken_lamp_stays_as_it_is(breakable_lamp) -> None:  # type: ignore[no-untyped-def]
    rig = breakable_lamp
    rig.device.send(1.0, rig.now)
    rig.break_down()
    assert rig.device.send(0.0, rig.now) == 1.0
    assert_told(rig)
    rig.mend()
    assert rig.device.send(0.0, rig.now) == 0.0
    assert rig.device.faults(rig.now) == ()


def test_closed_lamp_is_off(lamp) -> None:  # type: ignore[no-untyped-def]
    lamp.device.send(1.0, lamp.now)
    lamp.device.close()
    lamp.device.close()
    assert lamp.device.send(1.0, lamp.now) == 0.0


# ------------------------------------------------------------------------------------------------ arm

READY = (0.1, -0.2, 0.3, 0.0, 0.4, 0.0)


def settle(rig):  # type: ignore[no-untyped-def]
    for _ in range(100):
        state = rig.device.read(rig.now)
        if state.in_position:
            return state
        wait_a_tick(rig)
    raise AssertionError("the arm did not arrive within 4 s")


def test_arm_moves_only_when_enabled(arm) -> None:  # type: ignore[no-untyped-def]
    assert isinstance(arm.device, Arm)
    before = arm.device.read(arm.now).joints
    assert arm.device.move_joints(READY, 1.0, arm.now) == 0
    wait_a_tick(arm)
    assert arm.device.read(arm.now).joints == before
    arm.device.enable(arm.now)
    assert arm.device.read(arm.now).enabled
    assert arm.device.move_joints(READY, 1.0, arm.now) > 0
    wait_a_tick(arm)
    assert arm.device.read(arm.now).moving
    assert settle(arm).joints == pytest.approx(READY, abs=1e-3)


def test_arm_moves_in_a_straight_line(arm) -> None:  # type: ignore[no-untyped-def]
    arm.device.enable(arm.now)
    start = np.array(arm.device.read(arm.now).position)
    goal = start + np.array((0.05, 0.1, -0.05))
    first = arm.device.move_linear(tuple(goal), (0.0, 0.0, 0.5), 0.5, arm.now)
    between = []
    for _ in range(10):
        wait_a_tick(arm)
        between.append(np.array(arm.device.read(arm.now).position))
    for point in between:
        share = float(np.dot(point - start, goal - start) / np.dot(goal - start, goal - start))
        assert np.linalg.norm(point - start - share * (goal - start)) < 1e-3
    assert settle(arm).position == pytest.approx(tuple(goal), abs=1e-3)
    assert arm.device.move_joints(READY, 1.0, arm.now) > first


def test_arm_stops_at_once(arm) -> None:  # type: ignore[no-untyped-def]
    arm.device.enable(arm.now)
    arm.device.move_joints(READY, 0.1, arm.now)
    wait_a_tick(arm)
    arm.device.stop(arm.now)
    wait_a_tick(arm)
    at = arm.device.read(arm.now)
    arm.wait(0.5)
    later = arm.device.read(arm.now)
    assert later.joints == pytest.approx(at.joints, abs=1e-3)
    assert not later.moving
    assert not later.in_position


def test_arm_slows_down_and_goes_on(arm) -> None:  # type: ignore[no-untyped-def]
    arm.device.enable(arm.now)
    arm.device.move_joints(READY, 0.2, arm.now)
    wait_a_tick(arm)
    arm.device.limit_speed(0.0, arm.now)
    wait_a_tick(arm)
    held = arm.device.read(arm.now).joints
    for _ in range(10):
        wait_a_tick(arm)
        arm.device.read(arm.now)
    assert arm.device.read(arm.now).joints == pytest.approx(held, abs=0.02)
    arm.device.limit_speed(1.0, arm.now)
    assert settle(arm).joints == pytest.approx(READY, abs=1e-3)


def test_broken_arm_takes_no_command(breakable_arm) -> None:  # type: ignore[no-untyped-def]
    rig = breakable_arm
    rig.device.enable(rig.now)
    rig.break_down()
    assert rig.device.move_joints(READY, 1.0, rig.now) == 0
    assert rig.device.move_linear((0.3, 0.0, 0.3), (0.0, 0.0, 0.0), 1.0, rig.now) == 0
    rig.device.grip(True, rig.now)
    rig.device.stop(rig.now)
    rig.device.read(rig.now)
    assert_told(rig)
    rig.mend()
    assert rig.device.move_joints(READY, 1.0, rig.now) > 0
    assert rig.device.faults(rig.now) == ()


def test_closed_arm_stands_disabled(arm) -> None:  # type: ignore[no-untyped-def]
    arm.device.enable(arm.now)
    arm.device.move_joints(READY, 0.1, arm.now)
    arm.device.close()
    arm.device.close()
    state = arm.device.read(arm.now)
    assert not state.enabled
    assert not state.moving
    assert arm.device.move_joints(READY, 0.1, arm.now) == 0


# --------------------------------------------------------------------------------------------- teleop


def test_teleop_words_are_of_the_past_and_the_newest(teleop) -> None:  # type: ignore[no-untyped-def]
    assert isinstance(teleop.device, TeleopLink)
    heard = []
    for _ in range(30):
        word = teleop.device.latest(teleop.now)
        if word is not None:
            assert word.at <= teleop.now
            assert -1.0 <= word.v <= 1.0
            heard.append(word.at)
        wait_a_tick(teleop)
    assert heard == sorted(heard)
    teleop.device.tell("state: idle", teleop.now)
    assert teleop.device.faults(teleop.now) == ()


def test_broken_teleop_keeps_its_last_word(breakable_teleop) -> None:  # type: ignore[no-untyped-def]
    rig = breakable_teleop
    rig.wait(0.1)
    last = rig.device.latest(rig.now)
    rig.break_down()
    rig.wait(0.5)
    assert rig.device.latest(rig.now) == last
    rig.device.tell("anyone there?", rig.now)
    assert_told(rig)
    rig.mend()
    assert rig.device.latest(rig.now).at > last.at
    assert rig.device.faults(rig.now) == ()


def test_closed_teleop_is_quiet(teleop) -> None:  # type: ignore[no-untyped-def]
    last = teleop.device.latest(teleop.now)
    teleop.device.close()
    teleop.device.close()
    teleop.wait(1.0)
    assert teleop.device.latest(teleop.now) == last
    teleop.device.tell("bye", teleop.now)
