"""What the ground test calls an obstacle: steps, drops and posts; not rugs, lines, shadows, mirror images."""

import math

import cv2
import numpy as np
import pytest
from ground_scenes import Ground, TippedMount, chequers, lines, look, soft_shadows
from rendered_pairs import MOUNT, RIG, TILT, Block, Room

from calib.model import StereoRig
from robot.vision.ground import GroundLimits, find_obstacles
from robot.vision.ground_bright import bright_regions
from robot.vision.ground_plane import GroundPlane, warp_to_left
from robot.vision.ground_reflection import amid_floor, mirrored, twin_likeness
from robot.vision.half_size import half_camera, half_size, homography_to_half, to_half

EYE = half_camera(RIG.left)
FAR = Block(2.7, -0.6, 0.4, 0.5, 0.8, seed=31)
UP = TippedMount(math.radians(-0.5), math.radians(0.3))
DOWN = TippedMount(math.radians(0.5), math.radians(-0.3))
"""A base tipped by half a degree, which the robot does not know."""


def found_in(pair, rig=RIG):
    return find_obstacles(pair.left, pair.right, rig, MOUNT, 0.0, TILT)


def near(found, reach=1.5):
    return np.hypot(found.points[:, 0], found.points[:, 1]) < reach


FLOORS = {
    "rug": Room((FAR,), floor_paint=chequers(0.08), contrast=0.1),
    "bold rug": Room((FAR,), floor_paint=chequers(0.12), contrast=0.5, floor_seed=4),
    "lines": Room((FAR,), floor_paint=lines, contrast=0.2),
    "shadows": Room((FAR,), floor_paint=soft_shadows, contrast=0.3),
}


@pytest.mark.parametrize(
    ("floor", "mount"),
    [("rug", UP), ("rug", DOWN), ("bold rug", UP), ("bold rug", DOWN), ("lines", DOWN), ("shadows", UP)],
)
def test_what_lies_flat_is_no_obstacle_though_the_base_is_tipped(floor, mount):
    pair = look(FLOORS[floor], mount=mount, samples=2, gains=(1.0, 1.12))
    assert not near(found_in(pair)).any()


@pytest.mark.parametrize(("away", "mount"), [(0.6, UP), (0.8, UP), (0.8, DOWN)])
def test_a_step_up_of_30_mm_is_found(away, mount):
    step = Block(away + 0.4, 0.0, 0.8, 1.6, 0.03, seed=51)
    found = found_in(look(Room((step,), contrast=0.7), mount=mount, samples=2))
    here = near(found)
    assert here.sum() >= 5
    assert not found.falls[here].any()
    assert (found.points[here, 0] > away - 0.04).all()
    assert found.points[here, 0].min() < away + 0.1
    assert (np.abs(found.heights[here] - 0.02) < 0.015 + 3 * found.height_sigmas[here]).all()


@pytest.mark.parametrize(("drop", "mount"), [(0.03, UP), (0.03, DOWN), (0.08, DOWN), (0.3, UP)])
def test_a_step_down_is_found_at_its_edge(drop, mount):
    pair = look(Room(contrast=0.7), Ground(edge=0.75, edge_yaw=0.2, drop=drop), mount=mount, samples=2)
    found = found_in(pair)
    here = near(found)
    assert found.falls[here].sum() >= 5
    assert not (~found.falls[here]).any()
    beyond = found.points[:, 0] * math.cos(0.2) + found.points[:, 1] * math.sin(0.2) - 0.75
    assert (beyond[here] > -0.05).all()
    assert beyond[here].min() < 0.08
    assert (np.abs(found.heights[here] + drop) < 0.01 + 4 * found.height_sigmas[here]).mean() > 0.9


@pytest.mark.parametrize("wide", [0.02, 0.03])
def test_a_thin_post_is_found_where_it_stands(wide):
    post = Block(0.9, 0.1, wide, wide, 0.6, seed=72, yaw=0.3)
    found = found_in(look(Room((post, FAR)), samples=2))
    here = near(found)
    assert here.sum() >= 2
    off = np.hypot(*(found.points[here, :2] - (0.9, 0.1)).T)
    assert (off < 0.05 + 3 * found.sigma[here]).all()


