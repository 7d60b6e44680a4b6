"""What a top view of a run holds: room, bodies, ways. Plain values, so that anybody can make them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robot.messages import Points

Stamped = tuple[float, float, float]
"""(time s, x m, y m)"""


@dataclass(frozen=True, slots=True)
class Outline:
    """The true outline of a body on the floor: polygon in metres; low: the robot can see over it."""

    name: str
    points: tuple[tuple[float, float], ...]
    low: bool = False


@dataclass(frozen=True, slots=True)
class Scenery:
    """Everything the plot shows, in metres and seconds of one common room frame. All but `room` may be empty.

    room: the walls' inner outline. path_true: where the robot was. path_odometry: where its wheels believed
    it was. target_path: where the target was. obstacles: true outlines. state_changes: (time, state) when
    each state began, ascending. detours: (from, to) times in which the robot went around something.
    robot_radius: for the circles at start and end.
    """

    room: tuple[tuple[float, float], ...]
    path_true: tuple[Stamped, ...] = ()
    path_odometry: tuple[Stamped, ...] = ()
    target_path: tuple[Stamped, ...] = ()
    obstacles: tuple[Outline, ...] = ()
    state_changes: tuple[tuple[float, str], ...] = ()
    detours: tuple[tuple[float, float], ...] = ()
    robot_radius: float = 0.13


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """A piece of the way in one state: points (N, 2)."""

    state: str
    points: Points


def stretches(path: Sequence[Stamped], state_changes: Sequence[tuple[float, str]]) -> tuple[Stretch, ...]:
    """Cut the path where the state changed; neighbouring pieces share their point.

    >>> path = [(0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (2.0, 2.0, 0.0)]
    >>> [(s.state, len(s.points)) for s in stretches(path, [(0.0, "search"), (1.0, "track")])]
    [('search', 2), ('track', 2)]
    """
    if not path:
        return ()
    begins = [at for at, _ in state_changes]
    states = [state for _, state in state_changes]
    of_point = [int(np.searchsorted(begins, t + 1e-9)) - 1 for t, _, _ in path]
    cuts = [0] + [i for i in range(1, len(path)) if of_point[i] != of_point[i - 1]] + [len(path) - 1]
    places = np.array([(x, y) for _, x, y in path])
    return tuple(
        Stretch(states[of_point[a]] if of_point[a] >= 0 else "idle", places[a : b + 1])
        for a, b in pairwise(cuts)
        if b > a or len(path) == 1
    )


def place_at(path: Sequence[Stamped], at: float) -> tuple[float, float]:
    """Where a stamped path was at a time, between its points in a straight line, at its ends beyond them."""
    times = [t for t, _, _ in path]
    return (
        float(np.interp(at, times, [x for _, x, _ in path])),
        float(np.interp(at, times, [y for _, _, y in path])),
    )
