"""How fast the arm may move with things near it. Pure.

The arm is seen as a chain of straight links of one thickness; what comes near any of them slows the whole
arm, down to a stand. The target is what the arm is to reach, so what lies about it does not count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from robot.hal.interfaces import ArmState
from robot.messages import Points, Timed

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class ArmShape:
    """Where the links are (metres). Joints 1 and 2 place the elbow, the flange's pose the wrist.

    shoulder_height, shoulder_forward: second joint's axis above the base and ahead of the first one's.
    upper_arm: from there to the elbow. wrist: from the wrist's centre to the flange. radius: of all links.
    The defaults are those of an arm of the 850 mm class (DENSO VS-6577G).
    """

    shoulder_height: float = 0.335
    shoulder_forward: float = 0.075
    upper_arm: float = 0.365
    wrist: float = 0.080
    radius: float = 0.08

    def chain(self, arm: ArmState) -> Points:
        """Base, shoulder, elbow, wrist and flange, (5, 3), in the arm's base frame."""
        pan, lean = arm.joints[0], arm.joints[1]
        forward = np.array([math.cos(pan), math.sin(pan), 0.0])
        up = np.array([0.0, 0.0, 1.0])
        shoulder = self.shoulder_forward * forward + self.shoulder_height * up
        elbow = shoulder + self.upper_arm * (math.sin(lean) * forward + math.cos(lean) * up)
        flange = np.array(arm.position)
        wrist = flange - self.wrist * _looks_along(arm.orientation)
        return np.array([np.zeros(3), shoulder, elbow, wrist, flange])


@dataclass(frozen=True, slots=True)
class ArmGuardSettings:
    """slow_from, stop_at: distance (m) from a link's surface where slowing begins and where it stands.

    target_radius: what is within so many metres of the target belongs to it. max_age: older obstacles (s)
    are none. blind_share: the most (0..1) without recent ones, or if one of them is no number.
    """

    slow_from: float = 0.5
    stop_at: float = 0.12
    target_radius: float = 0.1
    max_age: float = 0.5
    blind_share: float = 0.1
    shape: ArmShape = ArmShape()

    def __post_init__(self) -> None:
        """Raises ValueError if the slope would not fall."""
        if not 0.0 <= self.stop_at < self.slow_from:
            raise ValueError(f"stop_at {self.stop_at} must be >= 0 and below slow_from {self.slow_from}")


_DEFAULTS: Final = ArmGuardSettings()


def speed_share(
    obstacles: Timed[Points] | None,
    arm: ArmState,
    target: Triple | None,
    now: float,
    settings: ArmGuardSettings = _DEFAULTS,
) -> float:
    """The share 0..1 of its speed the arm may have.

    obstacles: points (N, 3), or (N, 2) for what stands on the floor, of unknown height, in the arm's base
    frame (`to_arm_frame`), with their time; must not hold the arm itself. target: in the same frame.

    >>> arm = ArmState((0.0,) * 6, (0.4, 0.0, 0.9), (0.0, 0.0, 0.0), True, False, True)
    >>> def near(*point: float) -> float:
    ...     return round(speed_share(Timed(np.array([point]), at=5.0), arm, (0.6, 0.0, 0.9), now=5.1), 2)
    >>> near(2.0, 0.0, 0.9), near(0.4, 0.4, 0.9), near(0.4, 0.1, 0.9), near(0.6, 0.05, 0.9)
    (1.0, 0.53, 0.0, 1.0)
    """
    if obstacles is None or not 0.0 <= obstacles.age(now) <= settings.max_age:
        return settings.blind_share
    points = np.asarray(obstacles.value, dtype=np.float64)
    if points.size == 0:
        return 1.0
    known = np.isfinite(points).all(axis=1)
    most = 1.0 if known.all() else settings.blind_share
    distance = _nearest(_without_target(points[known], target, settings.target_radius), arm, settings.shape)
    slope = (distance - settings.stop_at) / (settings.slow_from - settings.stop_at)
    return min(most, max(0.0, slope))


def to_arm_frame(points: Points, forward: float, left: float, up: float = 0.0) -> Points:
    """Points (N, 2) or (N, 3) of the robot frame in the frame of an arm mounted there, looking forward.

    >>> to_arm_frame(np.array([[1.0, 0.5]]), forward=0.2, left=0.1).tolist()
    [[0.8, 0.4]]
    """
    result: Points = np.asarray(points, dtype=np.float64) - np.array([forward, left, up])[: points.shape[1]]
    return result


def _without_target(points: Points, target: Triple | None, radius: float) -> Points:
    if target is None or len(points) == 0:
        return points
    away = np.linalg.norm(points - np.array(target)[: points.shape[1]], axis=1)
    kept: Points = points[~(away <= radius)]
    return kept


def _nearest(points: Points, arm: ArmState, shape: ArmShape) -> float:
    """From the nearest point to the surface of the nearest link; inf without points, nan if the arm's is."""
    if len(points) == 0:
        return math.inf
    chain = shape.chain(arm)[:, : points.shape[1]]
    distances = [_to_segment(points, a, b) for a, b in pairwise(chain)]
    return float(np.min(distances)) - shape.radius


def _to_segment(points: Points, a: Points, b: Points) -> Points:
    way = b - a
    length = float(way @ way)
    share = np.clip((points - a) @ way / length, 0.0, 1.0) if length > 0.0 else np.zeros(len(points))
    result: Points = np.linalg.norm(points - (a + share[:, None] * way), axis=1)
    return result


def _looks_along(angles: Triple) -> Points:
    """The flange's own z axis: the third column of Rz(rz) Ry(ry) Rx(rx)."""
    (sx, sy, sz), (cx, cy, cz) = np.sin(angles), np.cos(angles)
    return np.array([cz * sy * cx + sz * sx, sz * sy * cx - cz * sx, cy * cx])
