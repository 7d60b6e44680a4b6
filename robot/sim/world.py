"""The simulated world: a room, a robot in it, and its devices as the drivers see them.

`World(scene, seed)` builds the room; `step()` lets one control tick (40 ms) pass. Everything random comes
from the seed: the same scene and seed give the same room, the same pictures and the same motions, bit for
bit, as long as the same commands come at the same ticks. One thread only: the one that made it.

Truth (poses, contacts, remembered moments) is here for the referee; robot code gets the devices only.
"""

from __future__ import annotations

import math
import zlib
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.model import HeadMount, StereoRig
from robot.errors import UserError
from robot.messages import Image, Pose2
from robot.sim.brick_emulator import BrickEmulator
from robot.sim.builder import (
    FLOOR,
    LEFT_WHEEL,
    RIGHT_WHEEL,
    ROBOT_PARTS,
    TIMESTEP_S,
    WHEEL_RADIUS_M,
    build_model,
)
from robot.sim.cameras import EyeSettings, SimStereoCamera
from robot.sim.eye_renderer import EyeRenderer
from robot.sim.gl import mujoco
from robot.sim.handling import Handling
from robot.sim.head import SimHead
from robot.sim.injected import InjectedFault, active_kinds, switch_base_faults
from robot.sim.lamp import SimLamp
from robot.sim.layout import Motion, draw_layout
from robot.sim.motor import Motor
from robot.sim.mover import Mover
from robot.sim.near import NearFeelings
from robot.sim.room import draw_room
from robot.sim.scene import Scene

Array = NDArray[np.float64]

