"""What a head does that can only pan: like every head, but the tilt is what it is."""

from __future__ import annotations

import math

import pytest

from robot.faults import TABLE
from robot.hal.interfaces import PanTilt
from robot.messages import HeadPose

TICK_S = 0.04


def look(rig, pan: float, seconds: float) -> HeadPose:  # type: ignore[no-untyped-def]
    for _ in range(round(seconds / TICK_S)):
        rig.device.read(rig.now)
        asked = rig.device.send(HeadPose(pan, 0.0), rig.now)
        rig.wait(TICK_S)
    return asked


def test_it_is_a_head_that_stands_straight_ahead(pan) -> None:  # type: ignore[no-untyped-def]
    assert isinstance(pan.device, PanTilt)
    assert pan.device.read(pan.now).pan == 0.0
    assert pan.device.faults(pan.now) == ()


@pytest.mark.parametrize("goal", [0.6, -0.6, 1.2])
def test_it_goes_where_it_says_it_goes_and_stays(pan, goal: float) -> None:  # type: ignore[no-untyped-def]
    asked = look(pan, goal, 2.4)
    assert asked.pan == goal
    for _ in range(10):
        assert pan.device.read(pan.now).pan == pytest.approx(goal, abs=0.03)
        look(pan, goal, 0.12)


def test_the_tilt_is_fixed_and_told(pan) -> None:  # type: ignore[no-untyped-def]
    tilt = pan.device.read(pan.now).tilt
    for asked_tilt in (-0.3, 0.5, math.nan):
        assert pan.device.send(HeadPose(0.1, asked_tilt), pan.now).tilt == tilt


def test_limits_and_what_is_no_number(pan) -> None:  # type: ignore[no-untyped-def]
    assert pan.device.send(HeadPose(pan=-9.0), pan.now).pan == pytest.approx(-math.radians(80))
    assert pan.device.send(HeadPose(pan=math.inf), pan.now).pan == pytest.approx(math.radians(80))
    assert pan.device.send(HeadPose(pan=math.nan), pan.now).pan == 0.0


def test_it_takes_time_to_turn(pan) -> None:  # type: ignore[no-untyped-def]
    look(pan, 1.2, 0.2)
    assert 0.0 <= pan.device.read(pan.now).pan < 0.6


def test_a_broken_one_stays_is_told_and_comes_back(pan) -> None:  # type: ignore[no-untyped-def]
    look(pan, 0.3, 2.0)
    before = pan.device.read(pan.now)
    pan.break_down()
    assert look(pan, -0.5, TABLE["head.link"].detection_s).pan == pytest.approx(0.3)
    assert [fault.key for fault in pan.device.faults(pan.now)] == ["head.link"]
    assert pan.device.read(pan.now) == before
    pan.mend()
    look(pan, -0.5, 3.5)
    assert pan.device.read(pan.now).pan == pytest.approx(-0.5, abs=0.03)
    assert pan.device.faults(pan.now) == ()


def test_a_head_nobody_sends_stands_after_its_pulse(pan) -> None:  # type: ignore[no-untyped-def]
    look(pan, 1.39, 0.2)
    pan.wait(0.9)
    still = pan.motor.angle
    pan.wait(0.5)
    assert pan.motor.angle == pytest.approx(still, abs=0.01)
    assert math.degrees(still) / 3 < 70


def test_closed_it_is_held_and_quiet(pan) -> None:  # type: ignore[no-untyped-def]
    look(pan, 1.0, 0.4)
    pan.device.close()
    pan.device.close()
    pan.wait(0.3)
    before, still = pan.device.read(pan.now), pan.motor.angle
    look(pan, 0.0, 0.6)
    assert pan.device.read(pan.now) == before
    assert pan.motor.angle == pytest.approx(still, abs=0.01)
