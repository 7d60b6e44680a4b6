"""What every drive base does, whatever stands behind it."""

from __future__ import annotations

import math

import pytest
from rig import drive, watch

from robot.faults import TABLE
from robot.hal.interfaces import DriveBase
from robot.messages import Twist

# From standing the wheels need a moment, and the motors of one base differ by a few percent.
LAG_S = 0.35


def test_it_is_a_drive_base_at_the_origin(base) -> None:  # type: ignore[no-untyped-def]
    assert isinstance(base.device, DriveBase)
    odometry = base.device.read(base.now)
    assert (odometry.pose.x, odometry.pose.y, odometry.pose.yaw) == (0.0, 0.0, 0.0)
    assert odometry.twist.is_zero
    assert base.device.faults(base.now) == ()


def test_battery_is_volts_or_unknown(base) -> None:  # type: ignore[no-untyped-def]
    volts = base.device.battery_volts()
    assert volts is None or 5.0 < volts < 13.0


@pytest.mark.parametrize("speed", [0.2, -0.2])
def test_positive_speed_is_forward(live_base, speed) -> None:  # type: ignore[no-untyped-def]
    pose = drive(live_base, Twist(v=speed), 2.0).pose
    sign = math.copysign(1.0, speed)
    assert 0.2 * (2.0 - LAG_S) < sign * pose.x < 0.2 * 2.0 * 1.05
    assert abs(pose.y) < 0.03
    assert abs(pose.yaw) < 0.1


@pytest.mark.parametrize("rate", [0.8, -0.8])
def test_positive_turn_is_left(live_base, rate) -> None:  # type: ignore[no-untyped-def]
    pose = drive(live_base, Twist(w=rate), 2.0).pose
    sign = math.copysign(1.0, rate)
    assert 0.8 * (2.0 - LAG_S) * 0.95 < sign * pose.yaw < 0.8 * 2.0 * 1.1
    assert math.hypot(pose.x, pose.y) < 0.03


def test_a_curve_to_the_left_ends_on_the_left(live_base) -> None:  # type: ignore[no-untyped-def]
    pose = drive(live_base, Twist(v=0.15, w=0.4), 2.0).pose
    assert pose.x > 0.15
    assert pose.y > 0.03


def test_the_speed_returned_is_the_speed_driven(live_base) -> None:  # type: ignore[no-untyped-def]
    before = drive(live_base, Twist(v=5.0, w=5.0), 1.4)
    asked = live_base.device.send(Twist(v=5.0, w=5.0), live_base.now)
    after = drive(live_base, Twist(v=5.0, w=5.0), 1.6)
    seconds = after.at - before.at
    turned = math.remainder(after.pose.yaw - before.pose.yaw, math.tau)
    assert turned / seconds == pytest.approx(asked.w, rel=0.08)


def test_limits_keep_the_curve(base) -> None:  # type: ignore[no-untyped-def]
    sent = base.device.send(Twist(v=10.0, w=-4.0), base.now)
    assert abs(sent.v) <= 0.25 + 1e-9
    assert abs(sent.w) <= math.radians(70.0) + 1e-9
    assert sent.v * -4.0 == pytest.approx(sent.w * 10.0)
    small = Twist(v=0.05, w=0.1)
    base.wait(0.5)
    base.device.read(base.now)
    assert base.device.send(small, base.now) in (small, Twist())


@pytest.mark.parametrize("twist", [Twist(math.nan, 0.0), Twist(0.1, math.inf), Twist(-math.inf, math.nan)])
def test_what_is_no_number_is_a_stop(base, twist) -> None:  # type: ignore[no-untyped-def]
    drive(base, Twist(v=0.1), 0.4)
    assert base.device.send(twist, base.now) == Twist()
    assert watch(base, 0.8).twist.v == pytest.approx(0.0, abs=0.01)


def test_a_pulse_expires_when_the_host_is_dead(live_base) -> None:  # type: ignore[no-untyped-def]
    before = drive(live_base, Twist(v=0.2), 2.0).pose
    live_base.wait(0.7)  # 0.3 s of pulse, then it coasts
    # Over Bluetooth the wheels are read in turn: a moment until both are known.
    standing = watch(live_base, 0.36).pose
    later = watch(live_base, 0.6)
    assert standing.x - before.x < 0.2 * 0.3 + 0.06
    assert later.pose.x == pytest.approx(standing.x, abs=0.004)
    assert later.twist.v == pytest.approx(0.0, abs=0.005)


