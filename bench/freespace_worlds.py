"""Random small worlds for the free-space bench: what stands, how it looks, how the robot stands in it. Pure.

Everything is laid out in the robot frame (x forward, y left, z up; metres, radians), so that what was drawn
is also the truth. The same kind and seed give the same world. Hands look along x from the origin, see
`freespace_truth`; their worlds are in `freespace_hand_worlds`.
"""

from __future__ import annotations

import math

import numpy as np

from bench.freespace_geometry import Edge
from bench.freespace_layout import FLOORS, RICH, WALLS, Ground, Room, Surface, Thing, World, cover
from bench.freespace_truth import BASE, FloorTruth, Gap
from robot.sim.solids import Solid

FLOOR_M = 0.95
"""A floor's picture repeats every so many metres."""
EYE_HEIGHT_M, EYE_FORWARD_M = 0.25, 0.08
HALF_VIEW = (math.atan(176 / 305), math.atan(144 / 305))
"""Half of the base eyes' view, sideways and upwards."""
LINED = ("tape", "chequers", "rug", "print", "shadow")


def draw_world(kind: str, rng: np.random.Generator) -> World:
    """A random world for the base.

    Raises:
        ValueError: no such kind.
    """
    if kind not in _DRAWN:
        raise ValueError(f"no worlds of kind '{kind}': choose one of {', '.join(sorted(_DRAWN))}")
    return _DRAWN[kind](rng)


# ------------------------------------------------------------------------------------------- ingredients


def _room(rng: np.random.Generator) -> Room:
    return Room(
        -0.7, float(rng.uniform(2.3, 3.6)), float(rng.uniform(1.0, 1.7)), 0.0, float(rng.uniform(2.2, 2.7))
    )


def _ground(rng: np.random.Generator, marks: tuple[str, ...] = ()) -> Ground:
    return Ground(cover(rng, FLOORS, FLOOR_M, plain=0.0), marks, int(rng.integers(1 << 30)))


def _degrees(rng: np.random.Generator, low: float, high: float) -> float:
    return math.radians(float(rng.uniform(low, high)))


def _box(centre: tuple[float, float], yaw: float, ahead: tuple[float, float], aside: tuple[float, float],
         heights: tuple[float, float]) -> Solid:  # fmt: skip
    """A box between `ahead` and `aside` (left positive) of a frame at `centre` that is turned by `yaw`."""
    x, y = 0.5 * sum(ahead), 0.5 * sum(aside)
    c, s = math.cos(yaw), math.sin(yaw)
    return Solid(
        "box", centre[0] + c * x - s * y, centre[1] + s * x + c * y, yaw,
        0.5 * (ahead[1] - ahead[0]), 0.5 * (aside[1] - aside[0]), heights[0], heights[1],
    )  # fmt: skip


def nearest_seen(tilt: float) -> float:
    """From here on (x, metres) the floor straight before the head is in the picture."""
    return EYE_FORWARD_M + EYE_HEIGHT_M / math.tan(tilt + HALF_VIEW[1])


def seen_height(tilt: float, off_pan: float, away: float) -> float:
    """Height of the picture's upper edge `away` metres from the robot, `off_pan` beside the axis."""
    # Rows of a pinhole picture: a point beside the axis at the same row lies on a lower ray.
    ahead = (away - EYE_FORWARD_M) * math.cos(off_pan)
    return EYE_HEIGHT_M + ahead * math.tan(HALF_VIEW[1] - tilt)


def _view(pan: float) -> tuple[float, float]:
    reach = HALF_VIEW[0] - math.radians(4.0)
    return pan - reach, pan + reach


def _distant_things(rng: np.random.Generator, room: Room, nearest: float) -> tuple[Thing, ...]:
    """A few boxes and drums between `nearest` and the far wall: the other side of a room."""
    things = []
    for _ in range(int(rng.integers(0, 4))):
        x, y = rng.uniform(nearest + 0.25, room.front), rng.uniform(-room.half, room.half)
        half_x, half_y, top = (float(n) for n in rng.uniform((0.06, 0.06, 0.15), (0.2, 0.2, 1.0)))
        yaw = float(rng.uniform(-1.5, 1.5))
        if rng.random() < 0.3:
            solid = Solid("cylinder", float(x), float(y), 0.0, half_x, half_x, 0.0, top)
        else:
            solid = Solid("box", float(x), float(y), yaw, half_x, half_y, 0.0, top)
        things.append(Thing(solid, cover(rng)))
    return tuple(things)


# ------------------------------------------------------------------------------------------------ worlds


def _open(rng: np.random.Generator, marks: tuple[str, ...] = (), reach: float = 1.5) -> World:
    room, pan, tilt = _room(rng), _degrees(rng, -12, 12), _degrees(rng, 12, 25)
    things = _distant_things(rng, room, reach)
    truth = FloorTruth(
        _solids(things, room), open_to=1.3, seen_height=seen_height(tilt, 0.0, 1.05), view=_view(pan)
    )
    return World(things, _ground(rng, marks), room, cover(rng, WALLS, 2.2, 0.15), truth, pan, tilt)


