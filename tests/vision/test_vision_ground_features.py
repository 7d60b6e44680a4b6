"""Where obstacles are looked for: not on floor, not where one eye sees nothing, not on a far wall."""

import math

import numpy as np
import pytest
from ground_scenes import Ground, chequers, lines, look
from rendered_pairs import MOUNT, RIG, TILT, Block, Room

from robot.vision.ground_features import candidates, look_at_floor
from robot.vision.ground_plane import through
from robot.vision.pair_input import grey_pair

STAND = MOUNT.left_eye(0.0, TILT)


def searched(room, ground=None, reach=2.0):
    pair = look(room, ground, samples=2)
    scene = look_at_floor(grey_pair(pair.left, pair.right), RIG, STAND)
    return scene, *candidates(scene, RIG, STAND, reach)


@pytest.mark.parametrize("paint", [lines, chequers(0.08)])
def test_next_to_nothing_is_looked_for_on_a_painted_floor(paint) -> None:
    scene, places, _ = searched(Room(floor_paint=paint), reach=1.5)
    assert len(places) <= 15
    assert len(scene.corners) > 200


def test_what_looks_like_floor_is_left_out_though_the_eyes_differ_about_it() -> None:
    """The floor just before a box lies in its bright region."""
    scene, places, _ = searched(Room((Block(0.9, 0.0, 0.2, 0.4, 0.2),), floor_paint=lines))
    assert len(places) >= 40
    whole = places[through(scene.homography, places)[:, 0] > 12.0]
    assert np.mean(scene.like_floor(whole) > 0.97) < 0.03


def test_what_the_right_eye_has_not_in_view_is_left_out() -> None:
    scene, places, _ = searched(Room(), Ground(edge=0.7, drop=0.2))
    right = through(scene.homography, places)
    assert len(places) > 40
    assert (right[:, 0] >= 0.0).all()
    assert (right[:, 0] <= RIG.right.width - 1).all()


def test_corners_come_first_and_both_kinds_are_spread() -> None:
    _, places, corner = searched(Room((Block(0.8, 0.0, 0.4, 1.2, 0.4, seed=3),)))
    assert (np.diff(corner.astype(int)) <= 0).all()
    assert 20 <= corner.sum() <= 80
    assert 5 <= (~corner).sum() <= 30
    tiles = (places[corner] // 32).astype(int)
    assert np.unique(tiles, axis=0, return_counts=True)[1].max() <= 6


def test_nothing_is_looked_for_where_no_floor_is_near() -> None:
    _, places, _ = searched(Room(size=1.2), reach=0.9)
    rows = RIG.left.cy + RIG.left.fy * math.tan(math.atan2(STAND[1][2], 0.9) - TILT)
    assert len(places) == 0 or places[:, 1].min() > rows - 12


def test_like_floor_is_the_likeness_under_the_floors_homography() -> None:
    scene, _, _ = searched(Room(contrast=0.7))
    floor = scene.corners[scene.corners[:, 1] > 120][:60]
    inside = floor[(floor[:, 0] > 80) & (floor[:, 0] < 320) & (floor[:, 1] < 270)]
    assert len(inside) > 20
    assert np.median(scene.like_floor(inside)) > 0.95
    assert np.median(scene.like_floor(inside + np.array([4.0, 0.0]))) > 0.95
    assert scene.like_floor(np.zeros((0, 2))).shape == (0,)
