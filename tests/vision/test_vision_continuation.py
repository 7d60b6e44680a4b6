"""Surfaces continued to where they really end: what is filled, what never is, and edges to a pixel."""

import numpy as np
import pytest
from layered_scenes import Layer, cast

from robot.vision.continuation import REACH_PX, Surfaces, bridged, to_the_rims, up_and_down
from robot.vision.eye_pair import EyePair

WIDTH, HEIGHT = 160, 20
FAR, NEAR = 4.0, 14.0
ALL = (0, WIDTH)
ROWS = np.s_[3:-3]
"""Rows whose windows lie in the picture."""


def shown(*layers, noise=1.0, seed=0):
    """The pair seen from the left eye and its true disparities."""
    scene = cast(layers, WIDTH, HEIGHT, noise, seed)
    return EyePair.of(scene.left, scene.right, 1), scene.truth.astype(np.float32)


def without(truth, *bands):
    """The true disparities measured but in these (first, last + 1) columns, where nonsense is guessed."""
    known = np.ones(truth.shape, np.bool_)
    for first, last in bands:
        known[:, first:last] = False
    return Surfaces(np.where(known, truth, np.float32(40.0)), known)


def layer(disparity, columns, shade, seed, contrast=28.0, rows=(0, HEIGHT), **slopes):
    """A textured surface whose edges lie between whole pixels: first column and row, last + 1."""
    box = (columns[0] - 0.5, rows[0] - 0.5, columns[1] - 0.5, rows[1] - 0.5)
    return Layer(disparity, box, shade, seed, contrast, **slopes)


def bare(disparity, columns, shade, rows=(0, HEIGHT)):
    return layer(disparity, columns, shade, 9, 0.0, rows)


WALL = layer(FAR, ALL, 110, 1)


def columns_of(mask):
    """First and last column of every row (R, 2) in which the mask holds."""
    return np.array([np.flatnonzero(row)[[0, -1]] for row in mask])


# --- rule 1: one surface between two ends ---


@pytest.mark.parametrize("across", [0.0, 0.05], ids=["level", "slanted"])
def test_a_hole_in_a_textured_surface_is_filled_with_its_disparity(across):
    pair, truth = shown(layer(10.0, ALL, 110, 1, across=across))
    given = without(truth, (60, 80))
    found = bridged(given, pair)
    filled = found.known & ~given.known
    assert filled[ROWS, 60:80].mean() > 0.9
    assert np.abs(found.values - truth)[filled].max() < 0.1
    assert (found.values[given.known] == truth[given.known]).all()


@pytest.mark.parametrize(("first", "last"), [(60, 78), (60, 95)], ids=["short", "long"])
def test_a_bare_patch_of_a_textured_surface_is_filled(first, last):
    patch = bare(FAR, (first - 4, last + 4), 110)
    pair, truth = shown(WALL, patch)
    found = bridged(without(truth, (first, last)), pair)
    assert found.known[ROWS].all()
    assert (found.values[ROWS] == FAR).all()


@pytest.mark.parametrize("wide", [2, 4, 10])
@pytest.mark.parametrize("disparity", [NEAR, FAR + 4.0])
def test_a_thing_between_two_ends_of_a_surface_is_not_covered(wide, disparity):
    bar = layer(disparity, (70, 70 + wide), 190, 3, contrast=12.0)
    pair, truth = shown(WALL, bar)
    assert not bridged(without(truth, (66, 74 + wide)), pair).known[ROWS, 66 : 74 + wide].any()


def test_a_bare_thing_before_a_bare_spot_is_seen_by_its_edges():
    pair, truth = shown(WALL, bare(FAR, (50, 100), 110), bare(NEAR, (72, 78), 150))
    assert not bridged(without(truth, (68, 82)), pair).known[:, 68:82].any()


def test_only_rows_with_the_thing_in_them_stay_unknown():
    pair, truth = shown(WALL, layer(NEAR, (70, 78), 190, 3, rows=(0, 10)))
    found = bridged(without(truth, (66, 82)), pair).known[:, 66:82]
    assert not found[:10].any()
    assert found[13:].all(axis=1).mean() > 0.8


