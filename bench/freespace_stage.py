"""A small world as a MuJoCo model that the robot's simulated eyes look at: pictures and true depth."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bench.freespace_geometry import Edge, Plate
from bench.freespace_layout import Surface, World
from bench.freespace_surfaces import dimmed, floor_picture
from bench.freespace_truth import FloorTruth, HandTruth
from calib.model import StereoRig
from robot.messages import Image
from robot.sim.builder import EYE_SEES, ROOM_GROUP
from robot.sim.cameras import EyeSettings, SimStereoCamera
from robot.sim.eye_renderer import EyeRenderer
from robot.sim.gl import mujoco
from robot.sim.lights import add_lights
from robot.sim.meshes import WHOLE, Mesh, Rect, clad, cylinder, join, quad
from robot.sim.textures import Picture
from robot.sim.world import LAMP_DIFFUSE

Array = NDArray[np.float64]
CELL_M, NEAR_CELL_M = 0.25, 0.12
"""Light is computed at vertices: faces are cut so finely."""
TREAD_M = 0.27
ROUND_STEPS = 64


def take_pictures(
    world: World, rig: StereoRig, rotation: Array, position: Array, rng: np.random.Generator
) -> tuple[Image, Image, NDArray[np.float32]]:
    """What both eyes see and the true depth (camera z, metres, inf: nothing) of the left picture's pixels.

    Args:
        world: what stands there.
        rig: parallel pair.
        rotation, position: of the left eye, camera to robot frame, as it really is.
        rng: the eyes' own weaknesses and noise.
    """
    model = _model(world, rig.left.width, rig.left.height, rng)
    model.cam_fovy[:] = math.degrees(2 * math.atan(0.5 * rig.left.height / rig.left.fy))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    right = position + rotation @ np.array([rig.baseline, 0.0, 0.0])
    _aim_lamp(model, data, world.lamp, 0.5 * (position + right), rotation[:, 2])
    renderer = EyeRenderer(model, data, rig.left.width, rig.left.height)
    try:
        eyes = SimStereoCamera(
            lambda _: (renderer.draw("left", rotation, position), renderer.draw("right", rotation, right)),
            rig.left.width, rig.left.height, EyeSettings(), *rng.spawn(2),
        )  # fmt: skip
        eyes.capture(1, 0.0)
        frame = eyes.latest(0.0)
    finally:
        renderer.close()
    assert frame is not None
    return frame.left, frame.right, _depth(model, data, rig, rotation, position)


def _aim_lamp(
    model: mujoco.MjModel, data: mujoco.MjData, level: float, position: Array, towards: Array
) -> None:
    lamp = model.light("lamp").id
    model.light_diffuse[lamp] = level * LAMP_DIFFUSE
    data.light_xpos[lamp], data.light_xdir[lamp] = position, towards


def _depth(
    model: mujoco.MjModel, data: mujoco.MjData, rig: StereoRig, rotation: Array, position: Array
) -> NDArray[np.float32]:
    """Rays one metre deep against the very shapes that are drawn: distances in their lengths are depths."""
    eye = rig.left
    u, v = np.meshgrid(np.arange(eye.width), np.arange(eye.height))
    local = np.stack([(u - eye.cx) / eye.fx, (v - eye.cy) / eye.fy, np.ones(u.shape)], axis=-1)
    rays = local.reshape(-1, 3) @ rotation.T
    depth, geom = np.full(len(rays), -1.0), np.full(len(rays), -1, np.int32)
    mujoco.mj_multiRay(
        model, data, position, rays.ravel(), np.array(EYE_SEES, np.uint8), True, -1, geom, depth, None,
        len(rays), 100.0,
    )  # fmt: skip
    return np.where(depth > 0.0, depth, np.inf).reshape(u.shape).astype(np.float32)


# ------------------------------------------------------------------------------------------------- model


def _model(world: World, width: int, height: int, rng: np.random.Generator) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    spec.visual.quality.offsamples = 0
    spec.stat.extent, spec.stat.center = 4.0, [1.5, 0.0, 0.5]
    spec.visual.map.znear, spec.visual.map.zfar = 0.006, 8.0
    paints = _Paints(spec)
    _walls(spec, world, paints)
    _floor(spec, world, paints)
    for k, thing in enumerate(world.things):
        _thing(spec, f"thing{k}", world, k, paints.of(thing.surface))
    if (
        isinstance(world.truth, HandTruth)
        and world.truth.plate is not None
        and world.plate_surface is not None
    ):
        mesh = _pierced(world.truth.plate, world.plate_surface.metres)
        _drawn(spec, "plate", mesh, paints.of(world.plate_surface))
    room = world.room
    # As the scenes are lit.
    add_lights(spec, (room.back, room.front), 2.0 * room.half, room.top, world.light, rng)
    for eye in ("left", "right"):
        spec.worldbody.add_camera(name=eye)
    return spec.compile()


class _Paints:
    """Materials of one model, each surface once."""

    def __init__(self, spec: mujoco.MjSpec) -> None:
        self._spec = spec
        self._known: dict[Surface, str] = {}

    def of(self, surface: Surface) -> str:
        """Name of the material for a surface."""
        if surface not in self._known:
            self._known[surface] = self.add(f"surface{len(self._known)}", dimmed(surface))
        return self._known[surface]

    def add(self, name: str, picture: Picture) -> str:
        """A material that shows a BGR picture; its name."""
        height, width = picture.shape[:2]
        texture = self._spec.add_texture(
            name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=width, height=height, nchannel=3
        )
        texture.data = np.ascontiguousarray(picture[..., ::-1]).tobytes()
        material = self._spec.add_material(name=name, specular=0.0, shininess=0.0)
        slots = material.textures
        slots[int(mujoco.mjtTextureRole.mjTEXROLE_RGB)] = name
        material.textures = slots
        return name


def _drawn(spec: mujoco.MjSpec, name: str, mesh: Mesh, material: str, **place: object) -> None:
    shape = spec.add_mesh(
        name=name, uservert=mesh.vertices.ravel(), usernormal=mesh.normals.ravel(),
        usertexcoord=mesh.uv.ravel(), userface=mesh.faces.ravel(),
    )  # fmt: skip
    shape.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    spec.worldbody.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, material=material, group=ROOM_GROUP,
        contype=0, conaffinity=0, mass=0.0, **place,
    )  # fmt: skip


def _tiled(
    corner: tuple[float, ...], right: tuple[float, ...], down: tuple[float, ...], metres: float
) -> Mesh:
    """A flat face clad in a picture that repeats every `metres`."""
    across, deep = np.array(right, np.float64), np.array(down, np.float64)
    rect: Rect = (0.0, 0.0, float(np.linalg.norm(across)) / metres, float(np.linalg.norm(deep)) / metres)
    return quad(np.array(corner, np.float64), across, deep, rect, CELL_M)


def _walls(spec: mujoco.MjSpec, world: World, paints: _Paints) -> None:
    room, look = world.room, world.walls
    long, half, low, top = room.front - room.back, room.half, room.bottom, room.top
    tall, metres = top - low, look.metres
    faces = (
        _tiled((room.back, -half, top), (0, 2 * half, 0), (0, 0, -tall), metres),
        _tiled((room.front, -half, top), (-long, 0, 0), (0, 0, -tall), metres),
        _tiled((room.front, half, top), (0, -2 * half, 0), (0, 0, -tall), metres),
        _tiled((room.back, half, top), (long, 0, 0), (0, 0, -tall), metres),
    )
    _drawn(spec, "walls", join(*faces), paints.of(look))
    ceiling = _tiled((room.back, -half, top), (long, 0, 0), (0, 2 * half, 0), 0.9)
    _drawn(spec, "ceiling", ceiling, paints.of(Surface("plaster", 0, 0.9, 1.1)))


def _floor(spec: mujoco.MjSpec, world: World, paints: _Paints) -> None:
    room, truth = world.room, world.truth
    edge = truth.edge if isinstance(truth, FloorTruth) else None
    if edge is not None:
        _stairs(spec, world, edge, paints)
        return
    if isinstance(truth, HandTruth):
        long = room.front - room.back
        under = _tiled((room.back, room.half, room.bottom), (long, 0, 0), (0, -2 * room.half, 0), 0.5)
        _drawn(spec, "floor", under, paints.of(world.ground.surface))
        return
    corner, right = np.array([room.back, room.half, 0.0]), np.array([room.front - room.back, 0.0, 0.0])
    mesh = quad(corner, right, np.array([0.0, -2 * room.half, 0.0]), WHOLE, CELL_M)
    _drawn(spec, "floor", mesh, paints.add("floor", floor_picture(world)))


def _stairs(spec: mujoco.MjSpec, world: World, edge: Edge, paints: _Paints) -> None:
    """The upper floor up to its edge, and the treads behind it."""
    ground = world.ground
    ahead, aside = (
        np.array([math.cos(edge.yaw), math.sin(edge.yaw), 0.0]),
        np.array([-math.sin(edge.yaw), math.cos(edge.yaw), 0.0]),
    )
    back, half = 2.5, 3.0
    material, lower = paints.of(ground.surface), paints.of(ground.lower or ground.surface)
    metres = ground.surface.metres

    def level(name: str, begin: float, end: float, z: float, look: str) -> None:
        corner = begin * ahead + half * aside + np.array([0.0, 0.0, z])
        _drawn(
            spec,
            name,
            _tiled(tuple(corner), tuple((end - begin) * ahead), tuple(-2 * half * aside), metres),
            look,
        )

    level("floor", edge.distance - back, edge.distance, 0.0, material)
    if "nosing" in ground.marks:
        strip = paints.of(Surface("tiles", 3, 0.7, 0.6))
        level("nosing", edge.distance - 0.03, edge.distance, 0.0005, strip)
    for k in range(1, ground.treads + 1):
        begin = edge.distance + (k - 1) * TREAD_M
        end = begin + TREAD_M if k < ground.treads else begin + 6.0
        level(f"tread{k}", begin, end, -k * edge.drop, lower)


def _thing(spec: mujoco.MjSpec, name: str, world: World, index: int, material: str) -> None:
    solid, metres = world.things[index].solid, world.things[index].surface.metres
    half_z = 0.5 * (solid.top - solid.bottom)
    place = {
        "pos": [solid.x, solid.y, solid.bottom + half_z],
        "quat": [math.cos(solid.yaw / 2), 0.0, 0.0, math.sin(solid.yaw / 2)],
    }
    if solid.kind == "cylinder":
        around: Rect = (0.0, 0.0, math.tau * solid.half_x / metres, 2 * half_z / metres)
        mesh = cylinder(solid.half_x, 2 * half_z, around, (0.0, 0.0, 0.2, 0.2), NEAR_CELL_M, 24)
    else:
        mesh = clad((solid.half_x, solid.half_y, half_z), metres, NEAR_CELL_M)
    _drawn(spec, name, mesh, material, **place)


def _pierced(plate: Plate, metres: float) -> Mesh:
    """The plate's face with its round opening, and the opening's inner wall."""
    angles = np.linspace(0.0, math.tau, ROUND_STEPS + 1)
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    to_side = plate.half / np.abs(ring).max(axis=1)
    shares = np.concatenate([np.linspace(0.0, 1.0, 8)])[:, None]
    reach = plate.radius + (to_side - plate.radius) * shares**2
    face = _lattice(plate, reach[..., None] * ring, np.zeros_like(reach), metres)
    depth = plate.thickness * np.array([[1.0], [0.0]]) * np.ones(len(angles))
    inner = _lattice(plate, plate.radius * np.stack([ring, ring]), depth, metres)
    return join(face, inner)


def _lattice(plate: Plate, flat: Array, depth: Array, metres: float) -> Mesh:
    """A lattice (rows, steps) of points in the plate's frame as a mesh; flat: left and up of the centre."""
    c, s = math.cos(plate.yaw), math.sin(plate.yaw)
    axes = np.array([[-s, c, 0.0], [0.0, 0.0, 1.0], [c, s, 0.0]])
    local = np.concatenate([flat, depth[..., None]], axis=-1)
    points = np.array(plate.centre) + local @ axes
    rows, steps = depth.shape
    index = np.arange(rows * steps).reshape(rows, steps)
    a, b, e, d = (i.ravel() for i in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
    faces = np.concatenate([np.column_stack([a, e, b]), np.column_stack([b, e, d])])
    along, around = points[1, 0] - points[0, 0], points[0, 1] - points[0, 0]
    if np.ptp(depth) == 0.0:
        normals = np.tile(-axes[2], (rows * steps, 1))
    else:
        inward = np.concatenate([-flat, np.zeros_like(depth)[..., None]], axis=-1) @ axes
        normals = (inward / np.linalg.norm(inward, axis=-1, keepdims=True)).reshape(-1, 3)
    if float(np.cross(along, around) @ normals[0]) < 0.0:
        faces = faces[:, ::-1]
    uv = (np.stack([-flat[..., 0], -flat[..., 1] + depth], axis=-1) / metres).reshape(-1, 2)
    return Mesh(points.reshape(-1, 3), normals, uv, np.ascontiguousarray(faces, np.int32))
