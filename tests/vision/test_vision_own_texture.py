"""What shows no texture of its own was not measured where it stands, and what may be a bare board."""

import numpy as np
import pytest
from layered_scenes import Layer, cast

from robot.vision.own_texture import may_be_boards, own_texture

WIDTH, HEIGHT = 200, 48
FAR, NEAR = 4.0, 16.0
INNER = np.s_[12:-12, 28:-24]


def layer(disparity, columns, shade, seed, rows=(0, HEIGHT), contrast=28.0):
    """A surface whose edges lie between whole pixels: first column and row, last + 1."""
    return Layer(
        disparity, (columns[0] - 0.5, rows[0] - 0.5, columns[1] - 0.5, rows[1] - 0.5), shade, seed, contrast
    )


WALL = layer(FAR, (0, WIDTH), 110, 1)


def board(top, bottom):
    return layer(NEAR, (0, WIDTH), 150, 4, (top, bottom), contrast=0.0)


def textured(*layers, disparity=FAR, noise=1.0, seed=0):
    """Which pixels of a picture measured at one disparity all over show texture of their own."""
    scene = cast(layers, WIDTH, HEIGHT, noise, seed)
    return own_texture(np.full((HEIGHT, WIDTH), disparity, np.float32), scene.left, scene.right)


def test_a_textured_surface_s_true_disparity_has_texture_of_its_own_and_a_wrong_one_has_not():
    assert textured(WALL)[INNER].mean() > 0.99
    for wrong in (FAR - 4.0, FAR + 4.0, FAR + 9.0):
        assert textured(WALL, disparity=wrong)[INNER].mean() < 0.25


@pytest.mark.parametrize(("contrast", "noise"), [(28.0, 8.0), (10.0, 4.0), (6.0, 2.0)])
def test_noise_does_not_hide_texture(contrast, noise):
    """A dark room's: the noise of single pixels comes near the texture's own contrast."""
    faint = layer(FAR, (0, WIDTH), 60, 1, contrast=contrast)
    assert textured(faint, noise=noise)[INNER].mean() > 0.9


@pytest.mark.parametrize("noise", [0.0, 1.0, 2.0, 6.0])
def test_a_bare_surface_has_none(noise):
    found = textured(layer(FAR, (0, WIDTH), 120, 1, contrast=0.0), noise=noise)
    assert found[INNER].mean() < (0.05 if noise else 1e-9)


@pytest.mark.parametrize("rows", [16, 10, 6])
def test_a_bare_board_lying_between_textured_walls_has_none_up_to_its_rims(rows):
    top, bottom = 24 - rows // 2, 24 + rows // 2
    found = textured(WALL, board(top, bottom))
    assert found[top + 1 : bottom - 1, 28:-24].mean() < 0.1
    assert found[[top - 9, bottom + 9], 28:-24].mean() > 0.95


def test_a_bare_post_standing_between_textured_walls_has_none():
    """Its lying window reaches the wall to both sides: the standing one tells."""
    found = textured(WALL, layer(NEAR, (90, 106), 110, 4, contrast=0.0))
    assert found[12:-12, 95:101].mean() < 0.2
    assert found[12:-12, np.r_[40:80, 116:150]].mean() > 0.9


# --- boards ---

ANSWERED = np.ones((HEIGHT, WIDTH), np.bool_)


def boards(*layers, noise=1.0):
    scene = cast(layers, WIDTH, HEIGHT, noise)
    known = textured(*layers, noise=noise)
    return may_be_boards(ANSWERED & ~known, known, scene.left)[:, 28:-24]


def test_a_bare_band_between_two_edges_may_be_a_board():
    found = boards(WALL, board(16, 32))
    assert found[17:31].mean() > 0.95
    assert not found[:14].any()
    assert not found[34:].any()


def test_a_bare_place_of_one_surface_may_not():
    """The wall itself is bare there: no edge parts it from its texture."""
    bare = layer(FAR, (0, WIDTH), 110, 4, (16, 32), contrast=0.0)
    even = layer(FAR, (0, WIDTH), 110, 1, contrast=6.0)
    assert boards(even, bare).mean() < 0.05


def test_a_band_that_reaches_the_picture_s_rim_without_an_edge_may_not():
    assert not boards(WALL, board(30, HEIGHT))[36:].any()


def test_what_nobody_answered_for_is_left_to_others():
    scene = cast((WALL, board(16, 32)), WIDTH, HEIGHT)
    none = np.zeros((HEIGHT, WIDTH), np.bool_)
    assert not may_be_boards(none, none, scene.left).any()
