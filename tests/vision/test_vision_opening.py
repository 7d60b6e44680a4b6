"""The base's opening and the way through it: gaps laid out by hand, seen by eyes that see them partly."""

import math
from dataclasses import replace

import numpy as np
import pytest
from upright_air import COLUMNS, FOCAL, RAYS, ROWS, TANGENTS, WALL, air

from robot.messages import FreeSpace
from robot.vision.opening import Needed, Opening, Way, floor_reaches, way_through, widest_opening
from robot.vision.plan import Plan

AWAY = 0.9
"""Metres from the origin to the jambs' faces."""
DISTANCES = 0.2 * 1.02 ** np.arange(122)
EYE = RAYS.eye


def places(pan=0.0):
    """x, y (K, J) of the plan's places in a frame turned by the head's pan."""
    x, y = EYE[0] * math.cos(pan) + EYE[1] * math.sin(pan), EYE[1] * math.cos(pan) - EYE[0] * math.sin(pan)
    return x + DISTANCES + 0.0 * TANGENTS[:, None], y - TANGENTS[:, None] * DISTANCES


def shadowed(barred):
    """What a wall bars it hides too: all rings behind the first barred one."""
    return np.maximum.accumulate(barred, axis=1)


def plan_of(barred, pan=0.0, in_view=True):
    seen = np.broadcast_to(in_view, barred.shape)
    return Plan(TANGENTS, DISTANCES, ~barred & seen, seen, 0.5 - 0.1 * DISTANCES, EYE, pan)


def wall_with_gaps(*gaps, away=AWAY, pan=0.0):
    """Barred places of a wall at this distance with gaps (rightmost y, leftmost y) in it."""
    x, y = places(pan)
    inside = np.zeros(y.shape, np.bool_)
    for right, left in gaps:
        inside |= (right < y) & (y < left)
    return shadowed((x >= away) & (x < away + 0.1) & ~inside)


def gap(width, middle=0.0):
    return middle - 0.5 * width, middle + 0.5 * width


# --- the opening ---


@pytest.mark.parametrize(("width", "middle"), [(0.3, 0.0), (0.45, 0.0), (0.4, 0.1), (0.35, -0.12)])
def test_a_gap_is_found_in_width_and_place(width, middle):
    found = widest_opening(plan_of(wall_with_gaps(gap(width, middle))), 0.26)
    assert found.width == pytest.approx(width, abs=0.01)
    assert found.middle == pytest.approx((AWAY, middle), abs=0.025)
    assert found.left[1] > found.right[1]
    assert found.distance == pytest.approx(math.hypot(*found.middle))
    assert found.bearing == pytest.approx(math.atan2(found.middle[1], found.middle[0]))
    assert found.top == pytest.approx(0.5 - 0.1 * (found.distance - EYE[0]), abs=0.005)


def test_a_barred_column_bars_all_of_its_own_width():
    """Things at columns 100 and 140 leave 39 columns between them."""
    barred = np.ones((COLUMNS, len(DISTANCES)), np.bool_)
    barred[101:140] = False
    barred[:, DISTANCES < 0.8] = False
    found = widest_opening(plan_of(barred), 0.05)
    away = DISTANCES[DISTANCES >= 0.8][0]
    assert found.width == pytest.approx(39 * away / FOCAL, rel=0.005)
    assert found.middle[1] == pytest.approx(EYE[1], abs=0.002)


def test_the_head_may_look_aside():
    pan = 0.4
    found = widest_opening(plan_of(wall_with_gaps(gap(0.4), pan=pan), pan), 0.26)
    assert found.width == pytest.approx(0.4, abs=0.012)
    ahead = AWAY * math.cos(pan), AWAY * math.sin(pan)
    assert found.middle == pytest.approx(ahead, abs=0.03)


def test_of_two_gaps_the_wider_one_is_taken():
    for wide, narrow in ((0.25, -0.25), (-0.25, 0.25)):
        found = widest_opening(plan_of(wall_with_gaps(gap(0.4, wide), gap(0.28, narrow), away=1.2)), 0.26)
        assert found.width == pytest.approx(0.4, abs=0.02)
        assert found.middle[1] * wide > 0


def test_open_space_is_as_wide_as_is_looked_for_and_has_its_place_ahead():
    found = widest_opening(plan_of(np.zeros((COLUMNS, len(DISTANCES)), np.bool_)), 0.26)
    assert found.width == pytest.approx(0.9, abs=0.01)
    assert found.distance == pytest.approx(1.05, abs=0.02)