def _lines(rng: np.random.Generator) -> World:
    count = int(rng.integers(1, 4))
    marks = tuple(str(m) for m in rng.choice(LINED, count, replace=False))
    return _open(rng, marks)


def _narrow(rng: np.random.Generator) -> World:
    """Two walls, boxes or posts with a gap of 0.5 to 1.8 times the body's width."""
    room, width = _room(rng), float(rng.uniform(0.5, 1.8)) * BASE.width
    away, bearing, turned = float(rng.uniform(0.6, 1.4)), _degrees(rng, -12, 12), _degrees(rng, -25, 25)
    if rng.random() < 0.5:
        turned *= 0.2
    tilt, pan = _tilt_that_sees(rng, away), bearing + _degrees(rng, -5, 5)
    centre, yaw = (away * math.cos(bearing), away * math.sin(bearing)), bearing + turned
    style = ("walls", "boxes", "posts")[int(rng.choice(3, p=(0.4, 0.4, 0.2)))]
    sides = []
    for side in (-1, 1):
        deep = float(rng.uniform(0.03, 0.08) if style == "walls" else rng.uniform(0.1, 0.35))
        wide = 1.6
        if style == "posts":
            deep = wide = float(rng.uniform(0.03, 0.1))
        top = float(rng.uniform(0.4, 1.4))
        aside = (0.5 * width, 0.5 * width + wide) if side > 0 else (-0.5 * width - wide, -0.5 * width)
        sides.append(Thing(_box(centre, yaw, (0.0, deep), aside, (0.0, top)), cover(rng)))
    if rng.random() < 0.3:
        sides[1] = Thing(sides[1].solid, sides[0].surface)
    things = (*sides, *_distant_things(rng, room, away + 0.6))
    gap = Gap(width, (*centre, 0.0), yaw=turned)
    high = seen_height(tilt, pan - bearing, away)
    truth = FloorTruth(_solids(things, room), gap=gap, seen_height=high, view=_view(pan))
    return World(things, _ground(rng), room, cover(rng, WALLS, 2.2, 0.1), truth, pan, tilt)


def _tilt_that_sees(rng: np.random.Generator, away: float) -> float:
    """Mostly a tilt that shows the whole height of the body at the gap; some that do not."""
    highest = 25.0
    if rng.random() < 0.9:
        whole = HALF_VIEW[1] - math.atan((1.08 * BASE.height - EYE_HEIGHT_M) / (away - EYE_FORWARD_M))
        highest = min(max(math.degrees(whole), 10.0), 25.0)
    return _degrees(rng, min(12.0, highest - 1.0), highest)


def _dark(rng: np.random.Generator) -> World:
    """A gap or open floor by the light of the lamp."""
    world = _narrow(rng) if rng.random() < 0.5 else _open(rng)
    return World(
        world.things, world.ground, world.room, world.walls, world.truth, world.pan, world.tilt,
        light=float(rng.uniform(0.02, 0.1)), lamp=1.0,
    )  # fmt: skip


def _wall(rng: np.random.Generator) -> World:
    """A wall across the whole view, up to two turns of it."""
    room, tilt, pan = _room(rng), _degrees(rng, 12, 25), _degrees(rng, -10, 10)
    away, turned = float(rng.uniform(0.32, 0.9)), _degrees(rng, -35, 35)
    centre, yaw = (away * math.cos(pan), away * math.sin(pan)), pan + turned
    top = float(rng.choice((rng.uniform(0.4, 1.0), 2.2)))
    things = (Thing(_box(centre, yaw, (0.0, 0.1), (-3.0, 3.0), (0.0, top)), cover(rng, WALLS, 0.9, 0.3)),)
    truth = FloorTruth(_solids(things, room), view=_view(pan))
    return World(things, _ground(rng), room, cover(rng, WALLS, 2.2), truth, pan, tilt)


def _step_up(rng: np.random.Generator) -> World:
    """A door sill or a platform of 30 to 120 mm across the way, within 0.8 m."""
    room, tilt, pan = _room(rng), _degrees(rng, 12, 25), _degrees(rng, -8, 8)
    away = float(rng.uniform(nearest_seen(tilt) + 0.06, 0.8))
    yaw = pan + _degrees(rng, -25, 25)
    centre, top = (away * math.cos(pan), away * math.sin(pan)), float(rng.uniform(0.03, 0.12))
    sill = rng.random() < 0.5
    deep = float(rng.uniform(0.04, 0.15)) if sill else 5.0
    ground = _ground(rng)
    alike = Surface(ground.surface.name, ground.surface.number, 0.7, ground.surface.gain)
    step = alike if rng.random() < 0.3 else cover(rng, RICH, 0.7, 0.0)
    things = (Thing(_box(centre, yaw, (0.0, deep), (-3.0, 3.0), (0.0, top)), step),)
    truth = FloorTruth(_solids(things, room), view=_view(pan))
    return World(things, ground, room, cover(rng, WALLS, 2.2), truth, pan, tilt)


