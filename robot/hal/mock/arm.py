"""A six-axis arm whose controller moves joints and flange evenly; no kinematics joins the two."""

from __future__ import annotations

import math
from typing import Final

from robot.hal.interfaces import ArmState
from robot.hal.mock.script import Mock

JOINT_RATE: Final = math.radians(90.0)  # rad/s at full speed
FLANGE_SPEED: Final = 0.25  # m/s at full speed
Triple = tuple[float, float, float]


class MockArm(Mock):
    """Obeys when it was enabled. A command number of 0 says that the command was not accepted.

    `gripped` is True while the gripper is closed.
    """

    def __init__(self, joints: tuple[float, ...] = (0.0,) * 6, position: Triple = (0.4, 0.0, 0.4)) -> None:
        super().__init__("arm")
        self.gripped = False
        self._enabled = False
        self._time = -math.inf
        self._now = (*joints, *position, 0.0, 0.0, 0.0)
        self._count = len(joints)
        self._start, self._goal = self._now, self._now
        self._driven_s = self._length_s = 0.0
        self._share = 1.0
        self._number = 0

    def enable(self, now: float) -> None:
        """Switch the drives on."""
        if self._works(now, "enable"):
            self._enabled = True

    def move_joints(self, joints: tuple[float, ...], speed: float, now: float) -> int:
        """Move all joints so that they arrive together; speed 0..1 of 90 degrees a second."""
        self._advance(now)
        if (
            not self._works(now, "move_joints", joints, speed)
            or not self._enabled
            or len(joints) != self._count
        ):
            return 0
        way = max(abs(a - b) for a, b in zip(joints, self._now, strict=False))
        return self._go((*joints, *self._now[self._count :]), way / JOINT_RATE, speed, now)

    def move_linear(self, position: Triple, orientation: Triple, speed: float, now: float) -> int:
        """Move the flange in a straight line; speed 0..1 of 0.25 m/s."""
        self._advance(now)
        if not self._works(now, "move_linear", position, orientation, speed) or not self._enabled:
            return 0
        here = self._now[self._count : self._count + 3]
        return self._go(
            (*self._now[: self._count], *position, *orientation),
            math.dist(position, here) / FLANGE_SPEED,
            speed,
            now,
        )

    def grip(self, closed: bool, now: float) -> None:
        """Close or open the gripper."""
        if self._works(now, "grip", closed):
            self.gripped = closed

    def limit_speed(self, share: float, now: float) -> None:
        """Slow the motion under way and all later ones; 0 holds it where it is."""
        self._advance(now)
        if self._works(now, "limit_speed", share) and math.isfinite(share):
            self._share = max(0.0, min(1.0, share))

    def stop(self, now: float) -> None:
        """Stop where it is."""
        self._advance(now)
        if self._works(now, "stop"):
            self._halt()

    def read(self, now: float) -> ArmState:
        """Where it is now; the last known while it fails."""
        if self._works(now, "read"):
            self._advance(now)
        n, values = self._count, self._now
        moving = self._driven_s < self._length_s
        return ArmState(
            joints=values[:n],
            position=(values[n], values[n + 1], values[n + 2]),
            orientation=(values[n + 3], values[n + 4], values[n + 5]),
            moving=moving,
            in_position=not moving and values == self._goal,
            enabled=self._enabled,
        )

    def close(self) -> None:
        """Stop and switch the drives off."""
        super().close()
        self._halt()
        self._enabled = False

    def _go(self, goal: tuple[float, ...], seconds_at_full_speed: float, speed: float, now: float) -> int:
        self._start, self._goal = self._now, goal
        self._driven_s = 0.0
        self._length_s = seconds_at_full_speed / max(0.01, min(1.0, speed))
        self._number += 1
        return self._number

    def _halt(self) -> None:
        self._length_s = self._driven_s

    def _advance(self, now: float) -> None:
        if now <= self._time:
            return
        if self._driven_s < self._length_s:
            self._driven_s = min(self._driven_s + self._share * (now - self._time), self._length_s)
            share = self._driven_s / self._length_s
            self._now = tuple(a + share * (b - a) for a, b in zip(self._start, self._goal, strict=True))
            if share == 1.0:
                self._now = self._goal
        self._time = now
