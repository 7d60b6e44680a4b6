"""Polling periods follow what exchanges were measured to take."""

from __future__ import annotations

import pytest

from robot.hal.nxt.pace import ExchangeTimes, PaceSettings, RateMeter
from robot.hal.nxt.settings import BLUETOOTH, BLUETOOTH_NEAR, BLUETOOTH_PAN, USB


@pytest.mark.parametrize("median_s", [0.0005, 0.003, 0.006])
def test_usb_polls_at_twenty_to_fifty_a_second(median_s: float) -> None:
    assert 20 <= 1 / USB.pace.period(median_s, USB.motors_per_read) <= 50


@pytest.mark.parametrize("median_s", [None, 0.03, 0.06, 0.08])
def test_bluetooth_polls_at_five_to_eight_a_second(median_s: float | None) -> None:
    assert 5 <= 1 / BLUETOOTH.pace.period(median_s, BLUETOOTH.motors_per_read) <= 8


@pytest.mark.parametrize("other", [BLUETOOTH_NEAR, BLUETOOTH_PAN])
def test_base_and_one_other_leave_bluetooth_some_air(other) -> None:  # type: ignore[no-untyped-def]
    for median_s in (0.02, 0.04, 0.06):
        duty = median_s / BLUETOOTH.pace.period(median_s) + median_s / other.pace.period(median_s)
        assert duty <= 0.61


def test_one_slow_exchange_changes_nothing() -> None:
    times = ExchangeTimes()
    for seconds in [0.003] * 9 + [0.5]:
        times.took(seconds)
    assert times.median_s == 0.003


def test_a_link_that_became_slow_is_noticed() -> None:
    times = ExchangeTimes()
    for seconds in [0.003] * 100 + [0.06] * 16:
        times.took(seconds)
    assert times.median_s == 0.06


def test_two_motors_take_twice_as_long() -> None:
    pace = PaceSettings(share=0.5, shortest_s=0.01, longest_s=1.0)
    assert pace.period(0.02, 2) == pytest.approx(2 * pace.period(0.02, 1))


def test_the_rate_is_of_the_last_three_seconds_only() -> None:
    meter = RateMeter()
    assert meter.rate_hz(0.0) is None
    for index in range(10):
        meter.happened(index * 0.1)
    assert meter.rate_hz(1.0) == pytest.approx(10.0)
    assert meter.rate_hz(10.0) is None
