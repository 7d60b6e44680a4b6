"""A scene with everything random drawn: one room as it really stands. Pure; same seed, same room.

`draw_layout` redraws until the room makes sense: no two bodies overlap, a robot of the real width can reach
a place from which it sees the target at the stand-off, and what the scene requires of the start holds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.messages import Pose2
from robot.sim.objects import SHAPES
from robot.sim.scene import SIZES, Obstacle, Ranged, Scene, SceneError
from robot.sim.solids import Solid, overlap
from robot.sim.ways import Ways

TRIES = 150
ROBOT_RADIUS_M = 0.13
START_CLEARANCE_M = 0.08
BODY_CLEARANCE_M = 0.02


@dataclass(frozen=True, slots=True)
class Placed:
    """An object standing in the room: its shape, which print it bears, where it stands."""

    shape: str
    design: int
    pose: Pose2
    pedestal: float


@dataclass(frozen=True, slots=True)
class Stop:
    """A place on the target's way and how long it rests there, metres and seconds."""

    x: float
    y: float
    pause: float


@dataclass(frozen=True, slots=True)
class Motion:
    """How the target moves: its stops in order, its speed, and when it sets out."""

    stops: tuple[Stop, ...] = ()
    speed: float = 0.08
    starts_at: float = 0.0
    starts_within: float | None = None


@dataclass(frozen=True, slots=True)
class Body:
    """An obstacle: its shape's name and the solids it is made of."""

    shape: str
    solids: tuple[Solid, ...]


@dataclass(frozen=True, slots=True)
class Layout:
    """One room, everything drawn. Lengths in metres, room frame."""

    length: float
    width: float
    height: float
    start: Pose2
    light: float
    noise: float
    blur_px: float
    skew_s: float
    dropped: float
    target: Placed | None
    motion: Motion
    distractors: tuple[Placed, ...]
    bodies: tuple[Body, ...]

    @property
    def solids(self) -> tuple[Solid, ...]:
        """Everything that never moves: obstacles and distractors."""
        return tuple(s for b in self.bodies for s in b.solids) + tuple(
            object_solid(d) for d in self.distractors
        )

    @property
    def ways(self) -> Ways:
        """Free ways between the things that never move."""
        return Ways(self.length, self.width, self.solids)


def object_solid(placed: Placed) -> Solid:
    """The bounding solid of an object with its pedestal."""
    shape = SHAPES[placed.shape]
    half_x, half_y = shape.half_x, shape.half_y
    pose = placed.pose
    return Solid("box", pose.x, pose.y, pose.yaw, half_x, half_y, 0.0, placed.pedestal + shape.height)


def draw_layout(scene: Scene, rng: np.random.Generator) -> Layout:
    """Draw the room of `scene`; SceneError if none of `TRIES` draws makes sense, with the last reason."""
    reason = ""
    for _ in range(TRIES):
        layout = _draw(scene, rng)
        reason = _refusal(scene, layout)
        if not reason:
            return layout
    raise SceneError(f"scene '{scene.name}': no room of {TRIES} drawn works; the last: {reason}")


def _draw(scene: Scene, rng: np.random.Generator) -> Layout:
    def number(value: Ranged) -> float:
        return round(float(rng.uniform(*value)), 5) if isinstance(value, tuple) else float(value)

    side = -1.0 if scene.mirror and rng.random() < 0.5 else 1.0

    def pose(x: Ranged, y: Ranged, heading_deg: Ranged) -> Pose2:
        return Pose2(number(x), side * number(y), side * math.radians(number(heading_deg)))

    length, width, height = (
        number(scene.room.length_m),
        number(scene.room.width_m),
        number(scene.room.height_m),
    )
    start = pose(scene.robot.x, scene.robot.y, scene.robot.heading_deg)
    target, motion = None, Motion()
    if scene.target is not None:
        t = scene.target
        target = Placed(t.object, 0, pose(t.x, t.y, t.heading_deg), number(t.pedestal_m))
        stops = tuple(Stop(number(w.x), side * number(w.y), number(w.pause_s)) for w in t.waypoints)
        if t.motion == "hides":
            home = Stop(target.pose.x, target.pose.y, 0.0)
            stops = (*stops, *(Stop(s.x, s.y, 0.0) for s in reversed(stops[:-1])), home)
        within = None if t.starts_within_m is None else number(t.starts_within_m)
        motion = Motion(stops, number(t.speed_m_s), number(t.starts_s), within)
    distractors = tuple(
        Placed(d.object, d.design, pose(d.x, d.y, d.heading_deg), number(d.pedestal_m))
        for d in scene.distractors
    )
    bodies = []
    for obstacle in scene.obstacles:
        sizes = {
            key: number(value) if (value := getattr(obstacle, key)) is not None else default
            for key, default in SIZES[obstacle.shape].items()
        }
        where = pose(obstacle.x, obstacle.y, obstacle.heading_deg)
        bodies.append(Body(obstacle.shape, _solids(obstacle, where, sizes, side)))
    eyes = scene.camera
    return Layout(
        length, width, height, start, number(scene.light.level), number(eyes.noise), number(eyes.blur_px),
        number(eyes.skew_s), number(eyes.dropped), target, motion, distractors, tuple(bodies),
    )  # fmt: skip


