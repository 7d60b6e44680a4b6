"""trajectory.png of a simulated run: the true ways beside what the wheels believed, in the room's frame."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from robot.record.recorder import WayPoint
from robot.record.run_folder import RunFolder
from robot.record.scenery import Outline, Scenery, Stamped
from robot.record.trajectory import plot_trajectory
from robot.sim import referee


def plot_run(
    folder: RunFolder,
    truth: referee.Scenery,
    times: Sequence[float],
    way: Sequence[WayPoint],
    title: str,
) -> None:
    """Draw it; a disk that is full ends the record, not the run.

    times: the robot's clock at each world tick (the true ways have one place before the first of them).
    way: the robot's own record, one point a control tick.
    """
    changes = [(way[0].now, way[0].state)] if way else []
    changes += [(b.now, b.state) for a, b in pairwise(way) if a.state != b.state]
    wheels = truth.start.to_world(np.array([(step.pose.x, step.pose.y) for step in way]).reshape(-1, 2))
    end = way[-1].now if way else 0.0
    scenery = Scenery(
        room=truth.room,
        path_true=_stamped(times, truth.robot_path[1:]),
        path_odometry=_stamped([step.now for step in way], [(float(x), float(y)) for x, y in wheels]),
        target_path=_stamped(times, truth.target_path[1:]),
        obstacles=tuple(Outline(thing.kind, thing.corners, thing.kind == "step") for thing in truth.things),
        state_changes=tuple(changes),
        detours=tuple(_detours(changes, end)),
    )
    with folder.recording.guarded(end):
        plot_trajectory(folder.trajectory_path, scenery, title)


def _stamped(times: Sequence[float], places: Sequence[tuple[float, float]]) -> tuple[Stamped, ...]:
    return tuple((at, x, y) for at, (x, y) in zip(times, places, strict=False))


def _detours(changes: list[tuple[float, str]], end: float) -> list[tuple[float, float]]:
    """The times in AVOID."""
    ends = [at for at, _ in changes[1:]] + [end]
    return [(at, until) for (at, state), until in zip(changes, ends, strict=True) if state == "avoid"]
