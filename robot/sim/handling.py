"""Hands on the robot: somebody lifts, tips or pushes the base, whatever its wheels do.

`Handling` moves the body of the robot in the physics engine while its wheels go on as the brick drives them:
in the air they turn freely, on the floor they are dragged. What is begun is also ended: a lifted or tipped
robot is set down again where it is held, a pushed one stays where it was pushed to. Each is done by quick
hands or by slow ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot.sim.gl import mujoco

Array = NDArray[np.float64]

LIFT_M, TIP_RAD = 0.12, math.radians(18.0)
FRICTION_M_S = 0.015
"""About the speed the floor takes from a pushed base in one physics step; hands give it back."""
HELD_UP_SHARE = 0.8
"""What takes more of a push than friction stands in the way: less than this share of its speed is kept."""


@dataclass(frozen=True, slots=True)
class Hands:
    """How quick hands are: m/s and rad/s. A push turns the base with it and ends after `push_s` seconds."""

    lift: float
    tip: float
    push: float
    push_turn: float
    push_s: float


QUICK = Hands(lift=0.3, tip=math.radians(60.0), push=0.3, push_turn=math.radians(40.0), push_s=0.7)
SLOW = Hands(lift=0.05, tip=math.radians(10.0), push=0.05, push_turn=0.0, push_s=3.0)
KINDS: dict[str, tuple[str, Hands]] = {
    **{kind: (kind, QUICK) for kind in ("lifted", "tipped", "pushed")},
    **{f"{kind}_slowly": (kind, SLOW) for kind in ("lifted", "tipped", "pushed")},
}
"""What hands can be at: name -> what they do and how quickly. A push goes sideways to the left."""


class Handling:
    """What hands do to the base. `set` says what they are at, `act` is called before every physics step.

    Raises nothing. Nothing is random: the same calls at the same times give the same motion.
    """

    def __init__(self, model: mujoco.MjModel, joint: str = "base") -> None:
        self._qpos, self._dof = int(model.joint(joint).qposadr[0]), int(model.joint(joint).dofadr[0])
        self._at: frozenset[str] = frozenset()
        self._hands = QUICK
        self._grip: Array | None = None  # the body's place and attitude when it was taken hold of
        self._height = self._tilt = 0.0
        self._pushed_for = 0.0

    def set(self, kinds: frozenset[str]) -> None:
        """What hands do from now on, of `KINDS`; anything else is ignored. They let go as they took."""
        orders = [KINDS[kind] for kind in sorted(kinds) if kind in KINDS]
        at = frozenset(kind for kind, _ in orders)
        if "pushed" in at - self._at:
            self._pushed_for = 0.0
        if orders:
            self._hands = orders[0][1]
        self._at = at

    def act(self, data: mujoco.MjData, dt: float) -> None:
        """Move the body on by `dt` seconds."""
        self._hold(data, dt)
        if "pushed" in self._at and self._pushed_for < self._hands.push_s and self._grip is None:
            self._push(data, dt)

    def _push(self, data: mujoco.MjData, dt: float) -> None:
        """Sideways and turning, kept down on the floor, until something stands in the way."""
        hands = self._hands
        w, _, _, z = data.qpos[self._qpos + 3 : self._qpos + 7]
        yaw = 2.0 * math.atan2(z, w)
        left = np.array([-math.sin(yaw), math.cos(yaw)])
        kept = float(data.qvel[self._dof : self._dof + 2] @ left) / hands.push
        held_up = self._pushed_for > 0.0 and kept < HELD_UP_SHARE
        self._pushed_for = hands.push_s if held_up else self._pushed_for + dt
        if held_up:
            return
        sideways = (hands.push + FRICTION_M_S) * left
        data.qvel[self._dof : self._dof + 6] = (*sideways, 0.0, 0.0, 0.0, hands.push_turn)

    def _hold(self, data: mujoco.MjData, dt: float) -> None:
        """Held in the hands: kept where it was gripped, raised and leant over as far as it is by now."""
        lifted, tipped = "lifted" in self._at, "tipped" in self._at
        if self._grip is None and not (lifted or tipped):
            return
        place = data.qpos[self._qpos : self._qpos + 7]
        if self._grip is None:
            self._grip = place.copy()
        before = self._height, self._tilt
        self._height = _towards(self._height, LIFT_M if lifted else 0.0, self._hands.lift * dt)
        self._tilt = _towards(self._tilt, TIP_RAD if tipped else 0.0, self._hands.tip * dt)
        lean = np.array([math.cos(self._tilt / 2), math.sin(self._tilt / 2), 0.0, 0.0])
        place[:3] = self._grip[:3]
        place[2] += self._height + _raised_by(self._tilt)
        mujoco.mju_mulQuat(place[3:7], self._grip[3:7], lean)
        velocity = data.qvel[self._dof : self._dof + 6]
        velocity[:] = 0.0
        velocity[2] = (self._height - before[0]) / dt
        velocity[3] = (self._tilt - before[1]) / dt
        if self._height == 0.0 and self._tilt == 0.0:
            self._grip = None  # back on its wheels: let go


def _raised_by(tilt: float) -> float:
    """Metres the middle of the axle rises when the base is tipped over one wheel's contact point."""
    return 0.075 * math.sin(abs(tilt))


def _towards(value: float, goal: float, step: float) -> float:
    return min(value + step, goal) if value < goal else max(value - step, goal)
