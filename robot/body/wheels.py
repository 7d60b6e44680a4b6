"""How an intent moves the wheeled body: small steering laws, the head's glance at unseen floor.

`step` is pure: what must be remembered from tick to tick is a frozen `WheelsState` that goes in and comes
out. `WheelsBody` keeps it for the loop. Nothing here knows obstacles: the guard decides what is really sent.

Source: following v = k_d (D - D_set), w = k_b bearing [W] (METHODS 3); paths by pure pursuit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from robot.body.pursuit import pursue
from robot.messages import (
    Approach,
    Command,
    Follow,
    HeadPose,
    Hold,
    Intent,
    Odometry,
    Pose2,
    Turn,
    Twist,
    wrap,
)


@dataclass(frozen=True, slots=True)
class WheelsSettings:
    """Numbers of the wheeled body. m, s, rad."""

    cruise: float = 0.25
    max_turn: float = math.radians(70.0)
    command_life: float = 0.2

    turn_gain: float = 2.5
    least_turn: float = 0.2
    """Turning rate that still moves the wheels against friction."""
    turn_done: float = math.radians(1.5)
    """A turn ends this near to its heading and begins again at twice that."""

    distance_gain: float = 1.2
    bearing_gain: float = 1.8
    stop_band: float = 0.03
    """Share of the set distance within which an approach comes to rest ..."""
    start_band: float = 0.08
    """... and beyond which it moves again, so that it does not hunt."""
    back_up_below: float = 0.85
    """Share of the set distance below which it backs away."""
    back_speed: float = 0.08
    least_speed: float = 0.03
    bearing_band: float = math.radians(3.0)
    """Bearings smaller than this do not turn a standing robot."""
    turn_first: float = math.radians(30.0)
    """Bearings larger than this are turned to before driving, down to half of it."""

    look_ahead: float = 0.2
    path_turn: float = math.radians(40.0)
    """Heading errors to a path larger than this are turned away on the spot, down to a quarter of it."""
    corner: float = math.radians(25.0)
    """Corners sharper than this are driven to, not cut."""
    corner_speed: float = 0.08
    path_braking: float = 0.25
    """Deceleration towards corners and the end, m/s^2."""
    arrived: float = 0.04

    pan_limit: float = math.radians(80.0)
    tilt_up_limit: float = math.radians(20.0)
    tilt_down_limit: float = math.radians(50.0)
    glance_tilt: float = math.radians(45.0)
    glance_for: float = 0.8
    """A glance at the floor before the wheels lasts so long: head there, one look, map told ..."""
    glance_pause: float = 1.2
    """... and the next comes no sooner after it."""
    glance_aside: tuple[float, ...] = (0.0, -0.7, 0.7)
    """Bearings beside the motion's that glances take in turn."""


@dataclass(frozen=True, slots=True)
class WheelsState:
    """What the body remembers: hysteresis of its laws, progress on the path, when the last glance began."""

    turning: bool = False
    moving: bool = False
    path: tuple[tuple[float, float], ...] = ()
    progress: float = 0.0
    glance_at: float = -math.inf
    glance_pan: float = 0.0
    glances: int = 0


class WheelsBody:
    """The wheeled body for the loop: `step` with its state kept.

    >>> body = WheelsBody()
    >>> body.command(Intent(motion=Turn(1.0)), Odometry(), blocked_by_unknown=False, now=0.0).twist.w > 0
    True
    """

    def __init__(self, settings: WheelsSettings | None = None) -> None:
        self.settings = settings or WheelsSettings()
        self.state = WheelsState()

    def command(self, intent: Intent, odometry: Odometry, blocked_by_unknown: bool, now: float) -> Command:
        """What the devices shall do now; see `step`."""
        self.state, command = step(self.settings, self.state, intent, odometry, blocked_by_unknown, now)
        return command


def step(
    settings: WheelsSettings,
    state: WheelsState,
    intent: Intent,
    odometry: Odometry,
    blocked_by_unknown: bool,
    now: float,
) -> tuple[WheelsState, Command]:
    """One tick of the body.

    Args:
        settings: its numbers.
        state: what the last tick returned; `WheelsState()` at first.
        intent: what is wanted.
        odometry: where the robot is; its pose is taken as of now.
        blocked_by_unknown: the guard held the last command up because of unseen floor within half a metre.
        now: seconds.

    Returns:
        The next state and the command, lamp 0 (the lamp is not the body's business). Never beyond the
        cruise speed, the turning rate and the head's limits; numbers that are none stand still.
    """
    pose = odometry.pose
    if not all(map(math.isfinite, (pose.x, pose.y, pose.yaw))):
        intent = replace(intent, motion=Hold())
    state, twist, towards = _move(settings, state, intent, pose)
    state, head = _look(settings, state, intent.look, towards if blocked_by_unknown else None, now)
    if not (math.isfinite(twist.v) and math.isfinite(twist.w)):
        twist = Twist()
    twist = saturated(twist, settings.cruise, settings.max_turn)
    return state, Command(twist, head, 0.0, now + settings.command_life)


def saturated(twist: Twist, cruise: float, max_turn: float) -> Twist:
    """Speed and turning rate brought within their limits together, so that the curve keeps its shape.

    >>> saturated(Twist(0.5, 1.0), cruise=0.25, max_turn=1.0)
    Twist(v=0.25, w=0.5)
    """
    share = 1.0
    if abs(twist.v) > cruise:
        share = cruise / abs(twist.v)
    if abs(twist.w) * share > max_turn:
        share = max_turn / abs(twist.w)
    return Twist(twist.v * share, twist.w * share)


