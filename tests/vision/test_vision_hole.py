"""The hand's opening: a framed hole of known size, plates without one, and what nobody measured."""

import numpy as np
import pytest
import rendered_pairs
from exact_maps import exact_map, without
from rendered_pairs import Block, Room, render

from calib.model import HeadMount, StereoRig
from robot.vision.both_eyes import BothEyes
from robot.vision.disparity import Disparity
from robot.vision.free_way import HandWayFinder
from robot.vision.hole import Plane, largest_hole, nearest_plane, open_in_plane
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


def test_the_bolder_map_finds_the_rim_and_proves_nothing():
    """Two fifths of the hole's height are unmeasured; a map that continues surfaces boldly sees all of it."""
    found = exact_map(shown(frame(0.08)), RIG)
    v = np.arange(288)[:, None]
    lower = without(found, np.broadcast_to((v > 155) & (v < 225), found.valid.shape))
    finder = HandWayFinder(RIG, MOUNT, RoundSection(0.06), AdaptiveWeightMatcher.floors(176))
    eyes, bold = BothEyes.of(lower), BothEyes.of(found)
    alone, about = (finder.joined(eyes, 0.0, 0.0, given).passage for given in (None, bold))
    assert alone.diameter < 0.065
    assert about.diameter == pytest.approx(0.08, rel=0.05)
    assert not alone.safe
    assert not about.safe


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


# --- both eyes ---


def hole_of(eyes, reach=0.5, behind=0.03):
    return largest_hole(eyes, RIG, reach, behind)


@pytest.mark.parametrize("size", [0.056, 0.06])
def test_of_a_hole_before_a_far_wall_each_eye_sees_one_end(size):
    """The plane's disparity is 49 px more than the wall's, more than half of the hole: its mouth is as wide
    as it is all the same, what is open in depth is less."""
    found = hole_of(BothEyes.of(exact_map(shown(frame(size)), RIG)))
    assert found.mouth_px == pytest.approx(size * 408.0 / AHEAD, rel=0.06)
    assert found.circle.diameter_px < found.mouth_px


@pytest.mark.parametrize("size", [0.02, 0.03, 0.045, 0.053])
def test_a_small_hole_before_a_far_wall_is_never_taken_for_a_larger_one(size):
    found = hole_of(BothEyes.of(exact_map(shown(frame(size)), RIG)))
    assert found is None or found.circle.diameter_px <= found.mouth_px < size * 408.0 / AHEAD + 2.0


def test_a_thing_in_the_plane_between_what_both_eyes_see_through_is_no_mouth():
    """A post 6 mm wide in the middle of the hole is measured: the mouth lies beside it."""
    post = Block(AHEAD + 0.005, 0.0, 0.01, 0.006, 0.4, z0=-0.4, seed=6)
    room = frame(0.06)
    barred = Room((*room.blocks, post), size=1.0, floor=-0.8, texels_per_metre=900.0)
    clear, beside = (hole_of(BothEyes.of(exact_map(shown(r), RIG))) for r in (room, barred))
    assert clear.mouth_px == pytest.approx(0.06 * 408.0 / AHEAD, rel=0.05)
    assert beside is None or beside.mouth_px < 0.03 * 408.0 / AHEAD


def test_a_thin_thing_in_the_plane_bounds_the_mouth():
    """A wire of 3 mm stands 8 mm beside the left side: the circle fits beside it, and so must the mouth."""
    wire = Block(AHEAD + 0.005, 0.04 - 0.0095, 0.01, 0.003, 0.4, z0=-0.4, seed=6)
    barred = Room((*frame(0.08).blocks, wire), size=1.0, floor=-0.8, texels_per_metre=900.0)
    found = hole_of(BothEyes.of(exact_map(shown(barred), RIG)))
    assert found.mouth_px == pytest.approx(0.069 * 408.0 / AHEAD, rel=0.05)


