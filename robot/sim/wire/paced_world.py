"""The world whose time is the wall clock's: physics goes on in small slices, others may look between."""

from __future__ import annotations

import threading
import time
from collections import deque

import numpy as np

from robot.messages import HeadPose, Pose2
from robot.sim.builder import TIMESTEP_S
from robot.sim.head import SimHead
from robot.sim.injected import InjectedFault
from robot.sim.scene import Scene
from robot.sim.wire.messages import Pace, WheelSpeeds
from robot.sim.wire.pacer import Pacer
from robot.sim.world import TICK_S, World

SLICE_S = 0.004
"""A poll of the brick finds wheels that are at most this old."""
_REMEMBERED = round(15.0 / SLICE_S)
_HEAD_STREAM = 6
_STEPS_A_SLICE = round(SLICE_S / TIMESTEP_S)


class PacedHead(SimHead):
    """A head that moves on between the world's ticks: a servo turns 8 degrees in one.

    `advance`, which the world calls once a tick, does nothing; `go_on` lets it move.
    """

    def advance(self, dt: float, now: float) -> None:
        """It has moved already."""

    def go_on(self, dt: float, now: float) -> None:
        """Let `dt` seconds pass; `now` is the time at their end."""
        super().advance(dt, now)


class PacedWorld(World):
    """Like `World`, but `step` takes 40 ms of wall time. One thread steps it.

    lock: held during each physics step; who holds it may talk to the brick or look at the bodies.
    """

    def __init__(self, scene: Scene, seed: int, faults: tuple[InjectedFault, ...] = ()) -> None:
        self.lock = threading.Lock()
        self._pacer = Pacer(TIMESTEP_S, SLICE_S, TICK_S, time.monotonic, time.sleep)
        self._substeps = 0
        self._wheel_speeds: deque[WheelSpeeds] = deque(maxlen=_REMEMBERED)
        super().__init__(scene, seed, faults)
        self._sim_head = self._paced_head = PacedHead(np.random.default_rng([seed, _HEAD_STREAM]))

    @property
    def pace(self) -> Pace:
        """How time was kept."""
        return self._pacer.pace

    @property
    def faults(self) -> tuple[InjectedFault, ...]:
        """All that break devices, over, at work or to come."""
        return self._faults

    @property
    def head_pose(self) -> HeadPose:
        """Where the eyes truly point."""
        return self._sim_head.true_pose

    def begin(self) -> None:
        """Time passes from now on; whatever it took until here does not count as late."""
        self._pacer.begin()

    def inject(self, fault: InjectedFault) -> None:
        """Break a device `fault.at` seconds from now."""
        self._faults = (
            *self._faults,
            InjectedFault(fault.device, fault.kind, self.now + fault.at, fault.duration),
        )

    def step(self) -> None:
        """Let one control tick pass, in 40 ms."""
        super().step()
        self._pacer.ticked()

    def wheels(self) -> tuple[float, float]:
        """Speed of the left and right wheel in rad/s."""
        (_, left, _), (_, right, _) = self._wheels
        return float(self.data.qvel[left]), float(self.data.qvel[right])

    def where(self) -> Pose2:
        """`robot_pose`, whatever the thread that steps is at."""
        with self.lock:
            return self.robot_pose

    def wheel_speeds(self) -> tuple[WheelSpeeds, ...]:
        """The last seconds, one entry a slice."""
        with self.lock:
            return tuple(self._wheel_speeds)

    def _physics(self) -> None:
        with self.lock:
            super()._physics()
            self._substeps += 1
            if self._substeps % _STEPS_A_SLICE == 0:
                now = self._substeps * TIMESTEP_S
                self._paced_head.go_on(SLICE_S, now)
                self._wheel_speeds.append(WheelSpeeds(time.monotonic(), now, *self.wheels()))
        self._pacer.wait()
