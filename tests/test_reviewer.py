"""While something is followed: what is more like the target is told, once it was seen twice."""

from __future__ import annotations

import math

import numpy as np
import pytest

from calib.model import HeadMount, StereoRig
from robot.messages import Box, Detection, HeadPose, Pose2, StereoFrame, View
from robot.reviewer import REMEMBERED, Reviewer
from robot.target_range import TargetRanger

RIG = StereoRig.parallel(352, 288, 305.0, 0.06)
FOLLOWED = Box(40, 100, 60, 80)
ELSEWHERE = Box(240, 100, 60, 80)
WALL = np.repeat(np.random.default_rng(0).integers(0, 255, (288, 480, 1), np.uint8), 3, axis=2)


def view(at: float, pan: float = 0.0) -> View:
    left, right = (np.ascontiguousarray(WALL[:, x : x + 352]) for x in (100, 120))
    return View(StereoFrame(left, right, at, round(at * 25)), HeadPose(pan, 0.0), Pose2())


class Scripted:
    """Glances at what the script says; gives what is followed a fixed score."""

    def __init__(self, *found: Detection, followed: float = 0.4) -> None:
        self.found, self.followed = list(found), followed
        self.heights: list[tuple[float, ...]] = []

    def glance(self, image, heights_px):
        self.heights.append(tuple(heights_px))
        return self.found

    def score(self, image, box):
        assert box == FOLLOWED
        return self.followed


def reviewer(model: Scripted, height_m: float | None = None) -> Reviewer:
    return Reviewer(RIG, model, TargetRanger(RIG, HeadMount(), height_m))


def rival(score: float = 0.9, box: Box = ELSEWHERE) -> Detection:
    return Detection(box, score, "box")


def test_a_better_match_is_told_when_it_is_seen_the_second_time() -> None:
    eye = reviewer(Scripted(rival()))
    assert eye.review(view(0.0), FOLLOWED) is None
    told = eye.review(view(1.0), FOLLOWED)
    assert told is not None
    assert told.box == ELSEWHERE
    assert told.azimuth == pytest.approx(math.atan2(175.5 - 270.0, 305.0), abs=0.01)


def test_all_sizes_are_gone_through_and_a_rivals_are_looked_at_again() -> None:
    nothing, something = Scripted(), Scripted(rival())
    for model in (nothing, something):
        eye = reviewer(model)
        for second in range(4):
            eye.review(view(float(second)), FOLLOWED)
    assert len(set(sum(nothing.heights, ()))) == 11
    assert something.heights[0] == something.heights[1]


@pytest.mark.parametrize(
    ("model", "why"),
    [
        (Scripted(rival(0.9), followed=0.85), "hardly better"),
        (Scripted(rival(0.9, Box(44, 104, 60, 80))), "it is what is followed"),
        (Scripted(), "nothing is there"),
    ],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_what_is_no_better_match_is_not_told(model: Scripted, why: str) -> None:
    eye = reviewer(model)
    assert all(eye.review(view(float(second)), FOLLOWED) is None for second in range(4)), why


def test_two_sightings_must_agree_and_be_fresh() -> None:
    eye = reviewer(Scripted(rival()))
    eye.review(view(0.0), FOLLOWED)
    assert eye.review(view(1.0, pan=0.3), FOLLOWED) is None, "another direction"
    assert eye.review(view(1.0 + REMEMBERED + 0.5, pan=0.3), FOLLOWED) is None, "too long ago"


def test_a_print_of_the_wrong_size_is_no_rival() -> None:
    eye = reviewer(Scripted(rival(box=Box(240, 100, 20, 26))), height_m=0.22)
    assert all(eye.review(view(float(second)), FOLLOWED) is None for second in range(3))
