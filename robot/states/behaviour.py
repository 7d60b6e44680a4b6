"""What every state has in common: its shape, and the numbers all of them go by."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robot.messages import Event, HeadPose, Intent, Pose2, Situation


class State(Protocol):
    """One state of the chart. The loop calls `enter` once, then `step` every control tick."""

    def enter(self, situation: Situation) -> None:
        """Forget the last visit and take note of the present."""
        ...

    def step(self, situation: Situation) -> tuple[Intent, Event | None]:
        """Say what is wanted now, and at most one reason to leave."""
        ...


@dataclass(frozen=True, slots=True)
class Behaviour:
    """Numbers the states go by, from the config. Metres, radians, seconds.

    body_radius: what a way must be free for, the body's own and a little beside it.
    """

    stand_off: float = 0.7
    search_timeout: float = 60.0
    confirm_frames: int = 3
    body_radius: float = 0.16
    margin: float = 0.06
    head_forward: float = 0.06
    head_height: float = 0.25
    pan_limit: float = math.radians(80.0)
    rest_tilt: float = math.radians(20.0)


def pan_towards(x: float, y: float, behaviour: Behaviour) -> float:
    """Pan that points the head at (x, y) of the robot frame, within the head's limits."""
    pan = math.atan2(y, x - behaviour.head_forward)
    return max(-behaviour.pan_limit, min(behaviour.pan_limit, pan))


def look_at_place(place: tuple[float, float], pose: Pose2, behaviour: Behaviour) -> HeadPose:
    """Head pose that looks towards a place of the odometry frame, floor ahead still in view."""
    local = pose.to_local(np.array([place]))[0]
    return HeadPose(pan_towards(float(local[0]), float(local[1]), behaviour), behaviour.rest_tilt)


def distance_between(pose: Pose2, place: tuple[float, float]) -> float:
    """Distance on the floor from the robot's origin to a place of the odometry frame."""
    return math.hypot(place[0] - pose.x, place[1] - pose.y)
