"""Rates are lowered only when there is not time for all, and never what the guard needs."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.governor import StagePlan, governed_rates

PLAN = st.builds(
    lambda wanted, share, cost: StagePlan(wanted, wanted * share, cost),
    st.floats(0.5, 30),
    st.sampled_from([0.2, 0.5, 1.0]),
    st.floats(0.0, 0.2),
)


@settings(deadline=None, max_examples=200)
@given(st.dictionaries(st.sampled_from("abcde"), PLAN, min_size=1))
def test_rates_stay_between_lowest_and_wanted_and_fit_if_they_can(stages):
    rates = governed_rates(stages, 0.9)
    for name, plan in stages.items():
        assert plan.lowest_hz - 1e-6 <= rates[name] <= plan.wanted_hz + 1e-6
    if sum(plan.lowest_hz * plan.cost for plan in stages.values()) <= 0.9:
        assert sum(rates[name] * plan.cost for name, plan in stages.items()) <= 0.9 + 1e-4


def test_enough_time_changes_nothing():
    assert governed_rates({"a": StagePlan(25.0, 5.0, 0.01)}, 0.9) == {"a": 25.0}


def test_the_guards_need_is_never_lowered():
    rates = governed_rates({"floor": StagePlan(8.0, 8.0, 0.2), "find": StagePlan(5.0, 1.0, 0.2)}, 0.9)
    assert rates == {"floor": 8.0, "find": 1.0}


def test_rates_recover_when_costs_fall():
    busy = governed_rates({"find": StagePlan(5.0, 1.0, 0.4)}, 0.9)["find"]
    assert busy == pytest.approx(2.25)
    assert governed_rates({"find": StagePlan(5.0, 1.0, 0.1)}, 0.9)["find"] == 5.0
