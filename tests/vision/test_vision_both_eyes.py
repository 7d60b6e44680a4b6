"""What both eyes see of an opening, what has no texture of its own, and pictures that show nothing."""

import numpy as np
import pytest
import rendered_pairs
from hypothesis import given, settings
from hypothesis import strategies as st
from layered_scenes import Layer, cast
from rendered_pairs import MOUNT, RIG, Block, Room, render

from robot.vision.both_eyes import (
    CONTINUED_SIGMA_PX,
    BothEyes,
    moved_to_right,
    plates_continued,
    see,
)
from robot.vision.continuation import Surfaces
from robot.vision.disparity import Disparity
from robot.vision.free_way import FreeWayFinder
from robot.vision.section import BoxSection
from robot.vision.stereo import AdaptiveWeightMatcher

WIDTH, HEIGHT = 200, 40
FAR, NEAR = 4.0, 16.0
ROWS = np.s_[6:-6]
LEFT_JAMB, RIGHT_JAMB = 70, 120
"""Columns between which the left picture shows an opening; the right one NEAR px farther left."""


def layer(disparity, columns, shade, seed, rows=(0, HEIGHT), contrast=28.0):
    """A surface whose edges lie between whole pixels: first column and row, last + 1."""
    return Layer(
        disparity, (columns[0] - 0.5, rows[0] - 0.5, columns[1] - 0.5, rows[1] - 0.5), shade, seed, contrast
    )


WALL = layer(FAR, (0, WIDTH), 110, 1)
JAMBS = layer(NEAR, (0, LEFT_JAMB), 180, 2), layer(NEAR, (RIGHT_JAMB, WIDTH), 60, 3)


def a_map(values, valid):
    return Disparity(
        values.astype(np.float32), valid, np.where(valid, np.float32(0.1), np.float32(np.inf))
    )  # fmt: skip


def measured(scene, fringe=0):
    """True disparities where both eyes see the pixel, but within so many columns of an edge."""
    edge = np.zeros(scene.truth.shape, np.bool_)
    edge[:, 1:] = np.abs(np.diff(scene.truth, axis=1)) > 1.0
    for _ in range(fringe):
        edge[:, 1:] |= edge[:, :-1].copy()
        edge[:, :-1] |= edge[:, 1:].copy()
    return a_map(scene.truth, scene.seen & ~edge)


def see_plates(found, left, right):
    return plates_continued(see(found, left, right), left, right)


def opening(eye, width):
    """First and last column (R, 2), between the jambs' middles, known to be far in all rows."""
    far = (eye.valid & (np.abs(eye.values - FAR) < 1.0))[ROWS]
    return np.array([np.flatnonzero(row)[[0, -1]] for row in far])


# --- both sides of an opening ---


@pytest.mark.parametrize("fringe", [1, 4])
@pytest.mark.parametrize("looked", [see, see_plates])
def test_the_left_eye_sees_an_opening_s_left_side_and_the_right_eye_its_right_side(looked, fringe):
    scene = cast((WALL, *JAMBS), WIDTH, HEIGHT)
    eyes = looked(measured(scene, fringe), scene.left, scene.right)
    begins, ends = opening(eyes.left, WIDTH)[:, 0], opening(eyes.right, WIDTH)[:, 1]
    assert np.abs(begins - LEFT_JAMB).max() <= 1
    assert np.abs(ends - (RIGHT_JAMB - 1 - NEAR)).max() <= 1


def test_the_map_alone_leaves_what_one_eye_sees_unknown():
    scene = cast((WALL, *JAMBS), WIDTH, HEIGHT)
    found = measured(scene)
    eyes = BothEyes.of(found)
    assert eyes.left is found
    assert opening(eyes.left, WIDTH)[:, 1].max() <= RIGHT_JAMB - 1 - (NEAR - FAR) + 1
    far = eyes.right.valid & (eyes.right.values == FAR)
    assert not far[:, RIGHT_JAMB - int(NEAR) :].any()


def test_what_is_measured_keeps_its_sigma_what_is_continued_has_another_and_what_is_unknown_none():
    scene = cast((WALL, *JAMBS), WIDTH, HEIGHT)
    found = measured(scene)
    eyes = see(found, scene.left, scene.right)
    for eye in (eyes.left, eyes.right):
        assert eye.values.shape == eye.valid.shape == eye.sigma_px.shape == (HEIGHT, WIDTH)
        assert eye.values.dtype == eye.sigma_px.dtype == np.float32
        assert np.isinf(eye.sigma_px[~eye.valid]).all()
    own = np.repeat(found.valid[::2], 2, axis=0)
    assert (eyes.left.sigma_px[eyes.left.valid & ~own] == np.float32(CONTINUED_SIGMA_PX)).all()
    assert (eyes.left.valid & ~own).any()
    kept = eyes.left.sigma_px[own & eyes.left.valid] == found.sigma_px[found.valid][0]
    assert kept.mean() > 0.95  # the others were measured without texture and bridged
    assert (eyes.right.sigma_px[eyes.right.valid] == np.float32(CONTINUED_SIGMA_PX)).all()


