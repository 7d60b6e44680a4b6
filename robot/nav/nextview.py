"""Where to look next: the place from which a look would show most of the unseen floor for its way.

Source: the automatic next view that [B] leaves to the future (METHODS 4, last paragraph). Candidates are
places the robot can reach over floor it has seen; from each, rays are cast in the map until something
occupied ends them, and the unseen floor they cross is what the look would show. Deterministic.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Points, Pose2, wrap
from robot.nav.costfield import Body, CostField
from robot.nav.grid import ObstacleMap

VIEW_RANGE = 2.4
"""How far a look shows floor, metres."""
HALF_VIEW = math.radians(60.0)
"""Half of what is seen from one stand: the eyes' 30 degrees and as much by turning the head."""
LEAST_GAIN = 0.25
"""Square metres of unseen floor for which it is not worth going anywhere."""
APART = 0.4
"""A place nearer than this to one visited shows nothing new, metres."""
CANDIDATES = 32
_RAYS = 48
_CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)
_SHADOW = 1.5
"""Unseen floor near something occupied counts so much more: there is where a target hides."""
_SPEED, _TURN, _LOOK = 0.2, 1.0, 5.0
"""Metres and radians a second on the way, and seconds that looking round takes, to weigh gain by time."""


def next_view(
    floor: ObstacleMap,
    pose: Pose2,
    visited: Sequence[tuple[float, float]] = (),
    radius: float = 0.13,
    margin: float = 0.06,
) -> tuple[float, float, float] | None:
    """The place and heading from which to look next, or None when nothing worth it can be reached.

    Args:
        floor: the map.
        pose: of the robot, odometry frame.
        visited: places (x, y) already looked round from; none nearer than `APART` to one is returned.
        radius, margin: of the body, metres.

    Returns:
        (x, y, heading) in the odometry frame; (x, y) is reached over floor seen free.

    >>> hall = ObstacleMap()
    >>> hall.start_disc(Pose2(), 1.0)
    >>> view = next_view(hall, Pose2(), visited=[(0.0, 0.0)])
    >>> 0.4 <= math.hypot(view[0], view[1]) <= 1.0
    True
    """
    if not all(map(math.isfinite, (pose.x, pose.y, pose.yaw))):
        return None
    here = np.array([pose.x, pose.y])
    # The robot itself stands on floor, whatever the map holds of it; unseen floor is no way to go.
    field = CostField(floor, Body(radius, margin, unknown_cost=math.inf), here[None, :])
    reach = field.reach(_standing_node(field, here))
    unseen = _unseen_weight(field)
    places = _candidates(field, reach.cost, unseen, visited)
    if len(places) == 0:
        return None
    gains, headings = _best_looks(field, unseen, field.stands[places])
    turns = np.abs([wrap(float(heading) - pose.yaw) for heading in headings])
    seconds = _LOOK + reach.cost[places] / _SPEED + turns / _TURN
    worth = np.where(gains >= LEAST_GAIN, gains / seconds, -1.0)
    best = int(np.argmax(worth))
    if worth[best] < 0.0:
        return None
    x, y = field.stands[places[best]]
    return float(x), float(y), wrap(float(headings[best]))


def _standing_node(field: CostField, here: Points) -> int:
    """The passable node nearest to the robot; its own if none is."""
    away = np.hypot(*(field.stands - here).T)
    nearest = int(np.argmin(np.where(field.passable, away, np.inf)))
    return nearest if field.passable[nearest] and away[nearest] < 0.5 else field.node_at(here[0], here[1])


def _unseen_weight(field: CostField) -> NDArray[np.float32]:
    """Per node 0 where the floor was seen, else 1, more in the shadow of something occupied."""
    shadow = np.where(field.node_distance < 0.6, np.float32(_SHADOW), np.float32(1.0))
    return np.where(field.node_seen, np.float32(0.0), shadow)


def _candidates(
    field: CostField, cost: Points, unseen: NDArray[np.float32], visited: Sequence[tuple[float, float]]
) -> NDArray[np.intp]:
    """Reachable nodes away from each other and from places visited, most promising first."""
    step = 2 * field.cell
    reach = 2 * round(VIEW_RANGE / 2 / step) + 1
    about = cv2.boxFilter(unseen, -1, (reach, reach), normalize=False, borderType=cv2.BORDER_CONSTANT).ravel()
    apart = max(round(APART / step), 1)
    rows, columns = np.divmod(np.arange(cost.size), field.nodes[1])
    # The edge of the seen floor is where most is to be seen from: nodes with unseen neighbours are always in.
    edge = cv2.dilate((unseen > 0).astype(np.uint8), np.ones((3, 3), np.uint8)).ravel() > 0
    lattice = (rows % apart == 0) & (columns % apart == 0)
    thin = edge & ((rows + columns) % apart == 0)
    usable = np.isfinite(cost) & (lattice | thin)
    for x, y in visited:
        usable &= np.hypot(field.stands[:, 0] - x, field.stands[:, 1] - y) >= APART
    nodes = np.flatnonzero(usable)
    promise = about[nodes] / (_LOOK + cost[nodes] / _SPEED)
    return nodes[np.argsort(-promise, kind="stable")[:CANDIDATES]]


def _best_looks(field: CostField, unseen: NDArray[np.float32], places: Points) -> tuple[Points, Points]:
    """For places (N, 2): most square metres of unseen floor in one view, and its heading. Two arrays (N,)."""
    step = 2 * field.cell
    angles = math.tau * np.arange(_RAYS) / _RAYS
    distances = step * (np.arange(int(VIEW_RANGE / step)) + 1.0)
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None, :] * distances[None, :, None]
    index = np.floor((places[:, None, None, :] + rays[None] - field.corner) / step).astype(np.int32)
    rows, columns = index[..., 1], index[..., 0]
    # A node more than is occupied ends the rays, so that they slip through no wall seen with gaps.
    walls = cv2.dilate(field.node_occupied.astype(np.uint8), _CROSS).ravel() > 0
    # Off the lattice everything is far from what was seen and counts nothing.
    outside = (rows < 0) | (rows >= field.nodes[0]) | (columns < 0) | (columns >= field.nodes[1])
    flat = np.where(outside, 0, rows * field.nodes[1] + columns)
    blocked = outside | walls[flat]
    open_way = ~np.logical_or.accumulate(blocked, axis=2)
    area = distances.astype(np.float32) * np.float32(step * math.tau / _RAYS)
    per_ray = (unseen.ravel()[flat] * open_way) @ area
    half = round(HALF_VIEW / math.tau * _RAYS)
    # Columns of one view about every heading: (headings, rays in it).
    views = (np.arange(_RAYS)[:, None] + np.arange(-half, half + 1)[None, :]) % _RAYS
    seen = per_ray[:, views].sum(axis=2)
    best = seen.argmax(axis=1)
    # Many headings show the same; the one in the middle of what is to be seen shows it best.
    shown = np.take_along_axis(per_ray, views[best], axis=1)
    middle = np.angle((shown * np.exp(1j * angles[views[best]])).sum(axis=1))
    return np.take_along_axis(seen, best[:, None], axis=1)[:, 0], middle
