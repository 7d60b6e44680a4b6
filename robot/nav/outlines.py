"""Obstacle points -> objects -> outlines (METHODS 4, [B]).

Delaunay triangulation of the points; edges longer than the robot's diameter dropped, for through a gap that
wide it can pass; connected components by depth-first search are the objects. An object's outline is the walk
round the unbounded face of its kept-edge graph, not its convex hull: an L keeps its free inside corner.
[B]'s own walk, upper and lower boundary by the edge nearest to the vertical, does not end on most random
components. Interior holes cannot be reached and are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError

from robot.messages import Points

Graph = dict[int, list[int]]


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """One object. Metres, in the frame of the points it was made from.

    boundary: (K, 2), the closed walk round it, counter-clockwise from the leftmost point, its first point not
    repeated; bridges are walked twice, a single point is itself. members: (M,) indices of its points.
    """

    boundary: Points
    members: NDArray[np.intp]

    @property
    def area(self) -> float:
        """Square metres enclosed, holes included; 0 for a point or a line.

        >>> [round(o.area, 6) for o in outlines(np.array([[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.1]]), 0.2)]
        [0.01]
        """
        x, y = self.boundary.T
        return float(0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def outlines(points: Points, max_edge: float) -> tuple[Outline, ...]:
    """Objects and their outlines.

    Args:
        points: (N, 2) obstacle points, finite; equal ones count once for the outline.
        max_edge: longest edge kept, the robot's diameter in metres, > 0.

    Returns:
        One `Outline` per object, ordered by the leftmost point (then the lowest). Every point is a member of
        exactly one; objects are at least `max_edge` apart.

    Raises:
        ValueError: points that are not finite, or max_edge not positive.
    """
    given = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    if not np.isfinite(given).all() or not max_edge > 0:
        raise ValueError("outlines needs finite points and a positive max_edge")
    if len(given) == 0:
        return ()
    distinct, inverse = np.unique(given, axis=0, return_inverse=True)
    inverse = np.asarray(inverse).reshape(-1)
    graph = kept_edges(distinct, max_edge)
    found = []
    for component in components(graph):
        walk = outer_walk(distinct, graph, component[0])
        found.append(Outline(distinct[walk], np.flatnonzero(np.isin(inverse, component))))
    return tuple(found)


def kept_edges(points: Points, max_edge: float) -> Graph:
    """Neighbours of every point by Delaunay edges no longer than `max_edge`; distinct points (N, 2)."""
    edges = _delaunay_edges(points)
    lengths = np.hypot(*(points[edges[:, 0]] - points[edges[:, 1]]).T)
    graph: Graph = {i: [] for i in range(len(points))}
    for a, b in edges[lengths <= max_edge].tolist():
        graph[a].append(b)
        graph[b].append(a)
    return graph


def components(graph: Graph) -> list[list[int]]:
    """Connected components by depth-first search, each sorted, ordered by their first member."""
    seen: set[int] = set()
    found = []
    for root in sorted(graph):
        if root in seen:
            continue
        seen.add(root)
        stack, members = [root], []
        while stack:
            vertex = stack.pop()
            members.append(vertex)
            fresh = [other for other in graph[vertex] if other not in seen]
            seen.update(fresh)
            stack.extend(fresh)
        found.append(sorted(members))
    return found


def outer_walk(points: Points, graph: Graph, leftmost: int) -> list[int]:
    """The walk round the unbounded face of the component of its leftmost vertex, counter-clockwise.

    At every vertex the next edge is the one that follows the reversed incoming edge in counter-clockwise
    order; the walk ends when its first directed edge would be taken again. Each directed edge is taken at
    most once, so it always ends.

    Args:
        points: (N, 2).
        graph: neighbours of every vertex; its edges cross nowhere.
        leftmost: vertex with the smallest x (of those, the smallest y) of its component.

    Returns:
        Vertices in order, the first not repeated at the end.
    """
    if not graph[leftmost]:
        return [leftmost]
    # Nothing lies to the left, so coming "from the left" starts the walk with the outside on its right.
    first = _next_counterclockwise(points, graph, leftmost, math.pi)
    walk = [leftmost]
    previous, vertex = leftmost, first
    while True:
        back = math.atan2(*(points[previous] - points[vertex])[::-1])
        following = _next_counterclockwise(points, graph, vertex, back, previous)
        if vertex == leftmost and following == first:
            return walk
        walk.append(vertex)
        previous, vertex = vertex, following


def _next_counterclockwise(
    points: Points, graph: Graph, vertex: int, reference: float, back_to: int | None = None
) -> int:
    """The neighbour whose direction follows `reference` first; back where one came from only at last."""

    def turn(other: int) -> float:
        if other == back_to:
            return math.tau
        direction = math.atan2(*(points[other] - points[vertex])[::-1])
        return (direction - reference) % math.tau

    return min(graph[vertex], key=turn)


def _delaunay_edges(points: Points) -> NDArray[np.intp]:
    """Edges (E, 2) of the triangulation, each once; of points on a line, the chain along it."""
    if len(points) < 3 or _collinear(points):
        return _chain(points)
    try:
        mesh = Delaunay(points - points.mean(axis=0))
    except QhullError:
        return _chain(points)
    pairs = np.concatenate([mesh.simplices[:, [0, 1]], mesh.simplices[:, [1, 2]], mesh.simplices[:, [2, 0]]])
    # A point Qhull left out (it coincides with a vertex to rounding) hangs on the vertex nearest to it.
    pairs = np.concatenate([pairs, mesh.coplanar[:, [0, 2]]]).astype(np.intp)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _collinear(points: Points) -> bool:
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[1] <= 1e-9 * max(spread[0], 1e-300))


def _chain(points: Points) -> NDArray[np.intp]:
    """Edges (N - 1, 2) that join points on a line to their neighbours on it."""
    if len(points) < 2:
        return np.zeros((0, 2), np.intp)
    centred = points - points.mean(axis=0)
    direction = np.linalg.svd(centred, full_matrices=False)[2][0]
    order = np.argsort(centred @ direction, kind="stable")
    return np.column_stack([order[:-1], order[1:]])
