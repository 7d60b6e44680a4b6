"""The base's way: gaps of known width, what must never be safe, and pictures that show nothing."""

import math
from dataclasses import replace

import numpy as np
import pytest
from exact_maps import exact_map, without
from rendered_pairs import MOUNT, RIG, TILT, Block, Room, render

from robot.vision.both_eyes import BothEyes
from robot.vision.free_way import FreeWayFinder
from robot.vision.plan import Plan, barred_by
from robot.vision.section import BoxSection
from robot.vision.stereo import AdaptiveWeightMatcher

BODY = BoxSection(0.26, 0.32)
FINDER = FreeWayFinder(RIG, MOUNT, BODY, AdaptiveWeightMatcher.floors(64))
NOTHING = np.zeros((0, 3))
LEVEL = math.radians(15.0)


def gap_room(gap, away, *extra, deep=0.1, high=0.8):
    blocks = tuple(
        Block(away + deep / 2, side * (gap / 2 + 0.6), deep, 1.2, high, seed=2 + side) for side in (1, -1)
    )
    return Room((*blocks, *extra))


def exact(room, tilt=LEVEL):
    return exact_map(render(room, tilt=tilt, samples=1, noise=0.0), RIG)


def look(found, tilt=LEVEL):
    return FINDER.joined(found, BothEyes.of(found), NOTHING, 0.0, tilt)


@pytest.mark.parametrize(("gap", "away"), [(0.45, 0.8), (0.34, 1.2), (0.31, 0.9)])
def test_a_gap_wide_enough_is_safe_and_measured(gap, away):
    passage = look(exact(gap_room(gap, away))).passage
    assert passage.safe
    assert passage.diameter == pytest.approx(gap, rel=0.04)
    assert passage.position[0] == pytest.approx(away, abs=0.03 * away)
    assert passage.position[1] == pytest.approx(0.0, abs=0.015)
    assert passage.sigma_diameter == pytest.approx(math.sqrt(2) * 1.5 * away / 305, rel=0.2)
    assert abs(passage.diameter - gap) < 2 * passage.sigma_diameter
    u, v = passage.centre
    ray = MOUNT.left_eye(0.0, LEVEL)[0] @ [(u - RIG.left.cx) / 305, (v - RIG.left.cy) / 305, 1.0]
    eye = MOUNT.left_eye(0.0, LEVEL)[1]
    off = np.cross(np.array(passage.position) - eye, ray / np.linalg.norm(ray))
    assert np.linalg.norm(off) < 0.002


@pytest.mark.parametrize(("gap", "away"), [(0.25, 0.7), (0.25, 1.3), (0.18, 0.9)])
def test_a_gap_smaller_than_the_body_is_never_safe(gap, away):
    passage = look(exact(gap_room(gap, away))).passage
    assert passage is None or not passage.safe


def test_what_one_eye_alone_sees_narrows_no_gap():
    found = exact(gap_room(0.36, 1.0))
    strip = ~found.valid[60, 150:]
    assert strip.sum() > 6  # the right side hides a strip of the far wall from the right eye
    blank = without(found, ~found.valid)  # and no guess tells what is there
    for seen in (found, blank):
        assert look(seen).passage.diameter == pytest.approx(0.36, rel=0.05)


def test_open_floor_is_safe_and_a_wall_is_not():
    assert look(exact(Room())).passage.safe
    for away in (0.5, 0.9):
        passage = look(exact(Room((Block(away + 0.05, 0.0, 0.1, 6.0, 1.0),)))).passage
        assert passage is None or not passage.safe


def test_a_hole_in_the_map_is_no_passage():
    wall = exact(Room((Block(0.95, 0.0, 0.1, 6.0, 1.0),)))
    for columns in (slice(100, 260), slice(120, 180)):
        holes = np.zeros(wall.valid.shape, np.bool_)
        holes[:170, columns] = True
        passage = look(without(wall, holes)).passage
        assert passage is None or not passage.safe


def test_sparse_false_matches_on_a_bare_wall_are_no_passage():
    wall = exact(Room((Block(0.95, 0.0, 0.1, 6.0, 1.0),)))
    rng = np.random.default_rng(4)
    holes = np.zeros(wall.valid.shape, np.bool_)
    holes[:150, 80:280] = True
    bare = without(wall, holes)
    false = holes & (rng.random(holes.shape) < 0.3)
    values = np.where(false, np.float32(7.0), bare.values)
    passage = look(type(wall)(values, bare.valid | false, np.where(false, 0.2, bare.sigma_px))).passage
    assert passage is None or not passage.safe


@pytest.mark.parametrize(
    "thing",
    [
        Block(0.7, 0.0, 0.1, 1.0, 0.05, seed=5),
        Block(0.8, 0.05, 0.03, 0.03, 0.6, seed=5),
        Block(0.9, 0.0, 0.3, 1.2, 0.3, z0=0.2, seed=5),
    ],
    ids=["sill", "post", "low table"],
)
def test_what_stands_in_the_way_makes_a_wide_gap_unsafe(thing):
    assert look(exact(gap_room(0.45, 1.1))).passage.safe
    passage = look(exact(gap_room(0.45, 1.1, thing))).passage
    assert passage is None or not passage.safe


