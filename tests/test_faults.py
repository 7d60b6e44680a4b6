"""The fault table is total, and its words name a cure."""

import json
import re
from pathlib import Path

import pytest

from robot import fault_page, faults
from robot.faults import TABLE, Action
from robot.messages import Fault


def test_every_fault_the_code_can_report_has_a_row():
    reported = set()
    for path in (Path(__file__).parents[1] / "robot").rglob("*.py"):
        reported |= set(re.findall(r"Fault\(\s*\"(\w+)\",\s*\"(\w+)\"", path.read_text(encoding="utf-8")))
    assert reported, "the search found no fault at all"
    assert {f"{device}.{kind}" for device, kind in reported} <= set(TABLE)


@pytest.mark.parametrize("key", TABLE)
def test_a_row_says_what_is_wrong_and_the_cure(key):
    row = TABLE[key]
    assert 0 < row.detection_s <= 60
    assert re.search("[:;]", row.words), "what is wrong, then the cure"
    fault = Fault(*key.split("."), since=1.5, evidence="seen")
    assert faults.explain(fault).startswith(f"{key} since 1.5 s (seen): ")


def test_the_strongest_action_wins():
    carry_on, stop, halt = Fault("lamp", "dead", 0), Fault("base", "stall", 0), Fault("camera", "swapped", 0)
    assert faults.worst_action([]) is Action.CARRY_ON
    assert faults.worst_action([carry_on]) is Action.CARRY_ON
    assert faults.worst_action([carry_on, stop]) is Action.STOP
    assert faults.worst_action([halt, stop, carry_on]) is Action.HALT


def test_an_unknown_fault_halts():
    assert faults.worst_action([Fault("base", "on_fire", 0)]) is Action.HALT


def test_a_person_at_the_stick_drives_on_past_what_only_the_eyes_need():
    assert faults.action(Fault("camera", "swapped", 0), "teleop") is Action.CARRY_ON
    assert faults.action(Fault("camera", "swapped", 0), "track") is Action.HALT
    assert faults.action(Fault("base", "stall", 0), "teleop") is Action.STOP
    assert faults.action(Fault("arm", "stopped", 0), "teleop") is Action.HALT, "an emergency stop stops all"


@pytest.mark.parametrize("key", TABLE)
def test_the_page_shows_every_row_with_its_cure(key):
    paragraph = next(each for each in fault_page.as_text().split("\n\n") if each.startswith(f"{key} "))
    assert " ".join(TABLE[key].words.split()) in " ".join(paragraph.split())
    assert TABLE[key].clears in " ".join(paragraph.split())
    assert max(map(len, paragraph.splitlines())) <= 100
    assert json.loads(fault_page.as_json())[key]["action"] == TABLE[key].action.name.lower()
