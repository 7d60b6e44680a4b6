"""Truth of the simulated views: depth by rays agrees with the referee's, and with the pictures themselves."""

import cv2
import numpy as np
import pytest

from bench.stereo_rooms import DISPARITIES, room_view, room_views, true_depth
from robot.messages import HeadPose
from robot.sim.scene import load_scene
from robot.sim.truth import Truth
from robot.sim.world import World


def test_depth_is_the_referees_at_single_pixels():
    world = World(load_scene("table"), 5)
    try:
        depth, truth = true_depth(world), Truth(world)
        for u in range(3, 352, 50):
            for v in range(3, 288, 50):
                assert depth[v, u] == pytest.approx(truth.range_at(world.moment, u, v)[0], abs=1e-6)
    finally:
        world.close()


@pytest.fixture(scope="module")
def view():
    return room_view("standing", 4, HeadPose(0.3, 0.45))


def test_the_pictures_agree_best_where_the_truth_says(view):
    case = view.case
    left, right = (
        cv2.GaussianBlur(cv2.cvtColor(eye, cv2.COLOR_BGR2GRAY).astype(np.float32), (0, 0), 1.0)
        for eye in (case.left, case.right)
    )
    u, v = np.meshgrid(np.arange(352, dtype=np.float32), np.arange(288, dtype=np.float32))
    disparity = np.nan_to_num(case.truth)
    inner = cv2.erode(case.non_occluded.astype(np.uint8), np.ones((9, 9))) > 0
    shifts = np.array([-0.4, -0.2, 0.0, 0.2, 0.4])
    unlike = []
    for shift in shifts:
        seen = cv2.remap(right, (u - disparity - shift).astype(np.float32), v, cv2.INTER_CUBIC)
        unlike.append(np.mean((left - seen)[inner] ** 2))
    a, b, _ = np.polyfit(shifts, unlike, 2)
    assert abs(-b / (2 * a)) < 0.05


def test_the_head_is_where_it_was_sent(view):
    assert (view.pan, view.tilt) == pytest.approx((0.3, 0.45), abs=0.005)


def test_what_the_search_cannot_reach_is_unknown(view):
    case = view.case
    assert DISPARITIES - 6 < np.nanmax(case.truth) <= DISPARITIES - 1
    assert 0.005 < np.isnan(case.truth).mean() < 0.5
    assert not (case.non_occluded & ~case.known).any()


def test_views_are_repeatable_and_differ():
    one, two = (list(room_views(2, seed=9)) for _ in range(2))
    assert all((a.case.left == b.case.left).all() for a, b in zip(one, two, strict=True))
    assert one[0].pan != one[1].pan
    assert one[0].case.name != one[1].case.name
