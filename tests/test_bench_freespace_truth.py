"""The truth of the free-space bench against brute force: clouds of points inside whatever stands there."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.freespace_geometry import Edge, Plate
from bench.freespace_truth import BASE, BASE_BEYOND_M, HAND, HAND_BEYOND_M, FloorTruth, Gap, HandTruth
from robot.sim.solids import Solid

Array = NDArray[np.float64]
GRID = 34


def filled(solid: Solid, count: int = GRID) -> Array:
    """Points (N, 3) all over a solid, its faces included."""
    s = np.linspace(-1.0, 1.0, count)
    if solid.kind == "cylinder":
        radius, angle = np.meshgrid(np.linspace(0.0, 1.0, count // 2), np.linspace(0.0, math.tau, 4 * count))
        flat = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1).reshape(-1, 2)
        flat = flat * solid.half_x
    else:
        flat = np.stack(np.meshgrid(s, s), axis=-1).reshape(-1, 2) * (solid.half_x, solid.half_y)
    c, t = math.cos(solid.yaw), math.sin(solid.yaw)
    x, y = solid.x + c * flat[:, 0] - t * flat[:, 1], solid.y + t * flat[:, 0] + c * flat[:, 1]
    z = np.linspace(solid.bottom, solid.top, count)
    return np.concatenate([np.column_stack([x, y, np.full(len(x), one)]) for one in z])


def random_solid(rng: np.random.Generator, reach: float, size: float) -> Solid:
    x, y = rng.uniform(0.1, reach), rng.uniform(-0.5 * reach, 0.5 * reach)
    bottom = float(rng.choice((0.0, rng.uniform(-size, size))))
    half = rng.uniform(0.1, 1.0, 2) * size
    top = bottom + float(rng.uniform(0.2, 2.0)) * size
    if rng.random() < 0.4:
        return Solid("cylinder", float(x), float(y), 0.0, float(half[0]), float(half[0]), bottom, top)
    yaw = float(rng.uniform(-2.0, 2.0))
    return Solid("box", float(x), float(y), yaw, float(half[0]), float(half[1]), bottom, top)


@pytest.mark.parametrize("seed", range(60))
def test_a_corridor_is_as_wide_as_the_nearest_point_beside_it_allows(seed: int) -> None:
    rng = np.random.default_rng(seed)
    solid = random_solid(rng, 1.5, 0.25)
    bearing, length, height = rng.uniform(-0.5, 0.5), rng.uniform(0.3, 1.8), 0.32
    points = filled(solid)
    ahead = points[:, 0] * math.cos(bearing) + points[:, 1] * math.sin(bearing)
    aside = np.abs(points[:, 1] * math.cos(bearing) - points[:, 0] * math.sin(bearing))
    within = (ahead >= 0) & (ahead <= length)
    width = FloorTruth((solid,)).corridor(float(bearing), float(length), height)
    if solid.bottom >= height or solid.top < 0.03:
        assert math.isinf(width)
    elif not within.any():
        assert width > 0.0
    else:
        brute = 2.0 * float(aside[within].min())
        assert brute - 0.06 <= width <= brute + 1e-9


@pytest.mark.parametrize("seed", range(60))
def test_a_hand_s_cylinder_is_as_wide_as_the_nearest_point_beside_its_axis(seed: int) -> None:
    rng = np.random.default_rng(1000 + seed)
    solid = random_solid(rng, 0.4, 0.08)
    way = np.array([1.0, rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3)])
    way, length = way / np.linalg.norm(way), float(rng.uniform(0.15, 0.5))
    points = filled(solid)
    along = points @ way
    away = np.linalg.norm(points - along[:, None] * way, axis=1)
    within = (along >= 0) & (along <= length)
    diameter = HandTruth((solid,)).clear_diameter(way, length)
    if within.any():
        brute = 2.0 * float(away[within].min())
        assert brute - 0.012 <= diameter <= brute + 1e-4
    else:
        assert diameter > 0.0


@pytest.mark.parametrize("seed", range(40))
def test_a_plate_s_opening_lets_through_what_no_point_of_the_plate_bars(seed: int) -> None:
    rng = np.random.default_rng(2000 + seed)
    away, yaw, radius = rng.uniform(0.15, 0.4), rng.uniform(-0.3, 0.3), rng.uniform(0.015, 0.045)
    centre = (float(away), float(rng.uniform(-0.03, 0.03)), float(rng.uniform(-0.03, 0.03)))
    plate = Plate(centre, float(yaw), float(radius), float(rng.uniform(0.002, 0.02)), 0.3)
    aim = np.array(centre) + np.array([0.0, rng.uniform(-0.01, 0.01), rng.uniform(-0.01, 0.01)])
    way = aim / np.linalg.norm(aim)
    angle, depth = np.meshgrid(np.linspace(0, math.tau, 720), np.linspace(0, plate.thickness, 12))
    c, s = math.cos(yaw), math.sin(yaw)
    flat = plate.radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    rim = np.array(centre) + (
        flat[..., :1] * (-s, c, 0.0)
        + flat[..., 1:] * (0.0, 0.0, 1.0)
        + depth[..., None] * np.array((c, s, 0.0))
    )
    points = rim.reshape(-1, 3)
    brute = 2.0 * float(np.linalg.norm(points - (points @ way)[:, None] * way, axis=1).min())
    found = HandTruth((), plate).clear_diameter(way, 1.0)
    # An ellipse is taken as its inner circle: never too wide, hardly too narrow.
    assert brute - 0.15 * radius <= found <= brute + 1e-6


def test_a_way_beside_the_opening_is_closed_and_one_that_ends_before_the_plate_is_open() -> None:
    plate = HandTruth((), Plate((0.3, 0.0, 0.0), 0.0, 0.03, 0.005, 0.3))
    beside = np.array([0.3, 0.06, 0.0])
    assert plate.clear_diameter(beside / np.linalg.norm(beside), 0.5) == 0.0
    assert math.isinf(plate.clear_diameter(np.array([1.0, 0.0, 0.0]), 0.29))
    assert plate.clear_diameter(np.array([1.0, 0.0, 0.0]), 0.5) == pytest.approx(0.06)


def gate(width: float, away: float = 1.0) -> FloorTruth:
    sides = tuple(
        Solid("box", away + 0.05, side * (0.5 * width + 0.5), 0.0, 0.05, 0.5, 0.0, 0.6) for side in (-1, 1)
    )
    return FloorTruth(sides, gap=Gap(width, (away, 0.0, 0.0)))


@pytest.mark.parametrize(
    ("width", "may", "must", "touches"),
    [
        (0.25, False, False, True),
        (0.261, True, False, False),
        (0.298, True, False, False),
        (0.30, True, True, False),
    ],
)
def test_the_rule_of_the_gap_for_the_base(width: float, may: bool, must: bool, touches: bool) -> None:
    truth = gate(width)
    assert (truth.may_pass(BASE), truth.must_pass(BASE)) == (may, must)
    assert truth.touches((1.0, 0.0, 0.16), BASE) is touches


def test_a_gap_that_the_picture_does_not_show_to_the_body_s_height_need_not_be_safe() -> None:
    tall = gate(0.4)
    low = FloorTruth(tall.solids, gap=tall.gap, seen_height=0.32)
    assert tall.must_pass(BASE)
    assert (low.must_pass(BASE), low.may_pass(BASE)) == (False, True)


def test_a_small_gap_with_a_way_round_it_may_pass() -> None:
    posts = tuple(Solid("cylinder", 1.0, y, 0.0, 0.02, 0.02, 0.0, 1.0) for y in (-0.08, 0.08))
    assert FloorTruth(posts, gap=Gap(0.12, (1.0, 0.0, 0.0)), view=(-0.4, 0.4)).may_pass(BASE)
    assert not FloorTruth(posts, gap=Gap(0.12, (1.0, 0.0, 0.0)), view=(-0.05, 0.05)).may_pass(BASE)


@pytest.mark.parametrize(
    ("top", "bottom", "stops"), [(0.029, 0.0, False), (0.03, 0.0, True), (0.8, 0.33, False)]
)
def test_low_sills_and_high_tops_do_not_touch(top: float, bottom: float, stops: bool) -> None:
    board = FloorTruth((Solid("box", 0.6, 0.0, 0.0, 0.05, 1.0, bottom, top),))
    assert board.touches((0.7, 0.0, 0.1), BASE) is stops


def test_the_body_goes_its_length_beyond_the_passage() -> None:
    wall = FloorTruth((Solid("box", 1.05, 0.0, 0.0, 0.05, 1.0, 0.0, 1.0),))
    assert wall.touches((1.0 - BASE_BEYOND_M + 0.001, 0.0, 0.1), BASE)
    assert not wall.touches((1.0 - BASE_BEYOND_M - 0.001, 0.0, 0.1), BASE)
    plate = HandTruth((Solid("box", 0.305, 0.0, 0.0, 0.005, 0.3, -0.3, 0.3),))
    assert plate.touches((0.3 - HAND_BEYOND_M + 0.001, 0.0, 0.0), HAND)
    assert not plate.touches((0.3 - HAND_BEYOND_M - 0.001, 0.0, 0.0), HAND)


@pytest.mark.parametrize("yaw", [-0.5, -0.1, 0.0, 0.3])
def test_driving_over_an_edge_is_touching_and_the_corridor_ends_at_its_near_corner(yaw: float) -> None:
    truth = FloorTruth((), edge=Edge(0.7, yaw, 0.05))
    length = 0.6
    width = truth.corridor(0.0, length, 0.32)
    # A body just narrower stays on the floor with both front corners, one just wider does not.
    for half, falls in ((0.5 * width - 1e-6, False), (0.5 * width + 1e-6, True)):
        if math.isfinite(half) and half > 0:
            corners = [length * math.cos(yaw) + side * half * math.sin(yaw) for side in (-1, 1)]
            assert (max(corners) > 0.7) is falls
    assert truth.touches((0.68, 0.0, 0.1), BASE)
    assert not FloorTruth((), edge=Edge(0.7, yaw, 0.029)).touches((0.68, 0.0, 0.1), BASE)


@pytest.mark.parametrize("seed", range(25))
def test_free_distances_are_where_a_march_along_the_ray_first_meets_something(seed: int) -> None:
    rng = np.random.default_rng(3000 + seed)
    solids = tuple(random_solid(rng, 1.6, 0.2) for _ in range(3))
    truth = FloorTruth(solids, edge=Edge(float(rng.uniform(0.8, 1.6)), float(rng.uniform(-0.4, 0.4)), 0.1))
    bearings = rng.uniform(-0.6, 0.6, 12)
    found = truth.free_distances(bearings)
    march = np.arange(0.0, 2.5, 0.002)
    for bearing, end in zip(bearings, found, strict=True):
        points = np.column_stack([march * math.cos(bearing), march * math.sin(bearing)])
        met = truth.distance_to(points) < 1e-9
        first = float(march[met.argmax()]) if met.any() else math.inf
        # A corner that is only grazed may be stepped over by the march; cylinders are polygons a hair larger.
        assert end <= first + 1e-9
        there = np.array([[end * math.cos(bearing), end * math.sin(bearing)]])
        assert not math.isfinite(end) or truth.distance_to(there)[0] < 1e-3


def test_what_hangs_high_does_not_end_floor() -> None:
    top = Solid("box", 1.0, 0.0, 0.0, 0.1, 0.5, 0.4, 0.43)
    assert math.isinf(FloorTruth((top,)).free_distances(np.zeros(1))[0])
    low = Solid("box", 1.0, 0.0, 0.0, 0.1, 0.5, 0.3, 0.43)
    assert FloorTruth((low,)).free_distances(np.zeros(1))[0] == pytest.approx(0.9)


@pytest.mark.parametrize("position", [(math.nan, 0.0, 0.0), (math.inf, 0.0, 0.0)])
def test_a_passage_nowhere_is_refused(position: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="finite"):
        FloorTruth(()).touches(position, BASE)
    with pytest.raises(ValueError, match="finite"):
        HandTruth(()).touches(position, HAND)
