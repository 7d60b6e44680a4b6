"""What the eyes say of the base's motion, in rendered rooms where the truth is known to the micrometre."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from rendered_pairs import MOUNT, RIG, TILT, Block, Room, render

from calib.model import HeadMount
from robot.messages import Box, EgoMotion, HeadPose, Pose2, StereoFrame, View
from robot.vision.egomotion import LONG_EVERY_S, LONG_GAP_S, EgoMotionEstimator, Looks
from robot.vision.rigid_fit import rotation_of

ROOM = Room(
    blocks=(Block(1.6, 0.5, 0.3, 0.4, 0.5, yaw=0.4, seed=3), Block(2.2, -0.7, 0.4, 0.3, 0.9, yaw=0.2, seed=4))
)
BARE = Room(contrast=0.0)
GAP = 0.12


@dataclass(frozen=True)
class Stand:
    """Where the base truly is in the room, and where its head truly looks."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    lift: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    pan: float = 0.0
    tilt: float = TILT


@dataclass(frozen=True)
class _Moved(HeadMount):
    """The mount of a base that stands somewhere in the room."""

    stand: Stand = Stand()

    def left_eye(self, pan: float, tilt: float) -> tuple[np.ndarray, np.ndarray]:
        rotation, position = MOUNT.left_eye(pan, tilt)
        s = self.stand
        turn = rotation_of(np.array([0.0, 0.0, s.yaw])) @ rotation_of(np.array([s.roll, s.pitch, 0.0]))
        return turn @ rotation, turn @ position + (s.x, s.y, s.lift)


@cache
def pictures(stand: Stand, room: Room, seed: int, gain: float, noise: float) -> tuple[np.ndarray, np.ndarray]:
    pair = render(
        room, mount=_Moved(stand=stand), pan=stand.pan, tilt=stand.tilt, seed=seed, samples=1, gain=gain,
        noise=noise,
    )  # fmt: skip
    return pair.left, pair.right


def view(
    stand: Stand, at: float, *, wheels: Pose2 | None = None, head: HeadPose | None = None, room: Room = ROOM,
    gain: float = 1.0, noise: float = 2.0,
) -> View:  # fmt: skip
    """What loop hands to vision: the true picture, the wheels' and the head's word (the truth by default)."""
    seq = round(at / GAP)
    left, right = pictures(stand, room, seq, gain, noise)
    said = wheels or Pose2(stand.x, stand.y, stand.yaw)
    return View(StereoFrame(left, right, at, seq), head or HeadPose(stand.pan, stand.tilt), said)


def after(first: View, second: View, moving: Box | None = None) -> EgoMotion | None:
    estimator = EgoMotionEstimator(RIG, MOUNT)
    assert estimator.update(first, moving) == Looks(), "one picture says nothing"
    return estimator.update(second).short


def over_long(looks: list[View], moving: Box | None = None) -> EgoMotion | None:
    """The newest long look over these pictures."""
    estimator = EgoMotionEstimator(RIG, MOUNT)
    found = [look for look in (estimator.update(one, moving).long for one in looks) if look is not None]
    return found[-1] if found else None


START = Stand()


@pytest.mark.parametrize(
    "end",
    [
        Stand(),
        Stand(x=0.03),
        Stand(x=0.028, y=0.002, yaw=0.1),
        Stand(yaw=-0.14, pan=0.1),
        Stand(x=0.01, pan=0.2, tilt=TILT + 0.1),
    ],
)
def test_wheels_that_tell_the_truth_are_not_contradicted(end: Stand) -> None:
    motion = after(view(START, GAP), view(end, 2 * GAP))
    assert motion is not None
    assert motion.deviation < 2.5
    assert (motion.eyes.x, motion.eyes.y) == pytest.approx((end.x, end.y), abs=0.003)
    assert motion.eyes.yaw == pytest.approx(end.yaw, abs=math.radians(0.2))
    assert motion.wheels == pytest.approx(Pose2(end.x, end.y, end.yaw))
    assert motion.since == GAP
    assert motion.inlier_share > 0.8
    assert 0.0 < max(motion.sigma) < 0.01


@pytest.mark.parametrize(
    ("end", "least"),
    [
        (Stand(y=0.036, yaw=0.08), 8.0),  # pushed aside
        (Stand(x=-0.04), 6.0),  # pulled back
        (Stand(lift=0.036), 6.0),
        (Stand(roll=math.radians(7.0)), 8.0),
        (Stand(pitch=math.radians(-7.0)), 8.0),
        (Stand(yaw=math.radians(5.0)), 7.0),  # turned by hand
    ],
)
def test_a_base_moved_while_its_wheels_stand_is_seen_as_it_was_moved(end: Stand, least: float) -> None:
    motion = after(view(START, GAP), view(end, 2 * GAP, wheels=Pose2()))
    assert motion is not None
    assert motion.deviation > least
    assert (motion.eyes.x, motion.eyes.y, motion.lift) == pytest.approx((end.x, end.y, end.lift), abs=0.004)
    assert (motion.roll, motion.pitch, motion.eyes.yaw) == pytest.approx(
        (end.roll, end.pitch, end.yaw), abs=math.radians(0.4)
    )
    assert motion.dissent < 0.05
    assert motion.inlier_share > 0.8


