"""What a small world of the free-space bench is made of: surfaces, things, floor, room. Plain values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.freespace_truth import Truth
from robot.sim.solids import Solid

RICH = ("brick", "wood", "plaster", "paper", "panel", "tiles", "carpet", "lino")
FLOORS = ("tiles", "wood", "carpet", "lino")
WALLS = ("brick", "wood", "plaster", "paper", "panel")
PICTURES = 12
"""Different pictures of every surface."""


@dataclass(frozen=True, slots=True)
class Surface:
    """How something looks: one of the drawn pictures, repeated every `metres`. gain: of its brightness."""

    name: str
    number: int
    metres: float = 0.7
    gain: float = 1.0


@dataclass(frozen=True, slots=True)
class Thing:
    """Something that stands and its cover."""

    solid: Solid
    surface: Surface


@dataclass(frozen=True, slots=True)
class Room:
    """Walls about the robot: `back` to `front` along x, `half` to either side, `bottom` to `top`."""

    back: float
    front: float
    half: float
    bottom: float
    top: float


@dataclass(frozen=True, slots=True)
class Ground:
    """The floor: its surface, what lies flat on it, and what lies lower beyond its edge (`treads`)."""

    surface: Surface
    marks: tuple[str, ...] = ()
    marks_seed: int = 0
    lower: Surface | None = None
    treads: int = 1


@dataclass(frozen=True, slots=True)
class World:
    """One place with a robot in it. pan, tilt: of the head, as ordered; light, lamp: 0..1."""

    things: tuple[Thing, ...]
    ground: Ground
    room: Room
    walls: Surface
    truth: Truth
    pan: float = 0.0
    tilt: float = 0.0
    light: float = 1.0
    lamp: float = 0.0
    plate_surface: Surface | None = None


def cover(
    rng: np.random.Generator, names: tuple[str, ...] = RICH, metres: float = 0.7, plain: float = 0.2
) -> Surface:
    """A random surface; with the chance `plain` bare paint that a matcher finds little on."""
    name = "paint" if rng.random() < plain else names[int(rng.integers(len(names)))]
    return Surface(name, int(rng.integers(PICTURES)), metres, float(rng.uniform(0.7, 1.1)))