TICK_S = 0.04
SUB_STEPS = round(TICK_S / TIMESTEP_S)
LEFT_PORT, RIGHT_PORT = 1, 2
RIGS = {"base": (305.0, 0.06), "hand": (408.0, 0.04)}
"""Focal length in pixels and baseline in metres of the two camera settings."""
WIDTH_PX, HEIGHT_PX = 352, 288
REMEMBERED = 250
"""Ticks whose truth is kept for the referee: ten seconds."""
LAMP_DIFFUSE = np.array([0.95, 0.97, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """The truth at one tick: the left eye (rotation camera to room, position), the robot, the target."""

    seq: int
    at: float
    rotation: Array
    position: Array
    robot: Pose2
    target: Pose2 | None


class World:
    """A room with a robot. See the module's words; `close()` it when done.

    scene: from `load_scene`. seed: any integer >= 0. faults: what shall break and when.
    Raises UserError if the scene cannot be drawn with this seed or OpenGL is missing.
    """

    def __init__(self, scene: Scene, seed: int, faults: tuple[InjectedFault, ...] = ()) -> None:
        if seed < 0:
            raise UserError(f"seed {seed}: must be 0 or more")
        self.scene, self.seed = scene, seed
        root = np.random.SeedSequence([seed, zlib.crc32(scene.name.encode())])
        streams = [np.random.default_rng(s) for s in root.spawn(10)]
        self.layout = draw_layout(scene, streams[0])
        focal, baseline = RIGS[scene.camera.setting]
        self.rig = StereoRig.parallel(WIDTH_PX, HEIGHT_PX, focal, baseline)
        self.mount = HeadMount(baseline=baseline)
        self.model = build_model(
            self.layout, draw_room(scene.room, self.layout, streams[1]), streams[2], WIDTH_PX, HEIGHT_PX
        )
        self.model.cam_fovy[:] = math.degrees(2 * math.atan(HEIGHT_PX / 2 / focal))
        self.data = mujoco.MjData(self.model)
        self._handling = Handling(self.model)
        self._look_up()
        motors = (Motor(streams[3]), Motor(streams[4]))
        self._motors = motors
        self._near = NearFeelings(self.model, self._base)
        self.brick = BrickEmulator((None, motors[0], motors[1]), streams[5], sensors=self._near.sensors)
        self._sim_head, self._sim_lamp = SimHead(streams[6]), SimLamp()
        eyes = EyeSettings(self.layout.noise, self.layout.blur_px, self.layout.skew_s, self.layout.dropped)
        self._sim_camera = SimStereoCamera(self._render, WIDTH_PX, HEIGHT_PX, eyes, streams[7], streams[8])
        self._mover = (
            None if self.layout.target is None else Mover(self.layout.target.pose, self.layout.motion)
        )
        self._faults = faults
        self._broken_base: frozenset[str] = frozenset()
        self._ticks = 0
        self._renderer: EyeRenderer | None = None
        self._touched: frozenset[str] = frozenset()
        self._moments: deque[Moment] = deque(maxlen=REMEMBERED)
        self._settle()
        self._end_tick()

    # ------------------------------------------------------------------------------------------- devices

    @property
    def camera(self) -> SimStereoCamera:
        """The two eyes."""
        return self._sim_camera

    @property
    def head(self) -> SimHead:
        """The pan-tilt head."""
        return self._sim_head

    @property
    def lamp(self) -> SimLamp:
        """The lamp on the head."""
        return self._sim_lamp

    # ---------------------------------------------------------------------------------------------- time

    @property
    def now(self) -> float:
        """Seconds since the world began."""
        return round(self._ticks * TICK_S, 9)

    def step(self) -> None:
        """Let one control tick pass: 40 ms."""
        touched: dict[str, Array] = {}
        for _ in range(SUB_STEPS):
            self._physics()
            self._note_contacts(touched)
        self._touched = frozenset(touched)
        self._near.feel(self.data, np.array(list(touched.values())).reshape(-1, 3))
        self._ticks += 1
        if self._mover is not None:
            robot = self.robot_pose
            self._mover.advance(TICK_S, self.now, (robot.x, robot.y))
            self._show_target(self._mover.pose)
        self._end_tick()

    def place_target(self, x: float, y: float, yaw: float) -> None:
        """Put the target somewhere else (teaching, tests); it stays there from the next tick on."""
        self._mover = Mover(Pose2(x, y, yaw), Motion())
        self._show_target(self._mover.pose)

    def close(self) -> None:
        """Release the graphics context. May be called twice."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    # --------------------------------------------------------------------------------------------- truth

    @property
    def robot_pose(self) -> Pose2:
        """Where the robot's origin truly is, room frame."""
        x, y = self.data.xpos[self._base][:2].tolist()
        m = self.data.xmat[self._base]
        return Pose2(x, y, math.atan2(float(m[3]), float(m[0])))

    @property
    def target_pose(self) -> Pose2 | None:
        """Where the target truly is, room frame; None in a room without one."""
        return None if self._mover is None else self._mover.pose

    @property
    def target_at_rest(self) -> bool:
        """True once the target will not move any more."""
        return self._mover is None or self._mover.finished

    @property
    def touched(self) -> frozenset[str]:
        """Names of everything but the floor that the robot touched during the last tick."""
        return self._touched

    @property
    def moment(self) -> Moment:
        """The truth of the newest tick."""
        return self._moments[-1]

    def moment_of(self, seq: int) -> Moment | None:
        """The truth when frame `seq` was captured; None if that is longer ago than is remembered."""
        offset = seq - self._moments[0].seq
        return self._moments[offset] if 0 <= offset < len(self._moments) else None

    # ------------------------------------------------------------------------------------------ internals

    def _look_up(self) -> None:
        model, kinds = self.model, mujoco.mjtObj
        self._base = mujoco.mj_name2id(model, kinds.mjOBJ_BODY, "base")
        self._lamp_light = mujoco.mj_name2id(model, kinds.mjOBJ_LIGHT, "lamp")
        self._wheels = [
            (int(model.joint(n).qposadr[0]), int(model.joint(n).dofadr[0]), int(model.actuator(n).id))
            for n in (LEFT_WHEEL, RIGHT_WHEEL)
        ]
        self._is_robot = np.zeros(model.ngeom, bool)
        self._is_robot[[model.geom(n).id for n in ROBOT_PARTS]] = True
        self._is_floor = np.zeros(model.ngeom, bool)
        self._is_floor[model.geom(FLOOR).id] = True

    def _show_target(self, pose: Pose2) -> None:
        self.data.mocap_pos[0, :2] = pose.x, pose.y
        self.data.mocap_quat[0] = math.cos(pose.yaw / 2), 0.0, 0.0, math.sin(pose.yaw / 2)

    def _settle(self) -> None:
        """Let the robot come to rest on its wheels before time begins."""
        for _ in range(150):
            mujoco.mj_step(self.model, self.data)
        start = self.layout.start
        self.data.qpos[:2] = start.x, start.y
        self.data.qpos[3:7] = math.cos(start.yaw / 2), 0.0, 0.0, math.sin(start.yaw / 2)
        for qpos, _, _ in self._wheels:
            self.data.qpos[qpos] = 0.0
        self.data.qvel[:] = 0.0
        self.data.time = 0.0
        mujoco.mj_forward(self.model, self.data)

    def _physics(self) -> None:
        data = self.data
        self.brick.advance(TIMESTEP_S)
        for motor, (_, dof, actuator) in zip(self._motors, self._wheels, strict=True):
            data.ctrl[actuator] = motor.torque(float(data.qvel[dof]))
        self._handling.act(data, TIMESTEP_S)
        mujoco.mj_step(self.model, data)
        for motor, (qpos, dof, _) in zip(self._motors, self._wheels, strict=True):
            motor.observe(float(data.qpos[qpos]), float(data.qvel[dof]))

    def _note_contacts(self, touched: dict[str, Array]) -> None:
        """Add what is touched now, by name, and where."""
        geoms = self.data.contact.geom
        if not len(geoms):
            return
        robot = self._is_robot[geoms]
        odd = (robot.any(axis=1)) & ~self._is_floor[geoms].any(axis=1)
        for index in np.flatnonzero(odd):
            first, second = geoms[index]
            other = second if self._is_robot[first] else first
            touched[self.model.geom(int(other)).name] = self.data.contact.pos[index].copy()

    def _end_tick(self) -> None:
        now = self.now
        self._break_devices(now)
        if self._ticks:
            self._sim_head.advance(TICK_S, now)
        mujoco.mj_kinematics(self.model, self.data)
        rotation, position = self._left_eye()
        self._moments.append(Moment(self._ticks, now, rotation, position, self.robot_pose, self.target_pose))
        self._sim_camera.capture(self._ticks, now)

    def _break_devices(self, now: float) -> None:
        self._sim_camera.break_with(active_kinds(self._faults, "camera", now), now)
        self._sim_head.break_with(active_kinds(self._faults, "head", now), now)
        self._sim_lamp.break_with(active_kinds(self._faults, "lamp", now), now)
        base = active_kinds(self._faults, "base", now)
        self._handling.set(base)
        if base != self._broken_base:
            switch_base_faults(self.brick, base - self._broken_base, self._broken_base - base)
            self._broken_base = base

    def _left_eye(self) -> tuple[Array, Array]:
        """Rotation (camera to room) and position of the left eye now, the base's pitch and roll included."""
        head = self._sim_head.true_pose
        rotation, position = self.mount.left_eye(head.pan, head.tilt)
        base = self.data.xmat[self._base].reshape(3, 3)
        return base @ rotation, self.data.xpos[self._base] + base @ position

    def _render(self, skew_s: float) -> tuple[Image, Image]:
        """Both eyes at the newest tick, BGR; the right one as seen `skew_s` seconds later."""
        newest = self._moments[-1]
        before = self._moments[-2] if len(self._moments) > 1 else newest
        drift = (newest.position - before.position) * (skew_s / TICK_S)
        right = newest.position + self.rig.baseline * newest.rotation[:, 0] + drift
        self._aim_lamp(newest)
        if self._renderer is None:
            self._renderer = EyeRenderer(self.model, self.data, WIDTH_PX, HEIGHT_PX)
        draw = self._renderer.draw
        return draw("left", newest.rotation, newest.position), draw("right", newest.rotation, right)

    def _aim_lamp(self, moment: Moment) -> None:
        light = self._lamp_light
        self.model.light_diffuse[light] = self._sim_lamp.light * LAMP_DIFFUSE
        self.data.light_xpos[light] = moment.position + 0.5 * self.rig.baseline * moment.rotation[:, 0]
        self.data.light_xdir[light] = moment.rotation[:, 2]


__all__ = ["HEIGHT_PX", "RIGS", "TICK_S", "WHEEL_RADIUS_M", "WIDTH_PX", "InjectedFault", "Moment", "World"]
