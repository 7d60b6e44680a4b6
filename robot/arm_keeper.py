"""Keeps the arm safe each tick: stops it when the robot must stand, slows it when something comes near."""

from __future__ import annotations

from robot.arm_guard import ArmGuardSettings, speed_share, to_arm_frame
from robot.hal.interfaces import Arm
from robot.messages import Fault, Points, Situation, Timed


class ArmKeeper:
    """Watches one arm. forward, left: its base in the robot frame, metres."""

    def __init__(self, arm: Arm, settings: ArmGuardSettings, forward: float = 0.0, left: float = 0.0) -> None:
        self._arm = arm
        self._settings = settings
        self._forward, self._left = forward, left
        self._stopped = False
        self.share = 1.0
        """Share of its speed the arm may have now."""

    def act(self, situation: Situation, stop: bool) -> None:
        """One tick. Stopping is repeated for as long as it moves; nothing is taken up again by itself."""
        state = self._arm.read(situation.now)
        if stop:
            self.share = 0.0
            self._arm.limit_speed(0.0, situation.now)  # an order that somebody gives meanwhile moves nothing
            if state.moving or not self._stopped:
                self._arm.stop(situation.now)
            self._stopped = True
            return
        self._stopped = False
        self.share = speed_share(
            self._obstacles(situation), state, self._target(situation), situation.now, self._settings
        )
        self._arm.limit_speed(self.share, situation.now)

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong with the arm."""
        return self._arm.faults(now)

    def _obstacles(self, situation: Situation) -> Timed[Points] | None:
        seen = situation.percepts.free_space
        if seen is None:
            return None
        return Timed(to_arm_frame(seen.value.obstacles, self._forward, self._left), seen.at)

    def _target(self, situation: Situation) -> tuple[float, float, float] | None:
        seen = situation.percepts.target
        if seen is None:
            return None
        x, y, z = seen.value.position
        return (x - self._forward, y - self._left, z)
