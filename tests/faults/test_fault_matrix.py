"""State x fault x device: for every row of the fault table the robot does what the table says."""

from dataclasses import replace

import pytest

from bench import fault_cases
from bench.fault_cases import Case, cases
from bench.fault_injectors import INJECTORS
from bench.fault_matrix import SLOW_BY_NATURE, STOP_BAR_S, run
from bench.fault_rig import PLAIN, VARIANTS, WORKER, FaultRobot
from robot import loop
from robot.chart import LEAVES, RobotChart
from robot.fault_watch import FaultWatch
from robot.faults import TABLE, Action
from robot.hal.nxt.base import NxtBase

REPRESENTATIVE = {"search": PLAIN, "track": WORKER, "teleop": PLAIN}
ONLY_WHILE_DRIVING = {"base.stall", "base.stranded"}
BEHIND_WORKERS = {"head", "base", "near", "arm", "teleop"}


def some_cases():
    """Each row in three states, in one of them behind its worker if it has one."""
    for case in cases(tuple(REPRESENTATIVE), every_way=False):
        wanted = REPRESENTATIVE[case.state]
        if case.variant == (wanted if wanted in case.injector.variants else case.injector.variants[0]):
            yield case


# ------------------------------------------------------------------------------------ it is complete


def test_every_row_of_the_table_has_a_way_to_come_about_and_nothing_else_has():
    assert INJECTORS.keys() == TABLE.keys()
    assert all(INJECTORS.values())


def test_every_row_is_run_in_every_state_where_it_can_happen():
    run_in = {key: {case.state for case in cases() if case.key == key} for key in TABLE}
    restricted = {key: states for key, states in run_in.items() if states != set(LEAVES)}
    assert restricted.keys() == {*ONLY_WHILE_DRIVING, "teleop.silent"}
    assert restricted["teleop.silent"] == {"teleop"}
    for key in ONLY_WHILE_DRIVING:
        assert set(LEAVES) - restricted[key] == {"idle", "halted"}


def test_devices_are_run_plain_and_behind_their_workers():
    for key in TABLE:
        if key.split(".")[0] in BEHIND_WORKERS and key != "base.moved":
            assert {case.variant for case in cases() if case.key == key} == set(VARIANTS)


def test_there_are_hundreds_of_cases():
    assert sum(1 for _ in cases()) > 500


def test_rows_that_stop_later_than_half_a_second_are_named():
    slow = {
        key for key, row in TABLE.items() if row.action > Action.CARRY_ON and row.detection_s > STOP_BAR_S
    }
    assert slow == SLOW_BY_NATURE


# ------------------------------------------------------------------------------------------ it holds


@pytest.mark.parametrize("case", list(some_cases()), ids=str)
def test_the_robot_does_what_the_table_says(case):
    outcome = run(case)
    assert outcome.broken == ()


@pytest.mark.slow
@pytest.mark.parametrize("key", TABLE)
def test_the_robot_does_what_the_table_says_in_every_state_and_every_way(key):
    broken = {
        str(case): outcome.broken for case in cases() if case.key == key if (outcome := run(case)).broken
    }
    assert broken == {}


def test_a_wheel_that_is_blocked_after_the_link_broke_pushes_on_and_only_the_dead_link_is_told():
    """The one thing nobody can know or mend from here; README and the row's words name the switch."""
    robot = FaultRobot()
    robot.reach("track")
    robot.brick.cut_link()
    robot.brick.stall(2)
    robot.run(3.0)
    assert robot.pushes
    assert "base.link" in {fault.key for fault in robot.tick.faults}
    robot.brick.power_off()
    robot.run(0.2)
    assert not robot.pushes


# ------------------------------------------------------- it would be noticed if the robot did otherwise


def one(key, state="track", variant=PLAIN):
    return Case(key, INJECTORS[key][0], state, variant)


def test_a_guard_that_does_not_heed_faults_is_found(monkeypatch):
    real = loop.guard
    monkeypatch.setattr(
        loop, "guard", lambda command, state, limits: real(command, replace(state, stop=None), limits)
    )
    broken = run(one("camera.black", "teleop")).broken
    assert broken == ()  # there a person may drive on: the guard is not asked to stop
    assert run(one("arm.link", "teleop")).broken


def test_a_base_whose_stop_does_nothing_is_found(monkeypatch):
    monkeypatch.setattr(NxtBase, "_hold_ports", lambda self: None)
    assert any("not held" in words or "stop" in words for words in run(one("camera.black")).broken)


def test_a_lead_that_is_too_long_is_found(monkeypatch):
    from robot.hal.nxt.wheel import Wheel

    monkeypatch.setattr(Wheel, "_lead", lambda self, rate: 3.0 * abs(rate) * self.settings.pulse_s)
    monkeypatch.setattr(Wheel, "_ceiling", lambda self, rate: 4.0 * abs(rate) * self.settings.pulse_s)
    assert any("the wheels turn until" in words for words in run(one("base.link")).broken)


def test_faults_nobody_gathers_are_found(monkeypatch):
    monkeypatch.setattr(FaultWatch, "_picture_fault", lambda self, now, percepts: None)
    assert any("noticed" in words for words in run(one("camera.black")).broken)


def test_a_track_taken_up_again_after_a_stop_is_found(monkeypatch):
    real = RobotChart.send

    def send(self, event, *args, **kwargs):
        return None if event == "interrupted" else real(self, event, *args, **kwargs)

    monkeypatch.setattr(RobotChart, "send", send)
    assert any("track" in words for words in run(one("camera.black")).broken)


def test_a_row_that_promises_too_much_is_found(monkeypatch):
    hasty = replace(TABLE["arm.link"], detection_s=0.1)
    monkeypatch.setitem(fault_cases.TABLE, "arm.link", hasty)
    assert any("noticed after" in words for words in run(one("arm.link")).broken)


# ------------------------------------------------------------------------------ what lasts is told once


@pytest.mark.parametrize("state", ["teleop", "halted"])
def test_a_state_that_goes_on_making_mistakes_is_told_once_and_not_more_every_tick(state):
    robot = FaultRobot()
    robot.reach(state)
    robot.states[state].error = ZeroDivisionError("a mistake, on order")
    robot.run(1.0)
    assert [fault.key for fault in robot.tick.faults].count("loop.error") == 1
