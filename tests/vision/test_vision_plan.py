"""The air from above: what is proven empty, what a strip or a hanging edge may hide, and the outline."""

import math

import numpy as np
import pytest
from upright_air import BASELINE, COLUMNS, FOCAL, MIDDLE, RAYS, ROWS, TANGENTS, WALL, air

from robot.vision.plan import barred_by, ends, outline, proven, standing_points


def crossing(distance):
    """Rows whose rays cross the body's heights at this distance."""
    return np.flatnonzero((RAYS.enters <= distance) & (distance < RAYS.leaves))


def with_hole(rows, columns, value=0.0):
    left = np.full((ROWS, COLUMNS), WALL, np.float32)
    left[rows, columns] = value
    return left


# --- proven ---


def test_what_is_measured_beyond_is_proven_and_what_is_not_measured_is_not():
    assert proven(air(WALL), 1.0).all()
    assert not proven(air(0.0), 1.0).any()
    assert not proven(air(WALL), WALL + 0.01).any()
    assert not proven(air(0.9), 1.0).any()


def test_where_no_ray_crosses_the_body_s_heights_nothing_is_proven():
    assert not len(crossing(500.0))
    assert not proven(air(900.0), 500.0).any()


AWAY = pytest.mark.parametrize("away", [0.8, 1.4, 1.0])


def strip(wide_m, away):
    """Columns of an unproven strip so wide at this distance."""
    return slice(MIDDLE, MIDDLE + round(wide_m * FOCAL / away))


@pytest.mark.parametrize("away", [0.8, 1.0, 1.4])
def test_an_unproven_strip_narrower_than_what_stands_by_itself_is_passed_over(away):
    assert proven(air(with_hole(slice(None), strip(0.010, away))), away).all()


@pytest.mark.parametrize("wide_m", [0.015, 0.020])
@AWAY
def test_a_wider_strip_is_not(wide_m, away):
    expected = np.ones(COLUMNS, np.bool_)
    expected[strip(wide_m, away)] = False
    assert (proven(air(with_hole(slice(None), strip(wide_m, away))), away) == expected).all()


@AWAY
def test_a_strip_at_the_side_of_a_barred_place_stays_unproven(away):
    """Beside a jamb the strip lies between the open and what stands: it adds to what is not proven."""
    left = with_hole(slice(None), slice(MIDDLE, None), away - 0.1)
    left[:, MIDDLE - 3 : MIDDLE] = 0.0
    assert (proven(air(left), away) == (np.arange(COLUMNS) < MIDDLE - 3)).all()


@pytest.mark.parametrize(("rows", "bars"), [(2, False), (3, True)])
@pytest.mark.parametrize("first", [2, 10])
def test_three_unproven_rows_between_proven_ones_bar_and_two_do_not(rows, bars, first):
    held = crossing(1.0)
    assert len(held) >= 3 / 0.1  # a tenth of the rays would pass for noise: only the edge rule bars these
    begin = held[0] + first
    left = with_hole(slice(begin, begin + rows), slice(None))
    assert proven(air(left), 1.0).all() != bars
    assert proven(air(left), 1.0).any() != bars


def test_a_tenth_of_the_rays_may_miss_and_no_more():
    held = crossing(1.0)
    least = math.floor(0.1 * len(held))
    for missing, passed in ((least, True), (least + 1, False)):
        left = np.full((ROWS, COLUMNS), WALL, np.float32)
        left[held[1 : 1 + 2 * missing : 2]] = 0.0  # every second row: no edge hangs there
        assert proven(air(left), 1.0).all() == passed


def test_unproven_rows_at_the_end_of_the_heights_are_no_hanging_edge():
    """Below the lowest ray nothing is proven any more: the rows are few, and between nothing."""
    held = crossing(1.0)
    assert proven(air(with_hole(slice(held[-3] + 1, held[-1] + 1), slice(None))), 1.0).all()


def test_a_hanging_edge_above_the_body_s_heights_does_not_matter():
    held = crossing(1.6)
    assert held[0] >= 5
    assert proven(air(with_hole(slice(held[0] - 5, held[0] - 1), slice(None))), 1.6).all()


def test_what_hangs_from_above_into_the_body_s_heights_counts_though_it_begins_above():
    held = crossing(1.6)
    left = with_hole(slice(held[0] - 2, held[0] + 3), slice(None))
    assert not proven(air(left), 1.6).any()


def test_what_the_left_eye_misses_the_right_one_may_prove_by_its_own_columns():
    """At a distance the right eye's column is the left one's less its disparity there."""
    shift = round(FOCAL * BASELINE / 1.4)
    right = np.zeros((ROWS, COLUMNS), np.float32)
    right[:, 100:160] = WALL
    found = proven(air(0.0, right), 1.4)
    assert np.flatnonzero(found).tolist() == list(range(100 + shift, 160 + shift))
    found = proven(air(0.0, WALL), 1.4)
    assert not found[:shift].any()  # out of the right eye's view
    assert found[shift:].all()


# --- outline ---


def test_the_outline_is_empty_up_to_what_is_measured():
    plan = outline(air(1.2, 1.2))
    middle = plan.empty[MIDDLE]
    near = plan.in_view[MIDDLE] & (plan.distances < 1.15)
    assert near.any()
    assert middle[near].all()
    assert not middle[plan.distances > 1.25].any()
    assert not (plan.empty & ~plan.in_view).any()