def test_a_table_higher_than_the_body_may_be_passed_under():
    top = Block(1.0, 0.0, 0.4, 1.2, 0.55, z0=0.5, seed=5)
    passage = look(exact(Room((top,)))).passage
    assert passage.safe


def test_what_the_picture_does_not_show_is_not_safe():
    # At 25 degrees the picture ends at the eyes' own height, which is below the body's top.
    steep = math.radians(25.0)
    passage = look(exact(gap_room(0.45, 0.8), steep), steep).passage
    assert passage is not None
    assert not passage.safe


def test_unmeasured_floor_before_a_gap_makes_it_unsafe():
    found = exact(gap_room(0.45, 1.1))
    holes = np.zeros(found.valid.shape, np.bool_)
    holes[175:240] = True
    passage = look(without(found, holes)).passage
    assert passage is None or not passage.safe


def test_a_gap_of_empty_air_is_not_safe_where_the_floor_before_it_ends():
    """The dense map sees nothing there; a corner of the other witness ends the floor (rule 5)."""
    found = exact(gap_room(0.45, 1.1))
    assert look(found).passage.safe
    passage = FINDER.joined(found, BothEyes.of(found), np.array([[0.75, 0.0, 0.05]]), 0.0, LEVEL).passage
    assert passage is not None
    assert not passage.safe


def open_plan():
    tangents, distances = np.arange(-60, 61) / 305.0, 0.3 * 1.02 ** np.arange(100)
    empty = np.ones((121, 100), np.bool_)
    return Plan(tangents, distances, empty, empty.copy(), np.ones(100), np.array([0.08, 0.03, 0.25]), 0.0)


def test_a_bare_side_stands_where_its_corners_are_seen():
    """Nobody measures a bare thing but for its edges: from such a corner on its direction is barred."""
    plan = open_plan()
    barred = barred_by(plan, np.array([[1.08, 0.03 + 0.1, 0.1]]))
    (column,) = np.flatnonzero(~barred.empty.all(axis=1))
    assert plan.tangents[column] == pytest.approx(-0.1, abs=0.51 / 305)
    assert plan.distances[~barred.empty[column]].min() == pytest.approx(1.0, rel=0.02)
    assert barred.empty[column][plan.distances < 1.0].all()


def test_a_corner_of_what_is_barred_already_adds_nothing():
    plan = open_plan()
    plan.empty[30:40, 60:] = False  # a thing from 0.98 m on
    behind = np.array([[0.08 + 1.1, 0.03 - 1.1 * plan.tangents[42], 0.1]])
    before = np.array([[0.08 + 0.7, 0.03 - 0.7 * plan.tangents[42], 0.1]])
    assert np.array_equal(barred_by(plan, behind).empty, plan.empty)
    assert not barred_by(plan, before).empty[42].all()


def seen_but_beside(found, side, wide, away=1.0, gap=0.45):
    """The passage if neither eye measures the air in a strip so wide (metres) at one side of a gap."""
    eyes, depth = BothEyes.of(found), away - MOUNT.left_eye(0.0, LEVEL)[1][0]
    for eye, at in (("left", 0.03), ("right", -0.03)):
        edges = (side * gap / 2, side * (gap / 2 - wide))
        first, last = sorted(round(RIG.left.cx + 305 * (at - y) / depth) for y in edges)
        holes = np.zeros(found.valid.shape, np.bool_)
        holes[:110, first:last] = True  # the floor below is seen: nothing is known to stand there
        eyes = replace(eyes, **{eye: without(getattr(eyes, eye), holes)})
    return FINDER.joined(found, eyes, NOTHING, 0.0, LEVEL).passage


@pytest.mark.parametrize("side", [1, -1])
def test_a_gap_whose_one_side_is_seen_less_well_is_passed_off_its_middle(side):
    found = exact(gap_room(0.45, 1.0))
    whole, partly = look(found).passage, seen_but_beside(found, side, 0.1)
    assert whole.safe
    assert partly.safe
    assert whole.position[1] == pytest.approx(0.0, abs=0.01)
    assert 0.02 < -side * partly.position[1] < 0.09
    assert partly.diameter == pytest.approx(whole.diameter, abs=0.01)
    # The body keeps to what is proven, and off the other side.
    assert 0.125 - side * partly.position[1] >= BODY.width / 2
    assert 0.225 + side * partly.position[1] >= BODY.width / 2


@pytest.mark.parametrize("side", [1, -1])
def test_a_gap_whose_one_side_is_hardly_seen_is_not_safe(side):
    found = exact(gap_room(0.45, 1.0))
    passage = seen_but_beside(found, side, 0.17)
    assert passage is None or not passage.safe


@pytest.mark.parametrize(("gap", "away"), [(0.4, 0.9), (0.33, 1.2)])
def test_both_sides_of_a_gap_are_seen_to_a_pixel_or_two(gap, away):
    """By the matcher itself, whose windows leave a fringe along every edge."""
    pair = render(gap_room(gap, away), tilt=LEVEL)
    passage = FINDER(pair.left, pair.right, 0.0, LEVEL).passage
    pixel = (away - MOUNT.left_eye(0.0, LEVEL)[1][0]) / 305
    assert abs(passage.diameter - gap) <= 4 * pixel
    assert abs(passage.position[1]) <= 2 * pixel


