"""A floor nobody told of is found as it lies, through noise and things on it, or said not to be there."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib.model import StereoRig
from robot.vision.disparity import Disparity
from robot.vision.found_floor import find_floor

RIG = StereoRig.parallel(176, 144, 152.0, 0.06)


def floor_map(height, tilt, roll=0.0, rig=RIG):
    """Disparities (H, W) of a floor, by the depth at which each ray meets it."""
    normal = np.array([math.sin(roll), math.cos(roll) * math.cos(tilt), math.cos(roll) * math.sin(tilt)])
    u, v = np.meshgrid(np.arange(rig.left.width), np.arange(rig.left.height))
    rays = np.stack(
        [(u - rig.left.cx) / rig.left.fx, (v - rig.left.cy) / rig.left.fy, np.ones(u.shape)], axis=-1
    )
    with np.errstate(divide="ignore"):
        depth = height / (rays @ normal)
    return rig.left.fx * rig.baseline / np.where(depth > 0.0, depth, np.inf) - rig.doffs


def as_map(values, valid=None, sigma=0.1):
    return Disparity(
        values.astype(np.float32),
        (values > 0.5) if valid is None else valid,
        np.full(values.shape, sigma, np.float32),
    )


@settings(max_examples=15, deadline=None, derandomize=True)
@given(st.floats(0.1, 1.2), st.floats(0.1, 1.1), st.floats(-0.15, 0.15))
def test_the_pose_of_an_exact_floor(height: float, tilt: float, roll: float) -> None:
    found = find_floor(as_map(floor_map(height, tilt, roll)), RIG)
    assert found is not None
    assert found.height == pytest.approx(height, rel=0.01)
    assert found.tilt == pytest.approx(tilt, abs=0.005)
    assert found.roll == pytest.approx(roll, abs=0.005)


def test_other_principal_points_are_taken_in() -> None:
    rig = StereoRig.parallel(176, 144, 152.0, 0.06, doffs=4.0)
    found = find_floor(as_map(floor_map(0.25, 0.4, rig=rig), np.ones((144, 176), np.bool_)), rig)
    assert found is not None
    assert found.height == pytest.approx(0.25, rel=0.01)


@pytest.mark.parametrize("share", [0.3, 0.55])
def test_noise_and_things_on_it_do_not_pull(share: float) -> None:
    rng = np.random.default_rng(3)
    values = floor_map(0.25, 0.35) + rng.normal(0.0, 0.15, (144, 176))
    thing = rng.random((144, 176)) < share
    values = np.where(thing, values + rng.uniform(3.0, 20.0, thing.shape), values)
    found = find_floor(as_map(values), RIG)
    assert found is not None
    assert found.height == pytest.approx(0.25, rel=0.03)
    assert found.tilt == pytest.approx(0.35, abs=0.02)


def test_the_same_map_gives_the_same_floor() -> None:
    values = floor_map(0.25, 0.35) + np.random.default_rng(4).normal(0.0, 0.2, (144, 176))
    assert find_floor(as_map(values), RIG) == find_floor(as_map(values), RIG)


def test_no_floor_is_none() -> None:
    rng = np.random.default_rng(5)
    wall = np.full((144, 176), 12.0)
    nothing = np.zeros((144, 176), np.bool_)
    few = rng.random((144, 176)) < 0.03
    ceiling = floor_map(0.25, 0.35)[::-1, ::-1]
    assert find_floor(as_map(wall), RIG) is None
    assert find_floor(as_map(wall, nothing), RIG) is None
    assert find_floor(as_map(floor_map(0.25, 0.35), few), RIG) is None, "too little of it is measured"
    assert find_floor(as_map(ceiling), RIG) is None
    assert find_floor(as_map(rng.uniform(1.0, 40.0, (144, 176))), RIG) is None
    assert find_floor(as_map(floor_map(0.25, 0.35, roll=0.3)), RIG) is None, "no floor is rolled so far"
    assert find_floor(as_map(floor_map(4.0, 0.9), np.ones((144, 176), np.bool_)), RIG) is None, "too low"


def test_what_is_not_measured_does_not_count() -> None:
    values = floor_map(0.25, 0.35)
    valid = values > 0.5
    valid[:, ::2] = False
    values[:, ::2] = 50.0
    found = find_floor(as_map(values, valid), RIG)
    assert found is not None
    assert found.height == pytest.approx(0.25, rel=0.01)


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (3, 2)])
def test_tiny_maps_hold_no_floor(size: tuple[int, int]) -> None:
    rig = StereoRig.parallel(*size, 152.0, 0.06)
    assert find_floor(as_map(np.full(size[::-1], 5.0)), rig) is None


def test_a_map_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match="4x3, the rig 176x144"):
        find_floor(as_map(np.ones((3, 4))), RIG)
