"""Ways round what stands in the way: straight segments joined by turns, for a body of its real size.

A path is a tuple of (x, y) in the odometry frame, two or more, the first is the start: what
`robot.messages.Follow` takes. Source: the path [B] leaves to the future (METHODS 4, last paragraph).
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from robot.messages import Points
from robot.nav.costfield import Body, CostField, Reach
from robot.nav.grid import ObstacleMap

Point = tuple[float, float]
Path = tuple[Point, ...]

GOAL_SLACK = 0.25
"""A goal that cannot be stood on is replaced by the nearest place that can, at most so far away (metres)."""
ESCAPE = 0.6
"""So far a robot that stands too near to something looks for a place to start from (metres)."""
NEARNESS = 5.0
"""What a metre too near to the target or too far off costs, in metres of way. With less, staying where the
straight way is blocked was cheaper than going round, and TRACK and AVOID took turns for ever."""
TARGET_SIZE = 0.2
"""Occupied cells so near to a target's middle are the target itself (metres)."""


def plan(
    floor: ObstacleMap,
    start: Point,
    goal: Point,
    radius: float,
    margin: float,
    unknown_cost: float = 3.0,
    now: float = 0.0,
    memory_s: float = math.inf,
) -> Path | None:
    """The cheapest way from start to goal, or None if there is none.

    The body's middle never comes nearer than `radius` to what is occupied; less than `margin` beyond that
    costs more, and so does unseen floor. A start too near to an obstacle is first left outwards; a goal that
    cannot be stood on is moved by at most `GOAL_SLACK`.

    Args:
        floor: the map.
        start, goal: (x, y) in the odometry frame.
        radius, margin: of the body, metres.
        unknown_cost: price of a metre of unseen floor in metres of seen floor, >= 1.
        now, memory_s: floor seen free longer ago than memory_s counts as unseen.

    >>> plan(ObstacleMap(), (0.0, 0.0), (1.0, 0.5), radius=0.13, margin=0.06)
    ((0.0, 0.0), (1.0, 0.5))
    """
    if not all(map(math.isfinite, (*start, *goal))) or max(map(abs, goal)) >= -floor.origin:
        return None
    a, b = np.array(start, dtype=np.float64), np.array(goal, dtype=np.float64)
    field = CostField(floor, Body(radius, margin, unknown_cost), np.stack([a, b]), now, memory_s)
    cost, nearest = field.straight_costs(a, b[None, :])
    # Nothing can be cheaper than a straight line over seen, uncrowded floor.
    if nearest[0] >= radius and (cost[0] <= 1.001 * math.dist(start, goal) or not field.seen.any()):
        return _points(np.stack([a, b]))
    origin = _start_node(field, a)
    if origin is None:
        return None
    reach = field.reach(origin)
    node = field.node_at(*goal)
    if math.isfinite(field.price_at(b)) and math.isfinite(reach.cost[node]):
        return _path(field, reach, a, node, b)
    nearby = _goal_node(field, reach, b)
    return None if nearby is None else _path(field, reach, a, nearby, None)


def plan_to_view(
    floor: ObstacleMap,
    start: Point,
    target: Point,
    stand_off: float,
    radius: float,
    margin: float,
    unknown_cost: float = 3.0,
    now: float = 0.0,
    memory_s: float = math.inf,
) -> Path | None:
    """The cheapest way to a place about `stand_off` metres from the target that sees it.

    Places 0.7 to 1.6 times the stand-off away are weighed by the cost of the way plus `NEARNESS` times how
    much their distance is off. Occupied cells within `TARGET_SIZE` of the target are the target itself and
    hide nothing.
    Heights are not known here: what one could look over counts as hiding.

    Returns:
        The path, or None if no such place can be reached.
    """
    if not all(map(math.isfinite, (*start, *target))):
        return None
    here, middle = np.array(start, dtype=np.float64), np.array(target, dtype=np.float64)
    field = CostField(floor, Body(radius, margin, unknown_cost), np.stack([here, middle]), now, memory_s)
    away = np.hypot(*(field.stands - middle).T)
    ring = np.flatnonzero((away >= 0.7 * stand_off) & (away <= 1.6 * stand_off) & field.passable)
    ring = ring[field.sight_free(field.stands[ring], middle, TARGET_SIZE)]
    origin = _start_node(field, here)
    if origin is None or len(ring) == 0:
        return None
    reach = field.reach(origin)
    worth = reach.cost[ring] + NEARNESS * np.abs(away[ring] - stand_off)
    best = int(np.argmin(worth))
    if not math.isfinite(worth[best]):
        return None
    return _path(field, reach, here, int(ring[best]), None)


