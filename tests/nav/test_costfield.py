"""The lattice of the planner: where its nodes stand and what they know."""

from __future__ import annotations

import numpy as np
import pytest
from flatworld import box, seen_room

from robot.nav.costfield import Body, CostField
from robot.nav.grid import ObstacleMap

ROOM = (-1.5, -1.5, 1.5, 1.5)


def test_every_node_stands_in_its_block_where_most_room_is() -> None:
    walls = [*box(-0.5, -0.5, -0.2, 0.1), (0.3, -1.0, 0.9, 0.8)]
    field = CostField(seen_room(walls, ROOM), Body(), np.zeros((1, 2)))
    rows, columns = field.fine(field.stands)
    assert np.array_equal(field.distance[rows, columns], field.node_distance.ravel())
    nodes = np.arange(len(field.stands))
    assert [field.node_at(x, y) for x, y in field.stands[::97]] == nodes[::97].tolist()
    cells = field.distance[: 2 * field.nodes[0], : 2 * field.nodes[1]]
    blocks = cells.reshape(field.nodes[0], 2, field.nodes[1], 2)
    assert np.array_equal(blocks.max(axis=(1, 3)), field.node_distance)


def test_distances_are_to_the_nearest_occupied_middle() -> None:
    floor = seen_room([(0.3, -1.0, 0.9, 0.8)], ROOM)
    field = CostField(floor, Body(), np.zeros((1, 2)))
    middles = floor.occupied_points()
    for place in np.array([[0.0, 0.0], [-1.2, 0.7], [1.1, 0.3]]):
        row, column = field.fine(place)
        middle = floor.centres(floor.cells(place[None, :]))[0]
        true = np.hypot(*(middles - middle).T).min()
        assert field.distance[row, column] == pytest.approx(true, rel=0.03)


def test_costs_on_free_seen_floor_are_metres() -> None:
    floor = seen_room([], ROOM)
    field = CostField(floor, Body(), np.zeros((1, 2)))
    reach = field.reach(field.node_at(-1.0, 0.0))
    assert reach.cost[field.node_at(1.0, 0.0)] == pytest.approx(2.0, abs=0.09)
    trace = reach.trace(field.node_at(1.0, 0.0))
    assert trace[0] == field.node_at(-1.0, 0.0)
    assert len(trace) == 26


def test_the_far_side_of_a_closed_wall_costs_infinitely_much() -> None:
    field = CostField(seen_room(box(-0.6, -0.6, 0.6, 0.6), ROOM), Body(), np.zeros((1, 2)))
    reach = field.reach(field.node_at(0.0, 0.0))
    assert np.isinf(reach.cost[field.node_at(1.0, 0.0)])


@pytest.mark.parametrize("place", [(0.0, 0.0), (5.9, -5.9), (80.0, 0.0)])
def test_any_place_has_a_lattice(place: tuple[float, float]) -> None:
    field = CostField(ObstacleMap(), Body(), np.array([place]))
    assert field.passable.all()
    assert field.stands.shape == (field.nodes[0] * field.nodes[1], 2)
