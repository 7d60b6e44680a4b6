"""Paths: through passages of the body's size, round walls, never through what is occupied."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from flatworld import Wall, box, distance, ray, seen_room
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.messages import Pose2
from robot.nav.grid import ObstacleMap
from robot.nav.planner import Path, corridor_free, path_length, plan, plan_to_view

RADIUS, MARGIN = 0.13, 0.06
ROOM = (-2.0, -2.0, 2.0, 2.0)


def clearance_along(path: Path, walls: list[Wall]) -> float:
    """Smallest true distance of a path to the walls."""
    nearest = math.inf
    for (ax, ay), (bx, by) in pairwise(path):
        for t in np.linspace(0.0, 1.0, max(2, int(math.dist((ax, ay), (bx, by)) / 0.01))):
            nearest = min(nearest, distance(walls, ax + t * (bx - ax), ay + t * (by - ay)))
    return nearest


def test_free_floor_is_crossed_straight() -> None:
    floor = seen_room([], ROOM)
    assert plan(floor, (-1.0, -1.0), (1.0, 0.5), RADIUS, MARGIN) == ((-1.0, -1.0), (1.0, 0.5))


def test_without_any_knowledge_the_way_is_straight() -> None:
    assert plan(ObstacleMap(), (0.0, 0.0), (2.0, 1.0), RADIUS, MARGIN) == ((0.0, 0.0), (2.0, 1.0))


def test_unseen_floor_costs_more_than_a_small_detour() -> None:
    floor = ObstacleMap()
    for x in np.arange(-1.0, 1.01, 0.1):
        floor.start_disc(Pose2(float(x), 0.0), 0.3)
    for y in np.arange(0.0, 1.01, 0.1):
        floor.start_disc(Pose2(-1.0, float(y)), 0.3)
        floor.start_disc(Pose2(1.0, float(y)), 0.3)
    start, goal = (-1.0, 0.6), (1.0, 0.6)
    path = plan(floor, start, goal, RADIUS, MARGIN)
    assert path is not None
    assert path_length(path) > 2.2
    careless = plan(floor, start, goal, RADIUS, MARGIN, unknown_cost=1.0)
    assert careless == (start, goal)


@pytest.mark.parametrize("shift", [0.0, 0.013, 0.027])
@pytest.mark.parametrize("turn", [0.0, 0.3, 0.785, math.pi / 2])
def test_a_passage_of_36_cm_is_planned_through(shift: float, turn: float) -> None:
    pose = Pose2(shift, shift, turn)
    straight: list[Wall] = [(0.0, -1.5, 0.0, -0.18), (0.0, 0.18, 0.0, 1.5)]
    walls: list[Wall] = []
    for x0, y0, x1, y1 in straight:
        (ax, ay), (bx, by) = pose.to_world(np.array([[x0, y0], [x1, y1]]))
        walls.append((ax, ay, bx, by))
    floor = seen_room(walls, ROOM)
    (sx, sy), (gx, gy) = pose.to_world(np.array([[-0.8, 0.5], [0.8, -0.4]]))
    path = plan(floor, (sx, sy), (gx, gy), RADIUS, MARGIN)
    assert path is not None
    assert path_length(path) < 2.3
    # Half a cell's diagonal is what the map does not know of the walls' place.
    assert clearance_along(path, walls) > RADIUS - 0.03
    assert len(path) <= 6


@pytest.mark.parametrize("gap", [0.16, 0.2])
def test_a_passage_narrower_than_the_body_is_none(gap: float) -> None:
    walls: list[Wall] = [(0.0, -3.0, 0.0, -gap / 2), (0.0, gap / 2, 0.0, 3.0)]
    floor = seen_room([*walls, *box(-2.5, -3.0, 2.5, 3.0)], ROOM)
    assert plan(floor, (-0.8, 0.0), (0.8, 0.0), RADIUS, MARGIN) is None


def test_a_dead_end_is_left_again() -> None:
    trap: list[Wall] = [(1.0, -0.8, 1.0, 0.8), (0.2, 0.8, 1.0, 0.8), (0.2, -0.8, 1.0, -0.8)]
    floor = seen_room(trap, ROOM)
    path = plan(floor, (0.6, 0.0), (1.6, 0.0), RADIUS, MARGIN)
    assert path is not None
    assert path[0] == (0.6, 0.0)
    assert path[-1] == (1.6, 0.0)
    assert 2.5 < path_length(path) < 4.0
    assert clearance_along(path, trap) > RADIUS


@settings(deadline=None, max_examples=15)
@given(st.lists(st.tuples(st.floats(-1.4, 1.2), st.floats(-1.4, 1.2)), min_size=1, max_size=5))
def test_paths_keep_the_body_off_random_boxes(corners: list[tuple[float, float]]) -> None:
    walls = [side for x, y in corners for side in box(x, y, x + 0.25, y + 0.25)]
    start, goal = (-1.8, -1.8), (1.8, 1.8)
    path = plan(seen_room(walls, ROOM), start, goal, RADIUS, MARGIN)
    assert path is not None
    assert path[0] == start
    assert path[-1] == goal
    assert clearance_along(path, walls) > RADIUS - 0.03
    assert path_length(path) < 1.5 * math.dist(start, goal)


def test_a_robot_too_near_to_a_wall_first_leaves_it() -> None:
    wall: list[Wall] = [(0.0, -1.0, 0.0, 1.0)]
    floor = seen_room(wall, ROOM)
    path = plan(floor, (-0.08, 0.0), (0.6, 0.0), RADIUS, MARGIN)
    assert path is not None
    assert path[0] == (-0.08, 0.0)
    assert path[1][0] < -0.1
    assert clearance_along(path[1:], wall) > RADIUS - 0.03


def test_a_goal_in_the_wall_is_moved_a_goal_in_a_block_is_none() -> None:
    floor = seen_room([(0.5, -1.0, 0.5, 1.0)], ROOM)
    path = plan(floor, (-0.5, 0.0), (0.5, 0.0), RADIUS, MARGIN)
    assert path is not None
    assert path[-1][0] == pytest.approx(0.35, abs=0.06)
    block = [(x, 0.0, x, 1.0) for x in np.arange(0.0, 1.0, 0.04)]
    assert plan(seen_room(block, ROOM), (-0.5, 0.0), (0.5, 0.5), RADIUS, MARGIN) is None


@pytest.mark.parametrize("goal", [(math.nan, 0.0), (7.0, 0.0)])
def test_goals_that_are_none_have_no_path(goal: tuple[float, float]) -> None:
    assert plan(seen_room([], ROOM), (0.0, 0.0), goal, RADIUS, MARGIN) is None
    assert plan_to_view(ObstacleMap(), (math.nan, 0.0), (1.0, 0.0), 0.7, RADIUS, MARGIN) is None


def test_a_body_without_size_is_refused() -> None:
    with pytest.raises(ValueError, match="radius"):
        plan(ObstacleMap(), (0.0, 0.0), (1.0, 0.0), radius=0.0, margin=0.0)


# ------------------------------------------------------------------------------------------- to a view


def test_a_view_is_taken_at_the_stand_off_on_the_near_side() -> None:
    target = box(0.95, -0.05, 1.05, 0.05)
    path = plan_to_view(seen_room(target, ROOM), (-1.0, 0.0), (1.0, 0.0), 0.7, RADIUS, MARGIN)
    assert path is not None
    assert math.dist(path[-1], (1.0, 0.0)) == pytest.approx(0.7, abs=0.12)
    assert path[-1][0] < 0.6


def test_a_view_sees_the_target_past_the_wall_that_hides_it() -> None:
    target = box(0.95, -0.05, 1.05, 0.05)
    wall: list[Wall] = [(0.4, -1.0, 0.4, 0.6)]
    path = plan_to_view(seen_room([*target, *wall], ROOM), (-0.5, 0.0), (1.0, 0.0), 0.7, RADIUS, MARGIN)
    assert path is not None
    x, y = path[-1]
    assert ray(wall, x, y, math.atan2(-y, 1.0 - x)) > math.dist((x, y), (1.0, 0.0))
    assert 0.45 < math.dist((x, y), (1.0, 0.0)) < 1.15
    assert clearance_along(path, wall) > RADIUS - 0.03


def test_a_walled_in_target_has_no_view() -> None:
    closed = box(0.3, -0.7, 1.7, 0.7)
    floor = seen_room([*closed, *box(0.95, -0.05, 1.05, 0.05)], ROOM)
    assert plan_to_view(floor, (-1.0, 0.0), (1.0, 0.0), 0.5, RADIUS, MARGIN) is None


# ------------------------------------------------------------------------------------------- corridors


def test_a_corridor_is_free_or_not_by_its_width() -> None:
    floor = seen_room([(0.5, 0.2, 0.5, 1.0)], ROOM)
    assert corridor_free(floor, (0.0, 0.0), (1.0, 0.0), 0.15)
    assert not corridor_free(floor, (0.0, 0.0), (1.0, 0.0), 0.25)
    assert corridor_free(floor, (0.0, 0.0), (0.2, 0.0), 0.25)
    assert corridor_free(floor, (0.7, 0.0), (1.5, 0.0), 0.25)


def test_a_corridor_ends_at_its_goal_and_begins_at_its_start() -> None:
    floor = seen_room([(0.5, -1.0, 0.5, 1.0)], ROOM)
    assert corridor_free(floor, (0.55, 0.0), (1.5, 0.0), 0.15)
    assert not corridor_free(floor, (1.5, 0.0), (0.6, 0.0), 0.15)
    assert not corridor_free(floor, (0.5, 0.0), (0.5, 0.0), 0.15)
    assert corridor_free(ObstacleMap(), (0.0, 0.0), (1.0, 0.0), 0.5)
