"""The target follower: the head's own motion is allowed for, the recogniser keeps an eye on the box."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from calib.model import HeadMount, StereoRig
from robot.messages import Box, Detection, HeadPose, Image, Pose2, StereoFrame, View
from robot.target import CONFIRM_EVERY, DOUBTS_ALLOWED, TargetFollower
from robot.target_range import SIZE_SIGMA, TargetRanger
from robot.vision.textures import texture

RIG = StereoRig.parallel(352, 288, 305.0, 0.06)
WIDE = texture(
    (800, 700), np.random.default_rng(3)
)  # a wall larger than the picture: turning shows other parts
LEFT, TOP = 220, 200
BOX = Box(140.0, 100.0, 60.0, 70.0)
DISPARITY_PX = 12
DEPTH = 305.0 * 0.06 / DISPARITY_PX


def seen(right: int = 0, down: int = 0) -> tuple[Image, Image]:
    """Both eyes' pictures of the wall, its content moved by so many pixels; 12 px disparity."""
    x, y = LEFT - right, TOP - down
    left = WIDE[y : y + 288, x : x + 352]
    return left, WIDE[y : y + 288, x + DISPARITY_PX : x + DISPARITY_PX + 352]


def view(
    at: float, *, right: int = 0, down: int = 0, head: HeadPose | None = None, base: Pose2 | None = None
) -> View:
    left, other = seen(right, down)
    return View(StereoFrame(left, other, at, round(at * 25)), head or HeadPose(), base or Pose2())


class Judge:
    """A recogniser whose verdict the test sets; counts its looks at the box."""

    def __init__(self, score: float = 0.9) -> None:
        self.verdict = score
        self.looks = 0

    def predict(self, image: Image, heights_px: Sequence[float] | None = None) -> list[Detection]:
        return []

    def refine(self, image: Image, box: Box) -> Detection:
        return Detection(box, self.verdict, "box")

    def score(self, image: Image, box: Box) -> float:
        self.looks += 1
        return self.verdict


def new_follower(judge: Judge | None = None, height_m: float | None = None) -> TargetFollower:
    return TargetFollower(RIG, judge or Judge(), TargetRanger(RIG, HeadMount(), height_m))


def follower(judge: Judge | None = None, height_m: float | None = None) -> TargetFollower:
    started = new_follower(judge, height_m)
    started.start(view(0.0), Detection(BOX, 0.9, "box"))
    return started


def test_nothing_is_followed_before_the_start_and_after_a_drop() -> None:
    idle = new_follower()
    assert not idle.active
    assert not idle.following
    assert idle.update(view(0.04)) is None
    started = follower()
    assert started.active
    assert started.following
    started.drop()
    assert not started.active
    assert started.update(view(0.04)) is None


def test_the_target_is_followed_and_ranged() -> None:
    sight = follower().update(view(0.04, right=5, down=-3))
    assert sight is not None
    assert not sight.track.lost
    assert sight.track.box.x == pytest.approx(BOX.x + 5, abs=1.0)
    assert sight.track.box.y == pytest.approx(BOX.y - 3, abs=1.0)
    assert sight.range is not None
    assert sight.range.distance == pytest.approx(DEPTH, rel=0.01)


TURN = 0.2
TURN_PX = round(305.0 * math.tan(TURN))  # 62 px


@pytest.mark.parametrize(
    ("head", "base", "right", "down"),
    [
        (HeadPose(pan=TURN), Pose2(), TURN_PX, 0),
        (HeadPose(pan=-TURN), Pose2(), -TURN_PX, 0),
        (HeadPose(tilt=TURN), Pose2(), 0, -TURN_PX),
        (HeadPose(tilt=-TURN), Pose2(), 0, TURN_PX),
        (HeadPose(), Pose2(yaw=TURN), TURN_PX, 0),
        (HeadPose(), Pose2(yaw=-TURN), -TURN_PX, 0),
    ],
)
def test_the_heads_and_the_bases_turn_are_allowed_for(
    head: HeadPose, base: Pose2, right: int, down: int
) -> None:
    told = follower().update(view(0.04, right=right, down=down, head=head, base=base))
    assert told is not None
    assert not told.track.lost
    assert told.track.box.centre == pytest.approx((BOX.centre[0] + right, BOX.centre[1] + down), abs=2.0)
    assert math.hypot(*told.track.velocity_px) < 2.0
    untold = follower().update(view(0.04, right=right, down=down))
    assert untold is not None
    # Who is not told takes the turn for the target's own motion.
    assert untold.track.lost or math.hypot(*untold.track.velocity_px) > TURN_PX - 4


def test_turning_head_and_base_against_each_other_moves_nothing() -> None:
    sight = follower().update(view(0.04, head=HeadPose(pan=TURN), base=Pose2(yaw=-TURN)))
    assert sight is not None
    assert sight.track.box.centre == pytest.approx(BOX.centre, abs=1.0)


def test_a_turn_across_the_back_is_a_small_one() -> None:
    begun = new_follower()
    begun.start(view(0.0, base=Pose2(yaw=math.pi - 0.01)), Detection(BOX, 0.9, "box"))
    sight = begun.update(view(0.04, right=6, base=Pose2(yaw=-math.pi + 0.01)))
    assert sight is not None
    assert not sight.track.lost
    assert sight.track.box.x == pytest.approx(BOX.x + 6, abs=1.0)


def follow_until(started: TargetFollower, seconds: float, begin: float = 0.0) -> list[bool]:
    """Frames at 25/s of a target that stands; True where the track was lost."""
    lost = []
    for tick in range(1, round(seconds * 25) + 1):
        sight = started.update(view(begin + tick * 0.04))
        assert sight is not None
        assert sight.range is None or not sight.track.lost
        lost.append(sight.track.lost)
    return lost


