"""The chart: where each event leads, and that every state can be left to halted and teleop."""

from pathlib import Path

import pytest
from statemachine.exceptions import TransitionNotAllowed

from robot.chart import AUTONOMOUS, LEAVES, RobotChart, mermaid

WAY_TO = {
    "idle": [],
    "search": ["armed"],
    "recognize": ["armed", "candidate_seen"],
    "range": ["armed", "candidate_seen", "target_confirmed"],
    "track": ["armed", "candidate_seen", "target_confirmed", "target_ranged"],
    "avoid": ["armed", "candidate_seen", "target_confirmed", "target_ranged", "way_blocked"],
    "teleop": ["teleop_taken"],
    "halted": ["fault_halted"],
}


def chart_in(state):
    chart = RobotChart()
    for event in WAY_TO[state]:
        chart.send(event)
    assert chart.leaf == state
    return chart


def test_the_ways_cover_every_state():
    assert set(WAY_TO) == set(LEAVES)


@pytest.mark.parametrize("state", LEAVES)
def test_every_state_has_exits_to_halted_and_teleop(state):
    if state != "halted":
        chart = chart_in(state)
        chart.send("fault_halted")
        assert chart.leaf == "halted"
    if state != "teleop":
        chart = chart_in(state)
        chart.send("teleop_taken")
        assert chart.leaf == "teleop"


@pytest.mark.parametrize("state", AUTONOMOUS)
def test_a_fault_is_followed_by_recognize_or_search_never_by_stale_track(state):
    chart = chart_in(state)
    chart.send("interrupted")
    assert chart.leaf in ("recognize", "search")


def test_after_teleop_autonomy_reenters_by_recognize():
    chart = chart_in("track")
    chart.send("teleop_taken")
    chart.send("teleop_resumed")
    assert chart.leaf == "recognize"


@pytest.mark.parametrize("state", AUTONOMOUS)
def test_autonomy_can_be_ended_from_every_state(state):
    for event in ("disarmed", "given_up"):
        chart = chart_in(state)
        chart.send(event)
        assert chart.leaf == "idle"


def test_the_whole_cycle():
    chart = chart_in("track")
    for event, state in [
        ("way_blocked", "avoid"),
        ("way_free", "track"),
        ("target_lost", "search"),
        ("candidate_seen", "recognize"),
        ("candidate_rejected", "search"),
    ]:
        chart.send(event)
        assert chart.leaf == state


def test_an_event_that_does_not_fit_is_an_error_not_silence():
    with pytest.raises(TransitionNotAllowed):
        chart_in("idle").send("target_ranged")
    with pytest.raises(Exception, match="no_such_event"):
        chart_in("idle").send("no_such_event")


def test_nothing_leads_from_halted_to_motion_without_a_person():
    chart = chart_in("halted")
    for event in ("armed", "candidate_seen", "teleop_resumed", "way_free"):
        with pytest.raises(TransitionNotAllowed):
            chart.send(event)


def test_architecture_shows_the_chart_as_it_is():
    page = (Path(__file__).parents[1] / "ARCHITECTURE.md").read_text(encoding="utf-8")
    assert f"```mermaid\n{mermaid()}```" in page, "run `robot chart` and put its print into ARCHITECTURE.md"
