"""The obstacle map: what becomes free, occupied, unknown again; how far the way is free."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flatworld import box, look, only_points
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.messages import FreeSpace, Pose2, Twist
from robot.nav.grid import NEVER, MapSettings, ObstacleMap

ROOM = box(-2.0, -2.0, 2.0, 2.0)
WALL = [(1.5, -1.0, 1.5, 1.0)]


def cell(floor: ObstacleMap, x: float, y: float) -> tuple[int, int]:
    row, column = floor.cells(np.array([[x, y]]))[0]
    return int(row), int(column)


def looked(
    pose: Pose2, times: int = 3, walls: list[tuple[float, float, float, float]] | None = None
) -> ObstacleMap:
    floor = ObstacleMap()
    floor.start_disc(pose, 0.4)
    for k in range(times):
        floor.update(look(WALL if walls is None else walls, pose), pose, 0.12 * k)
    return floor


def test_a_new_map_knows_nothing() -> None:
    floor = ObstacleMap()
    assert floor.evidence.shape == (300, 300)
    assert floor.evidence.dtype == floor.seen_free_at.dtype == floor.confirmed_at.dtype == np.float32
    assert not floor.occupied().any()
    assert not floor.seen_free(now=0.0).any()
    assert floor.clearance(Pose2(), 0.0, 0.13, 3.0, now=0.0).limited_by == "unknown"


def test_cells_and_centres_are_inverse() -> None:
    floor = ObstacleMap()
    index = np.array([[0, 0], [17, 203], [299, 299]])
    assert np.array_equal(floor.cells(floor.centres(index)), index)
    assert floor.centres(np.array([[150, 150]]))[0] == pytest.approx([0.02, 0.02])


def test_views_are_read_only_and_live() -> None:
    floor = ObstacleMap()
    seen = floor.seen_free_at
    with pytest.raises(ValueError, match="read-only"):
        seen[0, 0] = 1.0
    floor.start_disc(Pose2(), 0.2, at=5.0)
    assert seen[cell(floor, 0.0, 0.0)] == 5.0


@settings(deadline=None, max_examples=20)
@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-3.1, 3.1), st.floats(-1.3, 1.3))
def test_freed_are_exactly_the_cells_within_the_sectors(x: float, y: float, yaw: float, pan: float) -> None:
    pose = Pose2(x, y, yaw)
    seen = look(ROOM, pose, pan)
    floor = ObstacleMap(MapSettings(body_radius=0.01))
    floor.update(seen, pose, 1.0)
    rows, columns = np.indices(floor.evidence.shape)
    local = pose.to_local(floor.centres(np.column_stack([rows.ravel(), columns.ravel()])))
    reach = np.hypot(*local.T)
    off = np.arctan2(local[:, 1], local[:, 0]) - pan
    off = (off + np.pi) % math.tau - np.pi
    sector = np.clip(np.round((off + math.radians(30)) / math.radians(1.5)).astype(int), 0, 40)
    near, far = seen.near[sector], seen.free[sector]
    inside = (np.abs(off) <= math.radians(30.75)) & (reach >= near) & (reach <= far)
    marked = (floor.seen_free_at > NEVER).ravel()
    # float32 angles may put cells on a border to either side; cells hit and under the robot differ.
    doubtful = np.isclose((off / math.radians(1.5)) % 1.0, 0.5, atol=2e-3) | (reach < 0.1)
    doubtful |= np.isclose(reach, far, atol=1e-4) | np.isclose(reach, near, atol=1e-4)
    doubtful |= (floor.evidence > 0).ravel()
    assert np.array_equal(marked[~doubtful], inside[~doubtful])
    assert marked.sum() > 50


def test_one_far_point_is_not_yet_an_obstacle_two_looks_make_one() -> None:
    floor = ObstacleMap()
    point = only_points(np.array([[1.5, 0.3]]))
    floor.update(point, Pose2(), 0.0)
    assert not floor.occupied().any()
    floor.update(point, Pose2(), 0.1)
    assert floor.occupied()[cell(floor, 1.5, 0.3)]
    assert floor.occupied().sum() == 1


def test_a_dense_cluster_close_by_counts_at_the_first_look_but_not_far_away() -> None:
    cluster = np.array([[0.5, 0.0], [0.505, 0.01], [0.51, 0.02], [0.5, 0.03]])
    floor = ObstacleMap()
    floor.update(only_points(cluster), Pose2(), 0.0)
    assert floor.occupied().any()
    far = ObstacleMap()
    far.update(only_points(cluster + np.array([1.0, 0.0])), Pose2(), 0.0)
    assert not far.occupied().any()


def test_an_obstacle_that_went_away_is_gone_within_a_second_of_looks() -> None:
    floor = looked(Pose2(), times=10)
    assert floor.occupied()[cell(floor, 1.5, 0.0)]
    for k in range(8):
        floor.update(look([], Pose2()), Pose2(), 1.2 + 0.12 * k)
    assert not floor.occupied().any()
    assert floor.clearance(Pose2(), 0.0, 0.13, 2.0, now=2.0).limited_by == "range"


def test_an_obstacle_missed_in_every_second_look_stays() -> None:
    floor = looked(Pose2(), times=6)
    for k in range(20):
        walls = WALL if k % 2 else []
        floor.update(look(walls, Pose2()), Pose2(), 1.0 + 0.12 * k)
    assert floor.occupied()[cell(floor, 1.5, 0.0)]


def test_unconfirmed_obstacles_are_forgotten_and_leave_the_unknown() -> None:
    floor = looked(Pose2(), times=4)
    aside = Pose2(0.0, 0.0, math.pi)
    floor.update(look([], aside), aside, 25.0)
    assert floor.occupied()[cell(floor, 1.5, 0.0)]
    floor.update(look([], aside), aside, 40.0)
    assert not floor.occupied().any()
    assert not floor.seen_free(now=40.0)[cell(floor, 1.5, 0.0)]


def test_a_cell_hit_in_a_look_is_not_freed_by_it() -> None:
    floor = ObstacleMap()
    bearings = np.radians(np.arange(-10.0, 10.1, 1.0))
    over = FreeSpace(bearings, np.full(21, 0.3), np.full(21, 2.0), np.array([[1.0, 0.02]]))
    for at in (0.0, 0.1):
        floor.update(over, Pose2(), at)
    assert floor.occupied()[cell(floor, 1.0, 0.02)]


def test_a_look_backwards_across_the_half_turn_frees_behind() -> None:
    floor = ObstacleMap()
    bearings = np.radians(np.arange(160.0, 200.1, 1.0))
    floor.update(FreeSpace(bearings, np.full(41, 0.3), np.full(41, 1.0), np.zeros((0, 2))), Pose2(), 0.0)
    seen = floor.seen_free(0.0)
    assert seen[cell(floor, -0.7, 0.15)]
    assert seen[cell(floor, -0.7, -0.15)]
    assert not seen[cell(floor, 0.7, 0.0)]


def test_bad_points_are_left_out() -> None:
    floor = ObstacleMap()
    points = np.array([[math.nan, 0.0], [0.0, math.inf], [100.0, 0.0], [1.0, 0.0]])
    bearings = np.array([-0.1, 0.0, 0.1])
    bad = FreeSpace(bearings, np.full(3, 0.3), np.array([math.nan, 1.0, -math.inf]), points)
    for at in (0.0, 0.1):
        floor.update(bad, Pose2(), at)
    assert floor.occupied().sum() == 1
    assert floor.seen_free(0.1)[cell(floor, 0.6, 0.0)]


@pytest.mark.parametrize("pose", [Pose2(5.9, 5.9, 0.8), Pose2(50.0, 0.0), Pose2(-6.5, 0.0, math.pi)])
def test_the_rim_of_the_map_and_beyond_are_unknown(pose: Pose2) -> None:
    floor = ObstacleMap()
    floor.update(look([], pose), pose, 0.0)
    ahead = floor.clearance(pose, 0.0, 0.13, 3.0, now=0.0)
    assert ahead.limited_by == "unknown"
    assert ahead.distance < 0.3
    assert floor.disc_free(pose, 0.2)


# ------------------------------------------------------------------------------------------ clearance


@pytest.mark.parametrize("yaw", [0.0, 0.4, 1.7, -2.8])
def test_clearance_is_measured_from_the_front_edge(yaw: float) -> None:
    ends = Pose2(0.0, 0.0, yaw).to_world(np.array([[1.5, -1.0], [1.5, 1.0]]))
    wall = [(ends[0, 0], ends[0, 1], ends[1, 0], ends[1, 1])]
    floor = looked(Pose2(0.0, 0.0, yaw), walls=wall)
    ahead = floor.clearance(Pose2(0.0, 0.0, yaw), 0.0, 0.13, 3.0, now=0.3)
    assert ahead.limited_by == "obstacle"
    assert ahead.distance == pytest.approx(1.5 - 0.13, abs=0.06)
    assert ahead.distance <= 1.5 - 0.13 + 0.02


def test_clearance_says_range_when_nothing_is_in_the_way() -> None:
    floor = looked(Pose2())
    ahead = floor.clearance(Pose2(), 0.0, 0.13, 1.0, now=0.3)
    assert (ahead.distance, ahead.limited_by) == (1.0, "range")


def test_what_is_not_seen_lately_is_unknown() -> None:
    floor = looked(Pose2())
    assert floor.clearance(Pose2(), 0.0, 0.13, 1.0, now=30.0, memory_s=60.0).limited_by == "range"
    forgotten = floor.clearance(Pose2(), 0.0, 0.13, 1.0, now=30.0, memory_s=10.0)
    assert forgotten.limited_by == "unknown"
    # Only the strip the eyes never see is taken on trust.
    assert forgotten.distance <= MapSettings().skirt + 0.04


def test_behind_is_unknown_unless_the_robot_came_from_there() -> None:
    floor = looked(Pose2())
    assert floor.clearance(Pose2(), math.pi, 0.13, 1.0, now=0.3).limited_by == "unknown"
    came = ObstacleMap()
    came.start_disc(Pose2(), 0.2)
    for k in range(20):
        pose = Pose2(0.03 * k, 0.0)
        came.update(look([], pose), pose, 0.1 * k)
    behind = came.clearance(Pose2(0.57, 0.0), math.pi, 0.12, 1.0, now=2.0)
    assert behind.distance == pytest.approx(0.57 + 0.2 - 0.12, abs=0.1)


def test_a_single_unseen_cell_is_closed_a_wider_gap_is_not() -> None:
    def with_unseen(points: list[tuple[float, float]]) -> ObstacleMap:
        floor = ObstacleMap()
        floor.start_disc(Pose2(), 1.5)
        # What was an obstacle and is forgotten is unknown: so holes come into floor that was seen.
        for at in (0.0, 0.1):
            floor.update(only_points(np.array(points)), Pose2(), at)
        floor.update(only_points(np.zeros((0, 2))), Pose2(), 60.0)
        assert (~floor.seen_free(60.0)[145:156, 165:176]).sum() == len(points)
        return floor

    single = with_unseen([(0.82, 0.02)])
    assert single.clearance(Pose2(), 0.0, 0.13, 1.0, now=60.0).limited_by == "range"
    wide = with_unseen([(0.82 + dx, 0.02 + dy) for dx in (-0.04, 0.0, 0.04) for dy in (-0.04, 0.0, 0.04)])
    assert wide.clearance(Pose2(), 0.0, 0.13, 1.0, now=60.0).limited_by == "unknown"


def test_the_arc_meets_what_the_line_misses() -> None:
    floor = ObstacleMap()
    floor.start_disc(Pose2(), 3.0)
    for at in (0.0, 0.1):
        floor.update(only_points(np.array([[0.8, 0.6], [0.8, 0.62]])), Pose2(), at)
    line = floor.arc_clearance(Pose2(), Twist(0.2, 0.0), 0.15, 1.5, now=0.1)
    # Radius 0.8 m to the left: the circle through (0.8, 0.8) passes the point at 0.2 m, the body touches it.
    arc = floor.arc_clearance(Pose2(), Twist(0.2, 0.25), 0.3, 1.5, now=0.1)
    assert line.limited_by == "range"
    assert arc.limited_by == "obstacle"
    assert 0.5 < arc.distance < 1.1


def test_clearance_does_not_depend_on_speed_or_on_where_the_world_lies() -> None:
    pose = Pose2(-0.6, 0.9, 2.1)
    ends = pose.to_world(np.array([[1.0, -1.0], [1.0, 1.0]]))
    floor = looked(pose, walls=[(ends[0, 0], ends[0, 1], ends[1, 0], ends[1, 1])])
    slow = floor.arc_clearance(pose, Twist(0.02, 0.01), 0.14, 2.0, now=0.3)
    fast = floor.arc_clearance(pose, Twist(0.4, 0.2), 0.14, 2.0, now=0.3)
    assert slow.distance == pytest.approx(fast.distance, abs=1e-9)


def test_numbers_that_are_none_free_nothing() -> None:
    floor = looked(Pose2())
    for twist in (Twist(math.nan, 0.0), Twist(0.1, math.inf)):
        assert floor.arc_clearance(Pose2(), twist, 0.13, 1.0, now=0.3).distance == 0.0
    assert floor.clearance(Pose2(math.nan, 0.0), 0.0, 0.13, 1.0, now=0.3).distance == 0.0


def test_turning_room_is_the_disc() -> None:
    floor = ObstacleMap()
    for at in (0.0, 0.1):
        floor.update(only_points(np.array([[0.25, 0.0]])), Pose2(), at)
    assert floor.disc_free(Pose2(), 0.2)
    assert not floor.disc_free(Pose2(), 0.3)


def test_settings_without_a_grid_are_refused() -> None:
    with pytest.raises(ValueError, match="cells"):
        ObstacleMap(MapSettings(cell=0.0))