@pytest.mark.parametrize(("last", "filled"), [(80, True), (90, False)])
def test_a_long_run_with_an_edge_in_it_stays_unknown(last, filled):
    """The edge is painted on the surface, and both eyes agree: but so they would on a bare room behind."""
    plain, stripe = bare(FAR, (52, 110), 110), bare(FAR, (70, 74), 190)
    pair, truth = shown(WALL, plain, stripe)
    found = bridged(without(truth, (60, last)), pair)
    assert (found.known[ROWS, 60:last] == filled).all()


@pytest.mark.parametrize("fringe", [0, 3, 8])
@pytest.mark.parametrize("gap", [30, 60])
def test_a_bare_far_wall_seen_between_two_near_jambs_is_not_taken_for_theirs(gap, fringe):
    jambs = [layer(NEAR, (u0, u1), 60, 3 + u0) for u0, u1 in ((0, 50), (50 + gap, WIDTH))]
    pair, truth = shown(bare(FAR, ALL, 150), *jambs)
    given = without(truth, (50 - fringe, 50 + gap + fringe))
    assert not bridged(given, pair).known[:, 50 : 50 + gap].any()


def test_two_surfaces_are_not_bridged():
    pair, truth = shown(WALL, layer(FAR + 3.0, (0, 70), 170, 3))
    given = without(truth, (60, 80))
    assert (bridged(given, pair).known == given.known).all()


@pytest.mark.parametrize(("apart", "one"), [(1.8, True), (2.2, False)])
def test_ends_two_pixels_apart_are_of_two_surfaces(apart, one):
    """On a bare spot the eyes agree whatever lies there: only the ends tell."""
    pair, truth = shown(bare(FAR, ALL, 120), noise=0.0)
    given = without(truth, (70, 85))
    given.values[:, 85:] += apart
    found = bridged(given, pair)
    assert found.known[:, 70:85].all() == one
    assert found.known[:, 70:85].any() == one
    if one:
        assert found.values[3, 69:86] == pytest.approx(np.linspace(FAR, FAR + apart, 17), abs=1e-4)


def test_what_is_known_to_one_side_alone_is_not_bridged():
    pair, truth = shown(WALL)
    given = without(truth, (0, 20), (140, WIDTH))
    assert (bridged(given, pair).known == given.known).all()


# --- rules 2 and 3: up to the rims ---

POST = layer(NEAR, (60, 95), 180, 3)


def far_begins(found):
    """First column of every row, right of the post's middle, from which all is known to be far."""
    far = (found.known & (np.abs(found.values - FAR) < 1.0))[ROWS, 78:130]
    return 78 + far.shape[1] - np.argmin(far[:, ::-1], axis=1)


@pytest.mark.parametrize("inner", [1, 4, 10])
@pytest.mark.parametrize("outer", [1, 6, 15, 24])
def test_the_far_side_ends_at_the_true_edge_whatever_the_fringe(inner, outer):
    pair, truth = shown(WALL, POST)
    found = to_the_rims(without(truth, (95 - inner, 95 + outer)), pair)
    assert np.abs(far_begins(found) - 95).max() <= 1


@pytest.mark.parametrize("outer", [1, 6, 15, 24])
def test_the_right_eye_s_far_side_is_the_same_mirrored(outer):
    pair, _ = shown(WALL, POST)
    edge = 60 - int(NEAR)  # where the right eye sees the post's left side
    truth = np.full((HEIGHT, WIDTH), FAR, np.float32)
    truth[:, edge : edge + 35] = NEAR
    given = without(truth, (edge - outer, edge + 4))
    found = to_the_rims(given.mirrored, pair.mirrored).mirrored
    far = (found.known & (np.abs(found.values - FAR) < 1.0))[ROWS, 10 : edge + 18]
    assert np.abs(10 + np.argmin(far, axis=1) - edge).max() <= 1


@pytest.mark.parametrize("fattened", [1, 3, 5])
def test_a_near_surface_fattened_by_a_window_is_cut_back(fattened):
    pair, truth = shown(WALL, POST)
    wrong = truth.copy()
    wrong[:, 95 : 95 + fattened] = NEAR
    given = without(wrong, (95 + fattened, 103 + fattened))
    assert np.abs(far_begins(to_the_rims(given, pair)) - 95).max() <= 1


