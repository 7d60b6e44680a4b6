"""The small rigid motion behind moved points: exact, robust against what moves by itself, honest."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib.model import HeadMount
from robot.vision.rigid_fit import Sight, explained, fit, residuals, rotation_of, vector_of

SIGMA_PX = 0.3
ANGLE = st.floats(-0.15, 0.15)
LENGTH = st.floats(-0.08, 0.08)


def sight(pan: float = 0.0, tilt: float = 0.35) -> Sight:
    rotation, position = HeadMount().left_eye(pan, tilt)
    return Sight(305.0, 305.0, 175.5, 143.5, rotation, position)


def cloud(eye: Sight, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points 0.4-4 m before the eye, all over its picture, in the body's frame."""
    depth = rng.uniform(0.4, 4.0, count)
    rays = np.column_stack([rng.uniform(-0.5, 0.5, count), rng.uniform(-0.4, 0.4, count), np.ones(count)])
    return (rays * depth[:, None]) @ eye.rotation.T + eye.position


def seen_after(points: np.ndarray, motion: np.ndarray, eye: Sight) -> np.ndarray:
    """Where the points are in the picture once the body has made this motion: written out by hand."""
    roll, pitch, yaw = motion[3:]
    angle = math.sqrt(roll**2 + pitch**2 + yaw**2)
    axis = np.array([roll, pitch, yaw]) / angle if angle else np.array([0.0, 0.0, 1.0])
    back = []
    for point in points - motion[:3]:
        # Rodrigues, turned the other way: the body turned, so the world turns back.
        back.append(
            point * math.cos(angle)
            - np.cross(axis, point) * math.sin(angle)
            + axis * (axis @ point) * (1 - math.cos(angle))
        )
    camera = (np.array(back) - eye.position) @ eye.rotation
    return np.column_stack(
        [
            eye.cx + eye.fx * camera[:, 0] / camera[:, 2],
            eye.cy + eye.fy * camera[:, 1] / camera[:, 2],
        ]
    )


@settings(deadline=None, max_examples=25)
@given(st.tuples(LENGTH, LENGTH, LENGTH, ANGLE, ANGLE, ANGLE), st.floats(-1.0, 1.0))
def test_a_motion_is_found_exactly(motion: tuple[float, ...], pan: float) -> None:
    eye = sight(pan)
    points = cloud(eye, 60, np.random.default_rng(1))
    found = fit(points, seen_after(points, np.array(motion), eye), eye, SIGMA_PX)
    assert found.motion == pytest.approx(np.array(motion), abs=1e-5)
    assert float(found.residuals.max()) < 1e-3


def test_a_third_of_the_points_moving_by_itself_changes_nothing() -> None:
    eye, rng = sight(), np.random.default_rng(2)
    truth = np.array([0.03, -0.02, 0.04, 0.02, -0.03, 0.05])
    points = cloud(eye, 90, rng)
    pixels = seen_after(points, truth, eye) + rng.normal(0.0, SIGMA_PX, (90, 2))
    pixels[:30] += (14.0, 3.0)  # a thing that walks by
    found = fit(points, pixels, eye, SIGMA_PX)
    assert found.motion == pytest.approx(truth, abs=0.004)
    assert (found.residuals[30:] < 4 * SIGMA_PX).mean() > 0.95
    assert (found.residuals[:30] > 4 * SIGMA_PX).all()


def test_the_covariance_tells_the_error() -> None:
    eye, rng = sight(), np.random.default_rng(3)
    squares = []
    for _ in range(80):
        points = cloud(eye, 60, rng)
        truth = rng.normal(0.0, 0.02, 6)
        pixels = seen_after(points, truth, eye) + rng.normal(0.0, SIGMA_PX, (60, 2))
        found = fit(points, pixels, eye, SIGMA_PX)
        error = found.motion - truth
        squares.append(float(error @ np.linalg.solve(found.covariance, error)))
    assert 4.0 < np.mean(squares) < 8.0, "six unknowns: the mean square distance is six"


def test_a_point_the_prediction_explains_is_told_from_one_it_does_not() -> None:
    eye, rng = sight(), np.random.default_rng(4)
    points = cloud(eye, 40, rng)
    doubt = np.diag(np.array([0.004, 0.004, 0.004, 0.005, 0.005, 0.005]) ** 2)
    small = explained(points, seen_after(points, np.full(6, 0.002), eye), eye, doubt, SIGMA_PX)
    assert (small < 3.0).all()
    lifted = np.array([0.0, 0.0, 0.06, 0.0, 0.0, 0.0])
    near = np.linalg.norm(points - eye.position, axis=1) < 1.5
    assert (explained(points, seen_after(points, lifted, eye), eye, doubt, SIGMA_PX)[near] > 3.0).all()


def test_residuals_are_seen_minus_predicted() -> None:
    eye = sight()
    points = cloud(eye, 10, np.random.default_rng(5))
    pixels = seen_after(points, np.zeros(6), eye)
    aside = np.array([2.0, -1.0])
    assert residuals(points, pixels + aside, eye) == pytest.approx(np.tile([2.0, -1.0], (10, 1)))


@settings(deadline=None, max_examples=30)
@given(st.tuples(*[st.floats(-1.5, 1.5)] * 3))
def test_rotations_and_their_vectors_are_each_others_inverse(vector: tuple[float, float, float]) -> None:
    rotation = rotation_of(np.array(vector))
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
    assert vector_of(rotation) == pytest.approx(np.array(vector), abs=1e-9)


def test_too_few_points_are_refused() -> None:
    with pytest.raises(ValueError, match="6 points"):
        fit(np.zeros((5, 3)), np.zeros((5, 2)), sight(), SIGMA_PX)
