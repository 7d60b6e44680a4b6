"""Free floor and obstacles from disparity: what must be found, what must not be invented."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rendered_pairs import MOUNT, RIG, TILT, Block, Room, render

from calib.model import HeadMount
from robot.messages import FreeSpace
from robot.vision.disparity import Disparity
from robot.vision.floor_aligned import FloorAlignedMatcher
from robot.vision.freespace import FloorLimits, from_look, looked
from robot.vision.sectors import merge
from robot.vision.stereo import AdaptiveWeightMatcher

MATCHER = FloorAlignedMatcher(AdaptiveWeightMatcher.floors(64), RIG, MOUNT)
LIMITS = FloorLimits()


def free_space(disparity, pan=0.0, tilt=TILT):
    """Free floor in one disparity map by the default limits."""
    return from_look(looked(disparity, RIG, MOUNT, pan, tilt, LIMITS), RIG, MOUNT, LIMITS)


def look(room, pan=0.0, tilt=TILT, **camera):
    pair = render(room, pan=pan, tilt=tilt, samples=2, **camera)
    return free_space(MATCHER(pair.left, pair.right, pan, tilt), pan, tilt)


def exact(room, pan=0.0, tilt=TILT):
    """The disparity map of a perfect matcher."""
    pair = render(room, pan=pan, tilt=tilt, samples=1)
    values = (RIG.left.fx * RIG.baseline / pair.depth).astype(np.float32)
    return Disparity(values, np.ones(values.shape, np.bool_), np.full(values.shape, 0.1, np.float32))


def ahead(free, bearing=0.0):
    """The sector at a bearing: (near, free)."""
    k = int(np.argmin(np.abs(free.bearings - bearing)))
    return float(free.near[k]), float(free.free[k])


def within(free, radius):
    return free.obstacles[np.hypot(free.obstacles[:, 0], free.obstacles[:, 1]) < radius]


@pytest.mark.parametrize("pan", [0.0, 0.9, -1.3])
def test_an_empty_floor_is_free_and_holds_nothing(pan):
    free = look(Room(), pan)
    seen = np.abs(free.bearings - pan) < math.radians(22)
    assert len(within(free, 1.6)) == 0
    assert (free.free[seen] > 1.6).mean() > 0.97
    assert (free.near[seen] < 0.6).mean() > 0.9
    assert (np.diff(free.bearings) > 0).all()


@pytest.mark.parametrize(
    ("block", "front"),
    [
        (Block(0.9, 0.0, 0.25, 0.8, 0.04), 0.775),
        (Block(1.2, 0.0, 0.3, 0.3, 0.3), 1.05),
        (Block(0.6, 0.0, 0.1, 0.1, 0.2), 0.55),
    ],
    ids=["low step", "box", "near box"],
)
def test_things_in_the_way_end_the_sector_before_them(block, front):
    free = look(Room((block,)))
    near, end = ahead(free)
    assert front - 0.12 < end < front + 0.05
    assert near < end
    here = np.hypot(free.obstacles[:, 0] - front, free.obstacles[:, 1]) < 0.08
    assert here.sum() >= 4


def test_the_floor_under_a_table_is_free_but_its_legs_are_not():
    top = Block(1.2, 0.0, 0.5, 0.8, 0.55, z0=0.52)
    legs = [Block(1.2 + x, y, 0.04, 0.04, 0.52, seed=4) for x in (-0.22, 0.22) for y in (-0.37, 0.37)]
    free = look(Room((top, *legs)))
    assert ahead(free)[1] > 1.4
    for sign in (1, -1):
        assert ahead(free, sign * math.atan2(0.37, 0.98))[1] < 1.05


def test_a_step_down_is_an_obstacle_at_its_edge():
    # The floor lies 10 cm too low everywhere but where a slab the height of the nominal floor ends at 0.9 m.
    slab = Block(0.4, 0.0, 1.0, 4.0, 0.0, z0=-0.1, seed=5)
    free = free_space(exact(Room((slab,), floor=-0.1)))
    assert 0.75 < ahead(free)[1] < 0.97
    assert len(within(free, 1.1)) > 0


@settings(max_examples=8, deadline=None)
@given(tip=st.floats(-1.2, 1.2), lift=st.floats(-0.008, 0.008))
def test_a_tipped_base_sees_no_ramp(tip, lift):
    # The head believes its nominal height and tilt; the eyes really are tipped and lifted.
    tipped = HeadMount(height=MOUNT.height + lift)
    pair = render(Room(), tilt=TILT + math.radians(tip), mount=tipped, samples=1)
    values = (RIG.left.fx * RIG.baseline / pair.depth).astype(np.float32)
    found = Disparity(values, np.ones(values.shape, np.bool_), np.full(values.shape, 0.2, np.float32))
    free = free_space(found)
    assert len(within(free, 1.5)) == 0
    assert ahead(free)[1] > 1.5


def test_a_step_survives_the_levelling_of_a_tipped_base():
    pair = render(Room((Block(0.9, 0.0, 0.3, 1.0, 0.05),)), tilt=TILT + math.radians(0.8))
    free = free_space(MATCHER(pair.left, pair.right, 0.0, TILT))
    assert 0.6 < ahead(free)[1] < 0.82


def test_unmeasured_is_not_free():
    found = exact(Room())
    none = Disparity(found.values, np.zeros_like(found.valid), found.sigma_px)
    free = free_space(none)
    assert (free.free <= free.near).all()
    assert len(free.obstacles) == 0


def test_a_wide_hole_ends_the_floor_and_a_narrow_one_does_not():
    found = exact(Room())
    for rows, reach in ((slice(130, 190), 0.9), (slice(150, 154), 1.5)):
        valid = found.valid.copy()
        valid[rows] = False
        near, end = ahead(free_space(Disparity(found.values, valid, found.sigma_px)))
        assert near < 0.5
        assert (end < reach) == (reach == 0.9)


def test_the_dark_invents_no_obstacle():
    for seed in range(3):
        free = look(Room((Block(1.2, 0.3, 0.3, 0.3, 0.3),)), gain=0.05, noise=4.0, seed=seed)
        truly = (
            np.abs(free.obstacles - (1.05, 0.3)).max(axis=1) < 0.35 if len(free.obstacles) else np.zeros(0)
        )
        near = np.hypot(*free.obstacles.T) < 1.0
        assert (near & ~(truly > 0)).sum() <= 2


def test_an_eye_that_sees_no_floor_says_nothing():
    found = exact(Room(), tilt=-1.2)
    free = free_space(found, tilt=-1.2)
    assert not (free.free > free.near).any()


def test_merged_points_end_the_sectors_they_lie_in():
    look_ = FreeSpace(np.radians([-3.0, 0.0, 3.0]), np.full(3, 0.3), np.full(3, 2.0), np.zeros((0, 2)))
    merged = merge(look_, np.array([[1.0, 0.0, 0.2], [0.1, 0.0, 0.1]]))
    assert merged.free.tolist() == [2.0, 0.3, 2.0]
    assert merged.obstacles.tolist() == [[1.0, 0.0], [0.1, 0.0]]
    assert merge(look_, np.zeros((0, 3))) is look_
