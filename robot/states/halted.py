"""HALTED: stand still until a person has looked, and says so."""

from __future__ import annotations

from robot.messages import Event, HeadPose, Intent, Lamp, Situation
from robot.states.behaviour import Behaviour


class Halted:
    """Nothing moves. Only a person leads out of it (disarmed or teleop)."""

    def __init__(self, behaviour: Behaviour) -> None:
        self._behaviour = behaviour

    def enter(self, situation: Situation) -> None:
        """Nothing to remember."""

    def step(self, situation: Situation) -> tuple[Intent, Event | None]:
        """Hold, lamp off."""
        return Intent(look=HeadPose(0.0, self._behaviour.rest_tilt), lamp=Lamp.OFF), None
