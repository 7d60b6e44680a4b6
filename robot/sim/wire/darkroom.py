"""Turns moments of the world into pictures on the network, in a thread of its own.

Physics goes on meanwhile: a moment is a copy of all that moves. Only the newest one waits; what the thread
could not draw in time is counted, as a camera that drops frames under load.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.errors import UserError
from robot.messages import Image
from robot.sim.cameras import EyeSettings, SimStereoCamera
from robot.sim.eye_renderer import EyeRenderer
from robot.sim.gl import mujoco
from robot.sim.wire.eye_server import EyeServer, Shot
from robot.sim.world import HEIGHT_PX, TICK_S, WIDTH_PX, Moment, World

JPEG_QUALITY = 95
UNPAIRED_S = 0.6 * TICK_S
"""An unpaired right eye lags by this: more than half a period."""
_LAMP_DIFFUSE = np.array([0.95, 0.97, 1.0])

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Scenery:
    """All that a picture needs. before: the tick before, for eyes that do not look at the same time.

    shown_at: `time.monotonic()` of the moment. broken: the camera's faults at work.
    """

    moment: Moment
    before: Moment
    shown_at: float
    bodies: Array
    target_position: Array
    target_attitude: Array
    lamp: float
    broken: frozenset[str]


def scenery(world: World, before: Moment | None, shown_at: float, broken: frozenset[str]) -> Scenery:
    """The world as it stands. To be called by the thread that steps it."""
    data = world.data
    return Scenery(
        world.moment, before or world.moment, shown_at,
        data.qpos.copy(), data.mocap_pos.copy(), data.mocap_quat.copy(),
        world.lamp.light, broken,
    )  # fmt: skip


class Photographer:
    """Draws and spoils pictures of sceneries. It belongs to the thread that made it; `close` it."""

    def __init__(self, world: World) -> None:
        self._model, self._rig = world.model, world.rig
        self._data = mujoco.MjData(world.model)
        self._lamp_light = mujoco.mj_name2id(world.model, mujoco.mjtObj.mjOBJ_LIGHT, "lamp")
        mujoco.mj_forward(world.model, self._data)
        self._renderer = EyeRenderer(world.model, self._data, WIDTH_PX, HEIGHT_PX)
        eyes = EyeSettings(
            world.layout.noise, world.layout.blur_px, world.layout.skew_s, world.layout.dropped
        )
        left, right = (np.random.default_rng(seed) for seed in np.random.SeedSequence(world.seed).spawn(2))
        self._camera = SimStereoCamera(self._render, WIDTH_PX, HEIGHT_PX, eyes, left, right)
        self._scenery: Scenery | None = None
        self._seq = -1

    def take(self, seen: Scenery) -> tuple[Shot, Shot] | None:
        """Left and right picture; None if the camera gives no new one."""
        self._scenery = seen
        camera, moment = self._camera, seen.moment
        camera.break_with(seen.broken - {"unpaired"}, moment.at)
        camera.capture(moment.seq, moment.at)
        frame = camera.latest(moment.at)
        if frame is None or frame.seq == self._seq:
            return None
        self._seq = frame.seq
        lag = UNPAIRED_S if "unpaired" in seen.broken else 0.0
        return Shot(_jpeg(frame.left), seen.shown_at), Shot(_jpeg(frame.right), seen.shown_at - lag)

    def close(self) -> None:
        """Release the graphics context."""
        self._renderer.close()

    def _render(self, skew_s: float) -> tuple[Image, Image]:
        seen = self._scenery
        assert seen is not None
        self._arrange(seen)
        newest, before = seen.moment, seen.before
        drift = (newest.position - before.position) * (skew_s / TICK_S)
        right = newest.position + self._rig.baseline * newest.rotation[:, 0] + drift
        draw = self._renderer.draw
        return draw("left", newest.rotation, newest.position), draw("right", newest.rotation, right)

    def _arrange(self, seen: Scenery) -> None:
        data, light = self._data, self._lamp_light
        data.qpos[:] = seen.bodies
        data.mocap_pos[:] = seen.target_position
        data.mocap_quat[:] = seen.target_attitude
        mujoco.mj_kinematics(self._model, data)
        self._model.light_diffuse[light] = seen.lamp * _LAMP_DIFFUSE
        data.light_xpos[light] = seen.moment.position + 0.5 * self._rig.baseline * seen.moment.rotation[:, 0]
        data.light_xdir[light] = seen.moment.rotation[:, 2]


class Darkroom:
    """The thread: `develop` a scenery and go on; its pictures appear at both servers. `close` when done.

    Raises UserError on making if OpenGL is missing.
    """

    def __init__(self, world: World, left: EyeServer, right: EyeServer) -> None:
        self._world, self._left, self._right = world, left, right
        self._waiting: Scenery | None = None
        self._wanted = threading.Condition()
        self._closed = False
        self._standing = threading.Event()
        self._refused: UserError | None = None
        self.missed = 0
        """Moments that were overtaken by the next before they were drawn."""
        self._newest: tuple[Shot, Shot] | None = None
        self._thread = threading.Thread(target=self._work, name="darkroom", daemon=True)
        self._thread.start()
        self._standing.wait()
        if self._refused is not None:
            raise self._refused

    def develop(self, seen: Scenery) -> None:
        """Draw this one next."""
        with self._wanted:
            self.missed += self._waiting is not None
            self._waiting = seen
            self._wanted.notify()

    def repeat(self, shown_at: float) -> None:
        """Show the newest pictures again as of now: nothing has moved."""
        if self._newest is not None:
            left, right = self._newest
            self._left.publish(Shot(left.jpeg, shown_at))
            self._right.publish(Shot(right.jpeg, shown_at))

    def close(self) -> None:
        """Finish the picture at hand and end. May be called twice."""
        with self._wanted:
            self._closed = True
            self._wanted.notify()
        self._thread.join(timeout=2.0)

    def _work(self) -> None:
        try:
            photographer = Photographer(self._world)
        except UserError as refused:
            self._refused = refused
            return
        finally:
            self._standing.set()
        try:
            while (seen := self._next()) is not None:
                shots = photographer.take(seen)
                if shots is not None:
                    self._newest = shots
                    self._left.publish(shots[0])
                    self._right.publish(shots[1])
        finally:
            photographer.close()

    def _next(self) -> Scenery | None:
        with self._wanted:
            self._wanted.wait_for(lambda: self._closed or self._waiting is not None)
            seen, self._waiting = self._waiting, None
            return None if self._closed else seen


def _jpeg(picture: Image) -> bytes:
    done, coded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    assert done
    return coded.tobytes()