def test_a_wall_has_no_opening_and_what_is_not_in_view_neither():
    assert widest_opening(plan_of(wall_with_gaps()), 0.26) is None
    assert widest_opening(plan_of(wall_with_gaps(gap(0.03))), 0.26) is None
    unseen = DISTANCES < 0.7
    assert widest_opening(plan_of(wall_with_gaps(gap(0.4)), in_view=unseen), 0.26) is None


def test_a_gap_too_narrow_is_measured_all_the_same():
    found = widest_opening(plan_of(wall_with_gaps(gap(0.18))), 0.26)
    assert found.width == pytest.approx(0.18, abs=0.01)


# --- the way through ---

GAP = 0.45
LEFT, RIGHT = (AWAY, GAP / 2), (AWAY, -GAP / 2)
NEEDED = Needed(width=0.26, proven=0.3, room=0.28, beyond=0.13)
OPENING = Opening(LEFT, RIGHT, 0.4, leads_to=AWAY + NEEDED.beyond)
CLEAR = wall_with_gaps(gap(GAP))


def across(y, away=AWAY):
    """The direction (column) in which the left eye sees this y at the jambs' faces."""
    return round((EYE[1] - y) / (away - EYE[0]) * FOCAL) + COLUMNS // 2


def seen(barred=CLEAR, unproven=()):
    """The left eye's air up to what is barred, unmeasured between each two y (right, left) at the jambs."""
    first = np.where(barred.any(axis=1), barred.argmax(axis=1), len(DISTANCES) - 1)
    left = np.tile(np.where(barred.any(axis=1), DISTANCES[first], 2.0 * WALL), (ROWS, 1))
    for right_y, left_y in unproven:
        left[:, across(left_y) : across(right_y)] = 0.0
    return air(left)


def way(barred=CLEAR, unproven=(), needed=NEEDED, opening=OPENING):
    return way_through(seen(barred, unproven), plan_of(barred), opening, needed)


def test_the_way_leads_through_the_middle_if_that_will_do():
    found = way()
    assert (found.bearing, found.distance) == (OPENING.bearing, OPENING.distance)
    assert found.place == pytest.approx(OPENING.middle)
    # One side seen a bit less well leaves the middle good enough.
    assert way(unproven=[(RIGHT[1], RIGHT[1] + 0.05)]).bearing == OPENING.bearing


def test_a_place_is_its_bearing_and_distance():
    assert Way(math.radians(30.0), 2.0).place == pytest.approx((math.sqrt(3.0), 1.0))


@pytest.mark.parametrize("side", [1, -1])
def test_the_way_keeps_off_the_side_that_is_seen_less_well(side):
    """0.1 m beside one jamb nobody measured: of 0.45 m 0.35 are left, and the body needs 0.3 of them."""
    edge = side * GAP / 2
    strip = tuple(sorted((edge, edge - side * 0.1)))
    found = way(unproven=[strip])
    y = found.place[1]
    assert -0.08 <= y * side <= -0.02
    # Proven to one side, and room to what stands on the other.
    assert abs(edge - side * 0.1 - y) >= NEEDED.proven / 2 - 0.01
    assert abs(-edge - y) >= NEEDED.room / 2
    assert found.distance == OPENING.distance


@pytest.mark.parametrize("side", [1, -1])
def test_there_is_no_way_if_the_body_fits_nowhere(side):
    edge = side * GAP / 2
    assert way(unproven=[tuple(sorted((edge, edge - side * 0.17)))]) is None
    assert way(unproven=[(RIGHT[1], RIGHT[1] + 0.09), (LEFT[1] - 0.09, LEFT[1])]) is None
    assert way(unproven=[gap(GAP)]) is None


def test_each_need_counts_by_itself():
    assert way(needed=replace(NEEDED, proven=0.43)) is not None
    assert way(needed=replace(NEEDED, proven=0.47)) is None
    assert way(needed=replace(NEEDED, room=0.43)) is not None
    assert way(needed=replace(NEEDED, room=0.47)) is None


@pytest.mark.parametrize(("strip", "through"), [(0.008, True), (0.02, False)], ids=["8 mm", "20 mm"])
@pytest.mark.parametrize("y", [0.0, 0.05, -0.06])
def test_an_unproven_strip_in_the_way_closes_it_if_a_thing_may_stand_there(strip, through, y):
    found = way(unproven=[gap(strip, y)])
    assert (found is not None) == through


@pytest.mark.parametrize(("strip", "through"), [(0.01, True), (0.04, False)], ids=["10 mm", "40 mm"])
@pytest.mark.parametrize("side", [1, -1])
def test_an_unproven_strip_at_a_jamb_takes_its_width_off_what_is_proven(strip, through, side):
    """At the jambs it lies between open air and a thing, and what is proven of 0.45 m is that much less."""
    edge = side * GAP / 2
    tight = replace(NEEDED, proven=GAP - 0.03)
    found = way(unproven=[tuple(sorted((edge, edge - side * strip)))], needed=tight)
    assert (found is not None) == through


