"""Scenes: what a TOML file may say, read into frozen values. `scenes/README.md` documents every key.

A number may be given as a range `[low, high]`; it is then drawn anew for every seed (see `layout`).
Room frame: x from the back wall (0) to the front wall (length_m), y from -width_m/2 (right) to width_m/2
(left), z up from the floor. Headings in degrees, counter-clockwise, 0 looks along x.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, Struct, field

from robot.errors import UserError

Ranged = float | tuple[float, float]
"""A number, or [low, high] redrawn per seed."""

Shape = Literal["block", "l", "step", "post", "table", "wall", "gate"]
ObjectName = Literal["box", "cup", "calculator"]
WallStyle = Literal["any", "brick", "wood", "plaster", "paper", "panel"]
FloorStyle = Literal["any", "tiles", "wood", "carpet", "lino"]

FOLDER = Path(__file__).parent / "scenes"
SHIPPED = (
    "standing", "empty", "distractors", "dark", "post", "step",
    "hidden", "moving", "passage", "table", "trap", "lost",
)  # fmt: skip


class SceneError(UserError):
    """A scene file is wrong; the message names the file, the key and what is allowed."""


class Room(Struct, frozen=True, forbid_unknown_fields=True):
    """The walls, the floor and what they look like."""

    length_m: Ranged = (4.6, 5.4)
    width_m: Ranged = (4.0, 4.6)
    height_m: Ranged = 2.4
    walls: WallStyle = "any"
    floor: FloorStyle = "any"
    rugs: Annotated[int, Meta(ge=0, le=4)] = 1
    lines: Annotated[int, Meta(ge=0, le=6)] = 2


class Start(Struct, frozen=True, forbid_unknown_fields=True):
    """Where the robot begins."""

    x: Ranged = 0.7
    y: Ranged = 0.0
    heading_deg: Ranged = (-20.0, 20.0)


class Light(Struct, frozen=True, forbid_unknown_fields=True):
    """How bright the room is: 1 a bright day, 0.3 evening, 0.03 night."""

    level: Ranged = (0.75, 1.0)


class Eyes(Struct, frozen=True, forbid_unknown_fields=True):
    """The cameras and their weaknesses."""

    setting: Literal["base", "hand"] = "base"
    noise: Ranged = 1.0
    blur_px: Ranged = (0.45, 0.65)
    skew_s: Ranged = 0.0
    dropped: Ranged = 0.004


class Waypoint(Struct, frozen=True, forbid_unknown_fields=True):
    """A place the target moves to, and how long it stays there."""

    x: Ranged
    y: Ranged
    pause_s: Ranged = 0.0


class Target(Struct, frozen=True, forbid_unknown_fields=True):
    """The object the robot was taught, where it stands and how it moves."""

    object: ObjectName = "box"
    x: Ranged = (2.4, 3.0)
    y: Ranged = (-0.6, 0.6)
    heading_deg: Ranged = (-180.0, 180.0)
    pedestal_m: Ranged = 0.0
    motion: Literal["stands", "path", "hides"] = "stands"
    speed_m_s: Ranged = 0.08
    starts_s: Ranged = 0.0
    starts_within_m: Ranged | None = None
    waypoints: tuple[Waypoint, ...] = ()


class Distractor(Struct, frozen=True, forbid_unknown_fields=True):
    """An object of the target's shape with another print."""

    x: Ranged
    y: Ranged
    object: ObjectName = "box"
    design: Annotated[int, Meta(ge=1, le=8)] = 1
    heading_deg: Ranged = (-180.0, 180.0)
    pedestal_m: Ranged = 0.0


class Obstacle(Struct, frozen=True, forbid_unknown_fields=True):
    """Something in the way. Which sizes count depends on the shape."""

    shape: Shape
    x: Ranged
    y: Ranged
    heading_deg: Ranged = 0.0
    length_m: Ranged | None = None
    width_m: Ranged | None = None
    height_m: Ranged | None = None
    radius_m: Ranged | None = None
    gap_m: Ranged | None = None


