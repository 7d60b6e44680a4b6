"""What bumper and sonar of the simulated robot feel: contacts at its front, and a ray ahead."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot.sim.brick_inputs import Sensor, TouchSensor, UltrasonicSensor
from robot.sim.gl import mujoco

Array = NDArray[np.float64]

BUMPER_INPUT, SONAR_INPUT = 0, 3
"""Brick inputs they are plugged into, counted from 0: ports 1 and 4."""
SONAR_FORWARD_M, SONAR_HEIGHT_M = 0.12, 0.1
SONAR_REACH_M = 2.5
BUMPER_FROM_M = 0.05
"""A contact this far ahead of the axle presses the bumper."""


class NearFeelings:
    """Presses the touch sensor and sets the sonar's distance from the state of the physics.

    body: index of the robot's body in the model.
    """

    def __init__(self, model: mujoco.MjModel, body: int) -> None:
        self._model = model
        self._body = body
        self._touch = TouchSensor()
        self._sonar = UltrasonicSensor()
        self._geom = np.zeros(1, np.int32)
        self._groups = np.ones(6, np.uint8)

    @property
    def sensors(self) -> dict[int, Sensor]:
        """What is plugged into the brick."""
        return {BUMPER_INPUT: self._touch, SONAR_INPUT: self._sonar}

    def feel(self, data: mujoco.MjData, contacts: Array) -> None:
        """Look at the physics once a tick. contacts: (N, 3), where the robot touches things, room frame."""
        rotation = data.xmat[self._body].reshape(3, 3)
        place = data.xpos[self._body]
        ahead = (contacts - place) @ rotation[:, 0] if len(contacts) else np.zeros(0)
        self._touch.pressed = bool((ahead > BUMPER_FROM_M).any())
        self._sonar.distance_cm = self._echo(data, place, rotation)

    def _echo(self, data: mujoco.MjData, place: Array, rotation: Array) -> int | None:
        face = place + rotation @ np.array([SONAR_FORWARD_M, 0.0, SONAR_HEIGHT_M])
        forward = np.ascontiguousarray(rotation[:, 0])
        distance = mujoco.mj_ray(self._model, data, face, forward, self._groups, 1, self._body, self._geom)
        return round(100.0 * distance) if 0.0 <= distance <= SONAR_REACH_M else None
