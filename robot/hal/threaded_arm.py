"""The arm behind a worker: commands wait in order of rank, a stop before everything else."""

from __future__ import annotations

import math
from collections.abc import Callable

from robot.hal.device_thread import Worker
from robot.hal.interfaces import Arm, ArmState
from robot.messages import Fault

_NOWHERE = ArmState((0.0,) * 6, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), False, False, False)


class ThreadedArm:
    """An `Arm` whose methods never wait. The newest motion command replaces one not yet sent.

    A command's number is given at once and is this side's own; it is 0 if the arm cannot take commands now.
    """

    def __init__(self, driver: Arm, worker: Worker) -> None:
        self._arm = driver
        self._worker = worker
        self._state = _NOWHERE
        self._told: tuple[Fault, ...] = ()
        self._stop = False
        self._enable = False
        self._share: float | None = None
        self._grip: bool | None = None
        self._motion: Callable[[float], int] | None = None
        self._number = 0
        worker.start(self._exchange)

    def enable(self, now: float) -> None:
        """Let the worker switch the drives on."""
        self._enable = True
        self._worker.wake()

    def move_joints(self, joints: tuple[float, ...], speed: float, now: float) -> int:
        """Leave the motion for the worker; returns its number, 0 if the arm is not ready for one."""
        return self._post(lambda at: self._arm.move_joints(joints, speed, at), now)

    def move_linear(
        self,
        position: tuple[float, float, float],
        orientation: tuple[float, float, float],
        speed: float,
        now: float,
    ) -> int:
        """Leave the motion for the worker; returns its number, 0 if the arm is not ready for one."""
        return self._post(lambda at: self._arm.move_linear(position, orientation, speed, at), now)

    def limit_speed(self, share: float, now: float) -> None:
        """Let the worker set the share of speed, if it is a new one."""
        if math.isfinite(share) and share != self._share:
            self._share = share
            self._worker.wake()

    def grip(self, closed: bool, now: float) -> None:
        """Let the worker close or open the gripper."""
        self._grip = closed
        self._worker.wake()

    def stop(self, now: float) -> None:
        """Let the worker stop the arm before anything else; what waited is forgotten."""
        self._motion = None
        self._stop = True
        self._worker.wake()

    def read(self, now: float) -> ArmState:
        """The state as last read."""
        return self._state

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What the driver told last and, while its worker hangs, that."""
        return self._told + self._worker.faults("arm", now)

    def close(self) -> None:
        """Stop the arm and release it, from its own thread. May be called twice."""
        self._worker.end(self._end)

    def _post(self, motion: Callable[[float], int], now: float) -> int:
        if not self._state.enabled or self.faults(now):
            return 0
        self._motion = motion
        self._number += 1
        self._worker.wake()
        return self._number

    def _end(self, now: float) -> None:
        self._arm.close()
        self._state = self._arm.read(now)

    def _exchange(self, now: float) -> None:
        """In the worker: stop, then what changes how it moves, then the motion, then ask."""
        if self._stop:
            self._stop = False
            self._arm.stop(now)
        if self._enable:
            self._enable = False
            self._arm.enable(now)
        share = self._share
        if share is not None:
            self._arm.limit_speed(share, now)
        grip, self._grip = self._grip, None
        if grip is not None:
            self._arm.grip(grip, now)
        motion, self._motion = self._motion, None
        if motion is not None:
            motion(now)
        self._state = self._arm.read(now)
        self._told = self._arm.faults(now)
