"""Pure pursuit: the point aimed at, the arc to it, progress that never jumps."""

from __future__ import annotations

import math

import pytest

from robot.body.pursuit import pursue
from robot.messages import Pose2

CORNER = math.radians(25.0)


def test_the_arc_leads_through_the_point_aimed_at() -> None:
    """Coulter: curvature = 2 y / L^2 for a point at (x, y) of the robot frame, L away."""
    aim = pursue(((0.15, 0.1),), Pose2(), 0.0, 0.2, CORNER)
    assert aim.curvature == pytest.approx(2 * 0.1 / (0.15**2 + 0.1**2))
    assert aim.bearing == pytest.approx(math.atan2(0.1, 0.15))
    assert aim.to_end == pytest.approx(math.hypot(0.15, 0.1))


def test_the_aim_is_the_look_ahead_further_along_the_path() -> None:
    aim = pursue(((0.0, 0.0), (1.0, 0.0)), Pose2(0.3, 0.1), 0.0, 0.2, CORNER)
    assert aim.progress == pytest.approx(0.3)
    assert aim.bearing == pytest.approx(math.atan2(-0.1, 0.2))
    assert aim.to_corner == pytest.approx(0.7)


def test_on_a_hairpin_the_robot_stays_on_its_leg() -> None:
    hairpin = ((0.0, 0.0), (1.0, 0.0), (1.0, 0.1), (0.0, 0.1))
    assert pursue(hairpin, Pose2(0.5, 0.06), 0.45, 0.2, CORNER).progress == pytest.approx(0.5)
    assert pursue(hairpin, Pose2(0.5, 0.04), 1.55, 0.2, CORNER).progress == pytest.approx(1.6)


def test_progress_never_goes_back() -> None:
    assert pursue(((0.0, 0.0), (1.0, 0.0)), Pose2(0.2, 0.0), 0.6, 0.2, CORNER).progress == pytest.approx(0.6)


def test_a_sharp_corner_is_aimed_at_until_it_is_reached_a_gentle_one_is_cut() -> None:
    sharp = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
    assert pursue(sharp, Pose2(0.9, 0.0), 0.8, 0.2, CORNER).bearing == pytest.approx(0.0)
    assert pursue(sharp, Pose2(0.98, 0.0), 0.9, 0.2, CORNER).bearing > 1.0
    gentle = ((0.0, 0.0), (1.0, 0.0), (2.0, 0.3))
    assert pursue(gentle, Pose2(0.9, 0.0), 0.8, 0.2, CORNER).bearing > 0.05