def _solids(obstacle: Obstacle, pose: Pose2, sizes: dict[str, float], side: float) -> tuple[Solid, ...]:
    """The solids of one obstacle. `side` -1 mirrors what is not symmetric."""

    def box(x: float, y: float, half_x: float, half_y: float, bottom: float, top: float) -> Solid:
        centre = pose.compose(Pose2(x, side * y, 0.0))
        return Solid("box", centre.x, centre.y, centre.yaw, half_x, half_y, bottom, top)

    height = sizes["height_m"]
    if obstacle.shape == "post":
        return (Solid("cylinder", pose.x, pose.y, 0.0, sizes["radius_m"], sizes["radius_m"], 0.0, height),)
    half_length = sizes["length_m"] / 2
    if obstacle.shape == "wall":
        return (box(0.0, 0.0, 0.04, half_length, 0.0, height),)
    if obstacle.shape == "gate":
        half_part = (half_length - sizes["gap_m"] / 2) / 2
        offset = half_length - half_part
        return (
            box(0.0, offset, 0.05, half_part, 0.0, height),
            box(0.0, -offset, 0.05, half_part, 0.0, height),
        )
    half_width = sizes["width_m"] / 2
    if obstacle.shape == "l":
        thick = 0.07
        return (
            box(half_length - thick, 0.0, thick, half_width, 0.0, height),
            box(-thick, half_width - thick, half_length - thick, thick, 0.0, height),
        )
    if obstacle.shape == "table":
        x, y = half_width - 0.03, half_length - 0.03
        legs = tuple(box(i * x, j * y, 0.02, 0.02, 0.0, height - 0.03) for i in (-1, 1) for j in (-1, 1))
        return (*legs, box(0.0, 0.0, half_width, half_length, height - 0.03, height))
    return (box(0.0, 0.0, half_width, half_length, 0.0, height),)


def _refusal(scene: Scene, layout: Layout) -> str:
    """Why this draw makes no sense, in words; empty if it does."""
    groups = [(f"obstacles[{i}]", body.solids) for i, body in enumerate(layout.bodies)]
    groups += [(f"distractors[{i}]", (object_solid(d),)) for i, d in enumerate(layout.distractors)]
    if layout.target is not None:
        groups.append(("target", (object_solid(layout.target),)))
    robot = Solid("cylinder", layout.start.x, layout.start.y, 0.0, ROBOT_RADIUS_M, ROBOT_RADIUS_M, 0.0, 0.32)
    groups.append(("robot", (robot,)))
    reason = _overlap(groups, robot) or _outside(layout, groups)
    return reason or _not_as_required(scene, layout)


def _overlap(groups: list[tuple[str, tuple[Solid, ...]]], robot: Solid) -> str:
    for i, (name, solids) in enumerate(groups):
        for other, others in groups[i + 1 :]:
            space = START_CLEARANCE_M if others == (robot,) else BODY_CLEARANCE_M
            if any(overlap(a, b, space) for a in solids for b in others):
                return f"{name} and {other} overlap: move them apart"
    return ""


def _outside(layout: Layout, groups: list[tuple[str, tuple[Solid, ...]]]) -> str:
    for name, solids in groups:
        for x, y in (corner for s in solids for corner in s.outline):
            inside = 0.0 <= x <= layout.length and abs(y) <= layout.width / 2
            # Walls and gates may run into the room's walls; they close the way there.
            if not inside and not (name.startswith("obstacles") and _is_wall(layout, name)):
                return f"{name} stands outside the room ({layout.length:.2f} x {layout.width:.2f} m)"
    return ""


def _is_wall(layout: Layout, name: str) -> bool:
    return layout.bodies[int(name.split("[")[1].rstrip("]"))].shape in ("wall", "gate")


def _not_as_required(scene: Scene, layout: Layout) -> str:
    if layout.target is None:
        return ""
    ways, start, target = layout.ways, layout.start, layout.target.pose
    seen = ways.sees((start.x, start.y), (target.x, target.y))
    if scene.require.target_visible not in (None, seen):
        return f"the target is {'seen' if seen else 'not seen'} from the start"
    way = ways.shortest_way((start.x, start.y), (target.x, target.y), scene.stand_off_m)
    if way is None:
        return "the robot has no way to a place from which it sees the target: make room"
    blocked = ways.corridor_blocked((start.x, start.y), (target.x, target.y), scene.stand_off_m)
    if scene.require.straight_way_blocked not in (None, blocked):
        return f"the straight way is {'blocked' if blocked else 'free'}"
    return _bad_path(layout, ways) or _unreachable_end(scene, layout, ways)


def _bad_path(layout: Layout, ways: Ways) -> str:
    assert layout.target is not None
    here = (layout.target.pose.x, layout.target.pose.y)
    for stop in layout.motion.stops:
        if not ways.line_free(here, (stop.x, stop.y), 0.13):
            return "the target's path runs through an obstacle or a wall: mend target.waypoints"
        here = (stop.x, stop.y)
    return ""


def _unreachable_end(scene: Scene, layout: Layout, ways: Ways) -> str:
    if not layout.motion.stops:
        return ""
    end = layout.motion.stops[-1]
    if ways.shortest_way((layout.start.x, layout.start.y), (end.x, end.y), scene.stand_off_m) is None:
        return "the robot has no way to the target's last stop: mend target.waypoints"
    return ""