def test_what_is_not_measured_stands_at_its_foot():
    plan = outline(air(0.0, 0.0, foot=1.0))
    middle, seen = plan.empty[MIDDLE], plan.in_view[MIDDLE]
    assert middle[seen & (plan.distances < 0.97)].all()
    assert not middle[plan.distances > 1.03].any()
    assert not outline(air(0.0, 0.0, foot=0.0)).empty[MIDDLE].any()


def test_the_right_eye_s_surfaces_empty_what_the_left_one_cannot_see_past():
    """A strip the left eye does not measure, and whose foot is near: the right eye saw through it."""
    left = with_hole(slice(None), slice(MIDDLE, MIDDLE + 30))
    blind, told = (outline(air(left, right, foot=0.5)) for right in (0.0, WALL))
    ring = int(np.searchsorted(told.distances, 1.0))
    strip = np.s_[MIDDLE + 5 : MIDDLE + 25, ring]
    assert not blind.empty[strip].any()
    assert told.empty[strip].all()


def test_what_the_right_eye_measures_to_stand_is_not_empty_by_its_rays():
    left = with_hole(slice(None), slice(MIDDLE, MIDDLE + 30))
    plan = outline(air(left, 0.8, foot=0.5))
    ring = int(np.searchsorted(plan.distances, 1.0))
    assert not plan.empty[MIDDLE + 5 : MIDDLE + 25, ring].any()


@pytest.mark.parametrize(("rows", "bars"), [(2, False), (3, True)])
def test_three_rays_that_end_before_a_place_bar_it_and_two_do_not(rows, bars):
    """Two are false matches; three of some forty are less than the tenth that may be missing."""
    left = np.full((ROWS, COLUMNS), WALL, np.float32)
    held = crossing(0.8)
    left[held[5] : held[5] + rows] = 0.8
    plan = outline(air(left, left))
    ring = int(np.searchsorted(plan.distances, 1.0))
    assert plan.empty[MIDDLE, ring] != bars


def test_rays_that_end_before_the_body_s_heights_or_behind_are_nothing_that_stands():
    assert len(standing_points(air(WALL + 1.0))) == 0
    floor = np.broadcast_to(np.minimum(RAYS.leaves, 5.0)[:, None] + 0.01, (ROWS, COLUMNS))
    assert len(standing_points(air(floor))) == 0


def test_standing_points_lie_where_the_nearest_things_stand():
    found = standing_points(air(1.0))
    assert len(found) == COLUMNS
    assert found[:, 0] == pytest.approx(RAYS.eye[0] + 1.0)
    assert found[:, 1] == pytest.approx(RAYS.eye[1] - TANGENTS, abs=1e-6)


def test_two_rows_or_one_column_are_no_standing_thing():
    held = crossing(1.0)
    assert len(standing_points(air(with_hole(held[4:6], slice(None), 1.0)))) == COLUMNS  # the wall behind
    assert standing_points(air(with_hole(held[4:6], slice(None), 1.0)))[:, 0].min() > 1.9
    assert standing_points(air(with_hole(held[4:7], slice(None), 1.0)))[:, 0].max() < 1.1
    assert standing_points(air(with_hole(slice(None), slice(MIDDLE, MIDDLE + 1), 1.0)))[:, 0].min() > 1.9
    assert standing_points(air(with_hole(slice(None), slice(MIDDLE, MIDDLE + 2), 1.0)))[:, 0].min() < 1.1


def test_empty_air_ends_at_the_first_barred_ring():
    plan = outline(air(1.2, 1.2))
    found = ends(plan)
    assert found[MIDDLE, 0] == pytest.approx(RAYS.eye[0] + 1.2, rel=0.03)
    assert found[MIDDLE, 1] == pytest.approx(RAYS.eye[1], abs=1e-6)


# --- corners ---


def at(away, tangent):
    return [RAYS.eye[0] + away, RAYS.eye[1] - away * tangent, 0.1]


def test_nothing_is_empty_from_a_corner_on():
    plan = outline(air(WALL, WALL))
    barred = barred_by(plan, np.array([at(1.0, TANGENTS[MIDDLE])]))
    assert (barred.empty[MIDDLE] == (plan.empty[MIDDLE] & (plan.distances < 1.0))).all()
    rest = np.delete(np.arange(COLUMNS), MIDDLE)
    assert (barred.empty[rest] == plan.empty[rest]).all()
    assert (barred.in_view == plan.in_view).all()


def test_of_two_corners_in_one_direction_the_nearer_one_counts():
    plan = outline(air(WALL, WALL))
    for order in ((0.8, 1.2), (1.2, 0.8)):
        barred = barred_by(plan, np.array([at(away, 0.0) for away in order]))
        assert not barred.empty[MIDDLE, plan.distances >= 0.8].any()


def test_corners_of_what_is_barred_already_and_out_of_view_add_nothing():
    left = with_hole(slice(None), slice(MIDDLE, None), 1.0)
    plan = outline(air(left))
    for corner in (at(1.0, TANGENTS[MIDDLE - 3]), at(1.0, 3.0), at(-0.5, 0.0)):
        assert (barred_by(plan, np.array([corner])).empty == plan.empty).all()
    assert barred_by(plan, np.zeros((0, 3))) is plan
