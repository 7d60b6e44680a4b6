"""The last layer before the actuators: what may be sent of what was asked for. Pure; time is an argument.

Rules, in the order in which they are applied:

1. An expired command, an active stop fault or a number that is none: stop, at once and without a ramp.
2. Speed and turning rate within the limits, scaled together so that the curve keeps its shape; gathering
   speed within the acceleration limit, losing it always at once.
3. Turning on the spot only where the map shows nothing inside the body's circle.
4. Driving, forwards or backwards, only over floor seen free, with free space younger than its limit, and so
   slowly that v (age + latency) + v^2 / (2 a) stays within the free distance less the margin.
5. A person at the stick drives without working vision, or into unseen floor, at a capped speed.
6. Where the bumper touches nothing drives forwards, whoever drives; where the sonar hears something, no
   faster than by rule 4. Sonar and bumper only ever take away.

The caller gives what was measured (`GuardInput`); `Sent.limited_by` says in words what was taken away.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from robot.messages import Clearance, Command, HeadPose, Near, Sent, Twist

_SLOWEST_TURN = 0.1
"""On the spot, turning rates below this (rad/s) move no wheel."""
_CREEP = 0.005
"""Speeds below this (m/s) move no motor: they are a stop, said so."""
_NOTHING = 1e-9
"""Metres that are none."""
_ENDLESS = 1e6
"""Metres: more free distance than this changes nothing, but would overflow."""


@dataclass(frozen=True, slots=True)
class GuardLimits:
    """What the guard keeps. m, s, rad; all finite and not negative, accelerations positive.

    margin: metres kept between the body's edge and what ends the free way. latency: seconds from decision to
    turning wheels. free_space_max_age: no translation on older looks. blind_speed: top speed of a person
    without vision. sonar_inset: metres by which the sonar's face lies behind the body's front edge.
    near_max_age: older readings of bumper and sonar say nothing.
    """

    max_speed: float = 0.25
    max_turn: float = math.radians(70.0)
    max_acceleration: float = 0.6
    max_turn_acceleration: float = 6.0
    margin: float = 0.06
    latency: float = 0.12
    free_space_max_age: float = 0.3
    blind_speed: float = 0.08
    sonar_inset: float = 0.0
    near_max_age: float = 0.5

    def __post_init__(self) -> None:
        values = [getattr(self, name) for name in self.__slots__]
        if not all(math.isfinite(value) and value >= 0.0 for value in values):
            raise ValueError(f"guard limits must be finite and not negative: {self}")
        if self.max_acceleration == 0.0 or self.max_turn_acceleration == 0.0:
            raise ValueError(f"guard accelerations must be positive: {self}")


@dataclass(frozen=True, slots=True)
class GuardInput:
    """What the guard decides on.

    now: seconds. period: seconds since the last decision. previous: the twist sent then.
    free_space_at: capture time of the newest look at the floor, None before the first.
    clearance: free way along the arc of a twist that has forward or backward speed
    (`ObstacleMap.arc_clearance` with pose and time filled in); asked at most once.
    turn_free: nothing stands inside the body's circle. stop: why everything must stand (an active stop
    fault), None if nothing is wrong. teleop: a person holds the stick. near: bumper and sonar, if any.
    """

    now: float
    period: float
    previous: Twist
    free_space_at: float | None
    clearance: Callable[[Twist], Clearance]
    turn_free: bool
    stop: str | None = None
    teleop: bool = False
    near: Near | None = None


def safe_speed(free_distance: float, age: float, latency: float, acceleration: float) -> float:
    """The largest v with v (age + latency) + v^2 / (2 acceleration) <= free_distance, in m/s.

    Args:
        free_distance: metres that may be used up, margin already taken off; <= 0 gives 0.
        age: of the percept behind that distance, seconds.
        latency: from decision to turning wheels, seconds.
        acceleration: with which the body brakes, m/s^2, > 0.

    Returns:
        0 or more; 0 for anything that is not a number.

    >>> v = safe_speed(0.5, age=0.1, latency=0.1, acceleration=0.5)
    >>> round(v * 0.2 + v * v / (2 * 0.5), 9)
    0.5
    """
    if not all(map(math.isfinite, (free_distance, age, latency, acceleration))):
        return 0.0
    if free_distance <= _NOTHING or acceleration <= 0.0:
        return 0.0
    delay = max(age + latency, 0.0)
    distance = min(free_distance, _ENDLESS)
    # The positive root, written without the difference of two like numbers.
    return 2.0 * distance / (delay + math.hypot(delay, math.sqrt(2.0 * distance / acceleration)))


def guard(command: Command, state: GuardInput, limits: GuardLimits) -> Sent:
    """What may be sent of a command.

    Never faster than commanded, than the limits or than the free distance allows; on any doubt it stops.
    Head and lamp pass through, but an expired command moves no head.
    """
    if not _finite(state.now, command.expires_at) or command.expires_at <= state.now:
        return Sent(Twist(), None, _lamp(command), "command expired")
    standing = Sent(Twist(), _head(command), _lamp(command))
    wanted = command.twist
    if state.stop is not None:
        return replace(standing, limited_by=f"stop: {state.stop}")
    numbers = (wanted.v, wanted.w, state.period, state.previous.v, state.previous.w)
    if not _finite(*numbers) or state.period < 0.0:
        return replace(standing, limited_by="a number that is none")

    shaped, why = _within_limits(wanted, state, limits)
    if shaped.v == 0.0:
        allowed, reason = _turning(shaped, state)
    else:
        allowed, reason = _driving(shaped, state, limits)
        allowed, felt = _felt(allowed, state, limits)
        reason = felt or reason
    return replace(standing, twist=allowed, limited_by=reason or why)


# ------------------------------------------------------------------------------------------ limits, ramp


def _within_limits(wanted: Twist, state: GuardInput, limits: GuardLimits) -> tuple[Twist, str | None]:
    share = min(1.0, _share(limits.max_speed, wanted.v), _share(limits.max_turn, wanted.w))
    v = _ramped(wanted.v * share, state.previous.v, limits.max_acceleration * state.period)
    w = _ramped(wanted.w * share, state.previous.w, limits.max_turn_acceleration * state.period)
    if v != wanted.v * share or w != wanted.w * share:
        return Twist(v, w), "acceleration"
    return Twist(v, w), "speed limit" if share < 1.0 else None


def _share(limit: float, value: float) -> float:
    return limit / abs(value) if abs(value) > limit else 1.0


def _ramped(wanted: float, previous: float, step: float) -> float:
    """Towards `wanted`: slower at once, faster by at most `step`; through zero it starts again from zero."""
    base = abs(previous) if previous * wanted > 0.0 else 0.0
    return math.copysign(min(abs(wanted), base + step), wanted) if wanted != 0.0 else 0.0


# --------------------------------------------------------------------------------------- turning, driving


def _turning(twist: Twist, state: GuardInput) -> tuple[Twist, str | None]:
    if twist.w == 0.0 or state.turn_free:
        return Twist(0.0, twist.w), None
    return Twist(), "no room to turn"


def _driving(twist: Twist, state: GuardInput, limits: GuardLimits) -> tuple[Twist, str | None]:
    age = _free_space_age(state)
    if age is None or age > limits.free_space_max_age:
        why = "no free space seen yet" if age is None else f"free space {age:.2f} s old"
        if state.teleop:
            return _capped(twist, limits.blind_speed, f"{why}: blind speed")
        return _on_the_spot(twist, state, why)
    ahead = state.clearance(twist)
    free = ahead.distance - limits.margin
    speed = safe_speed(free, age, limits.latency, limits.max_acceleration)
    if state.teleop and ahead.limited_by == "unknown" and speed < limits.blind_speed:
        return _capped(twist, limits.blind_speed, "unseen floor: blind speed")
    if speed >= abs(twist.v):
        return twist, None
    known = math.isfinite(ahead.distance)
    why = f"{ahead.limited_by} in {ahead.distance:.2f} m" if known else "clearance unknown"
    if speed < _CREEP:
        return _on_the_spot(twist, state, why)
    return _scaled(twist, speed / abs(twist.v)), why


def _felt(twist: Twist, state: GuardInput, limits: GuardLimits) -> tuple[Twist, str | None]:
    """What bumper and sonar leave of a forward motion."""
    near = state.near
    if near is None or twist.v <= 0.0 or not 0.0 <= state.now - near.at <= limits.near_max_age:
        return twist, None
    if near.bumped:
        return Twist(), "the bumper touches"
    if near.distance is None or not math.isfinite(near.distance):
        return twist, None
    free = near.distance - limits.sonar_inset - limits.margin
    speed = safe_speed(free, state.now - near.at, limits.latency, limits.max_acceleration)
    if speed >= twist.v:
        return twist, None
    why = f"sonar in {near.distance:.2f} m"
    return (Twist(), why) if speed < _CREEP else (_scaled(twist, speed / twist.v), why)


def _free_space_age(state: GuardInput) -> float | None:
    """Seconds since the newest look at the floor; None without one, or with one from the future."""
    if state.free_space_at is None or not math.isfinite(state.free_space_at):
        return None
    age = state.now - state.free_space_at
    return age if age >= 0.0 else None


def _on_the_spot(twist: Twist, state: GuardInput, why: str) -> tuple[Twist, str]:
    """What remains of a curve that may not be driven: its turning, which sweeps nothing but the body.

    A turning too slow to move the wheels is none: they would stand under power and look stalled.
    """
    if abs(twist.w) < _SLOWEST_TURN:
        return Twist(), why
    turned, _ = _turning(Twist(0.0, twist.w), state)
    return turned, why


def _capped(twist: Twist, speed: float, why: str) -> tuple[Twist, str | None]:
    if abs(twist.v) <= speed:
        return twist, why
    return _scaled(twist, speed / abs(twist.v)), why


def _scaled(twist: Twist, share: float) -> Twist:
    return Twist(twist.v * share, twist.w * share)


# ------------------------------------------------------------------------------------------------ numbers


def _finite(*values: float) -> bool:
    return all(math.isfinite(value) for value in values)


def _head(command: Command) -> HeadPose | None:
    head = command.head
    return head if head is not None and _finite(head.pan, head.tilt) else None


def _lamp(command: Command) -> float:
    return min(max(command.lamp, 0.0), 1.0) if math.isfinite(command.lamp) else 0.0