def test_a_plain_post_is_found_by_its_edges():
    """White on a dim floor: no corner on it."""
    floor = Room(
        (Block(0.8, 0.0, 0.04, 0.04, 0.6, seed=3),),
        contrast=0.12,
        floor_paint=lambda x, y: np.full_like(x, 0.3),
    )
    found = found_in(look(floor, samples=2, noise=1.0))
    here = near(found)
    assert here.sum() >= 2
    assert (np.abs(found.points[here, :2] - (0.8, 0.0)) < 0.08).all()


# --------------------------------------------------------------------------------------------- reflections


@pytest.mark.parametrize(("away", "gloss"), [(0.8, 0.25), (1.0, 0.35)])
def test_what_a_glossy_floor_mirrors_is_no_step_down(away, gloss):
    block = Block(away, 0.0, 0.2, 0.35, 0.15, seed=41)
    found = found_in(look(Room((block, FAR), floor_seed=2), Ground(gloss=gloss), mount=UP, samples=2))
    here = near(found)
    assert not found.falls[here].any()
    assert here.sum() >= 5


@pytest.mark.parametrize("seed", [0, 1])
def test_nor_is_what_a_dark_polished_floor_mirrors(seed):
    """Its own grain is faint: mirror images match well and in numbers, and must be told from a drop."""
    block = Block(0.85, 0.0, 0.2, 0.35, 0.15, seed=41 + seed)
    room = Room((block,), floor_seed=2 + seed, floor_paint=lambda x, y: np.full_like(x, 0.4))
    mount = TippedMount(math.radians(0.3 * (seed - 1)))
    found = found_in(look(room, Ground(gloss=0.2), mount=mount, samples=2, seed=seed))
    here = near(found)
    assert not found.falls[here].any()
    assert here.sum() >= 5


@pytest.mark.parametrize("size", [1.4, 1.8])
def test_nor_is_the_mirror_image_of_a_wall(size):
    found = found_in(look(Room(size=size, floor_seed=3), Ground(gloss=0.3), mount=DOWN, samples=2))
    assert not found.falls[near(found)].any()


def test_a_drop_in_a_glossy_floor_is_still_found():
    room = Room((Block(1.4, 0.0, 0.2, 0.6, 0.5, seed=60),), floor_seed=2)
    found = found_in(look(room, Ground(gloss=0.3, edge=0.75, drop=0.06), samples=2))
    assert found.falls[near(found, 1.1)].sum() >= 5


def block_upside_down(gloss):
    """A block on a glossy floor: grey picture, the floor, and places below its foot with their depths."""
    block = Block(0.9, 0.0, 0.2, 0.4, 0.15, seed=44)
    pair = look(Room((block,), contrast=0.8), Ground(gloss=gloss), samples=2, noise=1.0)
    rotation, eye = MOUNT.left_eye(0.0, TILT)
    y, z = (g.ravel() for g in np.meshgrid(np.linspace(-0.12, 0.12, 5), np.linspace(-0.11, -0.05, 3)))
    local = (np.column_stack([np.full(y.size, 0.8), y, z]) - eye) @ rotation
    pixels = local[:, :2] / local[:, 2:] * RIG.left.fx + (RIG.left.cx, RIG.left.cy)
    grey = half_size(cv2.cvtColor(pair.left, cv2.COLOR_BGR2GRAY).astype(np.float32))
    return grey, GroundPlane.below(rotation, float(eye[2])), to_half(pixels), local[:, 2]


@pytest.fixture(scope="module")
def mirror():
    return block_upside_down(0.7)


def test_a_mirror_image_looks_like_its_twin_and_a_floor_does_not(mirror):
    grey, plane, pixels, depth = mirror
    sigma = np.full(len(pixels), 0.01)
    assert np.median(twin_likeness(grey, EYE, plane, pixels, depth)) > 0.8
    assert mirrored(grey, EYE, plane, pixels, depth, sigma).mean() > 0.8
    matte, *_ = block_upside_down(0.0)
    assert np.median(twin_likeness(matte, EYE, plane, pixels, depth)) < 0.5
    assert not mirrored(matte, EYE, plane, pixels, depth, sigma).any()


