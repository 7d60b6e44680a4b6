"""Which matched features stand up or fall away: gates by height, its doubt, kind, and the way back."""

import numpy as np
import pytest
from ground_scenes import look
from rendered_pairs import MOUNT, RIG, TILT, Block, Room

from robot.vision import ground
from robot.vision.ground import GroundLimits, find_obstacles
from robot.vision.ground_features import Features
from robot.vision.ground_points import SeenPoints

LIMITS = GroundLimits(step_height=0.03, body_height=0.35)


def judged(metres, sigma=0.001, corner=True, before=True, drop=0.3):
    """Whether one feature at such a height stands, and whether it falls."""
    seen = SeenPoints(np.array([[1.0, 0.0, -drop]]), np.ones(1), np.array([sigma]), np.array([before]))
    features = Features(np.zeros((1, 2)), np.zeros((1, 2)), seen, np.array([corner]))
    heights = ground._Heights(np.array([metres]), np.array([sigma]))
    return bool(ground._standing(features, heights, LIMITS)[0]), bool(
        ground._falling(features, heights, LIMITS)[0]
    )


def test_half_a_step_up_or_down_counts() -> None:
    assert judged(0.016) == (True, False)
    assert judged(-0.016) == (False, True)
    assert judged(0.014) == judged(-0.014) == (False, False)


def test_what_hangs_above_the_body_is_free() -> None:
    assert judged(0.34) == (True, False)
    assert judged(0.36) == (False, False)


@pytest.mark.parametrize("metres", [0.05, -0.05])
def test_three_standard_deviations_are_asked_for(metres: float) -> None:
    assert any(judged(metres, sigma=0.016))
    assert not any(judged(metres, sigma=0.017))


def test_only_corners_and_steep_rays_tell_of_a_drop() -> None:
    assert judged(-0.1, corner=False) == (False, False)
    assert judged(0.1, corner=False) == (True, False)
    assert judged(-0.1, drop=0.06) == (False, True)
    assert judged(-0.1, drop=0.04) == (False, False)


def test_rays_that_never_meet_tell_nothing() -> None:
    assert judged(0.1, before=False) == judged(-0.1, before=False) == (False, False)


def test_what_does_not_lead_back_is_no_obstacle(monkeypatch: pytest.MonkeyPatch) -> None:
    pair = look(Room((Block(0.8, 0.0, 0.2, 0.5, 0.06, seed=2),), contrast=0.7), samples=1)
    assert len(find_obstacles(pair.left, pair.right, RIG, MOUNT, 0.0, TILT).points) >= 5
    monkeypatch.setattr(
        ground, "leading_back", lambda scene, features, *_: np.zeros(len(features.left), np.bool_)
    )
    assert not len(find_obstacles(pair.left, pair.right, RIG, MOUNT, 0.0, TILT).points)


def test_nothing_is_told_beyond_the_range_to_the_sides_either() -> None:
    pair = look(Room((Block(0.85, 0.0, 0.1, 1.6, 0.3, seed=4),)), samples=1)
    away = []
    for reach in (2.0, 0.85):
        found = find_obstacles(pair.left, pair.right, RIG, MOUNT, 0.0, TILT, GroundLimits(max_range=reach))
        away.append(np.hypot(found.points[:, 0], found.points[:, 1]))
    assert (away[0] > 0.85).sum() >= 5
    assert len(away[1]) >= 5
    assert (away[1] < 0.85).all()