def test_only_plates_go_on_upwards_and_downwards():
    scene = cast((layer(8.0, (0, WIDTH), 110, 1),), WIDTH, HEIGHT)
    valid = np.zeros((HEIGHT, WIDTH), np.bool_)
    valid[:14] = True
    found = a_map(scene.truth, valid)
    floor, plate = (looked(found, scene.left, scene.right) for looked in (see, see_plates))
    inner = np.s_[16:, 30:170]
    for eye in (floor.left, floor.right):
        assert not eye.valid[inner].any()
    for eye in (plate.left, plate.right):
        assert eye.valid[inner].mean() > 0.6
        assert np.abs(eye.values[eye.valid] - 8.0).max() < 0.1


def test_rows_below_those_looked_at_stay_as_they_were_measured():
    """The lower half's far wall is measured 3 px wrong: where it is looked at that is noticed."""
    scene = cast((layer(8.0, (0, WIDTH), 110, 1),), WIDTH, HEIGHT)
    found = a_map(scene.truth + 3.0, np.ones((HEIGHT, WIDTH), np.bool_))
    eyes = see(found, scene.left, scene.right, 20)
    assert eyes.left.valid[:18].mean() < 0.3
    assert eyes.left.valid[22:].all()
    assert (eyes.left.values[22:] == 11.0).all()
    assert eyes.right.valid[22:, : WIDTH - 11].all()
    whole = see(found, scene.left, scene.right)
    assert (whole.left.valid[:6] == eyes.left.valid[:6]).all()
    assert whole.left.valid[24:].mean() < 0.3


# --- by the right eye's columns ---


def surfaces(values):
    """Disparities of one row; None where nothing is known."""
    known = np.array([[value is not None for value in values]])
    return Surfaces(np.array([[0.0 if v is None else v for v in values]], np.float32), known)


def test_the_right_eye_sees_each_pixel_its_disparity_farther_left():
    found = moved_to_right(surfaces([None, None, 2.0, None, None, 1.4, 1.6]))
    assert found.known[0].tolist() == [True, False, False, False, True, False, False]
    assert found.values[0, [0, 4]] == pytest.approx([2.0, 1.6])  # 1.4 fell there too, and is farther


def test_of_two_things_at_one_column_the_nearer_one_counts():
    for shift in range(1, 5):  # far ones hidden by near ones, whichever is written first
        row = [None] * 20
        row[8], row[8 + shift] = 2.0, 2.0 + shift
        found = moved_to_right(surfaces(row))
        assert found.values[0, 6] == 2.0 + shift
        assert found.known.sum() == 1


def test_what_leaves_the_picture_is_dropped():
    found = moved_to_right(surfaces([3.0, 3.0, 3.0, -2.0, None, -2.0]))
    assert found.known[0].tolist() == [False, False, False, False, False, True]
    assert found.values[0, 5] == -2.0


def test_a_hole_of_one_column_is_closed_by_the_nearer_neighbour_and_wider_ones_are_not():
    # Columns 2, 3 | 5, 6 | 9 of the right eye are seen.
    row = [None, None, None, None, 2.0, 2.0, None, None, 3.0, 3.0, None, None, 3.0]
    found = moved_to_right(surfaces(row))
    assert np.flatnonzero(found.known[0]).tolist() == [2, 3, 4, 5, 6, 9]
    assert found.values[0, 4] == 3.0
    other = moved_to_right(surfaces([None, None, None, 3.0, 2.0]))  # the nearer one to the left
    assert other.known[0].tolist() == [True, True, True, False, False]
    assert other.values[0, 1] == 3.0


GOES_ON = pytest.mark.xfail(
    strict=True,
    reason="above a bare board texture tells, so the wall goes on over the board's edge, and down it",
)


@pytest.mark.parametrize("looked", [see, pytest.param(see_plates, marks=GOES_ON)])
def test_a_disparity_carried_into_a_bare_surface_is_not_known(looked):
    """All of it is measured at the wall's disparity, as by a window wider than the bare board is high."""
    bare_board = layer(NEAR, (0, WIDTH), 150, 4, (8, 32), contrast=0.0)
    scene = cast((WALL, bare_board), WIDTH, HEIGHT, noise=0.0)
    found = a_map(np.full((HEIGHT, WIDTH), FAR), np.ones((HEIGHT, WIDTH), np.bool_))
    eyes = looked(found, scene.left, scene.right)
    for eye in (eyes.left, eyes.right):
        assert not eye.valid[18:22, 20:-20].any()


def test_a_bare_board_eight_pixels_high_is_not_known():
    scene = cast((WALL, layer(NEAR, (0, WIDTH), 150, 4, (16, 24), contrast=0.0)), WIDTH, HEIGHT)
    found = a_map(np.full((HEIGHT, WIDTH), FAR), np.ones((HEIGHT, WIDTH), np.bool_))
    assert see(found, scene.left, scene.right).left.valid[18:22, 24:-16].mean() < 0.9