def test_a_twin_that_is_out_of_view_is_not_compared(mirror):
    grey, plane, pixels, depth = mirror
    # So far below the floor the twin stands above the picture.
    assert (twin_likeness(grey, EYE, plane, pixels, np.full(len(depth), 3.0)) == 0.0).all()
    assert (twin_likeness(np.zeros_like(grey), EYE, plane, pixels, depth) == 0.0).all()


def test_a_depth_that_is_off_a_little_still_shows_the_twin(mirror):
    grey, plane, pixels, depth = mirror
    for share in (0.985, 1.015):
        assert np.median(twin_likeness(grey, EYE, plane, pixels, share * depth)) > 0.75


def test_one_likeness_alone_is_chance(mirror):
    grey, plane, pixels, depth = mirror
    likeness = twin_likeness(grey, EYE, plane, pixels, depth)
    best = int(likeness.argmax())
    one = slice(best, best + 1)
    assert not mirrored(grey, EYE, plane, pixels[one], depth[one], np.array([0.01])).any()
    assert mirrored(grey, EYE, plane, np.zeros((0, 2)), np.zeros(0), np.zeros(0)).shape == (0,)


def test_only_floor_on_all_sides_proves_floor():
    rng = np.random.default_rng(5)
    corners = rng.uniform(0, 200, (800, 2))
    point = np.array([[100.0, 100.0]])
    floor = np.ones(len(corners), np.bool_)
    assert amid_floor(point, corners, floor).all()
    # A straight edge, however it runs, leaves floor on one side alone.
    for angle in np.linspace(0.0, 2 * math.pi, 16):
        side = (corners - point) @ (math.cos(angle), math.sin(angle)) < -2.0
        assert not amid_floor(point, corners, side).any()
    # What is like floor by chance is not enough of it.
    assert not amid_floor(point, corners, rng.random(800) < 0.12).any()
    assert not amid_floor(point, corners[:0], floor[:0]).any()


# ------------------------------------------------------------------------------------------------- the rest


def test_the_right_eyes_obstacles_leave_no_ghost_on_the_left_eyes_floor():
    block = Block(0.8, 0.0, 0.1, 0.1, 0.5, seed=8)
    found = found_in(look(Room((block, FAR), contrast=1.0), samples=2))
    here = near(found)
    assert here.sum() >= 3
    # Where the right eye sees the block the left one sees floor some 25 px to the right of the block's own.
    off = np.abs(found.points[here, :2] - (0.8, 0.0)).max(axis=1)
    assert (off < 0.05 + 0.05 + 3 * found.sigma[here]).all()


def test_one_odd_match_is_no_obstacle():
    """A speck that each eye sees elsewhere (dirt, a highlight): it matches well, high above the floor."""
    pair = look(Room(contrast=0.5), samples=2)
    speck = cv2.GaussianBlur(np.random.default_rng(6).integers(0, 255, (15, 15, 1), np.uint8), (0, 0), 1.2)
    left, right = pair.left.copy(), pair.right.copy()
    left[190:205, 200:215], right[190:205, 150:165] = speck[..., None], speck[..., None]
    assert not near(find_obstacles(left, right, RIG, MOUNT, 0.0, TILT)).any()


def test_points_err_by_their_sigma():
    off = []
    for seed in range(3):
        block = Block(0.75 + 0.12 * seed, 0.0, 0.3, 0.9, 0.3, seed=80 + seed)
        found = found_in(look(Room((block,)), samples=2, seed=seed))
        rotation, eye = MOUNT.left_eye(0.0, TILT)
        face = block.x - block.length / 2
        # Those on the face: it is seen under a ray that hits x = face.
        rays = (
            np.column_stack(
                [(found.pixels - (RIG.left.cx, RIG.left.cy)) / RIG.left.fx, np.ones(len(found.pixels))]
            )
            @ rotation.T
        )
        at = eye + ((face - eye[0]) / rays[:, 0])[:, None] * rays
        on_face = (np.abs(at[:, 1]) < 0.4) & (at[:, 2] > 0.03) & (at[:, 2] < 0.27)
        away = np.linalg.norm(found.points - eye, axis=1) - np.linalg.norm(at - eye, axis=1)
        off.append((away / found.sigma)[on_face])
    ratio = np.concatenate(off)
    assert len(ratio) > 100
    assert 0.55 <= np.mean(np.abs(ratio) < 1.0) <= 0.95
    assert np.mean(np.abs(ratio) < 3.0) >= 0.95


