"""The whole robot in small simulated rooms: it finds, goes there, goes round, and touches nothing."""

from __future__ import annotations

from pathlib import Path

import pytest
from closed_loop import Outcome, drive, scene_file

from robot.model_file import Model
from robot.sim.scene import SHIPPED

NEAR_BOX = """
[target]
object = "box"
x = 2.2
y = [-0.2, 0.2]
"""

BLOCK_IN_THE_WAY = """
[target]
object = "box"
x = 2.6
y = 0.0
[[obstacles]]
shape = "block"
x = 1.55
y = [-0.05, 0.05]
length_m = 0.3
width_m = 0.2
height_m = 0.12
[require]
target_visible = true
straight_way_blocked = true
"""

NIGHT = """
[target]
object = "box"
x = 1.9
y = 0.6
[light]
level = 0.03
"""


def reached(outcome: Outcome) -> None:
    assert outcome.report["success"], outcome.report["reason"]
    assert outcome.report["collisions"] == 0
    assert outcome.report["false_detections"] == 0
    assert outcome.report["clearance_min"] > 0.0


def test_a_target_in_plain_sight_is_found_ranged_and_followed(tmp_path: Path, box: Model) -> None:
    outcome = drive(scene_file(tmp_path, "plain", NEAR_BOX, heading="[-20.0, 20.0]"), 1, box)
    reached(outcome)
    assert outcome.states[:4] == ("search", "recognize", "range", "track")
    assert outcome.report["found_s"] < 5.0
    assert outcome.report["duration_s"] < 15.0
    assert outcome.report["range_error_median"] <= 0.03
    assert outcome.report["range_samples"] >= 20
    assert outcome.displaced > 0.3, "from 1.3 m to the stand-off of 0.7 m"
    assert not outcome.lamp_burned, "it is day"


def goes_round(folder: Path, seed: int, target: Model) -> None:
    outcome = drive(scene_file(folder, "block", BLOCK_IN_THE_WAY, heading="[-10.0, 10.0]"), seed, target)
    reached(outcome)
    assert outcome.report["detour_needed"]
    assert outcome.report["detour_taken"]
    assert "avoid" in outcome.states
    assert outcome.report["duration_s"] < 25.0


def test_a_block_in_the_straight_way_is_gone_round(tmp_path: Path, box: Model) -> None:
    goes_round(tmp_path, 2, box)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 3, 4])
def test_a_block_is_gone_round_whatever_the_room(seed: int, tmp_path: Path, box: Model) -> None:
    goes_round(tmp_path, seed, box)


def test_at_night_the_lamp_is_lit_and_the_target_found(tmp_path: Path, box: Model) -> None:
    outcome = drive(scene_file(tmp_path, "night", NIGHT, heading="-20.0"), 1, box)
    reached(outcome)
    assert outcome.lamp_burned


def test_the_same_scene_and_seed_give_the_same_events_byte_for_byte(tmp_path: Path, box: Model) -> None:
    scene = scene_file(tmp_path, "same", BLOCK_IN_THE_WAY, heading="[-10.0, 10.0]")
    first, second = (drive(scene, 3, box, seconds=5.0) for _ in range(2))
    assert first.events.count(b"\n") >= 5, "a status line a second"
    assert b'"from":"recognize"' in first.events
    assert first.events == second.events
    assert first.report == second.report


def test_another_seed_is_another_run(tmp_path: Path, box: Model) -> None:
    scene = scene_file(tmp_path, "other", NEAR_BOX, heading="[-20.0, 20.0]")
    first, second = (drive(scene, seed, box, seconds=2.0).events for seed in (1, 2))
    assert first != second


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("scene", SHIPPED)
def test_no_shipped_scene_ends_in_a_collision(scene: str, seed: int, box: Model) -> None:
    outcome = drive(scene, seed, box)
    assert outcome.report["collisions"] == 0, outcome.report["collided_with"]
    if outcome.report["expect"] == "not found":
        assert outcome.report["success"], outcome.report["reason"]
        assert not outcome.claimed