def test_a_pulse_expires_while_the_host_only_reads(live_base) -> None:  # type: ignore[no-untyped-def]
    before = drive(live_base, Twist(v=0.2), 2.0).pose
    standing = watch(live_base, 0.8)
    later = watch(live_base, 0.6)
    assert standing.pose.x - before.x < 0.2 * 0.3 + 0.06
    assert later.pose.x == pytest.approx(standing.pose.x, abs=0.004)


@pytest.mark.parametrize("how", ["stop", "zero"])
def test_stop_wins_at_once(live_base, how) -> None:  # type: ignore[no-untyped-def]
    before = drive(live_base, Twist(v=0.25), 2.0)
    unread = 0.25 * (live_base.now - before.at)
    if how == "stop":
        live_base.device.stop(live_base.now)
    else:
        assert live_base.device.send(Twist(), live_base.now) == Twist()
    pose = watch(live_base, 0.6).pose
    assert pose.x - before.pose.x < 0.035 + unread
    assert watch(live_base, 0.4).pose.x == pytest.approx(pose.x, abs=0.004)


def test_it_drives_again_after_a_stop_and_the_other_way(live_base) -> None:  # type: ignore[no-untyped-def]
    drive(live_base, Twist(v=0.2), 1.0)
    live_base.device.stop(live_base.now)
    turned = watch(live_base, 0.8).pose
    back = drive(live_base, Twist(v=-0.2), 1.6).pose
    assert back.x < turned.x - 0.2
    assert live_base.device.faults(live_base.now) == ()


def test_closing_stops_for_good_and_may_be_repeated(base) -> None:  # type: ignore[no-untyped-def]
    drive(base, Twist(v=0.2), 0.8)
    base.device.close()
    base.wait(0.4)
    still = [motor.angle for motor in getattr(base, "motors", ())]
    base.device.close()
    for _ in range(5):
        assert base.device.send(Twist(v=0.2), base.now) == Twist()
        base.device.stop(base.now)
        base.device.read(base.now)
        base.device.faults(base.now)
        base.wait(0.04)
    assert [motor.angle for motor in getattr(base, "motors", ())] == pytest.approx(still, abs=0.01)


def test_a_broken_base_is_told_and_raises_nothing(breakable_base) -> None:  # type: ignore[no-untyped-def]
    before = drive(breakable_base, Twist(v=0.2), 1.0)
    breakable_base.break_down()
    broken_at = breakable_base.now
    while not breakable_base.device.faults(breakable_base.now):
        breakable_base.device.read(breakable_base.now)
        breakable_base.device.send(Twist(v=0.2), breakable_base.now)
        breakable_base.wait(0.04)
        assert breakable_base.now < broken_at + TABLE["base.link"].detection_s
    assert {fault.key for fault in breakable_base.device.faults(breakable_base.now)} <= TABLE.keys()
    assert breakable_base.device.send(Twist(v=0.2), breakable_base.now) == Twist()
    breakable_base.device.stop(breakable_base.now)
    assert breakable_base.device.read(breakable_base.now).pose.x <= before.pose.x + 0.02
    assert breakable_base.device.faults(breakable_base.now)[0].since <= breakable_base.now


def test_a_mended_base_drives_again_and_knows_where_it_is(breakable_base) -> None:  # type: ignore[no-untyped-def]
    before = drive(breakable_base, Twist(v=0.2), 1.0)
    breakable_base.break_down()
    drive(breakable_base, Twist(v=0.2), 1.0)
    breakable_base.mend()
    watch(breakable_base, 1.0)
    assert breakable_base.device.faults(breakable_base.now) == ()
    resumed = breakable_base.device.read(breakable_base.now)
    # The lead it ran on without a link is on the count, no more.
    assert -0.001 < resumed.pose.x - before.pose.x < 0.2 * 0.3 + 0.06
    assert drive(breakable_base, Twist(v=0.2), 1.5).pose.x > resumed.pose.x + 0.15