@pytest.mark.parametrize("thinned", [1, 3, 5])
def test_a_near_surface_eaten_by_a_window_is_not(thinned):
    """What a window gave the far side too much of is no longer known, or the near side's: never free."""
    pair, truth = shown(WALL, POST)
    given = without(truth, (92 - thinned, 97))
    found = to_the_rims(given, pair)
    assert not (found.known & (found.values < NEAR - 1.0))[ROWS, 78:94].any()


def test_a_third_surface_between_is_not_filled():
    """But for a pixel here and there that looks alike by chance."""
    shares = []
    for seed in range(4):
        pair, truth = shown(WALL, POST, layer(9.0, (95, 110), 60, 5 + seed))
        found = to_the_rims(without(truth, (92, 114)), pair)
        shares.append(found.known[ROWS, 95:109].mean())
        assert (found.values[ROWS, 114:] == FAR).all()
    assert np.mean(shares) < 0.1
    assert max(shares) < 0.2


def test_the_near_surface_is_not_continued_over_what_is_unknown():
    pair, truth = shown(WALL, POST)
    given = without(truth, (90, 100), (40, 70))
    found = to_the_rims(given, pair)
    filled = found.known & ~given.known
    assert (found.values[filled] == FAR).all()
    assert (found.values[given.known] == truth[given.known]).all()


def test_before_a_near_thing_the_far_side_ends_where_the_other_eye_loses_it():
    """Left of a near thing lies a strip that the left eye alone sees: as wide as both disparities differ."""
    pair, truth = shown(WALL, POST)
    hidden = 60 - int(NEAR - FAR)
    found = to_the_rims(without(truth, (hidden - 8, 64)), pair)
    ends = [78 - np.argmax(row[:78][::-1]) - 1 for row in (found.known & (found.values == FAR))[ROWS]]
    assert hidden - 2 <= min(ends) <= max(ends) <= hidden + 1


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_bare_far_surface_stops_at_the_first_edge(mirrored):
    """Both eyes agree on all of a bare wall; what the unmeasured thing before it is nobody knows."""
    thing = layer(NEAR, (100, WIDTH), 60, 3)
    pair, truth = shown(WALL, bare(FAR, (60, WIDTH), 150), thing)
    edge, given = 100 - int(NEAR - FAR), without(truth, (74, WIDTH))
    if mirrored:
        thing = layer(NEAR, (0, 60), 60, 3)
        pair, truth = shown(WALL, bare(FAR, (0, 100), 150), thing)
        edge, given = 60, without(truth, (0, 76))
    found = to_the_rims(given, pair)
    first, last = columns_of(found.known[ROWS]).T
    short = first - edge if mirrored else edge - 1 - last
    assert 0 <= short.min() <= short.max() <= 2
    assert (found.values[found.known] == FAR).all()


def test_a_surface_goes_on_into_the_unknown_no_farther_than_a_window_reaches():
    pair, truth = shown(bare(FAR, ALL, 120), noise=0.0)
    found = to_the_rims(without(truth, (0, 60), (110, WIDTH)), pair)
    first, last = columns_of(found.known).T
    assert 60 - REACH_PX <= first.min() <= first.max() < 45
    assert 125 < last.min() <= last.max() < 110 + REACH_PX


def test_a_hole_in_one_surface_is_left_to_the_bridge():
    pair, truth = shown(WALL)
    given = without(truth, (60, 100))
    assert (to_the_rims(given, pair).known == given.known).all()


def test_a_wide_run_is_not_cut():
    """Beyond 90 px of nothing known two surfaces do not bound what lies between them."""
    pair, truth = shown(layer(FAR, ALL, 110, 1), layer(NEAR, (0, 60), 180, 3))
    found = to_the_rims(without(truth, (30, 130)), pair)
    assert not found.known[:, 30 : 130 - REACH_PX].any()


