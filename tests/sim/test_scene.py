"""Scene files: what they may say, and one-line errors that name file, key and cure."""

from __future__ import annotations

import zlib
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot.errors import UserError
from robot.sim import scene as module
from robot.sim.layout import Layout, draw_layout, object_solid
from robot.sim.scene import FOLDER, load_scene, parse_scene, shipped_scenes
from robot.sim.solids import Solid, overlap
from robot.sim.ways import Ways, length


def room(name: str, seed: int) -> Layout:
    return draw_layout(load_scene(name), np.random.default_rng([seed, zlib.crc32(name.encode())]))


TARGET = {"object": "box", "x": 2.5, "y": 0.0}
HERE = {"x": 1.0, "y": 1.0}


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"target": TARGET, "robots": {}}, ["top level", "robots", "allowed", "obstacles"]),
        ({"target": {**TARGET, "colour": 1}}, ["target", "colour", "speed_m_s"]),
        ({"target": {**TARGET, "x": "far"}}, ["target.x", "range"]),
        ({"target": {**TARGET, "object": "cat"}}, ["target.object", "cat"]),
        ({"target": {**TARGET, "x": [3.0, 2.0]}}, ["target.x", "low first"]),
        ({"target": {**TARGET, "speed_m_s": 3.0}}, ["target.speed_m_s", "0.5"]),
        ({"target": {**TARGET, "motion": "path"}}, ["target.waypoints"]),
        ({"target": TARGET, "obstacles": [{**HERE, "shape": "blob"}]}, ["obstacles[0].shape", "blob"]),
        ({"target": TARGET, "obstacles": [{**HERE, "shape": "post", "gap_m": 1.0}]}, ["gap_m", "radius_m"]),
        ({"target": TARGET, "room": {"length_m": 50.0}}, ["room.length_m", "12"]),
        ({}, ["target", "missing"]),
        ({"expect": "not found", "require": {"target_visible": True}}, ["require"]),
        ({"target": TARGET, "name": "x"}, ["name"]),
    ],
)
def test_mistakes_are_told_in_one_line(table: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(UserError) as caught:
        parse_scene(table, "mine", "mine.toml")
    message = str(caught.value)
    assert message.startswith("mine.toml: ")
    assert "\n" not in message
    for word in words:
        assert word in message


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    broken = tmp_path / "broken.toml"
    broken.write_text("x = = 1")
    for name, word in ((broken, "not TOML"), (tmp_path / "none.toml", "no such"), ("nowhere", "standing")):
        with pytest.raises(UserError, match=word):
            load_scene(name)


@pytest.mark.parametrize(
    ("obstacle", "words"),
    [
        ({"shape": "block", "x": 2.5, "y": 0.0}, r"obstacles\[0\] and target overlap"),
        ({"shape": "block", "x": 0.7, "y": 0.0}, r"obstacles\[0\] and robot overlap"),
        ({"shape": "block", "x": 9.0, "y": 0.0}, r"obstacles\[0\] stands outside"),
        ({"shape": "gate", "x": 1.5, "y": 0.0, "length_m": 6.0, "gap_m": 0.2}, "no way"),
    ],
)
def test_impossible_rooms_are_refused(obstacle: dict[str, Any], words: str) -> None:
    scene = parse_scene({"target": TARGET, "mirror": False, "obstacles": [obstacle]}, "mine")
    with pytest.raises(UserError, match=words):
        draw_layout(scene, np.random.default_rng(0))


def test_twelve_scenes_are_shipped_and_every_file_loads() -> None:
    assert len(shipped_scenes()) == 12
    assert "demo" not in shipped_scenes()
    for file in FOLDER.glob("*.toml"):
        scene = load_scene(file)
        assert scene.title
        if scene.name in shipped_scenes():
            assert scene.duration_s <= 60.0


@pytest.mark.parametrize("name", [*shipped_scenes(), "demo"])
def test_every_seed_gives_a_room_the_robot_can_master(name: str) -> None:
    scene = load_scene(name)
    for seed in range(3):
        drawn = room(name, seed)
        assert drawn == room(name, seed)
        assert drawn != room(name, seed + 1)
        if drawn.target is None:
            assert scene.expect == "not found"
            continue
        start, target = (drawn.start.x, drawn.start.y), (drawn.target.pose.x, drawn.target.pose.y)
        way = drawn.ways.shortest_way(start, target, scene.stand_off_m)
        assert way is not None
        # The way is one for a real robot: 13 cm to every side along all of it.
        assert all(drawn.ways.line_free(a, b, 0.13) for a, b in pairwise(way))
        assert np.hypot(target[0] - start[0], target[1] - start[1]) <= 3.2
        solids = [*drawn.solids, object_solid(drawn.target)]
        bodies = [b.solids for b in drawn.bodies]
        assert not any(overlap(s, solids[-1]) for b in bodies for s in b)


def test_requirements_hold() -> None:
    for seed in range(4):
        hidden, trap = room("hidden", seed), room("trap", seed)
        assert hidden.target is not None
        assert trap.target is not None
        here = (hidden.start.x, hidden.start.y)
        assert not hidden.ways.sees(here, (hidden.target.pose.x, hidden.target.pose.y))
        start, end = (trap.start.x, trap.start.y), (trap.target.pose.x, trap.target.pose.y)
        assert trap.ways.corridor_blocked(start, end, 0.7)
        way = trap.ways.shortest_way(start, end, 0.7)
        assert way is not None
        assert length(way) > np.hypot(end[0] - start[0], end[1] - start[1]) - (1.2 * 0.7 + 0.13)


def test_gate_leaves_the_gap_that_was_asked_for() -> None:
    drawn = room("passage", 3)
    gap = drawn.bodies[0].solids
    middle = ((gap[0].x + gap[1].x) / 2, (gap[0].y + gap[1].y) / 2)
    between = np.hypot(gap[0].x - gap[1].x, gap[0].y - gap[1].y) - gap[0].half_y - gap[1].half_y
    assert 0.36 <= between <= 0.45
    free = drawn.ways.distance(np.array([drawn.bodies[0].solids[0].x]), np.array([middle[1]]))
    assert float(free[0]) == pytest.approx(between / 2, abs=0.06)


def test_shortest_way_round_a_wall_by_hand() -> None:
    wall = Solid("box", 2.0, 0.0, 0.0, 0.05, 0.5, 0.0, 1.0)
    way = Ways(4.0, 4.0, [wall]).shortest_way((1.0, 0.0), (3.0, 0.0), 0.7)
    assert way is not None
    # Round the corner at (1.95..2.05, 0.655), stopping 0.97 m before the target with a free sight.
    corner = float(np.hypot(0.95, 0.655))
    assert corner - 0.3 <= length(way) <= corner + 0.6
    assert Ways(4.0, 4.0, []).shortest_way((1.0, 0.0), (3.0, 0.0), 0.7) is not None
    assert (
        Ways(4.0, 4.0, [Solid("box", 2.0, 0.0, 0.0, 0.05, 2.0, 0.0, 1.0)]).shortest_way(
            (1.0, 0.0), (3.0, 0.0), 0.7
        )
        is None
    )


def test_low_things_do_not_hide_and_high_ones_do_not_hinder() -> None:
    step = Solid("box", 2.0, 0.0, 0.0, 0.1, 1.0, 0.0, 0.05)
    top = Solid("box", 2.0, 0.0, 0.0, 0.3, 0.5, 0.47, 0.5)
    assert Ways(4.0, 4.0, [step]).sees((1.0, 0.0), (3.0, 0.0))
    assert Ways(4.0, 4.0, [step]).corridor_blocked((1.0, 0.0), (3.0, 0.0), 0.7)
    assert not Ways(4.0, 4.0, [top]).corridor_blocked((1.0, 0.0), (3.0, 0.0), 0.7)


def test_readme_documents_every_key() -> None:
    text = (FOLDER / "README.md").read_text(encoding="utf-8")
    tables = (
        module.Scene, module.Room, module.Start, module.Light, module.Eyes, module.Target, module.Waypoint,
        module.Distractor, module.Obstacle, module.Require,
    )  # fmt: skip
    for table in tables:
        for key in table.__struct_fields__:
            written = (f"`{key}`", f"`[{key}]`", f"`[[{key}]]`")
            assert key == "name" or any(form in text for form in written), (
                f"{table.__name__}.{key} is not documented"
            )
    for name in (*shipped_scenes(), "demo"):
        assert f"`{name}`" in text