def test_what_stands_before_beside_or_shortly_behind_the_opening_bars_the_way():
    x, y = places()
    for at, bars in ((0.5, True), (AWAY + 0.06, True), (AWAY + NEEDED.beyond + 0.1, False)):
        thing = (np.abs(y) < 0.05) & (x > at) & (x < at + 0.05)
        barred = CLEAR | shadowed(thing)
        opened = replace(plan_of(CLEAR), empty=~barred)
        assert (way_through(seen(CLEAR), opened, OPENING, NEEDED) is None) == bars, at


@pytest.mark.parametrize(("leads_to", "through"), [(AWAY + 0.2, True), (AWAY + 0.35, False)])
def test_the_way_leads_as_far_as_the_opening_does(leads_to, through):
    """Aside of the way that was found there may be none: it must not end at a wall a little farther on."""
    x, y = places()
    wall = shadowed((np.abs(y) < 0.3) & (x > AWAY + 0.25) & (x < AWAY + 0.3))
    opened = replace(plan_of(CLEAR), empty=~(CLEAR | wall))
    found = way_through(seen(CLEAR), opened, replace(OPENING, leads_to=leads_to), NEEDED)
    assert (found is not None) == through


def test_the_air_must_be_proven_from_before_the_opening_to_behind_it():
    """All rays of a lane end a bit before the opening, or behind: what is beyond is not proven."""
    for ends_at, through in ((AWAY - 0.04, False), (AWAY + 0.06, False), (AWAY + 0.3, True)):
        seen_air = seen()
        left = seen_air.left.copy()
        left[:, across(0.03) : across(-0.03)] = ends_at - EYE[0]
        found = way_through(replace(seen_air, left=left), plan_of(CLEAR), OPENING, NEEDED)
        assert (found is not None) == through, ends_at


def test_an_opening_no_ring_reaches_has_no_way():
    far = Opening((9.0, 0.2), (9.0, -0.2), 0.4, 9.3)
    assert way(opening=far) is None


# --- the floor of the way ---

BEARINGS = np.radians(np.arange(-30.0, 30.1, 1.5))


def floor(free=2.0, near=0.4):
    each = np.ones(len(BEARINGS))
    return FreeSpace(BEARINGS, near=near * each, free=free * each, obstacles=np.zeros((0, 2)))


def ended(floor_, degrees, at):
    free = floor_.free.copy()
    free[np.abs(BEARINGS - math.radians(degrees)).argmin()] = at
    return replace(floor_, free=free)


def test_floor_seen_free_along_the_way_reaches():
    assert floor_reaches(floor(), 0.0, 1.2, 0.26)
    assert floor_reaches(floor(1.1), 0.0, 1.2, 0.26)  # sectors end at cells of some 12 cm
    assert not floor_reaches(floor(1.05), 0.0, 1.2, 0.26)


def test_every_sector_the_body_sweeps_is_asked_as_far_as_it_sweeps_it():
    for degrees in (0.0, 3.0, -4.5):
        assert not floor_reaches(ended(floor(), degrees, 0.9), 0.0, 1.2, 0.26)
    # At 9 degrees the body's side leaves the sector's near edge 0.13 / sin(9.75) = 0.77 m away.
    assert not floor_reaches(ended(floor(), 9.0, 0.6), 0.0, 1.2, 0.26)
    assert floor_reaches(ended(floor(), 9.0, 0.7), 0.0, 1.2, 0.26)
    assert floor_reaches(ended(floor(), 21.0, 0.5), 0.0, 1.2, 0.26)


def test_floor_first_seen_too_far_away_does_not_reach():
    assert floor_reaches(floor(near=0.6), 0.0, 1.2, 0.26)
    assert not floor_reaches(floor(near=0.61), 0.0, 1.2, 0.26)


def test_a_way_beside_the_view_has_no_floor():
    assert floor_reaches(floor(), math.radians(17.0), 1.2, 0.26)
    assert not floor_reaches(floor(), math.radians(25.0), 1.2, 0.26)
    assert not floor_reaches(floor(), math.radians(-25.0), 1.2, 0.26)


def test_no_sectors_or_one_are_no_floor():
    none = np.zeros(0)
    assert not floor_reaches(FreeSpace(none, none, none, np.zeros((0, 2))), 0.0, 1.2, 0.26)
    one = FreeSpace(np.zeros(1), near=np.full(1, 0.3), free=np.full(1, 2.0), obstacles=np.zeros((0, 2)))
    assert not floor_reaches(one, 0.0, 1.2, 0.26)
