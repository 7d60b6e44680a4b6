"""TELEOP: a person drives. The stick's twist goes to the guard directly; here only head and lamp."""

from __future__ import annotations

from robot.messages import Event, HeadPose, Intent, Situation
from robot.states.behaviour import Behaviour


class Teleop:
    """The robot's own wish is to stand still: without a fresh word from the stick it does."""

    def __init__(self, behaviour: Behaviour) -> None:
        self._behaviour = behaviour

    def enter(self, situation: Situation) -> None:
        """Nothing to remember."""

    def step(self, situation: Situation) -> tuple[Intent, Event | None]:
        """Look ahead and hold."""
        return Intent(look=HeadPose(0.0, self._behaviour.rest_tilt)), None
