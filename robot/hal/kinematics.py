"""Two driven wheels: twist to wheel rates and back, limits, and the arc driven. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot.messages import Pose2, Twist


@dataclass(frozen=True, slots=True)
class Wheels:
    """Geometry of a differential base: wheel radius and distance between the contact points, in metres."""

    radius: float
    track_width: float

    def __post_init__(self) -> None:
        if not (self.radius > 0 and self.track_width > 0):
            raise ValueError(f"radius {self.radius} and track width {self.track_width} must be positive")

    def rates(self, twist: Twist) -> tuple[float, float]:
        """Wheel rates (left, right) in rad/s: (v -+ w track/2) / radius.

        >>> Wheels(radius=0.05, track_width=0.2).rates(Twist(v=0.1, w=1.0))
        (0.0, 4.0)
        """
        half = twist.w * self.track_width / 2
        return (twist.v - half) / self.radius, (twist.v + half) / self.radius

    def twist(self, left: float, right: float) -> Twist:
        """The twist that wheel rates (rad/s) make; with angles (rad) instead, the way and the turn."""
        return Twist(v=(left + right) * self.radius / 2, w=(right - left) * self.radius / self.track_width)


@dataclass(frozen=True, slots=True)
class Limits:
    """The most a base does: forward speed m/s, turning rate rad/s, wheel rate rad/s."""

    speed: float
    turn: float
    wheel_rate: float = math.inf


def limited(twist: Twist, limits: Limits, wheels: Wheels) -> Twist:
    """The twist scaled down as a whole until every limit holds, so that the curve keeps its shape.

    A twist that is not a number asks for nothing: it becomes the stop.

    >>> limited(Twist(v=1.0, w=2.0), Limits(speed=0.25, turn=3.0), Wheels(0.03, 0.15))
    Twist(v=0.25, w=0.5)
    """
    if not (math.isfinite(twist.v) and math.isfinite(twist.w)):
        return Twist()
    left, right = wheels.rates(twist)
    excess = max(
        _share(abs(twist.v), limits.speed),
        _share(abs(twist.w), limits.turn),
        _share(max(abs(left), abs(right)), limits.wheel_rate),
    )
    if excess == math.inf:
        return Twist()
    return twist if excess <= 1.0 else Twist(twist.v / excess, twist.w / excess)


def arc(pose: Pose2, way: float, turn: float) -> Pose2:
    """The pose after driving `way` metres while turning by `turn` radians at an even rate: exact, no steps.

    >>> end = arc(Pose2(), way=math.pi / 2, turn=math.pi / 2)  # a quarter of a circle of radius 1
    >>> round(end.x, 9), round(end.y, 9)
    (1.0, 1.0)
    """
    half = turn / 2
    # sin(x)/x by its series where the division would lose the digits.
    chord = way * (math.sin(half) / half if abs(half) > 1e-6 else 1.0 - half * half / 6)
    return pose.compose(Pose2(chord * math.cos(half), chord * math.sin(half), turn))


def _share(value: float, limit: float) -> float:
    if value == 0.0:
        return 0.0
    return value / limit if limit > 0 else math.inf
