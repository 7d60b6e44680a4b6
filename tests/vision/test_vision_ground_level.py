"""How the floor really lies, from the pictures alone: tilt errors are found, low steps are no tilt."""

import math

import numpy as np
import pytest
from ground_scenes import Ground, TippedMount, chequers, look
from rendered_pairs import MOUNT, RIG, TILT, Block, Room

from calib.model import StereoRig
from robot.vision.ground_level import FloorMatches, floor_matches, level_of, see_ground
from robot.vision.ground_matching import EyePictures
from robot.vision.ground_plane import ground_homography, through
from robot.vision.levelling import REST_SIGMA
from robot.vision.pair_input import grey_pair

STAND = MOUNT.left_eye(0.0, TILT)


def level_in(pair):
    return level_of(
        floor_matches(EyePictures.of(*grey_pair(pair.left, pair.right)), RIG, *STAND), RIG, *STAND
    )


@pytest.mark.parametrize(
    ("pitch", "roll", "lift"),
    [(-1.5, 0.0, 0.0), (-1.0, 0.3, 0.005), (-0.5, 0.0, 0.0), (0.5, -0.3, 0.01),
     (1.0, 0.0, -0.005), (1.5, 0.0, 0.0)],
)  # fmt: skip
def test_a_tilt_error_is_read_off_the_picture(pitch, roll, lift):
    mount = TippedMount(math.radians(pitch), math.radians(roll), lift)
    pair = look(Room(floor_seed=3, contrast=0.5), mount=mount, samples=2)
    true_height = mount.left_eye(0.0, TILT)[1][2]
    found = see_ground(pair.left, pair.right, RIG, MOUNT, 0.0, TILT)
    assert math.degrees(found.plane.tilt - TILT) == pytest.approx(pitch, abs=0.08)
    assert math.degrees(found.plane.roll) == pytest.approx(roll, abs=0.15)
    assert found.plane.height == pytest.approx(true_height, abs=0.001)
    assert found.inliers >= 0.8 * found.matches >= 30
    exact = found.plane.homography(RIG)
    assert np.allclose(found.homography, exact / exact[2, 2], rtol=0.02, atol=0.6)
    # The guarded estimate that obstacles are judged by says the same.
    guarded = level_in(pair).plane(*STAND)
    assert math.degrees(guarded.tilt - TILT) == pytest.approx(pitch, abs=0.1)
    assert guarded.height == pytest.approx(true_height, abs=0.0015)


@pytest.mark.parametrize("tip", [-0.5, 0.5])
@pytest.mark.parametrize("height", [0.03, -0.03])
def test_a_low_step_does_not_tilt_the_floor(tip, height):
    """From 0.7 m on all lies 30 mm higher or lower: the floor is still what lies before."""
    mount = TippedMount(math.radians(tip))
    block = (Block(1.4, 0.0, 1.4, 3.0, height, seed=5),) if height > 0.0 else ()
    ground = Ground(edge=0.7, drop=-height) if height < 0.0 else None
    level = level_in(look(Room(block), ground, mount=mount, samples=2))
    here = np.array([[0.6, 0.0, 0.0], [0.9, 0.0, 0.0]])
    off, sigma = level.heights(here)
    # The true floor in the frame the robot believes in: it stands tipped front down about its origin.
    true = np.array([0.6, 0.9]) * math.tan(math.radians(tip))
    assert np.abs(-off - true).max() < 0.006
    assert (sigma < 0.004).all()


def test_false_matches_and_a_box_do_not_pull():
    pair = look(Room((Block(0.8, 0.0, 0.4, 0.7, 0.12, seed=4),), floor_paint=chequers(0.08)), samples=2)
    level = level_in(pair)
    off, _ = level.heights(np.array([[0.5, 0.3, 0.0], [1.5, -0.3, 0.0]]))
    assert np.abs(off).max() < 0.004


def test_too_little_floor_is_said_and_leaves_the_nominal_one():
    grey = np.full((288, 352), 128, np.uint8)
    with pytest.raises(ValueError, match="look at floor that has texture"):
        see_ground(grey, grey, RIG, MOUNT, 0.0, TILT)
    level = level_of(floor_matches(EyePictures.of(grey, grey), RIG, *STAND), RIG, *STAND)
    assert (level.level.lift, level.level.ahead, level.level.aside) == (0.0, 0.0, 0.0)
    # Unseen, the floor at a metre may lie a centimetre off.
    assert level.heights(np.array([[1.0, 0.0, 0.0]]))[1][0] == pytest.approx(0.01, abs=0.002)


def test_the_sigma_of_the_level_is_not_vain():
    """Over several floors and tips the level errs by its sigma, not by many."""
    ratios = []
    for seed in range(3):
        mount = TippedMount(
            math.radians((-0.5, 0.2, 0.5, -0.1)[seed]), math.radians((0.2, -0.3, 0.0, 0.3)[seed])
        )
        level = level_in(look(Room(floor_seed=seed + 20, contrast=0.3), mount=mount, samples=2, seed=seed))
        rotation, eye = mount.left_eye(0.0, TILT)
        for x, y in ((0.5, 0.0), (1.0, 0.3), (1.5, -0.3)):
            off, sigma = level.heights(np.array([[x, y, 0.0]]))
            floor = np.array([x, y, -off[0]])
            true = rotation @ (STAND[0].T @ (floor - STAND[1])) + eye
            ratios.append(true[2] / sigma[0])
    assert np.abs(ratios).max() < 3.0


def test_no_floor_is_believed_where_no_base_can_stand():
    """Matches of a ledge 22 mm up: the level stays within three standard deviations of the nominal one."""
    rotation, eye = STAND
    draw = np.random.default_rng(3)
    points = np.column_stack([draw.uniform(0.5, 1.5, 60), draw.uniform(-0.3, 0.3, 60), np.full(60, 0.022)])
    seen = (points - eye) @ rotation
    left, right = (
        p[:, :2] / p[:, 2:] * RIG.left.fx + (RIG.left.cx, RIG.left.cy) for p in (seen, seen + RIG.translation)
    )
    level = level_of(FloorMatches(left, right, np.full(60, 0.001)), RIG, *STAND).level
    assert abs(level.lift) <= 3 * REST_SIGMA[0] + 1e-9
    assert abs(level.ahead) <= 3 * REST_SIGMA[1] + 1e-9
    assert abs(level.aside) <= 3 * REST_SIGMA[2] + 1e-9


def test_floor_is_matched_by_a_pair_that_is_not_rectified():
    c, s = math.cos(0.04), math.sin(0.04)
    rig = StereoRig(RIG.left, RIG.right, (c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0), (-0.06, 0.003, 0.002))
    pair = look(Room(contrast=0.7), rig=rig, samples=2)
    found = floor_matches(EyePictures.of(*grey_pair(pair.left, pair.right)), rig, *STAND)
    off = found.right - through(ground_homography(rig, STAND[0], float(STAND[1][2])), found.left)
    assert len(found.left) >= 35
    assert np.median(np.hypot(*off.T)) < 0.2
