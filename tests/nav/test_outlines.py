"""Outlines: known shapes exactly, random sets against a flood from outside over the triangles."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from robot.messages import Points
from robot.nav.outlines import components, kept_edges, outer_walk, outlines


def rectangle(x0: float, y0: float, x1: float, y1: float, step: float = 0.1) -> Points:
    xs, ys = np.arange(x0, x1 + step / 2, step), np.arange(y0, y1 + step / 2, step)
    return np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)


def test_a_full_square_is_its_rim() -> None:
    (square,) = outlines(rectangle(0.0, 0.0, 1.0, 0.5), 0.15)
    assert square.area == pytest.approx(0.5)
    assert len(square.boundary) == 30
    assert len(square.members) == 66
    assert square.boundary[0] == pytest.approx([0.0, 0.0])


def test_an_l_keeps_its_free_inside_corner() -> None:
    points = np.concatenate([rectangle(0.0, 0.0, 1.0, 0.2), rectangle(0.0, 0.3, 0.2, 1.0)])
    (shape,) = outlines(points, 0.15)
    assert shape.area == pytest.approx(0.2 + 0.16 + 0.005, abs=0.011)
    assert any(np.allclose(corner, (0.2, 0.3)) for corner in shape.boundary)


def test_a_gap_wider_than_the_robot_parts_a_narrower_joins() -> None:
    two = np.concatenate([rectangle(0.0, 0.0, 0.5, 0.5), rectangle(0.9, 0.0, 1.4, 0.5)])
    assert [round(o.area, 6) for o in outlines(two, 0.39)] == [0.25, 0.25]
    assert len(outlines(two, 0.41)) == 1


def test_holes_are_not_outlined() -> None:
    ring = np.array(
        [p for p in rectangle(0.0, 0.0, 1.0, 1.0) if max(abs(p[0] - 0.5), abs(p[1] - 0.5)) > 0.35]
    )
    (shape,) = outlines(ring, 0.15)
    assert shape.area == pytest.approx(1.0)


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, 1.0), (0.6, 0.8), (1.0, -1.0)])
def test_a_line_is_walked_there_and_back(direction: tuple[float, float]) -> None:
    points = np.outer([0.3, 0.0, 0.2, 0.1], direction) + np.array([0.7, -0.4])
    (line,) = outlines(points, 0.2)
    assert len(line.boundary) == 6
    assert line.area == pytest.approx(0.0, abs=1e-12)
    assert sorted(line.members) == [0, 1, 2, 3]


def test_single_double_and_repeated_points() -> None:
    assert outlines(np.zeros((0, 2)), 0.2) == ()
    (single,) = outlines(np.array([[1.0, 2.0]]), 0.2)
    assert single.boundary.tolist() == [[1.0, 2.0]]
    (repeated,) = outlines(np.array([[1.0, 2.0]] * 3), 0.2)
    assert repeated.members.tolist() == [0, 1, 2]
    near, far = outlines(np.array([[5.0, 0.0], [0.0, 0.0]]), 0.2)
    assert near.members.tolist() == [1]
    assert far.members.tolist() == [0]
    (pair,) = outlines(np.array([[0.0, 0.0], [0.1, 0.0]]), 0.2)
    assert pair.boundary.tolist() == [[0.0, 0.0], [0.1, 0.0]]


def test_two_triangles_on_a_bridge_walk_the_bridge_twice() -> None:
    points = np.array([[0.0, 0.1], [0.0, -0.1], [0.15, 0.0], [0.45, 0.0], [0.6, 0.1], [0.6, -0.1]])
    (shape,) = outlines(points, 0.31)
    assert len(shape.boundary) == 8
    assert shape.area == pytest.approx(0.03)


@pytest.mark.parametrize(("points", "edge"), [([[math.nan, 0.0]], 0.2), ([[0.0, 0.0]], 0.0)])
def test_bad_input_is_refused(points: list[list[float]], edge: float) -> None:
    with pytest.raises(ValueError, match="finite points"):
        outlines(np.array(points), edge)


# --------------------------------------------------------------------------- against a flood from outside


def flooded_boundary(points: Points, inside: set[int], max_edge: float) -> tuple[set[tuple[int, int]], float]:
    """Directed outer edges of one component and its enclosed area, by flooding triangles from outside.

    The flood enters a triangle over every edge that is dropped or not the component's; a kept edge is outer
    on each side where it meets flooded ground. No walking, no angles.
    """
    mesh = Delaunay(points)
    sides: dict[tuple[int, int], int] = {}
    for t, simplex in enumerate(mesh.simplices):
        a, b, c = (int(v) for v in simplex)
        (ax, ay), (bx, by), (cx, cy) = points[a], points[b], points[c]
        if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) < 0:
            b, c = c, b
        for edge in ((a, b), (b, c), (c, a)):
            sides[edge] = t

    def kept(a: int, b: int) -> bool:
        return a in inside and b in inside and math.dist(points[a], points[b]) <= max_edge

    outside: set[int] = set()
    grown = True
    while grown:
        grown = False
        for (a, b), t in sides.items():
            other = sides.get((b, a), -1)
            if t not in outside and (other == -1 or other in outside) and not kept(a, b):
                outside.add(t)
                grown = True
    # To the left of (a, b) lies its own triangle; the walk keeps the outside to its right.
    edges = {(a, b) for a, b in sides if kept(a, b) and (sides.get((b, a), -1) in {-1} | outside)}
    edges |= {(b, a) for (a, b), t in sides.items() if kept(a, b) and t in outside}
    area = 0.0
    for t, simplex in enumerate(mesh.simplices):
        if t not in outside:
            (ax, ay), (bx, by), (cx, cy) = points[simplex]
            area += abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) / 2
    return edges, area


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6), st.integers(4, 60), st.floats(0.05, 0.6))
def test_the_walk_takes_exactly_the_outer_edges(seed: int, count: int, max_edge: float) -> None:
    points = np.unique(np.random.default_rng(seed).uniform(0.0, 1.0, (count, 2)), axis=0)
    graph = kept_edges(points, max_edge)
    groups = components(graph)
    assert sorted(v for group in groups for v in group) == list(range(count))
    for group in groups:
        walk = outer_walk(points, graph, group[0])
        if len(group) == 1:
            assert walk == group
            continue
        taken = list(zip(walk, walk[1:] + walk[:1], strict=True))
        expected, area = flooded_boundary(points, set(group), max_edge)
        assert len(taken) == len(set(taken))
        assert set(taken) == expected
        x, y = points[walk].T
        assert 0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() == pytest.approx(area, abs=1e-9)


@settings(deadline=None, max_examples=30)
@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=1, max_size=30))
def test_points_on_a_grid_with_many_ties_are_all_members_once(cells: list[tuple[int, int]]) -> None:
    points = np.array(cells, dtype=np.float64) * 0.04
    found = outlines(points, 0.06)
    assert sorted(int(i) for o in found for i in o.members) == list(range(len(points)))
    for one in found:
        assert one.area >= -1e-12
        for other in found:
            if other is not one:
                gaps = points[one.members][:, None] - points[other.members][None]
                assert np.hypot(gaps[..., 0], gaps[..., 1]).min() > 0.06