def test_a_pair_that_is_not_rectified_serves_as_well():
    c, s = math.cos(0.02), math.sin(0.02)
    rig = StereoRig(RIG.left, RIG.right, (c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0), (-0.06, 0.002, 0.001))
    block = Block(0.9, 0.0, 0.2, 0.3, 0.2, seed=9)
    found = found_in(look(Room((block, FAR), floor_paint=lines), rig=rig, samples=2), rig)
    here = near(found)
    assert here.sum() >= 5
    off = np.abs(found.points[here, :2] - (0.9, 0.0)) - (0.1, 0.15)
    assert (off.max(axis=1) < 0.04 + 3 * found.sigma[here]).all()


def test_limits_are_obeyed():
    pair = look(Room((Block(0.8, 0.0, 0.2, 0.5, 0.06, seed=2),), contrast=0.7), samples=2)
    high = GroundLimits(step_height=0.2)
    assert not near(find_obstacles(pair.left, pair.right, RIG, MOUNT, 0.0, TILT, high)).any()
    short = GroundLimits(max_range=0.6)
    assert not len(find_obstacles(pair.left, pair.right, RIG, MOUNT, 0.0, TILT, short).points)
    assert near(found_in(pair)).sum() >= 5


def test_the_bright_regions_are_those_off_the_floor():
    block = Block(0.9, 0.0, 0.2, 0.3, 0.2, seed=9)
    pair = look(Room((block,), floor_paint=lines), samples=2)
    rotation, eye = MOUNT.left_eye(0.0, TILT)
    left, right = (
        half_size(cv2.cvtColor(eye_, cv2.COLOR_BGR2GRAY).astype(np.float32))
        for eye_ in (pair.left, pair.right)
    )
    floor = homography_to_half(GroundPlane.below(rotation, float(eye[2])).homography(RIG))
    bright = bright_regions(left, warp_to_left(right, floor))
    assert bright[32:55, 75:105].mean() > 0.8
    assert bright[100:140, 40:170].mean() < 0.02


@pytest.mark.parametrize("size", [(352, 288), (351, 287), (1, 288), (352, 1), (9, 7)])
@pytest.mark.parametrize("level", [0, 128, 255])
def test_plain_and_odd_pictures_hold_nothing(size, level):
    picture = np.full(size[::-1], level, np.uint8)
    rig = StereoRig.parallel(*size, 305.0, 0.06)
    assert find_obstacles(picture, picture, rig, MOUNT, 0.0, TILT).points.shape == (0, 3)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [(2, 2), (13, 13), (31, 29), (353, 287), (1280, 960)])
@pytest.mark.parametrize("tilt", [-1.2, 0.0, 0.35, 1.4])
def test_noise_of_any_size_under_any_tilt_is_looked_at(size, tilt):
    """Unlike noise in both eyes, black and white: nothing in it stands for sure, and nothing breaks."""
    rng = np.random.default_rng(5)
    left, right = (np.where(rng.random(size[::-1]) < 0.5, 0, 255).astype(np.uint8) for _ in range(2))
    found = find_obstacles(left, right, StereoRig.parallel(*size, 305.0, 0.06), MOUNT, 0.0, tilt)
    assert len(found.points) <= 2
    assert np.isfinite(found.points).all()


def test_exchanged_eyes_break_nothing():
    pair = look(Room((Block(0.8, 0.0, 0.2, 0.5, 0.06, seed=2),)), samples=1)
    found = find_obstacles(pair.right, pair.left, RIG, MOUNT, 0.0, TILT)
    assert np.isfinite(found.points).all()
    assert not near(found, 0.5).any(), "what is told so near must be seen, not guessed"


def test_wrong_pictures_are_named():
    grey = np.zeros((288, 352), np.uint8)
    with pytest.raises(ValueError, match="different size"):
        find_obstacles(grey, grey[1:], RIG, MOUNT, 0.0, TILT)
    with pytest.raises(ValueError, match="the rig 352x288"):
        find_obstacles(grey[1:], grey[1:], RIG, MOUNT, 0.0, TILT)
