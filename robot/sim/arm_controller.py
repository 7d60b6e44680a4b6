"""The arm's controller with its arm: what it obeys, what it refuses, when it stops by itself.

Pure: `advance(dt)` is its time. Its registers are robot/sim/arm_registers.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from robot.sim.arm_kinematics import Joints, Pose, Triple, forward, pose_of, within_limits
from robot.sim.arm_motion import JointWay, LineWay, Runner, UnreachableError, Way

HOME: Final = tuple(math.radians(angle) for angle in (0.0, -20.0, 80.0, 0.0, 30.0, 0.0))
"""Flange at (0.34, 0, 0.96) m, looking forward."""
_STEP_S: Final = 0.01
_GRIPPER_S: Final = 0.3
_NUMBERS: Final = 65535


class Result(IntEnum):
    """How a command ended; from 10 on it never began."""

    NONE = 0
    DONE = 1
    REPLACED = 2
    STOPPED = 3
    HEARTBEAT_MISSING = 4
    SAFETY = 5
    UNKNOWN_OPCODE = 10
    DRIVES_OFF = 11
    UNREACHABLE = 12
    JOINT_LIMIT = 13
    BAD_SPEED = 14
    NOT_OWNED = 15
    STOPPING = 16
    NOT_REMOTE = 17
    ORDERED = 18


class Refusal(Exception):  # noqa: N818 (it is no error of the program)
    """A command is not begun."""

    def __init__(self, result: Result) -> None:
        super().__init__(result.name)
        self.result = result


@dataclass(frozen=True, slots=True)
class JointGoal:
    """Go to these joint angles."""

    joints: Joints

    def way_from(self, joints: Joints) -> Way:
        """Raises Refusal beyond a joint's limit."""
        if not within_limits(self.joints):
            raise Refusal(Result.JOINT_LIMIT)
        return JointWay(joints, self.joints)


@dataclass(frozen=True, slots=True)
class LineGoal:
    """Take the flange in a straight line to this position and these angles (rx, ry, rz)."""

    position: Triple
    angles: Triple

    def way_from(self, joints: Joints) -> Way:
        """Raises Refusal if the line leaves the arm's reach."""
        try:
            return LineWay(joints, pose_of(self.position, self.angles))
        except UnreachableError as error:
            raise Refusal(Result.UNREACHABLE) from error


@dataclass(frozen=True, slots=True)
class MoveCommand:
    """A motion with its number (1..65535) at a share 0..1 of full speed."""

    number: int
    goal: JointGoal | LineGoal
    share: float