def path_length(path: Path) -> float:
    """Metres along a path.

    >>> path_length(((0.0, 0.0), (3.0, 4.0), (3.0, 5.0)))
    6.0
    """
    return sum(math.dist(a, b) for a, b in pairwise(path))


def corridor_free(floor: ObstacleMap, start: Point, goal: Point, half_width: float) -> bool:
    """True if no occupied cell's middle lies within `half_width` of the straight segment from start to goal.

    Cells behind the start do not count. Unseen floor is not asked for: see `ObstacleMap.clearance`.
    """
    a, b = np.array(start, dtype=np.float64), np.array(goal, dtype=np.float64)
    points = floor.occupied_about(np.stack([a, b]), half_width) - a
    if len(points) == 0:
        return True
    length = math.dist(start, goal)
    if length == 0.0:
        return not bool((np.hypot(*points.T) < half_width).any())
    direction = (b - a) / length
    along = points @ direction
    nearest = points - np.clip(along, 0.0, length)[:, None] * direction
    return not bool(((along > 0.0) & (np.hypot(*nearest.T) < half_width)).any())


# ---------------------------------------------------------------------------------------------------- inside


def _points(points: Points) -> Path:
    return tuple((float(x), float(y)) for x, y in points)


def _goal_node(field: CostField, reach: Reach, goal: Points) -> int | None:
    away = np.hypot(*(field.stands - goal).T)
    away[~np.isfinite(reach.cost)] = np.inf
    best = int(np.argmin(away))
    return best if away[best] <= GOAL_SLACK else None


def _start_node(field: CostField, start: Points) -> int | None:
    """The node to start from: the one here or, in a crowded place, the nearest that is left outwards to."""
    node = field.node_at(float(start[0]), float(start[1]))
    if field.passable[node]:
        return node
    away = np.hypot(*(field.stands - start).T)
    near = np.flatnonzero((away <= ESCAPE) & field.passable)
    near = near[np.argsort(away[near], kind="stable")]
    if len(near) == 0:
        return None
    _, nearest = field.straight_costs(start, field.stands[near])
    # A cell of slack, or a robot between two things that touch its circle could not leave sideways.
    outward = np.flatnonzero(nearest >= field.distance[field.fine(start)] - field.cell)
    return int(near[outward[0]]) if len(outward) else None


def _path(field: CostField, reach: Reach, start: Points, node: int, goal: Points | None) -> Path:
    """The way from start to a node and, if given, on to a goal in that node's block."""
    nodes = np.array(reach.trace(node), dtype=np.intp)
    inner = field.stands[nodes[1:] if len(nodes) > 1 else nodes]
    pieces = [start[None, :], inner] if goal is None else [start[None, :], inner[:-1], goal[None, :]]
    return _points(_pulled_tight(field, np.concatenate(pieces)))


def _pulled_tight(field: CostField, points: Points) -> Points:
    """Leave out points wherever the straight line costs no more and comes no nearer than the way does."""
    piece_cost, piece_nearest = _pieces(field, points)
    kept: list[int] = [0]
    while kept[-1] < len(points) - 1:
        i = kept[-1]
        along = np.cumsum(piece_cost[i:])
        allowed = np.minimum(np.minimum.accumulate(piece_nearest[i:]), field.body.radius)
        cost, nearest = field.straight_costs(points[i], points[i + 1 :])
        good = np.flatnonzero((cost <= 1.02 * along + 1e-9) & (nearest >= allowed - 1e-6))
        kept.append(i + 1 + (int(good[-1]) if len(good) else 0))
    return points[np.array(kept, dtype=np.intp)]


def _pieces(field: CostField, points: Points) -> tuple[Points, Points]:
    """Cost and smallest obstacle distance of each piece of a polyline (N, 2): two arrays (N - 1,)."""
    t = np.array([0.125, 0.375, 0.625, 0.875])
    steps = np.diff(points, axis=0)
    samples = points[:-1, None, :] + t[None, :, None] * steps[:, None, :]
    rows, columns = field.fine(samples)
    distance = field.distance[rows, columns]
    lengths: NDArray[np.float64] = np.hypot(*steps.T)
    price = field.soft_price(distance, field.seen[rows, columns])
    return lengths * price.mean(axis=1), np.asarray(distance.min(axis=1), dtype=np.float64)