def test_wheels_that_turn_on_and_on_while_the_base_stands_are_contradicted() -> None:
    estimator = EgoMotionEstimator(RIG, MOUNT)
    looks = [
        estimator.update(view(START, GAP * (k + 1), wheels=Pose2(0.03 * k, 0.0, 0.0))).short for k in range(3)
    ]
    spinning, still_spinning = looks[1:]
    assert spinning is not None
    assert still_spinning is not None
    assert 3.0 < spinning.deviation < still_spinning.deviation, "only speeding up could be a late reading"
    assert still_spinning.deviation > 5.5
    assert still_spinning.wheels.x == pytest.approx(0.03)
    assert still_spinning.eyes.x == pytest.approx(0.0, abs=0.003)


def test_a_little_slip_is_no_contradiction() -> None:
    end = Stand(x=0.027, yaw=0.09)
    motion = after(view(START, GAP), view(end, 2 * GAP, wheels=Pose2(0.030, 0.0, 0.1)))
    assert motion is not None
    assert motion.deviation < 3.0


def test_a_head_that_reads_a_fifth_of_a_degree_wrong_is_no_contradiction() -> None:
    wrong = math.radians(0.2)
    motion = after(
        view(START, GAP, head=HeadPose(-wrong, TILT + wrong)),
        view(Stand(), 2 * GAP, head=HeadPose(wrong, TILT - wrong)),
    )
    assert motion is not None
    assert motion.deviation < 3.0


def test_a_head_that_turns_may_read_a_little_late() -> None:
    end = Stand(pan=0.21)
    motion = after(view(START, GAP), view(end, 2 * GAP, head=HeadPose(0.21 - math.radians(0.7), TILT)))
    assert motion is not None
    assert motion.deviation < 1.5


def test_wheels_that_slip_a_tenth_in_a_steady_turn_are_no_contradiction() -> None:
    estimator = EgoMotionEstimator(RIG, MOUNT)
    looks = [
        estimator.update(view(Stand(yaw=0.135 * k), GAP * (k + 1), wheels=Pose2(yaw=0.15 * k))).short
        for k in range(3)
    ]
    steady = looks[-1]
    assert steady is not None
    assert steady.deviation < 1.5


def test_the_step_counts_in_the_frame_of_the_earlier_pose() -> None:
    """The same drive, begun somewhere else in the odometry frame, facing elsewhere."""
    begin = Pose2(5.0, -2.0, 2.0)
    end = begin.compose(Pose2(0.03, 0.0, 0.1))
    motion = after(view(START, GAP, wheels=begin), view(Stand(x=0.03, yaw=0.1), 2 * GAP, wheels=end))
    assert motion is not None
    assert (motion.wheels.x, motion.wheels.y, motion.wheels.yaw) == pytest.approx((0.03, 0.0, 0.1))
    assert (motion.eyes.x, motion.eyes.y) == pytest.approx((0.03, 0.0), abs=0.003)


def walks_by(y: float) -> Room:
    """A block takes up a third of the picture."""
    return Room(blocks=(Block(1.0, y, 0.3, 0.5, 0.7, seed=5), *ROOM.blocks))


def test_a_thing_that_walks_by_is_not_the_base() -> None:
    pair = view(START, GAP, room=walks_by(0.0)), view(START, 2 * GAP, room=walks_by(0.05))
    motion = after(*pair)
    assert motion is not None
    assert motion.deviation < 2.5
    assert motion.inlier_share < 0.9, "the thing is there and it did move"
    target = after(*pair, Box(85.0, 0.0, 180.0, 180.0))
    assert target is not None
    assert target.deviation < 2.5
    assert target.inlier_share > 0.97, "what is known to move by itself is not followed"


def test_nothing_is_followed_where_all_may_move_by_itself() -> None:
    assert after(view(START, GAP), view(START, 2 * GAP), Box(0.0, 0.0, 352.0, 288.0)) is None


@pytest.mark.parametrize("case", ["bare walls", "night", "long gap", "swing", "time stands"])
def test_nothing_is_said_where_nothing_can_be_said(case: str) -> None:
    first, second = view(START, GAP), view(Stand(lift=0.05), 2 * GAP, wheels=Pose2())
    match case:
        case "bare walls":
            first, second = (view(Stand(lift=h), GAP * (h > 0) + GAP, room=BARE) for h in (0.0, 0.05))
        case "night":
            first = view(START, GAP, gain=0.01, noise=3.0)
            second = view(Stand(lift=0.05), 2 * GAP, wheels=Pose2(), gain=0.01, noise=3.0)
        case "long gap":
            second = view(Stand(lift=0.05), 6 * GAP, wheels=Pose2())
        case "swing":
            second = view(Stand(pan=0.9, lift=0.05), 2 * GAP, wheels=Pose2())
        case "time stands":
            second = view(Stand(lift=0.05), GAP, wheels=Pose2())
    assert after(first, second) is None


