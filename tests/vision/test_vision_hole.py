"""The hand's opening: a framed hole of known size, plates without one, and what nobody measured."""

import numpy as np
import pytest
from exact_maps import exact_map, without
from rendered_pairs import Block, Room, render

from calib.model import HeadMount, StereoRig
from robot.vision.both_eyes import BothEyes
from robot.vision.disparity import Disparity
from robot.vision.free_way import HandWayFinder
from robot.vision.hole import nearest_plane
from robot.vision.section import RoundSection
from robot.vision.stereo import AdaptiveWeightMatcher

RIG = StereoRig.parallel(352, 288, 408.0, 0.04)
MOUNT = HeadMount(forward=0.0, height=0.0, eye_forward=0.0, baseline=0.04)
AHEAD = 0.25


def frame(size, away=AHEAD, y=0.0):
    half, thick = size / 2, 0.01
    x = away + thick / 2
    boards = (
        Block(x, y + half + 0.2, thick, 0.4, 0.4, z0=-0.4, seed=2),
        Block(x, y - half - 0.2, thick, 0.4, 0.4, z0=-0.4, seed=3),
        Block(x, y, thick, size, 0.4, z0=half, seed=4),
        Block(x, y, thick, size, -half, z0=-0.4, seed=5),
    )
    return Room(boards, size=1.0, floor=-0.8, texels_per_metre=900.0)


def shown(room):
    return render(room, rig=RIG, mount=MOUNT, tilt=0.0, samples=1, noise=0.0)


def passage_of(found, diameter=0.05):
    finder = HandWayFinder(RIG, MOUNT, RoundSection(diameter), AdaptiveWeightMatcher.floors(176))
    return finder.joined(BothEyes.of(found), 0.0, 0.0).passage


@pytest.mark.parametrize(("size", "y"), [(0.08, 0.0), (0.06, 0.015), (0.1, -0.02)])
def test_a_hole_is_measured_in_size_and_place(size, y):
    passage = passage_of(exact_map(shown(frame(size, y=y)), RIG))
    assert passage.diameter == pytest.approx(size, rel=0.05)
    assert np.linalg.norm(np.array(passage.position) - (AHEAD, y, 0.0)) < 0.01
    assert passage.safe
    assert 0.0 < passage.sigma_diameter < 0.003
    assert 0.0 < passage.sigma_position < 0.005


def test_a_head_as_wide_as_the_hole_is_not_safe():
    found = exact_map(shown(frame(0.06)), RIG)
    assert not passage_of(found, 0.06).safe
    assert passage_of(found, 0.052).safe


def test_a_hole_in_the_map_of_a_plate_is_no_passage():
    plate = Room((Block(AHEAD + 0.01, 0.0, 0.02, 1.0, 0.5, z0=-0.5),), size=1.0, floor=-0.8)
    found = exact_map(shown(plate), RIG)
    v, u = np.mgrid[:288, :352]
    holes = np.hypot(u - 176, v - 144) < 70
    for seen in (found, without(found, holes)):
        assert passage_of(seen) is None


def test_a_window_in_a_board_that_nobody_measures_is_not_safe():
    pair = shown(frame(0.08))
    found = exact_map(pair, RIG)
    passage = passage_of(without(found, pair.depth < 0.3))
    assert passage is None or not passage.safe


def test_open_space_is_safe():
    assert passage_of(exact_map(shown(Room((), size=1.0, floor=-0.8)), RIG)).safe


@pytest.mark.parametrize("grey", [0, 140, 255])
def test_pictures_that_show_nothing_have_no_passage(grey):
    picture = np.full((288, 352), grey, np.uint8)
    finder = HandWayFinder(RIG, MOUNT, RoundSection(0.05), AdaptiveWeightMatcher.lite(176))
    look = finder(picture, picture, 0.0, 0.0)
    assert look.passage is None
    assert len(look.bearings) == len(look.obstacles) == 0


def test_the_plane_is_found_beside_other_things():
    v, u = np.mgrid[:288, :352]
    values = (0.05 * u - 0.02 * v + 55.0).astype(np.float32)
    values[:120, :150] += 25.0
    near = np.ones(values.shape, np.bool_)
    near[::3] = False
    plane = nearest_plane(values, near)
    assert (plane.along, plane.down, plane.constant) == pytest.approx((0.05, -0.02, 55.0), abs=1e-3)
    assert nearest_plane(values, np.zeros_like(near)) is None


def test_a_map_of_another_size_is_refused():
    none = np.zeros((100, 100), np.float32)
    with pytest.raises(ValueError, match="the rig 352x288"):
        passage_of(Disparity(none, none > 0.0, none))
