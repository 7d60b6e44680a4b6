"""What bumper and sonar do, whatever stands behind them."""

from __future__ import annotations

from robot.faults import TABLE
from robot.hal.interfaces import NearSensors

TICK_S = 0.04
ROUND_S = 1.5  # over Bluetooth one exchange in 0.2 s, five for all three sensors


def watch(rig, seconds: float = ROUND_S):  # type: ignore[no-untyped-def]
    for _ in range(round(seconds / TICK_S)):
        rig.device.read(rig.now)
        rig.wait(TICK_S)
    return rig.device.read(rig.now)


def test_it_is_a_set_of_near_sensors_that_lack_nothing(near) -> None:  # type: ignore[no-untyped-def]
    assert isinstance(near.device, NearSensors)
    value = watch(near)
    assert near.device.faults(near.now) == ()
    assert isinstance(value.bumped, bool)
    assert value.distance is None or 0.0 <= value.distance < 2.55


def test_values_are_fresh(live_near) -> None:  # type: ignore[no-untyped-def]
    for _ in range(3):
        value = watch(live_near)
        assert live_near.now - ROUND_S < value.at <= live_near.now


def test_a_reading_is_never_younger_than_now_and_never_grows_older(live_near) -> None:  # type: ignore[no-untyped-def]
    last = live_near.device.read(live_near.now).at
    for _ in range(50):
        value = live_near.device.read(live_near.now)
        assert last <= value.at <= live_near.now
        last = value.at
        live_near.wait(TICK_S)


def test_a_broken_one_is_told_keeps_its_last_value_and_comes_back(breakable_near) -> None:  # type: ignore[no-untyped-def]
    rig = breakable_near
    before = watch(rig)
    rig.break_down()
    after = watch(rig, TABLE["near.link"].detection_s)
    assert [fault.key for fault in rig.device.faults(rig.now)] == ["near.link"]
    assert after.at <= before.at + TICK_S
    assert after.bumped == before.bumped
    rig.mend()
    value = watch(rig, 3.0)
    assert rig.device.faults(rig.now) == ()
    assert value.at > before.at + 1.0


def test_closing_may_be_repeated_and_asks_nothing_more(near) -> None:  # type: ignore[no-untyped-def]
    before = watch(near)
    near.device.close()
    near.device.close()
    assert watch(near).at == before.at
    near.device.faults(near.now)