# ------------------------------------------------------------------------------------------------ motion


def _move(
    settings: WheelsSettings, state: WheelsState, intent: Intent, pose: Pose2
) -> tuple[WheelsState, Twist, float | None]:
    """Next state, twist, and the bearing one wants to get to (None: nowhere)."""
    match intent.motion:
        case Hold():
            return replace(state, turning=False, moving=False, path=()), Twist(), None
        case Turn(heading):
            error = wrap(heading - pose.yaw) if math.isfinite(heading) else 0.0
            turning, w = turn_rate(settings, error, state.turning)
            return replace(state, turning=turning, moving=False, path=()), Twist(0.0, w), None
        case Approach() as approach:
            return _approach(settings, replace(state, path=()), approach)
        case Follow(path):
            return _follow(settings, state, path, pose)


def turn_rate(settings: WheelsSettings, error: float, turning: bool) -> tuple[bool, float]:
    """Whether to go on turning, and how fast, for a heading error in radians."""
    if abs(error) <= settings.turn_done * (1.0 if turning else 2.0):
        return False, 0.0
    rate = min(max(settings.turn_gain * abs(error), settings.least_turn), settings.max_turn)
    return True, math.copysign(rate, error)


def _approach(
    settings: WheelsSettings, state: WheelsState, approach: Approach
) -> tuple[WheelsState, Twist, float | None]:
    bearing = approach.bearing
    if not (math.isfinite(bearing) and math.isfinite(approach.distance) and approach.stand_off > 0.0):
        return replace(state, turning=False, moving=False), Twist(), None
    turning = abs(bearing) > settings.turn_first * (0.5 if state.turning else 1.0)
    if turning:
        w = min(max(settings.bearing_gain * abs(bearing), settings.least_turn), settings.max_turn)
        return replace(state, turning=True, moving=False), Twist(0.0, math.copysign(w, bearing)), None
    moving, v = approach_speed(settings, approach, state.moving)
    still = v == 0.0 and abs(bearing) <= settings.bearing_band
    w = 0.0 if still else settings.bearing_gain * bearing
    if v == 0.0 and w != 0.0:
        w = math.copysign(max(abs(w), settings.least_turn), w)
    # Behind cannot be looked at: only the way ahead is worth a glance.
    return replace(state, turning=False, moving=moving), Twist(v, w), bearing if v > 0.0 else None


def approach_speed(settings: WheelsSettings, approach: Approach, moving: bool) -> tuple[bool, float]:
    """Whether to move, and the speed; still in a dead zone about the set distance."""
    error = approach.distance - approach.stand_off
    share = error / approach.stand_off
    if share > (settings.stop_band if moving else settings.start_band):
        return True, min(max(settings.distance_gain * error, settings.least_speed), settings.cruise)
    backing = -(1.0 - settings.back_up_below) * (0.5 if moving else 1.0)
    if share < backing:
        return True, -settings.back_speed
    return False, 0.0


def _follow(
    settings: WheelsSettings, state: WheelsState, path: tuple[tuple[float, float], ...], pose: Pose2
) -> tuple[WheelsState, Twist, float | None]:
    if path != state.path:
        state = replace(state, path=path, progress=0.0)
    if not path:
        return replace(state, turning=False, moving=False), Twist(), None
    aim = pursue(path, pose, state.progress, settings.look_ahead, settings.corner)
    state = replace(state, progress=aim.progress)
    if aim.to_end <= settings.arrived:
        return replace(state, turning=False, moving=False), Twist(), None
    turning = abs(aim.bearing) > settings.path_turn * (0.25 if state.turning else 1.0)
    state = replace(state, turning=turning, moving=not turning)
    if turning:
        w = min(max(settings.turn_gain * abs(aim.bearing), settings.least_turn), settings.max_turn)
        return state, Twist(0.0, math.copysign(w, aim.bearing)), aim.bearing
    v = math.sqrt(settings.corner_speed**2 + 2.0 * settings.path_braking * aim.to_corner)
    v = min(v, math.sqrt(settings.least_speed**2 + 2.0 * settings.path_braking * aim.to_end), settings.cruise)
    return state, Twist(v, v * aim.curvature), aim.bearing


# -------------------------------------------------------------------------------------------------- head


def _look(
    settings: WheelsSettings, state: WheelsState, look: HeadPose, blocked_towards: float | None, now: float
) -> tuple[WheelsState, HeadPose]:
    """The head pose wanted or, for a moment, a glance at the unseen floor that holds the motion up."""
    since = now - state.glance_at
    if since < settings.glance_for:
        return state, HeadPose(state.glance_pan, settings.glance_tilt)
    if blocked_towards is None or since < settings.glance_for + settings.glance_pause:
        return state, _clamped(settings, look)
    # One look down does not cover the whole way: glances that follow one another look beside it too.
    aside = settings.glance_aside[state.glances % len(settings.glance_aside)]
    head = _clamped(settings, HeadPose(blocked_towards + aside, settings.glance_tilt))
    return replace(state, glance_at=now, glance_pan=head.pan, glances=state.glances + 1), head


def _clamped(settings: WheelsSettings, look: HeadPose) -> HeadPose:
    pan = look.pan if math.isfinite(look.pan) else 0.0
    tilt = look.tilt if math.isfinite(look.tilt) else 0.0
    return HeadPose(
        min(max(pan, -settings.pan_limit), settings.pan_limit),
        min(max(tilt, -settings.tilt_up_limit), settings.tilt_down_limit),
    )