class ArmController:
    """Emulated controller with its arm; joints: where it stands at first.

    Faults at hand: `press_emergency_stop`, `trip_protective_stop` and their releases, `fail(code)`, `frozen`
    (its program hangs: a motion runs to its end unwatched), `refusing` (every motion is refused), `remote`
    (False: its key switch is on manual).
    """

    def __init__(self, joints: Joints = HOME) -> None:
        self._joints: Joints = joints
        self._speeds: Joints = (0.0,) * 6
        self._gripper = 0.0
        self._since_beat = math.inf
        self._runner: Runner | None = None
        self._motion: MoveCommand | None = None
        self._next: MoveCommand | None = None
        self._braking: Result | None = None
        self.powered = self.emergency_stop = self.protective_stop = False
        self.frozen = self.refusing = False
        self.remote = True
        self.grip = False
        self.owner = self.error = 0
        self.limit = 1.0
        self.watchdog_s = 0.3
        self.begun = self.ended = 0
        self.result = Result.NONE
        self.in_position = False

    # ----------------------------------------------------------------------------------- how it stands

    @property
    def joints(self) -> Joints:
        """Joint angles in radians."""
        return self._joints

    @property
    def speeds(self) -> Joints:
        """Joint speeds in rad/s."""
        return self._speeds

    @property
    def flange(self) -> Pose:
        """The flange in the arm's base frame."""
        return forward(self._joints)

    @property
    def moving(self) -> bool:
        """True while a motion is under way, also while it is held at speed 0."""
        return self._runner is not None

    @property
    def stopping(self) -> bool:
        """True while it brakes to a stop that is not its goal."""
        return self._braking is not None

    @property
    def gripper_closed(self) -> bool:
        """True when the gripper has closed."""
        return self._gripper >= 1.0

    @property
    def heart_stopped(self) -> bool:
        """True if the heartbeat is missing for longer than the watchdog's time."""
        return self._since_beat > self.watchdog_s + 1e-9

    # ------------------------------------------------------------------------------------ what it obeys

    def beat(self) -> None:
        """The master lives."""
        self._since_beat = 0.0

    def enable(self) -> None:
        """Drives on, unless something forbids it."""
        self.powered = self.remote and not (self.emergency_stop or self.error)

    def disable(self) -> None:
        """Stop, drives off."""
        self._switch_off(Result.STOPPED)

    def stop(self) -> None:
        """Brake on the way."""
        self._brake(Result.STOPPED)

    def reset(self) -> None:
        """Acknowledge the fault."""
        self.error = 0

    def move(self, command: MoveCommand) -> None:
        """Begin the motion; one under way brakes first and is replaced. Once only for each number."""
        if not self._is_new(command.number):
            return
        try:
            self._check(command)
        except Refusal as refusal:
            self.refuse(command.number, refusal.result)
            return
        if self._runner is None:
            self._begin(command)
        else:
            self._next = command
            self.begun = command.number

    def refuse(self, number: int, result: Result) -> None:
        """Say of a command that it is not begun."""
        if self._is_new(number):
            self.ended, self.result = number, result

    # ---------------------------------------------------------------------------------------- its faults

    def press_emergency_stop(self) -> None:
        """The red button: it stops and the drives lose their power."""
        self.emergency_stop = True
        self._switch_off(Result.SAFETY)

    def release_emergency_stop(self) -> None:
        """Turn the button out again; the drives stay off."""
        self.emergency_stop = False

    def trip_protective_stop(self) -> None:
        """A safety sensor: it stops and holds, drives on."""
        self.protective_stop = True
        self._brake(Result.SAFETY)

    def release_protective_stop(self) -> None:
        """The sensor is content again."""
        self.protective_stop = False

    def fail(self, code: int) -> None:
        """A fault of its own, until it is reset."""
        self.error = code
        self._switch_off(Result.SAFETY)

    # ------------------------------------------------------------------------------------------ its time

    def advance(self, dt: float) -> None:
        """Let dt seconds pass."""
        while dt > 1e-9:
            step = min(dt, _STEP_S)
            dt -= step
            self._advance(step)

    def _advance(self, dt: float) -> None:
        self._since_beat += dt
        if self.heart_stopped and not self.frozen:
            self.owner = 0
            self._brake(Result.HEARTBEAT_MISSING)
        towards = 1.0 if self.grip else -1.0
        self._gripper = min(max(self._gripper + towards * dt / _GRIPPER_S, 0.0), 1.0)
        before = self._joints
        self._run(dt)
        self._speeds = tuple((b - a) / dt for a, b in zip(before, self._joints, strict=True))

    def _run(self, dt: float) -> None:
        runner, motion = self._runner, self._motion
        if runner is None or motion is None:
            return
        stopping = self._braking is not None or self._next is not None
        runner.advance(dt, 0.0 if stopping else motion.share * self.limit)
        self._joints = runner.joints
        if runner.done and self._braking is None:
            self._end(motion, Result.DONE)
        elif stopping and runner.standing:
            self._end(motion, self._braking or Result.REPLACED)

    # --------------------------------------------------------------------------------------- its motions

    def _begin(self, command: MoveCommand) -> None:
        self.begun = command.number
        self.in_position = False
        try:
            # From where it stands now: a replaced motion was still under way when this was asked.
            way = command.goal.way_from(self._joints)
        except Refusal as refusal:
            self.ended, self.result = command.number, refusal.result
            return
        self._motion = command
        self._runner = Runner(way, self._joints)

    def _end(self, motion: MoveCommand, result: Result) -> None:
        following = self._next
        self._runner = self._motion = self._next = self._braking = None
        self.ended, self.result = motion.number, result
        self.in_position = result is Result.DONE and following is None
        if following is not None:
            self._begin(following)

    def _brake(self, why: Result) -> None:
        if self._next is not None:
            # What waited ends together with what it was to replace.
            self._motion, self._next = self._next, None
        if self._runner is not None and self._braking is None:
            self._braking = why

    def _switch_off(self, why: Result) -> None:
        self._brake(why)
        self.powered = False

    def _check(self, command: MoveCommand) -> None:
        reasons = {
            Result.NOT_REMOTE: not self.remote,
            Result.DRIVES_OFF: not self.powered or self.protective_stop,
            Result.NOT_OWNED: self.owner == 0 or self.heart_stopped,
            Result.STOPPING: self.stopping,
            Result.ORDERED: self.refusing,
        }
        for result, holds in reasons.items():
            if holds:
                raise Refusal(result)
        command.goal.way_from(self._joints)

    def _is_new(self, number: int) -> bool:
        """A number not ahead of the last one is the same telegram again, or an older one."""
        last = self.begun or self.ended
        if self.begun and self.ended and 0 < (self.ended - self.begun) % _NUMBERS < _NUMBERS // 2:
            last = self.ended
        return number != 0 and (last == 0 or 0 < (number - last) % _NUMBERS < _NUMBERS // 2)