class Require(Struct, frozen=True, forbid_unknown_fields=True):
    """What must hold at the start; the room is redrawn until it does."""

    target_visible: bool | None = None
    straight_way_blocked: bool | None = None


class Scene(Struct, frozen=True, forbid_unknown_fields=True):
    """Everything a scene file says."""

    title: str = ""
    object: ObjectName = "box"
    expect: Literal["found", "not found"] = "found"
    duration_s: Annotated[float, Meta(ge=1.0, le=600.0)] = 45.0
    hold_s: Annotated[float, Meta(ge=0.0, le=60.0)] = 4.0
    hold_after_motion: bool = False
    stand_off_m: Annotated[float, Meta(ge=0.3, le=5.0)] = 0.7
    mirror: bool = True
    room: Room = field(default_factory=Room)
    robot: Start = field(default_factory=Start)
    light: Light = field(default_factory=Light)
    camera: Eyes = field(default_factory=Eyes)
    target: Target | None = None
    distractors: tuple[Distractor, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    require: Require = field(default_factory=Require)
    name: str = ""

    @property
    def taught_object(self) -> str:
        """The object the robot looks for: the target's, or `object` where there is no target."""
        return self.target.object if self.target is not None else self.object


LIMITS: dict[str, tuple[float, float]] = {
    "x": (-20.0, 20.0),
    "y": (-20.0, 20.0),
    "heading_deg": (-360.0, 360.0),
    "length_m": (0.02, 12.0),
    "width_m": (0.02, 12.0),
    "height_m": (0.01, 4.0),
    "radius_m": (0.005, 1.0),
    "gap_m": (0.05, 5.0),
    "pedestal_m": (0.0, 1.0),
    "speed_m_s": (0.01, 0.5),
    "starts_s": (0.0, 600.0),
    "starts_within_m": (0.3, 20.0),
    "pause_s": (0.0, 600.0),
    "level": (0.0, 1.2),
    "noise": (0.0, 10.0),
    "blur_px": (0.0, 3.0),
    "skew_s": (-0.02, 0.02),
    "dropped": (0.0, 0.9),
}
"""Allowed values of every ranged key, whatever table it is in."""

ROOM_LIMITS = (2.0, 12.0)

SIZES: dict[str, dict[str, float]] = {
    "block": {"length_m": 0.4, "width_m": 0.3, "height_m": 0.4},
    "l": {"length_m": 0.9, "width_m": 0.9, "height_m": 0.4},
    "step": {"length_m": 0.8, "width_m": 0.3, "height_m": 0.045},
    "post": {"radius_m": 0.018, "height_m": 0.9},
    "table": {"length_m": 1.0, "width_m": 0.6, "height_m": 0.5},
    "wall": {"length_m": 1.2, "height_m": 0.8},
    "gate": {"length_m": 3.0, "height_m": 0.6, "gap_m": 0.42},
}
"""The sizes each shape has, with their defaults."""


def shipped_scenes() -> tuple[str, ...]:
    """Names of the scored scenes, in rising difficulty (without `demo` and the teaching studios)."""
    return SHIPPED


def load_scene(name_or_path: str | Path) -> Scene:
    """Read a scene by the name of a shipped one or by the path of a TOML file.

    Raises SceneError (one line) for a missing file, bad TOML, an unknown key, a wrong type or range.

    >>> load_scene("standing").target.object
    'box'
    """
    path = _find(name_or_path)
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as cause:
        raise SceneError(f"{path}: cannot be read: {cause}") from cause
    except (ValueError, RecursionError) as cause:  # also tomllib's own limits: digits, nesting
        raise SceneError(f"{path}: not TOML: {cause}") from cause
    return parse_scene(table, path.stem, str(path))


def parse_scene(table: dict[str, Any], name: str, source: str = "scene") -> Scene:
    """Turn a parsed TOML table into a checked `Scene`; `source` is what the errors name."""
    if "name" in table:
        raise SceneError(f"{source}: name: not allowed; the file's name is the scene's name")
    try:
        scene = msgspec.convert({**table, "name": name}, Scene)
    except msgspec.ValidationError as cause:
        raise SceneError(f"{source}: {_plain(str(cause))}") from cause
    for key, value in _ranged_values(scene, ""):
        _check_range(source, key, value)
    _check_shapes(scene, source)
    _check_target(scene, source)
    return scene


def _find(name_or_path: str | Path) -> Path:
    path = Path(name_or_path)
    if path.suffix == ".toml" or path.is_file():
        if not path.is_file():
            raise SceneError(f"{path}: there is no such scene file")
        return path
    shipped = FOLDER / f"{name_or_path}.toml"
    if path.name != str(name_or_path) or not shipped.is_file():
        names = ", ".join(sorted(p.stem for p in FOLDER.glob("*.toml")))
        raise SceneError(f"{name_or_path}: no such scene; give a TOML file or one of: {names}")
    return shipped


def _plain(message: str) -> str:
    """`key: what is wrong (allowed: ...)` out of msgspec's words."""
    text, _, path = message.partition(" - at `")
    key = path.rstrip("`").removeprefix("$").removeprefix(".") or "top level"
    if "unknown field" in text:
        unknown = text.split("`")[1]
        struct = _struct_at(key)
        allowed = ", ".join(n for n in struct.__struct_fields__ if (struct, n) != (Scene, "name"))
        return f"{key}: unknown key '{unknown}'; allowed: {allowed}"
    text = text.replace("`float | array`", "a number or a range [low, high]").replace("Object", "Table")
    return f"{key}: {text}"


def _struct_at(key: str) -> type[Struct]:
    structs: dict[str, type[Struct]] = {
        "room": Room, "robot": Start, "light": Light, "camera": Eyes, "target": Target,
        "distractors": Distractor, "obstacles": Obstacle, "require": Require,
    }  # fmt: skip
    if "waypoints" in key:
        return Waypoint
    return structs.get(key.split(".")[0].split("[")[0], Scene)


def _ranged_values(struct: Struct, prefix: str) -> list[tuple[str, Ranged]]:
    found: list[tuple[str, Ranged]] = []
    for name in struct.__struct_fields__:
        value = getattr(struct, name)
        if isinstance(value, Struct):
            found += _ranged_values(value, f"{prefix}{name}.")
        elif isinstance(value, tuple) and value and isinstance(value[0], Struct):
            for i, item in enumerate(value):
                found += _ranged_values(item, f"{prefix}{name}[{i}].")
        elif name in LIMITS and value is not None:
            found.append((f"{prefix}{name}", value))
    return found


def _check_range(source: str, key: str, value: Ranged) -> None:
    low, high = value if isinstance(value, tuple) else (value, value)
    smallest, largest = (
        ROOM_LIMITS if key in ("room.length_m", "room.width_m") else LIMITS[key.rpartition(".")[2]]
    )
    if not smallest <= low <= high <= largest:
        raise SceneError(f"{source}: {key}: {value} is not within {smallest}..{largest} (a range: low first)")


def _check_shapes(scene: Scene, source: str) -> None:
    for i, obstacle in enumerate(scene.obstacles):
        for key in ("length_m", "width_m", "height_m", "radius_m", "gap_m"):
            if getattr(obstacle, key) is not None and key not in SIZES[obstacle.shape]:
                allowed = ", ".join(SIZES[obstacle.shape])
                raise SceneError(
                    f"{source}: obstacles[{i}].{key}: a {obstacle.shape} has none; it has: {allowed}"
                )


def _check_target(scene: Scene, source: str) -> None:
    target = scene.target
    if target is None:
        if scene.expect == "found":
            raise SceneError(f'{source}: target: missing; add a [target] table or expect = "not found"')
        if scene.require.target_visible is not None or scene.require.straight_way_blocked is not None:
            raise SceneError(f"{source}: require: speaks of a target, but there is no [target] table")
    elif (target.motion == "stands") != (not target.waypoints):
        raise SceneError(f"{source}: target.waypoints: needed for motion 'path' and 'hides', and only there")