# --- a bare board across the way ---

LEVEL = np.radians(15.0)
BARE = 99
"""Seed of a texture that is none."""


@pytest.fixture
def bare_boards(monkeypatch):
    cloud = rendered_pairs.texture

    def texture(seed, size=512):
        return np.full((size, size), 0.5, np.float32) if seed == BARE else cloud(seed, size)

    monkeypatch.setattr(rendered_pairs, "texture", texture)


def through_a_gap(*extra):
    """The passage through a gap of 0.45 m at 1.1 m; its far wall is seen above and below a hanging board."""
    jambs = (Block(1.15, side * 0.825, 0.1, 1.2, 0.8, seed=2 + side) for side in (1, -1))
    pair = render(Room((*jambs, *extra)), tilt=LEVEL, samples=2)
    finder = FreeWayFinder(RIG, MOUNT, BoxSection(0.26, 0.32), AdaptiveWeightMatcher.floors(64))
    return finder(pair.left, pair.right, 0.0, LEVEL).passage


def board(low, high, away=0.9):
    return Block(away, 0.0, 0.02, 1.4, high, z0=low, seed=BARE)


def test_the_gap_is_safe_without_a_board(bare_boards):
    assert through_a_gap().safe


@pytest.mark.parametrize(
    ("low", "high"),
    [
        (0.1, 0.16),
        (0.05, 0.3),
        (0.15, 0.35),
        (0.1, 0.13),
        (0.2, 0.26),
        (0.28, 0.31),
    ],
)
def test_a_bare_board_across_the_gap_is_not_passed(bare_boards, low, high):
    """Nothing of it is measured: what lies behind it must not be taken for measured there."""
    passage = through_a_gap(board(low, high))
    assert passage is None or not passage.safe


# --- bad and empty input ---


def nothing(height, width, disparity=6.0):
    return a_map(np.full((height, width), disparity), np.ones((height, width), np.bool_))


@pytest.mark.parametrize("looked", [see, see_plates])
@pytest.mark.parametrize("grey", [0, 128, 255])
def test_pictures_that_show_nothing_tell_nothing(looked, grey):
    picture = np.full((HEIGHT, WIDTH, 3), grey, np.uint8)
    eyes = looked(nothing(HEIGHT, WIDTH), picture, picture)
    assert not eyes.left.valid.any()
    assert not eyes.right.valid.any()


@pytest.mark.parametrize("looked", [see, see_plates])
def test_pictures_of_another_size_than_the_map_are_refused_in_one_line(looked):
    picture = np.zeros((HEIGHT, WIDTH), np.uint8)
    with pytest.raises(
        ValueError, match=r"the disparity map is \(40, 199\), its pictures are \(40, 200\)"
    ) as told:
        looked(nothing(HEIGHT, WIDTH - 1), picture, picture)
    assert "\n" not in str(told.value)
    with pytest.raises(ValueError, match="eyes of different size"):
        looked(nothing(HEIGHT, WIDTH), picture, picture[:, 1:])
    with pytest.raises(ValueError, match="uint8"):
        looked(nothing(HEIGHT, WIDTH), picture.astype(float), picture)


def test_a_grey_picture_goes_with_a_coloured_one():
    scene = cast((WALL, *JAMBS), WIDTH, HEIGHT)
    found, coloured = measured(scene), np.dstack([scene.right] * 3)
    mixed, both = see(found, scene.left, coloured), see(found, scene.left, scene.right)
    assert (mixed.left.valid == both.left.valid).all()
    assert (mixed.right.values == both.right.values).all()
    single = see(found, scene.left[:, :, None], coloured)
    assert (single.left.valid == both.left.valid).all()


def test_a_map_that_measured_nothing_stays_empty():
    scene = cast((WALL,), WIDTH, HEIGHT)
    eyes = see(a_map(scene.truth, np.zeros((HEIGHT, WIDTH), np.bool_)), scene.left, scene.right)
    assert not eyes.left.valid.any()
    assert not eyes.right.valid.any()


@settings(deadline=None, max_examples=40)
@given(
    st.integers(1, 23),
    st.integers(1, 41),
    st.integers(0, 2**16),
    st.sampled_from([1, 3]),
    st.none() | st.integers(1, 23),
)
def test_pictures_of_any_size_come_back_in_theirs(height, width, seed, colours, rows):
    rng = np.random.default_rng(seed)
    left, right = rng.integers(0, 256, (2, height, width, colours), np.uint8)
    found = a_map(rng.uniform(-2.0, 50.0, (height, width)), rng.random((height, width)) < 0.7)
    for eyes in (see(found, left, right, rows), see_plates(found, left, right)):
        for eye in (eyes.left, eyes.right):
            assert eye.values.shape == eye.valid.shape == eye.sigma_px.shape == (height, width)
            assert np.isfinite(eye.values).all()