def test_forgetting_takes_the_picture_before_away() -> None:
    estimator = EgoMotionEstimator(RIG, MOUNT)
    estimator.update(view(START, GAP))
    estimator.forget()
    assert estimator.update(view(START, 2 * GAP)) == Looks()
    assert estimator.update(view(START, 3 * GAP)).short is not None


def test_the_same_pictures_give_the_same_numbers() -> None:
    pair = view(START, GAP), view(Stand(x=0.03), 2 * GAP)
    assert after(*pair) == after(*pair)


# ------------------------------------------------------------------------------------------ the long look

LONG = 7 * GAP


def slow(seconds: float, speed: dict[str, float]) -> list[View]:
    """A picture, and one of so much later of a base that hands moved at this speed; its wheels stand."""
    moved = Stand(**{name: rate * seconds for name, rate in speed.items()})
    return [view(START, GAP), view(moved, GAP + seconds, wheels=Pose2())]


@pytest.mark.parametrize(
    "speed",
    [
        {"lift": 0.05},
        {"y": 0.05},
        {"x": -0.05},
        {"roll": math.radians(6.0)},
        {"pitch": math.radians(-6.0)},
        {"yaw": math.radians(8.0)},
    ],
)
def test_slow_hands_are_seen_over_most_of_a_second(speed: dict[str, float]) -> None:
    long = over_long(slow(LONG, speed))
    assert long is not None
    assert long.deviation > 6.0
    assert long.since == GAP
    seen = {"x": long.eyes.x, "y": long.eyes.y, "yaw": long.eyes.yaw, "lift": long.lift, "roll": long.roll}
    ((name, rate),) = speed.items()
    assert seen.get(name, long.pitch) == pytest.approx(rate * LONG, rel=0.12)
    assert long.dissent <= 0.1
    assert long.inlier_share > 0.7


@pytest.mark.parametrize("speed", [{"lift": 0.05}, {"yaw": math.radians(8.0)}])
def test_slow_hands_do_not_stand_out_from_picture_to_picture(speed: dict[str, float]) -> None:
    short = after(*slow(GAP, speed))
    assert short is not None
    assert short.deviation < 4.0


def test_driving_turning_and_looking_about_is_consistent_over_a_long_look_too() -> None:
    end = Stand(x=0.12, yaw=0.2, pan=0.14)
    long = over_long([view(START, GAP), view(end, GAP + LONG)])
    assert long is not None
    assert long.deviation < 2.5


def test_what_the_wheels_may_have_slipped_counts_all_they_did_not_only_where_they_ended() -> None:
    """Forth and back again: the wheels say they are where they began, the base is 1.8 cm away."""
    first, last = view(START, GAP), view(Stand(x=-0.018), GAP + LONG, wheels=Pose2())
    away = [view(START, GAP * k, wheels=Pose2(0.1)) for k in (3, 4)]
    restless, calm = over_long([first, *away, last]), over_long([first, last])
    assert restless is not None
    assert calm is not None
    assert restless.deviation < 2.0 < 3.5 < calm.deviation


def test_something_large_that_creeps_by_is_not_the_base() -> None:
    """Over one short step what creeps and what stands look alike: a sum of short steps would err here."""
    long = over_long([view(START, GAP, room=walks_by(0.0)), view(START, GAP + LONG, room=walks_by(0.05))])
    assert long is not None
    assert long.deviation < 2.5
    assert long.inlier_share < 0.9, "the thing is there and it did creep"


def test_a_long_look_is_taken_every_second_picture_and_as_far_back_as_it_may() -> None:
    estimator, plain = EgoMotionEstimator(RIG, MOUNT), view(START, GAP)
    looks = [
        estimator.update(replace(plain, frame=replace(plain.frame, captured_at=GAP * k))) for k in range(14)
    ]
    seen = [(k, look.long) for k, look in enumerate(looks) if look.long is not None]
    times = [GAP * k for k, _ in seen]
    assert len(times) == 5
    assert min(np.diff(times)) >= LONG_EVERY_S
    gaps = [GAP * k - look.since for k, look in seen]
    assert LONG_GAP_S[0] <= min(gaps)
    assert max(gaps) <= LONG_GAP_S[1]
    assert gaps[-1] == pytest.approx(LONG), "the oldest it may take"


def test_no_long_look_over_a_swing_a_nod_or_a_long_way() -> None:
    def after_long(end: Stand) -> EgoMotion | None:
        return over_long([view(START, GAP), view(end, GAP + LONG)])

    assert after_long(Stand(pan=0.4)) is not None
    assert after_long(Stand(pan=0.47)) is None
    assert after_long(Stand(tilt=TILT - 0.47)) is None
    assert after_long(Stand(x=0.14)) is not None
    assert after_long(Stand(x=0.16)) is None
