"""IDLE: stand still, look ahead, wait to be armed."""

from __future__ import annotations

from robot.messages import Event, HeadPose, Intent, Lamp, Situation
from robot.states.behaviour import Behaviour


class Idle:
    """Nothing to do. Leaves by itself only when the mission wants autonomy from the start.

    It waits for the first good picture before it arms, so that autonomy never begins blind.
    """

    def __init__(self, behaviour: Behaviour, arm_at_start: bool = False) -> None:
        self._behaviour = behaviour
        self._arm_at_start = arm_at_start

    def enter(self, situation: Situation) -> None:
        """Once left, autonomy is not started a second time unasked."""

    def step(self, situation: Situation) -> tuple[Intent, Event | None]:
        """Hold; arm once if the config says so and the eyes are good."""
        intent = Intent(look=HeadPose(0.0, self._behaviour.rest_tilt), lamp=Lamp.OFF)
        health = situation.percepts.health
        if self._arm_at_start and health is not None and health.value.fault is None:
            self._arm_at_start = False
            return intent, Event(
                "armed", "the mission starts by itself", {"brightness": health.value.brightness}
            )
        return intent, None
