"""The light in a room: ambient, two ceiling lamps, daylight from one side, and the robot's own lamp (off)."""

from __future__ import annotations

import math

import numpy as np

from robot.sim.gl import mujoco

_ALONG, _BELOW_CEILING_M = (0.28, 0.75), 0.15
_NO_AMBIENT = {"castshadow": False, "specular": np.zeros(3), "ambient": np.zeros(3)}


def add_lights(
    spec: mujoco.MjSpec,
    reach: tuple[float, float],
    width: float,
    ceiling: float,
    level: float,
    rng: np.random.Generator,
) -> None:
    """Light a room; the robot's lamp is named `lamp`.

    reach: x of its back and front wall; width across, height of the ceiling, metres; level: of all lights but
    the robot's lamp, 1 is a bright day; rng: draws the light's warmth, where the lamps hang, where the
    daylight comes from.
    """
    warm = np.array([1.0, rng.uniform(0.9, 1.0), rng.uniform(0.8, 1.0)])
    spec.visual.headlight.active = 1
    spec.visual.headlight.ambient = 0.5 * level * warm
    spec.visual.headlight.diffuse = spec.visual.headlight.specular = np.zeros(3)
    for k, share in enumerate(_ALONG):
        x = reach[0] + share * (reach[1] - reach[0])
        spec.worldbody.add_light(
            name=f"ceiling{k}", type=mujoco.mjtLightType.mjLIGHT_POINT, attenuation=[1.0, 0.0, 0.06],
            pos=[x, rng.uniform(-0.25, 0.25) * width, ceiling - _BELOW_CEILING_M],
            diffuse=0.58 * level * warm, **_NO_AMBIENT,
        )  # fmt: skip
    side = rng.uniform(0, math.tau)
    spec.worldbody.add_light(
        name="daylight", type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        dir=[math.cos(side), math.sin(side), -0.6], diffuse=np.array([0.26, 0.27, 0.28]) * level,
        **_NO_AMBIENT,
    )  # fmt: skip
    spec.worldbody.add_light(
        name="lamp", type=mujoco.mjtLightType.mjLIGHT_SPOT, cutoff=65.0, exponent=6.0,
        attenuation=[0.8, 0.0, 0.16], diffuse=np.zeros(3), **_NO_AMBIENT,
    )  # fmt: skip
