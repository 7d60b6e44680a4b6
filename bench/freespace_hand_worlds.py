"""Random worlds before a hand: a plate with an opening of known size, a closed plate, nothing near. Pure.

Frame: origin in the middle between the eyes, x along the approach, y left, z up. See `freespace_worlds`.
"""

from __future__ import annotations

import math

import numpy as np

from bench.freespace_geometry import Plate
from bench.freespace_layout import RICH, WALLS, Ground, Room, Surface, Thing, World, cover
from bench.freespace_truth import HAND, Gap, HandTruth
from robot.sim.solids import Solid

HALF_VIEW = (176 / 408, 144 / 408)
"""Half of the hand eyes' view at one metre of depth, sideways and upwards."""
HALF_BASELINE_M = 0.02
FINE_M = 0.2
"""Covers of near things repeat every so many metres."""
BORDER = 0.93
"""An opening counts as wholly in view if it keeps within this share of the half view."""


def draw_hand_world(kind: str, rng: np.random.Generator) -> World:
    """A random world for the hand.

    Raises:
        ValueError: no such kind.
    """
    if kind not in _DRAWN:
        raise ValueError(f"no worlds of kind '{kind}': choose one of {', '.join(sorted(_DRAWN))}")
    return _DRAWN[kind](rng)


def _background(rng: np.random.Generator, nearest: float) -> tuple[Room, tuple[Thing, ...]]:
    """A room and up to three things in it, none nearer than `nearest` metres."""
    room = Room(-0.4, nearest + float(rng.uniform(0.15, 0.9)), float(rng.uniform(0.5, 0.9)), -0.5, 0.7)
    things = []
    for _ in range(int(rng.integers(0, 4))):
        half = rng.uniform(0.03, 0.1, 2)
        x, y = rng.uniform(nearest + 0.1, room.front + 0.1), rng.uniform(-0.3, 0.3)
        top = float(rng.uniform(-0.2, 0.2))
        solid = Solid(
            "box", float(x), float(y), float(rng.uniform(-1, 1)), float(half[0]), float(half[1]), -0.5, top
        )
        things.append(Thing(solid, cover(rng, metres=0.35, plain=0.1)))
    return room, tuple(things)


def _world(
    rng: np.random.Generator,
    things: tuple[Thing, ...],
    room: Room,
    truth: HandTruth,
    plate: Surface | None = None,
) -> World:
    ground = Ground(cover(rng, RICH, 0.5, plain=0.0))
    return World(things, ground, room, cover(rng, WALLS, 0.7, 0.1), truth, plate_surface=plate)


def _hand_open(rng: np.random.Generator) -> World:
    room, things = _background(rng, 0.6)
    return _world(rng, things, room, HandTruth(tuple(t.solid for t in things), open_to=0.6))


def _hand_wall(rng: np.random.Generator) -> World:
    """A closed plate, sometimes with the picture of a dark hole on it."""
    room, things = _background(rng, 0.5)
    away, yaw = float(rng.uniform(0.15, 0.4)), math.radians(float(rng.uniform(-20, 20)))
    look = cover(rng, RICH, FINE_M, 0.3)
    if rng.random() < 0.3:
        look = Surface("hole", look.number, 0.25, look.gain)
    plate = Solid("box", away + 0.005, 0.0, yaw, 0.005, 0.625, -0.625, 0.625)
    things = (Thing(plate, look), *things)
    return _world(rng, things, room, HandTruth(tuple(t.solid for t in things)))


def _hand_narrow(rng: np.random.Generator) -> World:
    """An opening, round or rectangular, of 0.5 to 1.8 times the head's diameter."""
    away, yaw = float(rng.uniform(0.15, 0.4)), math.radians(float(rng.uniform(-15, 15)))
    if rng.random() < 0.5:
        yaw *= 0.3
    width, thick = float(rng.uniform(0.5, 1.8)) * HAND.diameter, float(rng.uniform(0.002, 0.025))
    longer = width * float(rng.choice((1.0, rng.uniform(1.0, 2.5))))
    round_, upright = rng.random() < 0.4, rng.random() < 0.5
    half = (0.5 * width, 0.5 * width)
    if not round_:
        half = (0.5 * width, 0.5 * longer) if upright else (0.5 * longer, 0.5 * width)
    centre = (away, _off(rng, away, 0, half[0]), _off(rng, away, 1, half[1]))
    whole = _whole(away, centre, half)
    room, things = _background(rng, away + 0.12)
    look, slack = cover(rng, RICH, FINE_M, 0.2), (half[0] - 0.5 * width, half[1] - 0.5 * width)
    gap = Gap(width, centre, 2.0 * half[1], yaw, slack)
    if round_:
        plate = Plate(centre, yaw, half[0], thick, 0.4)
        truth = HandTruth(tuple(t.solid for t in things), plate, gap, whole=whole)
        return _world(rng, things, room, truth, look)
    things = (*_frame(centre, yaw, half, thick, look), *things)
    return _world(rng, things, room, HandTruth(tuple(t.solid for t in things), None, gap, whole=whole))


def _off(rng: np.random.Generator, away: float, axis: int, half: float) -> float:
    """How far beside the axis an opening of this half size may lie and still be in view."""
    spare = BORDER * HALF_VIEW[axis] * away - half - (HALF_BASELINE_M if axis == 0 else 0.0)
    return float(rng.uniform(-1.0, 1.0)) * max(min(spare, 0.25 * away), 0.0)


def _whole(away: float, centre: tuple[float, float, float], half: tuple[float, float]) -> bool:
    sideways = abs(centre[1]) + half[0] + HALF_BASELINE_M <= BORDER * HALF_VIEW[0] * away * 1.001
    return sideways and abs(centre[2]) + half[1] <= BORDER * HALF_VIEW[1] * away * 1.001


def _frame(
    centre: tuple[float, float, float], yaw: float, half: tuple[float, float], thick: float, look: Surface
) -> tuple[Thing, ...]:
    """Four boards about a rectangular opening whose mouth has this centre."""
    c, s = math.cos(yaw), math.sin(yaw)
    x, y, z = centre

    def board(low: float, high: float, bottom: float, top: float) -> Thing:
        aside = 0.5 * (low + high)
        solid = Solid(
            "box", x + 0.5 * thick * c - s * aside, y + 0.5 * thick * s + c * aside, yaw,
            0.5 * thick, 0.5 * (high - low), bottom, top,
        )  # fmt: skip
        return Thing(solid, look)

    return (
        board(half[0], 0.5, -0.45, 0.45),
        board(-0.5, -half[0], -0.45, 0.45),
        board(-half[0], half[0], z + half[1], 0.45),
        board(-half[0], half[0], -0.45, z - half[1]),
    )


_DRAWN = {"hand_narrow": _hand_narrow, "hand_wall": _hand_wall, "hand_open": _hand_open}
HAND_KINDS = tuple(_DRAWN)
