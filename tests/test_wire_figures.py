"""Figures of real time, on times made up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.wire_figures import (
    Decision,
    capture_to_telegram,
    fault_stops,
    in_ms,
    missed_ticks,
    order_to_telegram,
    request_to_stop,
    true_moment,
    with_news,
)
from robot.wire_witness import DecisionLog, resident_bytes


@dataclass(frozen=True)
class Telegram:
    at: float
    stops: bool = False
    port: int = 1
    power: int = 50


def drive(
    at: float, track_at: float | None = None, driving: bool = True, stop: str | None = None
) -> Decision:
    return Decision(at, at + 0.005, "track", driving, track_at, None, stop)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(1, 6), min_size=1, max_size=40), st.floats(-0.015, 0.015))
def test_every_tick_left_out_is_counted_whatever_the_jitter(steps: list[int], jitter: float) -> None:
    """Steps of n periods lose n - 1 ticks; a tick early or late by less than half changes nothing."""
    begun = np.cumsum([0, *steps]) * 0.04
    begun[1::2] += jitter
    assert missed_ticks(begun.tolist()) == sum(steps) - len(steps)


def test_a_picture_counts_until_the_command_that_first_rests_on_it() -> None:
    decisions = [drive(1.00, 0.95), drive(1.04), drive(1.08, 1.02), drive(1.12)]
    telegrams = [Telegram(at, power=power) for power, at in enumerate((0.99, 1.01, 1.03, 1.09))]
    moments = [0.94, 1.021]
    figures = capture_to_telegram(decisions, telegrams, moments, lambda decision: decision.track_at)
    assert figures == pytest.approx([1.01 - 0.94, 1.09 - 1.021])
    assert order_to_telegram(decisions, telegrams) == pytest.approx([0.005, 0.005])


def test_a_command_that_came_before_the_order_is_not_its_command() -> None:
    decisions = [drive(1.0, 0.95), drive(1.04, 0.99)]
    early = [Telegram(1.004)]
    assert capture_to_telegram(decisions, early, [0.95], lambda decision: decision.track_at) == []
    late = [Telegram(1.046)]
    assert capture_to_telegram(decisions, late, [0.95], lambda decision: decision.track_at) == [], (
        "the next's"
    )


def test_a_renewal_at_the_old_power_is_no_news() -> None:
    telegrams = [
        Telegram(1.0, port=1, power=50), Telegram(1.1, port=2, power=50), Telegram(1.2, port=1, power=50),
        Telegram(1.3, port=1, power=51), Telegram(1.4, port=255, power=0, stops=True),
        Telegram(1.5, port=255, power=0, stops=True), Telegram(1.6, port=1, power=51),
    ]  # fmt: skip
    assert with_news(telegrams) == [1.0, 1.1, 1.3, 1.4, 1.5, 1.6]


def test_who_stands_commands_nothing() -> None:
    standing = [drive(1.0, 0.95, driving=False), drive(1.04)]
    assert capture_to_telegram(standing, [Telegram(1.01)], [], lambda decision: decision.track_at) == []
    assert order_to_telegram(standing, [Telegram(1.01)]) == []


@pytest.mark.parametrize(("estimate", "moment"), [(1.0, 1.01), (1.05, 1.06), (5.0, 5.0), (1.035, 1.035)])
def test_the_drivers_estimate_is_corrected_by_the_moment_next_to_it(estimate: float, moment: float) -> None:
    assert true_moment(estimate, [0.5, 1.01, 1.06, 4.0]) == moment


def test_a_request_waits_for_the_next_stop_and_no_longer_than_a_second() -> None:
    telegrams = [Telegram(1.0, True), Telegram(2.0), Telegram(2.03, True), Telegram(9.0, True)]
    assert request_to_stop([1.99, 5.0, 9.5], telegrams) == [pytest.approx(0.04), None, None]


def test_a_fault_counts_where_it_first_stopped_a_robot_that_drove() -> None:
    black = "camera.black"
    ticks = [
        drive(1.0), drive(1.04, stop=black, driving=False), drive(1.08, stop=black, driving=False),
        drive(1.12, driving=False), drive(1.16, stop=black, driving=False),
    ]  # fmt: skip
    assert fault_stops(ticks) == [1.04]


def test_figures_are_in_milliseconds_and_nothing_gives_nothing() -> None:
    assert in_ms([0.001] * 99 + [0.101]) == {"n": 100, "median": 1.0, "p99": 2.0, "worst": 101.0}
    assert in_ms([]) == {"n": 0, "median": None, "p99": None, "worst": None}


def test_the_log_gives_back_what_it_was_given_and_forgets_the_oldest() -> None:
    log = DecisionLog(size=3)
    given = [
        Decision(1.0, 1.1, "search", False, None, 0.9, None),
        Decision(2.0, 2.1, "track", True, 1.9, None, None),
        Decision(3.0, 3.1, "track", False, None, None, "camera.black"),
        Decision(4.0, 4.1, "idle", False),
    ]
    for k, decision in enumerate(given):
        log.add(decision)
        assert log.all() == given[max(0, k - 2) : k + 1]


def test_the_memory_of_this_process_is_told_in_bytes() -> None:
    assert 10e6 < resident_bytes() < 10e9