def _stair_down(rng: np.random.Generator) -> World:
    """The floor ends within 0.8 m; below it one floor or several treads, each 30 to 200 mm lower."""
    room, tilt, pan = _room(rng), _degrees(rng, 12, 25), _degrees(rng, -8, 8)
    away, drop = float(rng.uniform(nearest_seen(tilt) + 0.06, 0.8)), float(rng.uniform(0.03, 0.2))
    yaw, treads = pan + _degrees(rng, -25, 25), int(rng.choice((1, 1, 3, 6)))
    ground = _ground(rng)
    alike = rng.random() < 0.5
    lower = ground.surface if alike else cover(rng, FLOORS, FLOOR_M, plain=0.0)
    low = Room(room.back, room.front, room.half, -drop * treads, room.top)
    edge = Edge(away * math.cos(pan - yaw), yaw, drop)
    truth = FloorTruth(_solids((), room), edge=edge, view=_view(pan))
    stairs = Ground(
        ground.surface, ("nosing",) if rng.random() < 0.3 else (), ground.marks_seed, lower, treads
    )
    return World((), stairs, low, cover(rng, WALLS, 2.2), truth, pan, tilt)


def _post(rng: np.random.Generator) -> World:
    """One or two thin posts, round or square, on open floor."""
    world = _open(rng, reach=1.7)
    posts = []
    for _ in range(int(rng.integers(1, 3))):
        away, bearing = float(rng.uniform(0.5, 1.2)), world.pan + _degrees(rng, -18, 18)
        half, top = float(rng.uniform(0.006, 0.02)), float(rng.uniform(0.3, 1.5))
        kind, yaw = ("cylinder", 0.0) if rng.random() < 0.5 else ("box", _degrees(rng, -45, 45))
        x, y = away * math.cos(bearing), away * math.sin(bearing)
        posts.append(Thing(_post_solid(kind, x, y, yaw, half, top), cover(rng, metres=0.3, plain=0.0)))
    things = (*posts, *world.things)
    truth = FloorTruth(_solids(things, world.room), view=_view(world.pan))
    return World(things, world.ground, world.room, world.walls, truth, world.pan, world.tilt)


def _post_solid(kind: str, x: float, y: float, yaw: float, half: float, top: float) -> Solid:
    return Solid("cylinder" if kind == "cylinder" else "box", x, y, yaw, half, half, 0.0, top)


def _table(rng: np.random.Generator) -> World:
    """A table or bench: four legs and a top whose underside lies below or well above the body's height."""
    world = _open(rng, reach=2.0)
    half_x, half_y = (float(n) for n in rng.uniform(0.2, 0.45, 2))
    nearest = float(rng.uniform(0.5, 0.9))
    away = nearest + math.hypot(half_x, half_y)
    bearing, yaw = world.pan + _degrees(rng, -12, 12), _degrees(rng, -90, 90)
    low = rng.random() < 0.5
    # A low top must be in the picture where it begins.
    highest = min(0.28, seen_height(world.tilt, abs(bearing - world.pan), nearest) - 0.03)
    under = float(rng.uniform(0.14, highest)) if low else float(rng.uniform(0.42, 0.75))
    centre, leg = (away * math.cos(bearing), away * math.sin(bearing)), float(rng.uniform(0.012, 0.03))
    look = cover(rng, ("wood", "panel", "lino", "plaster"), 0.7, 0.2)
    parts = [_box(centre, yaw, (-half_x, half_x), (-half_y, half_y), (under, under + 0.03))]
    for i, j in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        ahead, aside = i * (half_x - 2 * leg), j * (half_y - 2 * leg)
        parts.append(_box(centre, yaw, (ahead - leg, ahead + leg), (aside - leg, aside + leg), (0.0, under)))
    things = (*(Thing(part, look) for part in parts), *world.things)
    truth = FloorTruth(_solids(things, world.room), view=_view(world.pan))
    return World(things, world.ground, world.room, world.walls, truth, world.pan, world.tilt)


def _solids(things: tuple[Thing, ...], room: Room) -> tuple[Solid, ...]:
    """All solids, and the room's four walls as boxes 0.1 m thick."""
    middle, half_x = 0.5 * (room.back + room.front), 0.5 * (room.front - room.back) + 0.1
    walls = (
        Solid("box", room.front + 0.05, 0.0, 0.0, 0.05, room.half, room.bottom, room.top),
        Solid("box", room.back - 0.05, 0.0, 0.0, 0.05, room.half, room.bottom, room.top),
        Solid("box", middle, room.half + 0.05, 0.0, half_x, 0.05, room.bottom, room.top),
        Solid("box", middle, -room.half - 0.05, 0.0, half_x, 0.05, room.bottom, room.top),
    )
    return (*(t.solid for t in things), *walls)


_DRAWN = {
    "open": _open, "narrow": _narrow, "wall": _wall, "step_up": _step_up, "stair_down": _stair_down,
    "post": _post, "table": _table, "dark": _dark, "lines": _lines,
}  # fmt: skip
BASE_KINDS = tuple(_DRAWN)