def test_the_recogniser_looks_now_and_then_not_every_frame() -> None:
    judge = Judge()
    assert not any(follow_until(follower(judge), 4.0))
    assert judge.looks == pytest.approx(4.0 / CONFIRM_EVERY, abs=1)


def test_several_doubts_in_a_row_end_the_track_although_the_tracker_is_sure() -> None:
    judge = Judge(0.1)
    started = follower(judge)
    lost = follow_until(started, (DOUBTS_ALLOWED + 1) * CONFIRM_EVERY + 0.2)
    first = lost.index(True)
    assert (first + 1) * 0.04 == pytest.approx(DOUBTS_ALLOWED * CONFIRM_EVERY, abs=0.13), "the third doubt"
    assert all(lost[first:]), "and it stays lost"
    assert started.active
    assert not started.following


def test_one_sure_look_wipes_out_the_doubts_before_it() -> None:
    judge = Judge(0.1)
    started = follower(judge)
    now = 0.0
    for _ in range(3):
        judge.verdict = 0.1
        while judge.looks % DOUBTS_ALLOWED < DOUBTS_ALLOWED - 1:
            assert not any(follow_until(started, 0.04, now))
            now += 0.04
        judge.verdict = 0.9
        while judge.looks % DOUBTS_ALLOWED:
            assert not any(follow_until(started, 0.04, now))
            now += 0.04
    assert judge.looks == 3 * DOUBTS_ALLOWED


def test_a_box_that_is_not_as_large_as_the_target_there_is_given_up() -> None:
    """70 px at 1.5 m are 0.35 m: the recogniser's word alone does not do."""
    assert not any(follow_until(follower(height_m=0.35), 2.0))
    for height in (0.8, 0.15):
        misfit = follower(height_m=height)
        assert follow_until(misfit, (DOUBTS_ALLOWED + 1) * CONFIRM_EVERY)[-1]
        assert not misfit.following


def test_a_new_detection_starts_a_lost_track_again() -> None:
    judge = Judge(0.1)
    started = follower(judge)
    assert follow_until(started, 2.5)[-1]
    judge.verdict = 0.9
    started.start(view(2.6), Detection(BOX, 0.9, "box"))
    assert started.following
    assert not any(follow_until(started, 1.0, 2.6))


def test_a_target_lost_for_a_moment_is_found_again_where_it_must_be() -> None:
    judge = Judge(0.1)
    started = follower(judge)
    other = texture((352, 288), np.random.default_rng(9))
    sight = started.update(View(StereoFrame(other, other, 0.04, 1), HeadPose(), Pose2()))
    assert sight is not None
    assert sight.track.lost
    judge.verdict = 0.8
    sight = started.update(view(0.08))
    assert sight is not None
    assert not sight.track.lost
    assert sight.track.box.iou(BOX) > 0.8


def test_a_target_that_is_gone_is_lost_and_has_no_range() -> None:
    judge = Judge()
    started = follower(judge)
    judge.verdict = 0.1
    other = texture((352, 288), np.random.default_rng(9))
    sight = started.update(View(StereoFrame(other, other, 0.04, 1), HeadPose(), Pose2()))
    assert sight is not None
    assert sight.track.lost
    assert sight.range is None
    assert not started.following


def test_a_wall_without_depth_is_followed_without_a_range() -> None:
    started = follower()
    left, _ = seen()
    grey = np.full_like(left, 90)
    sight = started.update(View(StereoFrame(left, grey, 0.04, 1), HeadPose(), Pose2()))
    assert sight is not None
    assert not sight.track.lost
    assert sight.range is None


def one_eyed(at: float) -> View:
    """The right eye sees a grey wall only."""
    left, _ = seen()
    return View(StereoFrame(left, np.full_like(left, 90), at, round(at * 25)), HeadPose(), Pose2())


def test_a_target_one_eye_cannot_see_is_ranged_by_its_known_size() -> None:
    sight = follower(height_m=0.35).update(one_eyed(0.04))
    assert sight is not None
    assert sight.range is not None
    assert sight.range.method == "size"
    assert sight.range.distance == pytest.approx(305.0 * 0.35 / sight.track.box.h)
    assert sight.range.sigma == pytest.approx(SIZE_SIGMA * sight.range.distance)
    by_stereo = TargetRanger(RIG, HeadMount()).measure(view(0.04), sight.track.box)
    assert by_stereo is not None
    # Both lie on the ray through the box's middle.
    _, eye = HeadMount().left_eye(0.0, 0.0)
    scale = sight.range.distance / by_stereo.distance
    assert np.array(sight.range.position) - eye == pytest.approx(scale * (np.array(by_stereo.position) - eye))


def test_a_box_at_the_pictures_rim_has_no_range_by_size() -> None:
    ranger = TargetRanger(RIG, HeadMount(), 0.35)
    for rim in (Box(1.0, 100.0, 60.0, 70.0), Box(140.0, 217.5, 60.0, 70.0), Box(300.0, 100.0, 60.0, 70.0)):
        assert ranger.measure(one_eyed(0.04), rim) is None
    assert ranger.measure(one_eyed(0.04), BOX) is not None


def test_stereo_beats_size_where_both_tell() -> None:
    measured = TargetRanger(RIG, HeadMount(), 0.3).measure(view(0.04), BOX)
    assert measured is not None
    assert measured.distance == pytest.approx(DEPTH, rel=0.01)
    assert measured.method != "size"