@pytest.mark.parametrize(("fringe", "reached"), [(8, True), (14, True), (30, False), (40, False)])
def test_the_mouth_reaches_to_a_measured_rim_over_a_narrow_fringe_alone(fringe, reached):
    """A fringe inside the rim is unmeasured; a third of the opening's radius may be."""
    pair = shown(frame(0.09))
    found = exact_map(pair, RIG)
    v, u = np.mgrid[:288, :352]
    half = 0.045 * 408.0 / AHEAD
    centre = 175.5 + 0.5 * 0.04 * 408.0 / AHEAD  # the left eye looks from 2 cm to the left
    off = np.maximum(np.abs(u - centre), np.abs(v - 143.5))
    mouth = hole_of(BothEyes.of(without(found, (off < half) & (off > half - fringe)))).mouth_px
    assert (mouth > 2 * half * 0.94) == reached


def test_what_the_left_eye_does_not_measure_the_right_one_proves():
    found = exact_map(shown(frame(0.08)), RIG)
    eyes = BothEyes.of(found)
    blind = without(found, found.values < 30.0)  # the left eye measured nothing of the far wall
    plane = Plane(0.0, 0.0, 408.0 * 0.04 / AHEAD)
    by_right = open_in_plane(BothEyes(blind, eyes.right), RIG, plane, 0.03)
    neither = open_in_plane(BothEyes.of(blind), RIG, plane, 0.03)
    assert by_right.sum() > 0.3 * (0.08 * 408.0 / AHEAD) ** 2
    assert not neither.any()
    half = 0.04 * 408.0 / AHEAD
    v, u = np.nonzero(by_right)
    centre = 175.5 + 0.5 * 0.04 * 408.0 / AHEAD
    assert np.abs(u - centre).max() <= half + 1.5
    assert np.abs(v - 143.5).max() <= half + 1.5


@pytest.mark.parametrize("tilted", [0.0, 0.06])
def test_the_right_eye_s_rays_cross_a_slanting_plane_where_it_is(tilted):
    """A wall at 20 px seen through a plane of 40 px and more: by its own columns, moved by the plane's."""
    values = np.full((288, 352), 20.0, np.float32)
    none = np.zeros(values.shape, np.bool_)
    valid = none.copy()
    valid[:, 100:120] = True
    eyes = BothEyes(Disparity(values, none, values), Disparity(values, valid, values))
    plane = Plane(tilted, 0.0, 40.0)
    columns = np.flatnonzero(open_in_plane(eyes, RIG, plane, 0.03)[144])
    first, last = ((u + 40.0) / (1.0 - tilted) for u in (100, 119))
    assert columns[0] == pytest.approx(first, abs=1)
    assert columns[-1] == pytest.approx(last, abs=1)


@pytest.mark.parametrize(
    "bar",
    [
        Block(AHEAD + 0.002, 0.0, 0.004, 0.006, 0.3, z0=-0.3, seed=99),
        Block(AHEAD + 0.002, 0.0, 0.004, 0.3, 0.01, z0=-0.01, seed=99),
        pytest.param(Block(AHEAD + 0.002, 0.0, 0.004, 0.3, 0.005, z0=-0.005, seed=99)),
    ],
    ids=["upright, 6 mm", "lying, 20 mm", "lying, 10 mm"],
)
def test_a_bare_bar_across_the_hole_is_not_passed(bar, monkeypatch):
    cloud = rendered_pairs.texture
    grey = np.full((512, 512), 0.5, np.float32)
    monkeypatch.setattr(rendered_pairs, "texture", lambda seed, size=512: grey if seed == 99 else cloud(seed))
    room = frame(0.08)
    barred = Room((*room.blocks, bar), size=1.0, floor=-0.8, texels_per_metre=900.0)
    pair = render(barred, rig=RIG, mount=MOUNT, tilt=0.0, samples=2)
    finder = HandWayFinder(RIG, MOUNT, RoundSection(0.05), AdaptiveWeightMatcher.floors(176))
    passage = finder(pair.left, pair.right, 0.0, 0.0).passage
    assert passage is None or not passage.safe