def test_the_step_height_given_is_every_witness_s():
    """A sill of 4 cm stops a robot that climbs 3 cm, in the cells and by its corners, and none that climbs 9:
    corners speak from half the step's height on, for a step is seen halfway up its front."""
    pair = render(Room((Block(0.8, 0.0, 0.1, 6.0, 0.04),)), tilt=LEVEL, samples=2)
    climber = FreeWayFinder(RIG, MOUNT, BODY, AdaptiveWeightMatcher.floors(64), step_height=0.09)
    low, high = (finder(pair.left, pair.right, 0.0, LEVEL) for finder in (climber, FINDER))
    ahead = int(np.abs(high.bearings).argmin())
    assert high.free[ahead] < 0.85
    assert (np.hypot(*high.obstacles.T) < 1.2).any()
    assert not (np.hypot(*low.obstacles.T) < 1.2).any()


def test_a_post_nobody_measured_ends_its_sector():
    """Its pixels say nothing; that the floor goes on to both sides but not there says enough (rule 2)."""
    post = exact(Room((Block(1.0, 0.0, 0.06, 0.06, 0.8),)))
    nearer = post.values > exact(Room()).values + 1.0
    grown = np.roll(nearer, 3, axis=1) | nearer | np.roll(nearer, -3, axis=1)
    free = look(without(post, grown))
    assert free.free[int(np.abs(free.bearings).argmin())] < 1.05
    assert free.free[np.abs(np.abs(free.bearings) - math.radians(15)).argmin()] > 1.6


def test_a_sill_ends_the_sectors_before_it_and_unknown_floor_beyond_is_not_free():
    free = look(exact(Room((Block(0.75, 0.0, 0.1, 6.0, 0.04),))))
    seen = free.free > free.near
    assert seen.any()
    assert free.free[seen].max() < 0.82


def test_the_corners_of_another_witness_end_sectors_too():
    found = exact(Room())
    free = FINDER.joined(found, BothEyes.of(found), np.array([[0.9, 0.0, 0.1]]), 0.0, LEVEL)
    k = int(np.abs(free.bearings).argmin())
    assert free.free[k] == pytest.approx(0.9, abs=0.01)
    assert free.obstacles[-1].tolist() == [0.9, 0.0]


@pytest.mark.parametrize("away", [1.0, 1.5])
def test_a_thin_post_that_the_matcher_may_not_measure_ends_its_sector(away):
    pair = render(Room((Block(away, 0.0, 0.03, 0.03, 0.8),)), tilt=TILT, samples=2)
    free = FINDER(pair.left, pair.right, 0.0, TILT)
    end = free.free[int(np.abs(free.bearings).argmin())]
    assert away - 0.135 < end < away + 0.05
    beside = np.abs(np.abs(free.bearings) - math.radians(15)).argmin()
    assert free.free[beside] > 1.6


@pytest.mark.parametrize("gap", [0.2, 0.4])
def test_with_the_matcher_itself(gap):
    pair = render(gap_room(gap, 0.9), tilt=LEVEL)
    passage = FINDER(pair.left, pair.right, 0.0, LEVEL).passage
    assert passage.safe == (gap > 0.3)
    assert passage.diameter == pytest.approx(gap, rel=0.1)


@pytest.mark.parametrize("grey", [0, 128, 255])
def test_pictures_that_show_nothing_free_nothing(grey):
    picture = np.full((288, 352, 3), grey, np.uint8)
    found = FINDER(picture, picture, 0.0, TILT)
    assert not (found.free > found.near).any()
    assert found.passage is None


def test_nearer_than_the_search_is_never_free():
    # 20 cm before the lenses a thing has 92 px of disparity; 64 are searched from the floor's own on.
    pair = render(Room((Block(0.3, 0.0, 0.04, 1.0, 0.8),)), tilt=LEVEL)
    found = FINDER(pair.left, pair.right, 0.0, LEVEL)
    assert (found.free[found.free > found.near] < 0.33).all()
    assert found.passage is None or not found.passage.safe


def test_a_map_of_another_size_is_refused():
    found = exact(Room())
    small = type(found)(found.values[:100], found.valid[:100], found.sigma_px[:100])
    with pytest.raises(ValueError, match=r"352x100|the rig 352x288"):
        look(small)


def test_a_matcher_that_gives_no_guesses_makes_nothing_safe_by_them():
    found = exact(gap_room(0.25, 0.9))
    silent = type(found)(
        np.where(found.valid, found.values, 0.0), found.valid, np.full_like(found.values, 0.1)
    )
    holes = np.zeros(found.valid.shape, np.bool_)
    holes[:150, 100:250] = True
    hushed = without(silent, holes)
    for seen in (silent, type(found)(hushed.values, hushed.valid, silent.sigma_px)):
        passage = look(seen).passage
        assert passage is None or not passage.safe
