"""The simulated pan-tilt head: hobby servos with limits, a top speed, a small lag and small errors."""

from __future__ import annotations

import math

import numpy as np

from robot.messages import Fault, HeadPose

PAN_LIMIT = math.radians(80.0)
TILT_UP_LIMIT = math.radians(20.0)
TILT_DOWN_LIMIT = math.radians(50.0)
TOP_SPEED = math.radians(200.0)
LAG_S = 0.03
OFFSET_SIGMA = math.radians(0.05)
READ_NOISE = math.radians(0.03)
STUCK_ANGLE = math.radians(4.0)
STUCK_AFTER_S = 0.6
_STEP_S = 0.005


class SimHead:
    """A `PanTilt` whose true pose is `true_pose`; `read` is off by at most 0.2 degrees.

    advance() moves it; a stuck head keeps its pose and says so once it fails to reach what was asked.

    >>> head = SimHead(np.random.default_rng(1))
    >>> _ = head.send(HeadPose(pan=0.5, tilt=0.1), now=0.0)
    >>> for k in range(25):
    ...     head.advance(0.04, now=0.04 * k)
    >>> abs(head.read(1.0).pan - 0.5) < math.radians(0.2)
    True
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        offset = np.clip(rng.normal(0.0, OFFSET_SIGMA, 2), -2 * OFFSET_SIGMA, 2 * OFFSET_SIGMA)
        self._offset = (float(offset[0]), float(offset[1]))
        self._servo = HeadPose()
        self._goal = HeadPose()
        self._reading = HeadPose()
        self._off_since: float | None = None
        self._broken: dict[str, float] = {}

    def break_with(self, kinds: frozenset[str], now: float) -> None:
        """Set the faults at work from now on: 'stuck' does not move, 'link' neither hears nor answers."""
        self._broken = {kind: self._broken.get(kind, now) for kind in sorted(kinds)}

    @property
    def true_pose(self) -> HeadPose:
        """Where the eyes really point."""
        return HeadPose(self._servo.pan + self._offset[0], self._servo.tilt + self._offset[1])

    def send(self, pose: HeadPose, now: float) -> HeadPose:
        """Go there; returns the pose within the limits that is really asked for."""
        if "link" in self._broken or not (math.isfinite(pose.pan) and math.isfinite(pose.tilt)):
            return self._goal
        self._goal = HeadPose(
            min(max(pose.pan, -PAN_LIMIT), PAN_LIMIT), min(max(pose.tilt, -TILT_UP_LIMIT), TILT_DOWN_LIMIT)
        )
        return self._goal

    def read(self, now: float) -> HeadPose:
        """Where the encoders say the head is; the same value all through one tick."""
        return self._reading

    def faults(self, now: float) -> tuple[Fault, ...]:
        """`head.link` while it does not answer; `head.stuck` once off its goal longer than any move takes."""
        if "link" in self._broken:
            return (Fault("head", "link", self._broken["link"], "no answer"),)
        if self._off_since is None or now - self._off_since < STUCK_AFTER_S:
            return ()
        off = math.degrees(self._distance())
        return (Fault("head", "stuck", self._off_since, f"{off:.0f} degrees off and not moving"),)

    def close(self) -> None:
        """Nothing to release."""

    def advance(self, dt: float, now: float) -> None:
        """Let `dt` seconds pass; `now` is the time at their end."""
        before = self._servo
        if "stuck" not in self._broken:
            steps = max(1, round(dt / _STEP_S))
            for _ in range(steps):
                self._servo = HeadPose(
                    _approach(self._servo.pan, self._goal.pan, dt / steps),
                    _approach(self._servo.tilt, self._goal.tilt, dt / steps),
                )
        noise = np.clip(self._rng.normal(0.0, READ_NOISE, 2), -2 * READ_NOISE, 2 * READ_NOISE)
        if "link" not in self._broken:
            self._reading = HeadPose(self._servo.pan + float(noise[0]), self._servo.tilt + float(noise[1]))
        if self._servo != before or self._distance() < STUCK_ANGLE:
            self._off_since = None
        elif self._off_since is None:
            self._off_since = now

    def _distance(self) -> float:
        return max(abs(self._goal.pan - self._servo.pan), abs(self._goal.tilt - self._servo.tilt))


def _approach(angle: float, goal: float, dt: float) -> float:
    """First-order lag towards the goal, no faster than the servo's top speed."""
    step = (goal - angle) * min(dt / LAG_S, 1.0)
    return angle + min(max(step, -TOP_SPEED * dt), TOP_SPEED * dt)
