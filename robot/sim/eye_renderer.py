"""Draws what an eye sees, from any place in the room: clean pictures, before a camera spoils them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image
from robot.sim.builder import EYE_SEES
from robot.sim.gl import missing_graphics, mujoco

Array = NDArray[np.float64]


class EyeRenderer:
    """One graphics context for both eyes. It belongs to the thread that made it; `close` it.

    Raises UserError if OpenGL is missing.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, width: int, height: int) -> None:
        self._data = data
        self._eyes = {name: model.camera(name).id for name in ("left", "right")}
        try:
            self._renderer = mujoco.Renderer(model, height, width)
        except Exception as cause:  # the binding raises whatever EGL or Mesa answered
            raise missing_graphics(cause) from cause
        flags = mujoco.mjtRndFlag
        for flag in (flags.mjRND_SHADOW, flags.mjRND_REFLECTION, flags.mjRND_SKYBOX):
            self._renderer.scene.flags[flag] = 0
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = EYE_SEES

    def draw(self, eye: str, rotation: Array, position: Array) -> Image:
        """What eye 'left' or 'right' sees, (H, W, 3) uint8 BGR; rotation camera to room, position in it."""
        camera = self._eyes[eye]
        # MuJoCo's cameras look along -z with y up; OpenCV's along z with y down.
        self._data.cam_xpos[camera] = position
        self._data.cam_xmat[camera] = (rotation * np.array([1.0, -1.0, -1.0])).ravel()
        self._renderer.update_scene(self._data, camera=camera, scene_option=self._options)
        picture: Image = cv2.cvtColor(self._renderer.render(), cv2.COLOR_RGB2BGR)
        return picture

    def close(self) -> None:
        """Release the graphics context."""
        self._renderer.close()
