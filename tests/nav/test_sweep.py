"""The swept circle: contact distances against a body that is really moved in small steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flatworld import driven
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from robot.messages import Pose2, Twist
from robot.nav.sweep import GRAZE, first_contact

RADIUS = 0.15
STEP = 2e-3


def stepped_contact(point: tuple[float, float], twist: Twist, longest: float) -> float:
    """Metres driven in steps of 2 mm until the circle holds the point."""
    for k in range(int(longest / STEP)):
        pose = driven(Pose2(), twist, k * STEP / abs(twist.v))
        if math.hypot(point[0] - pose.x, point[1] - pose.y) < RADIUS:
            return k * STEP
    return math.inf


@settings(deadline=None, max_examples=120)
@given(
    st.sampled_from([-0.2, 0.2]),
    st.floats(-1.2, 1.2),
    st.floats(0.2, 0.9),
    st.floats(0.0, 0.3),
    st.floats(-3.2, 3.2),
)
def test_contact_is_where_a_moved_body_touches(
    v: float, w: float, way: float, off: float, angle: float
) -> None:
    twist = Twist(v, w)
    near = driven(Pose2(), twist, way / abs(v))
    x, y = near.x + off * math.cos(angle), near.y + off * math.sin(angle)
    assume(math.hypot(x, y) > RADIUS + 0.01)
    found = first_contact(np.array([[x, y]]), twist, RADIUS)
    stepped = stepped_contact((x, y), twist, 1.4)
    if stepped < math.inf:
        assert stepped - 1.5 * STEP <= found <= stepped + 1e-9
    elif found < 1.39:
        # The stepped body may miss a touch shallower than a step, never a deep one.
        end = driven(Pose2(), twist, found / abs(v))
        assert math.hypot(x - end.x, y - end.y) == pytest.approx(RADIUS, abs=1e-6)
        further = driven(Pose2(), twist, (found + STEP) / abs(v))
        assert math.hypot(x - further.x, y - further.y) > RADIUS - 1e-3


def test_a_point_a_tight_turn_never_leaves_is_not_ahead() -> None:
    assert first_contact(np.array([[0.01, 0.06], [0.0, 0.05]]), Twist(0.05, 1.0), RADIUS) == math.inf


def test_nearest_of_many_points_counts() -> None:
    points = np.array([[2.0, 0.0], [0.9, 0.1], [0.5, 0.3]])
    assert first_contact(points, Twist(0.1), RADIUS) == pytest.approx(0.9 - math.sqrt(RADIUS**2 - 0.01))


def test_backwards_looks_behind() -> None:
    behind = np.array([[-1.0, 0.0]])
    assert first_contact(behind, Twist(-0.1), RADIUS) == pytest.approx(0.85)
    assert first_contact(behind, Twist(0.1), RADIUS) == math.inf


def test_a_point_inside_the_circle_stops_the_way_to_it_but_not_away_from_it() -> None:
    inside = np.array([[0.1, 0.02]])
    assert first_contact(inside, Twist(0.2, 0.3), RADIUS) == 0.0
    assert first_contact(inside, Twist(-0.2, 0.0), RADIUS) == math.inf


def test_a_wall_just_beside_does_not_hold_the_robot() -> None:
    beside = np.array([[0.02, RADIUS - 0.5 * GRAZE]])
    assert first_contact(beside, Twist(0.2), RADIUS) == math.inf
    assert first_contact(beside - (0.0, GRAZE), Twist(0.2), RADIUS) == 0.0


@pytest.mark.parametrize("twist", [Twist(), Twist(0.0, 1.0)])
def test_turning_on_the_spot_touches_nothing(twist: Twist) -> None:
    assert first_contact(np.array([[0.2, 0.0]]), twist, RADIUS) == math.inf


def test_no_points_no_contact() -> None:
    assert first_contact(np.zeros((0, 2)), Twist(0.2), RADIUS) == math.inf
