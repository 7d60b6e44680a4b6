"""Map, planner, body and guard together: a body that does as told drives through a house of walls unharmed.

Perfect eyes and wheels, real latency: looks come in 0.12 s late, at 8 a second, from a head that follows the
body's own wishes. What is under test is that the pieces fit: nothing touches, and the end is reached.
"""

from __future__ import annotations

import math
from functools import partial

import pytest
from flatworld import Wall, box, distance, driven, look

from robot.body.wheels import WheelsBody
from robot.guard import GuardInput, GuardLimits, guard
from robot.messages import Follow, HeadPose, Intent, Odometry, Pose2, Twist
from robot.nav.grid import ObstacleMap
from robot.nav.planner import plan

PERIOD = 0.04
RADIUS = 0.13
NEAR_AT_REST, NEAR_LOOKING_DOWN = 0.31, 0.17

GAP: list[Wall] = [*box(-1.0, -1.5, 3.0, 1.5), (1.0, -1.5, 1.0, 0.3), (1.0, 0.66, 1.0, 1.5)]
TRAP: list[Wall] = [*box(-1.0, -1.6, 3.0, 1.6), (1.2, -0.7, 1.2, 0.6), (0.4, 0.6, 1.2, 0.6)]
POSTS: list[Wall] = [*box(-1.0, -1.5, 3.0, 1.5)]
for _x, _y in ((0.6, 0.05), (1.1, -0.4), (1.2, 0.35), (1.6, -0.02)):
    POSTS += box(_x, _y, _x + 0.03, _y + 0.03)


def drive(walls: list[Wall], goal: tuple[float, float], seconds: float) -> tuple[list[Pose2], float]:
    """The poses driven, and the smallest true distance of the body's middle to a wall."""
    floor, body, limits, start = ObstacleMap(), WheelsBody(), GuardLimits(), Pose2()
    floor.start_disc(start, 0.35)
    pose, twist, head, held = start, Twist(), HeadPose(0.0, math.radians(20.0)), False
    trail, nearest = [pose], math.inf
    path: tuple[tuple[float, float], ...] = ()
    pending: list[tuple[float, Pose2, HeadPose]] = []
    seen_at: float | None = None
    for k in range(round(seconds / PERIOD)):
        now = k * PERIOD
        if k % 3 == 0:
            pending.append((now, pose, head))
        if pending and now >= pending[0][0] + 0.12:
            at, where, eyes = pending.pop(0)
            near = NEAR_LOOKING_DOWN if eyes.tilt > math.radians(40.0) else NEAR_AT_REST
            floor.update(look(walls, where, eyes.pan, near), where, at)
            seen_at = at
        if k % 20 == 5:
            path = plan(floor, (pose.x, pose.y), goal, RADIUS, 0.06) or ()
        intent = Intent(look=HeadPose(0.0, math.radians(20.0)), motion=Follow(path))
        command = body.command(intent, Odometry(pose, twist, now), held, now)
        asked = partial(floor.arc_clearance, pose, half_width=RADIUS + 0.01, max_range=1.0, now=now)
        sent = guard(
            command, GuardInput(now, PERIOD, twist, seen_at, asked, floor.disc_free(pose, RADIUS)), limits
        )
        held = sent.limited_by is not None and sent.limited_by.startswith("unknown")
        head, twist = sent.head or head, sent.twist
        pose = driven(pose, twist, PERIOD)
        nearest = min(nearest, distance(walls, pose.x, pose.y))
        trail.append(pose)
        if math.dist((pose.x, pose.y), goal) < 0.08:
            break
    return trail, nearest


@pytest.mark.parametrize(
    ("walls", "goal", "seconds"),
    [(GAP, (1.8, -0.6), 60.0), (TRAP, (1.8, 0.0), 90.0), (POSTS, (2.3, 0.0), 60.0)],
    ids=["gap of 36 cm", "L-shaped trap", "thin posts"],
)
def test_the_goal_is_reached_and_nothing_is_touched(
    walls: list[Wall], goal: tuple[float, float], seconds: float
) -> None:
    trail, nearest = drive(walls, goal, seconds)
    assert nearest > RADIUS
    assert math.dist((trail[-1].x, trail[-1].y), goal) < 0.08


def test_a_goal_behind_closed_walls_is_not_reached_and_nothing_is_touched() -> None:
    walls = [*box(-1.0, -1.0, 1.0, 1.0), (0.5, -1.0, 0.5, 1.0)]
    trail, nearest = drive(walls, (0.75, 0.0), 15.0)
    assert nearest > RADIUS
    assert trail[-1].x < 0.5
