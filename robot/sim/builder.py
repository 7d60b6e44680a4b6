"""From a drawn room to a MuJoCo model: surfaces, obstacles, objects, lights and the robot's body.

Geom groups: 0 the room and its obstacles, 1 the target, 2 the robot (the eyes do not see it), 3 bare
collision shapes (never drawn). What is drawn never collides and what collides is never drawn.
"""

from __future__ import annotations

import math

import numpy as np

from robot.sim import textures
from robot.sim.gl import mujoco
from robot.sim.layout import Layout, Placed
from robot.sim.lights import add_lights
from robot.sim.meshes import WHOLE, Mesh, clad, cylinder, quad
from robot.sim.motor import ROTOR_INERTIA
from robot.sim.objects import SHAPES
from robot.sim.room import RoomPictures
from robot.sim.solids import Solid
from robot.sim.textures import Picture

ROOM_GROUP, TARGET_GROUP, ROBOT_GROUP, COLLISION_GROUP = 0, 1, 2, 3
EYE_SEES = (1, 1, 0, 0, 0, 0)
"""Groups that the eyes, and rays that stand for them, see."""

TIMESTEP_S = 0.002
WHEEL_RADIUS_M = 0.028
TRACK_WIDTH_M = 0.15
CLADDING_M = 0.7
CLADDING_PX = 420

FLOOR = "floor"
ROBOT_PARTS = ("base_box", "base_mast", "base_eyes", "wheel_left", "wheel_right", "caster")
LEFT_WHEEL, RIGHT_WHEEL = "wheel_left", "wheel_right"


def build_model(
    layout: Layout, pictures: RoomPictures, rng: np.random.Generator, width: int, height: int
) -> mujoco.MjModel:
    """Compile the model of one room. width, height: of the eyes' pictures, pixels."""
    spec = mujoco.MjSpec()
    spec.option.timestep = TIMESTEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.visual.global_.offwidth, spec.visual.global_.offheight = max(width, 640), max(height, 480)
    spec.visual.quality.offsamples = 0
    spec.stat.extent, spec.stat.center = 4.0, [layout.length / 2, 0.0, 0.5]
    spec.visual.map.znear, spec.visual.map.zfar = 0.006, 8.0
    _room(spec, layout, pictures)
    add_lights(spec, (0.0, layout.length), layout.width, layout.height, layout.light, rng)
    for k, body in enumerate(layout.bodies):
        cover = _material(
            spec, f"cover{k}", textures.any_surface(rng, CLADDING_PX, CLADDING_PX, CLADDING_PX / CLADDING_M)
        )
        for j, solid in enumerate(body.solids):
            _obstacle(spec, f"obstacle{k}_{j}", solid, cover)
    for k, distractor in enumerate(layout.distractors):
        _object(spec, f"distractor{k}", distractor, ROOM_GROUP)
    if layout.target is not None:
        _object(spec, "target", layout.target, TARGET_GROUP)
    _robot(spec, layout)
    for eye in ("left", "right"):
        spec.worldbody.add_camera(name=eye)
    return spec.compile()


def _material(spec: mujoco.MjSpec, name: str, picture: Picture) -> str:
    height, width = picture.shape[:2]
    texture = spec.add_texture(
        name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=width, height=height, nchannel=3
    )
    texture.data = np.ascontiguousarray(picture[..., ::-1]).tobytes()
    material = spec.add_material(name=name, specular=0.0, shininess=0.0)
    slots = material.textures
    slots[int(mujoco.mjtTextureRole.mjTEXROLE_RGB)] = name
    material.textures = slots
    return name


def _drawn(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    name: str,
    mesh: Mesh,
    material: str,
    group: int,
    **place: object,
) -> None:
    """Add a mesh that is seen and never touched."""
    shape = spec.add_mesh(
        name=name, uservert=mesh.vertices.ravel(), usernormal=mesh.normals.ravel(),
        usertexcoord=mesh.uv.ravel(), userface=mesh.faces.ravel(),
    )  # fmt: skip
    shape.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    body.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, material=material, group=group,
        contype=0, conaffinity=0, mass=0.0, **place,
    )  # fmt: skip


def _room(spec: mujoco.MjSpec, layout: Layout, pictures: RoomPictures) -> None:
    length, half, top = layout.length, layout.width / 2, layout.height
    world = spec.worldbody

    def surface(
        name: str,
        picture: Picture,
        corner: tuple[float, ...],
        right: tuple[float, ...],
        down: tuple[float, ...],
    ) -> None:
        mesh = quad(np.array(corner), np.array(right), np.array(down), WHOLE, 0.25)
        _drawn(spec, world, f"{name}_picture", mesh, _material(spec, name, picture), ROOM_GROUP)

    surface("wall_back", pictures.walls[0], (0, -half, top), (0, 2 * half, 0), (0, 0, -top))
    surface("wall_right", pictures.walls[1], (length, -half, top), (-length, 0, 0), (0, 0, -top))
    surface("wall_front", pictures.walls[2], (length, half, top), (0, -2 * half, 0), (0, 0, -top))
    surface("wall_left", pictures.walls[3], (0, half, top), (length, 0, 0), (0, 0, -top))
    surface("floor_surface", pictures.floor, (0, half, 0), (length, 0, 0), (0, -2 * half, 0))
    surface("ceiling", pictures.ceiling, (0, -half, top), (length, 0, 0), (0, 2 * half, 0))
    world.add_geom(
        name=FLOOR,
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 1],
        group=COLLISION_GROUP,
        friction=[0.9, 0.005, 0.0001],
    )
    thick = 0.1
    for name, x, y, half_x, half_y in (
        ("back", -thick, 0.0, thick, half + 0.2),
        ("front", length + thick, 0.0, thick, half + 0.2),
        ("right", length / 2, -half - thick, length / 2, thick),
        ("left", length / 2, half + thick, length / 2, thick),
    ):
        _collider(
            world, f"room_{name}", mujoco.mjtGeom.mjGEOM_BOX, [half_x, half_y, top / 2], pos=[x, y, top / 2]
        )