def test_eyes_that_show_no_edge_do_not_cut_a_run():
    """A fattened bare thing before a bare wall of its own grey: nobody can tell where it ends."""
    pair, truth = shown(bare(FAR, ALL, 120), bare(NEAR, (60, 95), 120), noise=0.0)
    given = without(truth, (93, 103))
    found = to_the_rims(given, pair)
    assert (found.values[given.known] == truth[given.known]).all()


@pytest.mark.parametrize("rule", [bridged, to_the_rims, up_and_down])
def test_where_nothing_is_known_nothing_becomes_known(rule):
    pair, truth = shown(WALL, POST)
    assert not rule(without(truth, (0, WIDTH)), pair).known.any()
    same = rule(without(truth), pair)
    assert same.known.all()
    assert (same.values == truth).all()


# --- up and down ---


def plate(*layers, known, noise=1.0):
    """A picture seen from the left whose rows `known` (first, last + 1) alone are measured."""
    pair, truth = shown(*layers, noise=noise)
    rows = np.zeros(truth.shape, np.bool_)
    rows[slice(*known)] = True
    return Surfaces(np.where(rows, truth, np.float32(40.0)), rows), pair


INNER = np.s_[20:140]
"""Columns whose matches lie in the picture."""


@pytest.mark.parametrize("known", [(0, 4), (16, 20)], ids=["down", "up"])
def test_a_textured_plate_goes_on_up_and_down_over_its_own_edges(known):
    stripe = layer(8.0, ALL, 200, 4, rows=(9, 12))
    given, pair = plate(layer(8.0, ALL, 90, 1), stripe, known=known)
    found = up_and_down(given, pair)
    assert found.known[:, INNER].mean() > 0.85
    assert (found.values[found.known] == 8.0).all()


@pytest.mark.parametrize(("known", "beyond"), [((0, 4), np.s_[11:]), ((16, 20), np.s_[:9])])
def test_a_bare_plate_stops_at_an_edge_along_the_row(known, beyond):
    """Eyes side by side agree on all of it, whatever lies below: the edge may be the plate's own end."""
    given, pair = plate(bare(8.0, ALL, 90), bare(3.0, ALL, 150, rows=(10, HEIGHT)), known=known, noise=0.0)
    found = up_and_down(given, pair)
    assert not found.known[beyond].any()
    reached = found.known[np.s_[:8] if known[0] == 0 else np.s_[12:]]
    assert reached[:, INNER].all()


@pytest.mark.parametrize("known", [(0, 4), (16, 20)])
def test_a_textured_plate_stops_where_the_eyes_disagree(known):
    given, pair = plate(layer(8.0, ALL, 90, 1), layer(3.0, ALL, 150, 4, rows=(10, HEIGHT)), known=known)
    found = up_and_down(given, pair)
    beyond = found.known[np.s_[12:] if known[0] == 0 else np.s_[:8]]
    assert beyond[:, INNER].mean() < 0.02


def test_between_two_plates_each_goes_on_to_where_the_eyes_disagree():
    pair, truth = shown(layer(8.0, ALL, 90, 1), layer(3.0, ALL, 150, 4, rows=(10, HEIGHT)))
    known = np.ones(truth.shape, np.bool_)
    known[5:15] = False
    found = up_and_down(Surfaces(np.where(known, truth, np.float32(40.0)), known), pair)
    told = found.known[:, INNER]
    assert told[[6, 7, 12, 13]].mean() > 0.9
    right = np.abs(found.values - truth) < 0.1
    assert right[:9][found.known[:9]].mean() > 0.97
    assert right[11:][found.known[11:]].mean() > 0.97


def test_up_and_down_goes_no_farther_than_a_window_reaches():
    scene = cast((layer(8.0, ALL, 110, 1),), 60, 80)
    known = np.zeros((80, 60), np.bool_)
    known[38:42] = True
    found = up_and_down(
        Surfaces(np.full((80, 60), 8.0, np.float32), known), EyePair.of(scene.left, scene.right, 1)
    )
    rows = np.flatnonzero(found.known[:, 20:50].any(axis=1))
    assert (rows[0], rows[-1]) == (38 - REACH_PX, 41 + REACH_PX)
