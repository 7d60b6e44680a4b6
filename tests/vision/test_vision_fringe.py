"""Fringes and specks: what may be closed, and that holes in a map stay holes."""

import numpy as np

from robot.vision.fringe import continued, specks_closed

FAR, NEAR, FB = 2.0, 0.5, 20.0


def edge_rows(fringe=10, edge=4):
    """Far left, near right, unmeasured between; the guess jumps `edge` pixels into the fringe."""
    surface = np.zeros((6, 60), np.float32)
    surface[:, :20], surface[:, 20 + fringe :] = FAR, NEAR
    guess = np.full((6, 60), FB / FAR, np.float32)
    guess[:, 20 + edge :] = FB / NEAR
    return surface, guess, np.ones((6, 60), np.bool_)


def test_a_far_surface_goes_on_up_to_the_edge_that_is_guessed():
    surface, guess, sure = edge_rows()
    closed = continued(surface, guess, sure, 36)
    assert (closed[:, 20:24] == FAR).all()
    assert (closed[:, 24:30] == 0.0).all()
    mirrored = continued(surface[:, ::-1], guess[:, ::-1], sure[:, ::-1], 36)
    assert np.array_equal(mirrored[:, ::-1], closed)


def test_without_a_sure_near_thing_behind_it_a_fringe_stays_unknown():
    surface, guess, sure = edge_rows()
    assert np.array_equal(continued(surface, guess, ~sure, 36), surface)
    surface[:, 30:] = 0.0
    level = np.full_like(guess, FB / FAR)
    assert np.array_equal(continued(surface, level, sure, 36), surface)


def test_a_fringe_wider_than_any_stays_unknown():
    surface, guess, sure = edge_rows(fringe=30, edge=25)
    assert np.array_equal(continued(surface, guess, sure, 20), surface)


def test_a_hole_in_a_far_surface_is_not_closed_by_guesses():
    surface = np.full((6, 60), FAR, np.float32)
    surface[:, 20:40] = 0.0
    guess = np.full((6, 60), FB / FAR, np.float32)
    assert np.array_equal(continued(surface, guess, np.ones((6, 60), np.bool_), 36), surface)


def test_a_speck_is_closed_with_the_nearest_thing_about_it_and_a_post_is_not():
    surface = np.full((20, 20), FAR, np.float32)
    surface[10, 10], surface[10, 11] = 0.0, NEAR
    assert specks_closed(surface)[10, 10] == NEAR
    surface[:, 4:7] = 0.0
    assert (specks_closed(surface)[:, 5] == 0.0).all()