def _collider(
    body: mujoco.MjsBody, name: str, kind: mujoco.mjtGeom, size: list[float], **place: object
) -> None:
    body.add_geom(
        name=name, type=kind, size=size, group=COLLISION_GROUP, friction=[0.6, 0.005, 0.0001], **place
    )


def _obstacle(spec: mujoco.MjSpec, name: str, solid: Solid, material: str) -> None:
    half_z = (solid.top - solid.bottom) / 2
    place = {
        "pos": [solid.x, solid.y, solid.bottom + half_z],
        "quat": [math.cos(solid.yaw / 2), 0.0, 0.0, math.sin(solid.yaw / 2)],
    }
    if solid.kind == "cylinder":
        around = math.tau * solid.half_x / CLADDING_M
        mesh = cylinder(
            solid.half_x, 2 * half_z, (0, 0, around, 2 * half_z / CLADDING_M), (0, 0, 0.2, 0.2), 0.15, 16
        )
        _collider(spec.worldbody, name, mujoco.mjtGeom.mjGEOM_CYLINDER, [solid.half_x, half_z, 0], **place)
    else:
        mesh = clad((solid.half_x, solid.half_y, half_z), CLADDING_M, 0.15)
        _collider(
            spec.worldbody, name, mujoco.mjtGeom.mjGEOM_BOX, [solid.half_x, solid.half_y, half_z], **place
        )
    _drawn(spec, spec.worldbody, f"{name}_seen", mesh, material, ROOM_GROUP, **place)


def _object(spec: mujoco.MjSpec, name: str, placed: Placed, group: int) -> None:
    """A target or a look-alike, on its pedestal if it has one. The target's body can be moved (mocap)."""
    shape = SHAPES[placed.shape]
    body = spec.worldbody.add_body(
        name=name, pos=[placed.pose.x, placed.pose.y, 0.0], mocap=name == "target",
        quat=[math.cos(placed.pose.yaw / 2), 0.0, 0.0, math.sin(placed.pose.yaw / 2)],
    )  # fmt: skip
    mesh, picture = shape.build(placed.design)
    raised = mesh.shifted(0.0, 0.0, placed.pedestal)
    _drawn(spec, body, f"{name}_seen", raised, _material(spec, name, picture), group)
    half_z = (placed.pedestal + shape.height) / 2
    size = [shape.half_x, shape.half_y, half_z]
    _collider(body, f"{name}_solid", mujoco.mjtGeom.mjGEOM_BOX, size, pos=[0.0, 0.0, half_z])
    if placed.pedestal > 0:
        rng = np.random.default_rng([31, placed.design])
        cover = _material(spec, f"{name}_pedestal", textures.wood(rng, 256, 256, 500.0))
        half = (shape.half_x, shape.half_y, placed.pedestal / 2)
        _drawn(
            spec, body, f"{name}_stand", clad(half, 0.5), cover, group, pos=[0.0, 0.0, placed.pedestal / 2]
        )


def _robot(spec: mujoco.MjSpec, layout: Layout) -> None:
    """The differential base: origin on the floor below the middle of the axle, x forward."""
    start = layout.start
    base = spec.worldbody.add_body(
        name="base",
        pos=[start.x, start.y, 0.0],
        quat=[math.cos(start.yaw / 2), 0.0, 0.0, math.sin(start.yaw / 2)],
    )
    base.add_freejoint(name="base")
    # The weight lies behind the axle, so that braking does not lift the caster.
    base.mass, base.ipos, base.inertia, base.explicitinertial = (
        1.5,
        [-0.03, 0.0, 0.08],
        [0.008, 0.009, 0.009],
        True,
    )
    part = {"group": ROBOT_GROUP, "friction": [0.4, 0.005, 0.0001], "rgba": [0.9, 0.45, 0.1, 1.0]}
    geom = mujoco.mjtGeom
    base.add_geom(name="base_box", type=geom.mjGEOM_BOX, size=[0.1, 0.08, 0.1], pos=[0, 0, 0.12], **part)
    base.add_geom(
        name="base_mast", type=geom.mjGEOM_CYLINDER, size=[0.015, 0.015, 0], pos=[0.06, 0, 0.225], **part
    )
    base.add_geom(
        name="base_eyes", type=geom.mjGEOM_CYLINDER, size=[0.05, 0.025, 0], pos=[0.06, 0, 0.25], **part
    )
    # Contact friction is the larger of both geoms: priority and a single dimension make the caster slide.
    base.add_geom(
        name="caster", type=geom.mjGEOM_SPHERE, size=[0.012, 0, 0], pos=[-0.085, 0, 0.012],
        group=ROBOT_GROUP, priority=1, condim=1,
    )  # fmt: skip
    for name, side in ((LEFT_WHEEL, 1), (RIGHT_WHEEL, -1)):
        wheel = base.add_body(name=name, pos=[0.0, side * TRACK_WIDTH_M / 2, WHEEL_RADIUS_M])
        joint = wheel.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
        joint.armature = ROTOR_INERTIA
        wheel.add_geom(
            name=name, type=geom.mjGEOM_ELLIPSOID, size=[WHEEL_RADIUS_M, 0.01, WHEEL_RADIUS_M], mass=0.03,
            group=ROBOT_GROUP, friction=[1.1, 0.002, 0.0001], rgba=[0.15, 0.15, 0.15, 1.0],
        )  # fmt: skip
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
