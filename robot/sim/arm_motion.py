"""How the emulated arm gets somewhere: all joints together, or the flange along a straight line.

A way is a function of the seconds it takes at full speed; `Runner` drives along it with ramps (trapezoidal
speed), at any share of full speed, and brakes on it.
"""

from __future__ import annotations

import math
from typing import Final, Protocol

import numpy as np

from robot.sim.arm_kinematics import SPEEDS, Joints, Matrix, Pose, forward, inverse

FULL_SPEED: Final = 0.5
"""m/s of the flange on a line."""
FULL_TURN: Final = math.radians(120.0)
"""rad/s of the flange on a line."""
RAMP_S: Final = 0.2
"""From standing to full speed."""
BRAKE_S: Final = 0.08
"""From full speed to standing when told to stop or to slow down."""

# The way of a line is tried beforehand at so fine a step that no joint may jump between two.
_TRIAL_STEP_M: Final = 0.01
_TRIAL_STEP_RAD: Final = math.radians(3.0)
_LARGEST_JUMP: Final = math.radians(30.0)
_FINEST_SPLIT: Final = 1.0 / 64.0


class UnreachableError(ValueError):
    """The goal, or the straight line to it, is out of the arm's reach."""


class Way(Protocol):
    """From standing to standing."""

    duration: float

    def joints_at(self, s: float, near: Joints) -> Joints | None:
        """The joints after s of `duration` seconds, next to `near`; None where there are none."""
        ...


class JointWay:
    """Every joint runs evenly and all arrive together; the slowest one sets the time.

    >>> JointWay((0.0,) * 6, (0.0, 0.0, 0.0, 0.0, 0.0, SPEEDS[5])).duration
    1.0
    """

    def __init__(self, start: Joints, goal: Joints) -> None:
        self._start = start
        self._goal = goal
        self.duration = max(abs(b - a) / v for a, b, v in zip(start, goal, SPEEDS, strict=True))

    def joints_at(self, s: float, near: Joints) -> Joints:
        """On the straight way between the joint angles."""
        if s >= self.duration:
            return self._goal
        share = s / self.duration
        return tuple(a + share * (b - a) for a, b in zip(self._start, self._goal, strict=True))


class LineWay:
    """The flange in a straight line, turning evenly about one axis. Raises UnreachableError."""

    def __init__(self, start: Joints, goal: Pose) -> None:
        here = forward(start)
        self._from, self._way = here.position, goal.position - here.position
        self._rotation = here.rotation
        self._axis, self._angle = _axis_angle(here.rotation.T @ goal.rotation)
        length = float(np.linalg.norm(self._way))
        self.duration = max(length / FULL_SPEED, self._angle / FULL_TURN)
        self._try_out(start, max(length / _TRIAL_STEP_M, self._angle / _TRIAL_STEP_RAD))

    def joints_at(self, s: float, near: Joints) -> Joints | None:
        """The joints for the point of the line."""
        share = min(s / self.duration, 1.0) if self.duration > 0.0 else 1.0
        rotation = self._rotation @ _rotation(self._axis, share * self._angle)
        return inverse(Pose(self._from + share * self._way, rotation), near)

    def _try_out(self, start: Joints, steps: float) -> None:
        joints = start
        count = max(math.ceil(steps), 1)
        for index in range(1, count + 1):
            after = self.joints_at(self.duration * index / count, joints)
            if after is None:
                raise UnreachableError("the line leaves the arm's reach")
            if max(abs(a - b) for a, b in zip(after, joints, strict=True)) > _LARGEST_JUMP:
                raise UnreachableError("a joint would have to jump on the line")
            joints = after


class Runner:
    """Drives along one way. `done` when the end is reached, `standing` when nothing moves."""

    def __init__(self, way: Way, joints: Joints) -> None:
        self._way = way
        self._s = 0.0
        self._rate = 0.0
        self.joints = joints
        self.done = way.duration <= 0.0

    @property
    def standing(self) -> bool:
        """True if nothing moves."""
        return self._rate == 0.0

    def advance(self, dt: float, share: float) -> None:
        """Go on for dt seconds at no more than `share` 0..1 of full speed; 0 brakes and holds."""
        if self.done:
            return
        left = self._way.duration - self._s
        # What can still be braked on the ramp before the end, one step ahead.
        end = math.sqrt(2.0 * left / RAMP_S + (0.5 * dt / RAMP_S) ** 2) - 0.5 * dt / RAMP_S
        wanted = max(share, self._rate - dt / BRAKE_S)
        self._rate = max(min(self._rate + dt / RAMP_S, wanted, end), 0.0)
        self._step(min(self._rate * dt, left), dt)
        if self._way.duration - self._s < 1e-6:
            self.done, self._rate = True, 0.0

    def _step(self, length: float, dt: float) -> None:
        """Go as far as no joint exceeds its speed (near a singular posture a line goes slower)."""
        split = 1.0
        while length > 0.0 and split >= _FINEST_SPLIT:
            joints = self._way.joints_at(self._s + split * length, self.joints)
            if joints is not None and _bearable(self.joints, joints, dt):
                self._s += split * length
                self.joints = joints
                return
            split *= 0.5
        self._rate = 0.0


def _bearable(before: Joints, after: Joints, dt: float) -> bool:
    return all(abs(b - a) <= 1.01 * v * dt for a, b, v in zip(before, after, SPEEDS, strict=True))


def _axis_angle(rotation: Matrix) -> tuple[Matrix, float]:
    cosine = max(-1.0, min(1.0, (float(np.trace(rotation)) - 1.0) / 2.0))
    vector = np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    length = float(np.linalg.norm(vector))
    angle = math.atan2(length / 2.0, cosine)
    if length > 1e-6:
        return vector / length, angle
    if cosine > 0.0:
        return np.array([0.0, 0.0, 1.0]), 0.0
    # Half a turn: the axis is the column of R + I that is not zero.
    columns = rotation + np.eye(3)
    axis = columns[:, int(np.argmax(np.linalg.norm(columns, axis=0)))]
    return axis / np.linalg.norm(axis), math.pi


def _rotation(axis: Matrix, angle: float) -> Matrix:
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: Matrix = np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross
    return rotation
