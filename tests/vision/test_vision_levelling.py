"""The plane through measured heights: a tipped floor is followed, a low step and noise are not."""

import math

import numpy as np
import pytest

from robot.vision.levelling import REST_SIGMA, FloorLevel, floor_plane


def floor(ahead=0.0, aside=0.0, lift=0.0, noise=0.003, count=4000, seed=0):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0.4, 2.0, count), rng.uniform(-0.6, 0.6, count)
    height = lift + ahead * x + aside * y + rng.normal(0.0, noise, count)
    return (
        x.astype(np.float32),
        y.astype(np.float32),
        height.astype(np.float32),
        np.full(count, noise, np.float32),
    )


def off(plane, true, x=1.0, y=0.3):
    return FloorLevel(*plane).at(x, y) - FloorLevel(*true).at(x, y)


@pytest.mark.parametrize("true", [(0.0, 0.0, 0.0), (0.004, 0.008, -0.004), (-0.003, -0.009, 0.005)])
def test_a_tipped_floor_is_followed(true) -> None:
    plane = floor_plane(*floor(true[1], true[2], true[0]))
    assert abs(off(plane, true)) < 0.002
    assert abs(off(plane, true, 1.6, -0.4)) < 0.004


@pytest.mark.parametrize("step", [0.05, 0.058, 0.2])
def test_what_stands_on_it_does_not_lift_it(step: float) -> None:
    x, y, height, sigma = floor(0.004)
    height = np.where(x > 1.0, height + np.float32(step), height)
    plane = floor_plane(x, y, height, sigma)
    assert abs(off(plane, (0.0, 0.004, 0.0), 0.8, 0.0)) < 0.002


def test_nor_does_a_low_step_beyond_the_near_floor() -> None:
    x, y, height, sigma = floor(0.004)
    height = np.where(x > 1.5, height + np.float32(0.03), height)
    assert abs(off(floor_plane(x, y, height, sigma), (0.0, 0.004, 0.0), 0.8, 0.0)) < 0.003


def test_high_things_do_not_lift_it_though_their_heights_are_vague() -> None:
    x, y, height, _ = floor()
    height[::3] = 0.1
    assert abs(off(floor_plane(x, y, height, np.full(len(x), 0.05, np.float32)), (0.0, 0.0, 0.0))) < 0.001


def test_too_little_is_the_nominal_floor() -> None:
    assert floor_plane(*(part[:59] for part in floor(0.01))).tolist() == [0.0, 0.0, 0.0]
    assert floor_plane(*(part[:0] for part in floor())).tolist() == [0.0, 0.0, 0.0]
    x, y, height, sigma = floor()
    assert floor_plane(x, y, height + np.float32(0.07), sigma).tolist() == [0.0, 0.0, 0.0], "no floor so high"
    assert floor_plane(*(part[:60] for part in floor(0.02)))[1] > 0.0


def test_vague_heights_leave_it_near_where_a_base_stands() -> None:
    x, y, height, _ = floor(math.radians(1.5), noise=0.001)
    sure = floor_plane(x, y, height, np.full(len(x), 0.001, np.float32))
    vague = floor_plane(x, y, height, np.full(len(x), 0.2, np.float32))
    assert abs(vague[1]) < 0.5 * abs(sure[1])
    assert sure[1] == pytest.approx(math.radians(1.5), abs=0.5 * REST_SIGMA[1])


def test_many_pixels_are_thinned_and_say_the_same() -> None:
    true = (0.002, 0.006, 0.0)
    many = floor_plane(*floor(true[1], true[2], true[0], count=40000))
    assert abs(off(many, true)) < 0.002
