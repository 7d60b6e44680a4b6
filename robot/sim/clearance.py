"""How near the robot's body comes to anything but the floor, by the exact distance between shapes."""

from __future__ import annotations

import math

import numpy as np

from robot.sim.builder import FLOOR, ROBOT_PARTS
from robot.sim.gl import mujoco
from robot.sim.world import World

CAP_M = 2.0
"""Farther than this nobody asks."""


class Clearances:
    """Keeps the smallest distance seen so far, metres; `smallest` is inf before the first `note`."""

    def __init__(self, world: World) -> None:
        model = world.model
        self._world = world
        self._parts = [model.geom(name).id for name in ROBOT_PARTS if name != "caster"]
        solid = [
            k for k in range(model.ngeom)
            if model.geom_contype[k] and model.geom(k).name not in (*ROBOT_PARTS, FLOOR)
        ]  # fmt: skip
        self._things = np.array(solid, int)
        self.smallest = math.inf

    def note(self) -> float:
        """Measure now; returns the smallest distance so far, at most `CAP_M`."""
        model, data = self._world.model, self._world.data
        bound = min(self.smallest, CAP_M)
        for part in self._parts:
            apart = np.linalg.norm(data.geom_xpos[self._things] - data.geom_xpos[part], axis=1)
            near = apart - model.geom_rbound[self._things] - model.geom_rbound[part] < bound
            for thing in self._things[near]:
                distance = mujoco.mj_geomDistance(model, data, part, int(thing), bound, None)
                bound = min(bound, max(float(distance), 0.0))
        if bound < CAP_M:
            self.smallest = min(self.smallest, bound)
        return bound
