"""The next view: where unseen floor is to be seen; none when all within reach was."""

from __future__ import annotations

import math

import numpy as np
from flatworld import Wall, box, distance, look, ray, seen_room

from robot.messages import Pose2
from robot.nav.grid import ObstacleMap
from robot.nav.nextview import APART, next_view
from robot.nav.planner import plan

ROOM = (-1.4, -1.4, 1.4, 1.4)


def test_a_room_seen_to_its_walls_has_no_next_view() -> None:
    assert next_view(seen_room(box(-1.5, -1.5, 1.5, 1.5), (-1.45, -1.45, 1.45, 1.45)), Pose2()) is None


def test_an_unknown_world_has_no_place_to_go_to() -> None:
    assert next_view(ObstacleMap(), Pose2(), visited=[(0.0, 0.0)]) is None
    assert next_view(ObstacleMap(), Pose2(math.nan, 0.0)) is None


def test_the_view_is_through_the_only_door() -> None:
    walls = [*box(-1.5, -1.5, 1.5, 1.5)[:1], (1.5, -1.5, 1.5, -0.4), (1.5, 0.4, 1.5, 1.5)]
    walls += box(-1.5, -1.5, 1.5, 1.5)[2:]
    view = next_view(seen_room(walls, (-1.45, -1.45, 1.45, 1.45)), Pose2(-0.8, 0.0), visited=[(-0.8, 0.0)])
    assert view is not None
    x, y, heading = view
    assert abs(heading) < math.radians(75)
    assert ray(walls, x, y, math.atan2(-y, 1.7 - x)) > math.hypot(1.7 - x, y)


def test_the_view_shows_what_a_box_hides_and_keeps_off_it() -> None:
    walls = [*box(-2.0, -1.5, 2.0, 1.5), *box(0.5, -0.3, 0.9, 0.3)]
    floor = ObstacleMap()
    start = Pose2(-0.5, 0.0)
    floor.start_disc(start, 0.4)
    for turn in range(12):
        pose = Pose2(-0.5, 0.0, turn * math.pi / 6)
        for k in range(3):
            floor.update(look(walls, pose), pose, 0.1 * (3 * turn + k))
    view = next_view(floor, start, visited=[(-0.5, 0.0)])
    assert view is not None
    x, y, heading = view
    assert distance(walls, x, y) > 0.1
    assert plan(floor, (start.x, start.y), (x, y), 0.13, 0.06) is not None

    def shadow_known() -> float:
        rows, columns = floor.cells(np.array([[1.0, -0.5], [1.9, 0.5]])).T
        return float(floor.seen_free(9.0)[rows[0] : rows[1], columns[0] : columns[1]].mean())

    before = shadow_known()
    for pan in (-56, 0, 56):
        pose = Pose2(x, y, heading)
        floor.update(look(walls, pose, math.radians(pan)), pose, 9.0)
    assert before < 0.3
    assert shadow_known() > 0.8


def test_visited_places_are_not_sent_to_again() -> None:
    floor = ObstacleMap()
    floor.start_disc(Pose2(), 1.2)
    visited: list[tuple[float, float]] = [(0.0, 0.0)]
    for _ in range(40):
        view = next_view(floor, Pose2(), visited)
        if view is None:
            break
        assert all(math.hypot(view[0] - x, view[1] - y) >= APART for x, y in visited)
        visited.append(view[:2])
    else:
        raise AssertionError("it never ends")
    assert len(visited) > 4


def test_looking_round_again_and_again_sees_the_whole_house() -> None:
    """Two rooms with a door: going to every next view leaves no part of the floor unseen."""
    walls: list[Wall] = [*box(-1.5, -1.2, 2.5, 1.2), (0.5, -1.2, 0.5, 0.1), (0.5, 0.7, 0.5, 1.2)]
    floor, x, y, at = ObstacleMap(), -0.8, -0.5, 0.0
    floor.start_disc(Pose2(x, y), 0.4)
    visited: list[tuple[float, float]] = []
    for _ in range(12):
        for turn in range(12):
            pose = Pose2(x, y, turn * math.pi / 6)
            for _ in range(2):
                at += 0.1
                floor.update(look(walls, pose), pose, at)
        visited.append((x, y))
        view = next_view(floor, Pose2(x, y), visited)
        if view is None:
            break
        assert distance(walls, view[0], view[1]) > 0.1
        x, y, _ = view
    else:
        raise AssertionError(f"still looking after {visited}")
    seen = floor.seen_free(at)
    inner = [(px / 10, py / 10) for px in range(-13, 24) for py in range(-10, 11)]
    known = [bool(seen[tuple(floor.cells(np.array([place]))[0])]) for place in inner]
    assert sum(known) / len(known) > 0.93
