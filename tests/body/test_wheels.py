"""The wheeled body: each intent reaches its end on a body that does as told, and the head's glance."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.body.wheels import (
    WheelsBody,
    WheelsSettings,
    WheelsState,
    approach_speed,
    saturated,
    step,
    turn_rate,
)
from robot.messages import (
    Approach,
    Command,
    Follow,
    HeadPose,
    Hold,
    Intent,
    Motion,
    Odometry,
    Pose2,
    Turn,
    Twist,
    wrap,
)

PERIOD = 0.04
SETTINGS = WheelsSettings()
number = st.floats(allow_nan=True, allow_infinity=True)
motions = st.one_of(
    st.just(Hold()),
    st.builds(Turn, number),
    st.builds(Approach, number, number, number),
    st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), max_size=5).map(lambda p: Follow(tuple(p))),
)


def driven(pose: Pose2, twist: Twist, seconds: float = PERIOD) -> Pose2:
    middle = pose.yaw + 0.5 * twist.w * seconds
    return Pose2(
        pose.x + twist.v * seconds * math.cos(middle),
        pose.y + twist.v * seconds * math.sin(middle),
        wrap(pose.yaw + twist.w * seconds),
    )


def run(motion: Motion, pose: Pose2, seconds: float, delay: int = 3) -> list[tuple[Pose2, Twist]]:
    """Drive a body whose wheels answer `delay` ticks late."""
    body, trail = WheelsBody(), []
    waiting = [Twist()] * delay
    for k in range(round(seconds / PERIOD)):
        waiting.append(body.command(Intent(motion=motion), Odometry(pose), False, k * PERIOD).twist)
        twist = waiting.pop(0)
        pose = driven(pose, twist)
        trail.append((pose, twist))
    return trail


def command(motion: Motion, pose: Pose2 = Pose2(), state: WheelsState = WheelsState()) -> Command:  # noqa: B008
    return step(SETTINGS, state, Intent(motion=motion), Odometry(pose), False, 1.0)[1]


@settings(deadline=None, max_examples=200)
@given(motions, number, number, st.booleans())
def test_any_intent_gives_a_command_within_limits(
    motion: Motion, pan: float, tilt: float, held: bool
) -> None:
    intent = Intent(HeadPose(pan, tilt), motion)
    _, sent = step(SETTINGS, WheelsState(), intent, Odometry(Pose2(0.3, -0.2, 1.0)), held, 5.0)
    assert abs(sent.twist.v) <= SETTINGS.cruise * (1 + 1e-9)
    assert abs(sent.twist.w) <= SETTINGS.max_turn * (1 + 1e-9)
    assert sent.head is not None
    assert abs(sent.head.pan) <= SETTINGS.pan_limit
    assert -SETTINGS.tilt_up_limit <= sent.head.tilt <= SETTINGS.tilt_down_limit
    assert sent.expires_at == pytest.approx(5.0 + SETTINGS.command_life)


def test_a_pose_that_is_none_stands_still() -> None:
    for motion in (Turn(1.0), Follow(((0.0, 0.0), (1.0, 0.0)))):
        assert command(motion, Pose2(math.nan, 0.0, 0.0)).twist.is_zero
        assert command(motion, Pose2(0.0, 0.0, math.inf)).twist.is_zero


def test_hold_stands_still() -> None:
    assert command(Hold()).twist.is_zero


# -------------------------------------------------------------------------------------------------- turn


@pytest.mark.parametrize("heading", [0.1, 1.5, -2.5, 3.1])
def test_a_turn_ends_at_its_heading_and_rests(heading: float) -> None:
    trail = run(Turn(heading), Pose2(yaw=0.0), 5.0)
    end, twist = trail[-1]
    assert twist.is_zero
    assert abs(wrap(end.yaw - heading)) < math.radians(2.0)
    assert abs(end.x) + abs(end.y) < 1e-9
    overshoot = max(wrap(pose.yaw - heading) * math.copysign(1.0, heading) for pose, _ in trail[-80:])
    assert overshoot < math.radians(2.0)


def test_between_its_bands_the_body_goes_on_as_it_was() -> None:
    between = 1.5 * SETTINGS.turn_done
    assert turn_rate(SETTINGS, between, turning=True)[1] > 0.0
    assert turn_rate(SETTINGS, between, turning=False) == (False, 0.0)
    near = Approach(0.7 * (1.0 + 0.5 * (SETTINGS.stop_band + SETTINGS.start_band)), 0.0, 0.7)
    assert approach_speed(SETTINGS, near, moving=True)[1] > 0.0
    assert approach_speed(SETTINGS, near, moving=False) == (False, 0.0)


def test_a_turn_takes_the_short_way_round() -> None:
    assert command(Turn(-3.0), Pose2(yaw=3.0)).twist.w > 0.0


# ---------------------------------------------------------------------------------------------- approach


def approached(start: float, bearing: float, seconds: float) -> list[tuple[float, float, Twist]]:
    """(distance, bearing, twist) on the way to a standing target."""
    body, pose, trail = WheelsBody(), Pose2(), []
    target = (start * math.cos(bearing), start * math.sin(bearing))
    waiting = [Twist()] * 4
    for k in range(round(seconds / PERIOD)):
        dx, dy = target[0] - pose.x, target[1] - pose.y
        distance, off = math.hypot(dx, dy), wrap(math.atan2(dy, dx) - pose.yaw)
        intent = Intent(motion=Approach(distance, off, 0.7))
        waiting.append(body.command(intent, Odometry(pose), False, k * PERIOD).twist)
        twist = waiting.pop(0)
        pose = driven(pose, twist)
        trail.append((distance, off, twist))
    return trail


@pytest.mark.parametrize(("start", "bearing"), [(2.0, 0.0), (1.5, 0.4), (1.2, -1.2), (0.4, 0.1), (2.0, 3.0)])
def test_an_approach_comes_to_rest_at_the_set_distance_facing_the_target(
    start: float, bearing: float
) -> None:
    trail = approached(start, bearing, 16.0)
    distance, off, twist = trail[-1]
    assert twist.is_zero
    assert distance == pytest.approx(0.7, rel=0.1)
    assert abs(off) < math.radians(5.0)
    # It does not hunt: once at rest for a second it stays so.
    rests = [k for k, (_, _, t) in enumerate(trail) if t.is_zero]
    first = next(
        k for k in rests if all(trail[j][2].is_zero for j in range(k, min(k + 25, len(trail)))) and k > 5
    )
    assert all(t.is_zero for _, _, t in trail[first:])


def test_a_target_aside_is_turned_to_before_driving() -> None:
    assert command(Approach(2.0, 0.9, 0.7)).twist.v == 0.0
    assert command(Approach(2.0, 0.9, 0.7)).twist.w > 0.0
    assert command(Approach(2.0, 0.2, 0.7)).twist.v > 0.0


def test_too_near_it_backs_up_slowly_a_little_near_it_stays() -> None:
    assert command(Approach(0.45, 0.0, 0.7)).twist.v == pytest.approx(-SETTINGS.back_speed)
    assert command(Approach(0.65, 0.0, 0.7)).twist.is_zero


def test_following_law_is_proportional() -> None:
    """v = k_d (D - D_set), w = k_b bearing (METHODS 3)."""
    twist = command(Approach(0.8, 0.1, 0.7)).twist
    assert twist.v == pytest.approx(SETTINGS.distance_gain * 0.1)
    assert twist.w == pytest.approx(SETTINGS.bearing_gain * 0.1)


def test_a_curve_too_fast_keeps_its_shape() -> None:
    assert saturated(Twist(0.5, 1.0), 0.25, 1.2) == Twist(0.25, 0.5)
    assert saturated(Twist(0.2, 2.4), 0.25, 1.2) == Twist(0.1, 1.2)


# ------------------------------------------------------------------------------------------------ follow


def off_path(path: tuple[tuple[float, float], ...], pose: Pose2) -> float:
    best = math.inf
    for (ax, ay), (bx, by) in pairwise(path):
        ex, ey = bx - ax, by - ay
        length = max(ex * ex + ey * ey, 1e-12)
        t = min(max(((pose.x - ax) * ex + (pose.y - ay) * ey) / length, 0.0), 1.0)
        best = min(best, math.hypot(ax + t * ex - pose.x, ay + t * ey - pose.y))
    return best


PATHS = [
    ((0.0, 0.0), (1.5, 0.0)),
    ((0.0, 0.0), (0.8, 0.0), (0.8, 0.8)),
    ((0.0, 0.0), (0.6, 0.1), (1.2, 0.3), (1.8, 0.6)),
    ((0.0, 0.0), (0.7, 0.0), (0.1, 0.4), (0.9, 0.8)),
    ((0.0, 0.0), (-1.0, 0.0)),
    ((0.0, 0.0), (0.0, 0.0), (0.5, 0.5), (0.5, 0.5)),
]


@pytest.mark.parametrize("path", PATHS)
def test_a_path_is_followed_closely_to_its_end_and_then_rests(path: tuple[tuple[float, float], ...]) -> None:
    trail = run(Follow(path), Pose2(), 20.0)
    end, twist = trail[-1]
    assert twist.is_zero
    assert math.dist((end.x, end.y), path[-1]) < 0.06
    assert max(off_path(path, pose) for pose, _ in trail) < 0.045
    driven_length = sum(abs(t.v) * PERIOD for _, t in trail)
    assert driven_length < 1.1 * sum(math.dist(a, b) for a, b in pairwise(path)) + 0.02


def test_a_sharp_corner_is_neared_slowly_and_turned_on_the_spot() -> None:
    trail = run(Follow(PATHS[1]), Pose2(), 20.0)
    nearing = [twist.v for pose, twist in trail if pose.x > 0.75 and abs(pose.yaw) < 0.05 and twist.v > 0.0]
    assert nearing == sorted(nearing, reverse=True)
    assert nearing[-1] < 0.17
    turning = [pose for pose, twist in trail if twist.v == 0.0 and 0.2 < pose.yaw < 1.0]
    assert turning
    assert all(math.dist((pose.x, pose.y), (0.8, 0.0)) < 0.05 for pose in turning)
    assert max(twist.v for _, twist in trail) > 0.24


def test_a_path_begun_aside_is_joined() -> None:
    trail = run(Follow(((0.0, 0.0), (2.0, 0.0))), Pose2(0.1, 0.15, 0.2), 20.0)
    assert off_path(((0.0, 0.0), (2.0, 0.0)), trail[150][0]) < 0.03
    assert math.dist((trail[-1][0].x, trail[-1][0].y), (2.0, 0.0)) < 0.06


def test_a_path_without_points_or_length_stands_still() -> None:
    assert command(Follow(())).twist.is_zero
    assert command(Follow(((0.01, 0.0),))).twist.is_zero


def test_a_new_path_begins_at_its_start() -> None:
    there, back = ((0.0, 0.0), (1.0, 0.0)), ((1.0, 0.0), (0.0, 0.0))
    state = WheelsState()
    for x in (0.0, 0.3, 0.6, 0.9, 0.98):
        state, _ = step(SETTINGS, state, Intent(motion=Follow(there)), Odometry(Pose2(x, 0.0)), False, 0.0)
    _, sent = step(
        SETTINGS, state, Intent(motion=Follow(back)), Odometry(Pose2(1.0, 0.0, math.pi)), False, 0.1
    )
    assert sent.twist.v == pytest.approx(SETTINGS.cruise)


# ------------------------------------------------------------------------------------------------ glance


def heads(motion: Motion, held: bool, seconds: float, look: HeadPose = HeadPose(0.2, 0.35)) -> list[HeadPose]:
    body, seen = WheelsBody(), []
    for k in range(round(seconds / PERIOD)):
        head = body.command(Intent(look, motion), Odometry(), held, k * PERIOD).head
        assert head is not None
        seen.append(head)
    return seen


def test_held_up_by_unseen_floor_it_looks_down_that_way_for_a_moment() -> None:
    seen = heads(Follow(((0.0, 0.0), (1.0, 0.5))), held=True, seconds=4.0)
    down = [head for head in seen if head.tilt == pytest.approx(math.radians(45.0))]
    assert down[0].pan == pytest.approx(math.atan2(0.5, 1.0), abs=0.02)
    share = len(down) / len(seen)
    assert 0.3 < share < 0.5
    assert seen[0] == down[0]
    assert HeadPose(0.2, 0.35) in seen


def test_nothing_held_up_nothing_glanced_at() -> None:
    wanted = HeadPose(0.2, 0.35)
    assert set(heads(Follow(((0.0, 0.0), (1.0, 0.5))), held=False, seconds=1.0)) == {wanted}
    for motion in (Hold(), Turn(1.0), Approach(0.4, 0.0, 0.7)):
        assert set(heads(motion, held=True, seconds=1.0)) == {wanted}


def test_a_glance_once_begun_is_finished() -> None:
    motion = Intent(HeadPose(), Approach(2.0, 0.3, 0.7))
    state, first = step(SETTINGS, WheelsState(), motion, Odometry(), True, 0.0)
    _, second = step(SETTINGS, state, motion, Odometry(), False, 0.4)
    _, after = step(SETTINGS, state, motion, Odometry(), False, 0.9)
    assert first.head == second.head == HeadPose(0.3, SETTINGS.glance_tilt)
    assert after.head == HeadPose()
