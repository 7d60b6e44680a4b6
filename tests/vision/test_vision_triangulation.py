"""Signed triangulation, [W]'s published forms with the signs of their figures, exact toe-in correction."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.vision import triangulation as t

F, B = 4.0, 8.0  # [W]'s figures: both in cm, pixel numbers put straight into x
TOE_INS = [math.radians(a) for a in (5, 10, 15, 20)]
# [W] does not say how a displacement n splits between the eyes: half each between, one of them 0 aside.
SPLITS = {
    "between": lambda n: (n / 2, n / 2),
    "left": lambda n: (0.0, n),
    "right": lambda n: (n, 0.0),
}
TOE_IN = {
    "between": t.toe_in_error_between,
    "left": t.toe_in_error_left_of_axes,
    "right": t.toe_in_error_right_of_axes,
}
FOCAL = {
    "between": t.focal_error_between,
    "left": t.focal_error_left_of_axes,
    "right": t.focal_error_right_of_axes,
}


@given(
    x=st.floats(-2.0, 2.0), z=st.floats(0.3, 20.0), f=st.floats(100.0, 2000.0), baseline=st.floats(0.02, 0.5)
)
@settings(deadline=None, max_examples=60)
def test_signed_triangulation_finds_any_point(x: float, z: float, f: float, baseline: float) -> None:
    u_left, u_right = f * x / z, f * (x - baseline) / z
    assert t.depth(f, baseline, u_left - u_right) == pytest.approx(z, rel=1e-6)


@given(x=st.floats(-2.0, 2.0), z=st.floats(0.3, 20.0))
@settings(deadline=None, max_examples=60)
def test_the_unsigned_form_of_each_side_agrees_with_the_signed_one(x: float, z: float) -> None:
    u_left, u_right = 305 * x / z, 305 * (x - 0.06) / z
    magnitudes = abs(u_left), abs(u_right)
    if x < 0:
        distance = t.distance_left_of_axes(305, 0.06, *magnitudes)
    elif x > 0.06:
        distance = t.distance_right_of_axes(305, 0.06, *magnitudes)
    else:
        distance = t.distance_between(305, 0.06, *magnitudes)
    assert distance == pytest.approx(z, rel=1e-6)


@pytest.mark.parametrize("disparity", [0.0, -3.0, math.nan])
def test_rays_that_never_meet_have_no_range(disparity: float) -> None:
    with pytest.raises(t.RangeError, match="do not meet"):
        t.depth(305.0, 0.06, disparity)


def test_sigma_is_the_derivative_of_the_distance() -> None:
    d, step = 6.1, 1e-5
    slope = (t.depth(305, 0.06, d + step) - t.depth(305, 0.06, d - step)) / (2 * step)
    assert t.depth_sigma(305, 0.06, t.depth(305, 0.06, d), 0.18) == pytest.approx(0.18 * abs(slope), rel=1e-6)


def test_three_percent_at_three_metres_takes_018_px_at_60_mm_and_012_px_at_40_mm() -> None:
    assert t.depth_sigma(305, 0.06, 3.0, 0.18) / 3.0 == pytest.approx(0.03, abs=0.001)
    assert t.depth_sigma(305, 0.04, 3.0, 0.12) / 3.0 == pytest.approx(0.03, abs=0.001)


def test_farthest_distance_is_that_of_one_pixel() -> None:
    assert t.farthest(305.0, 0.06) == pytest.approx(t.depth(305.0, 0.06, 1.0))


@pytest.mark.parametrize("where", SPLITS)
@pytest.mark.parametrize("toe_in", TOE_INS)
def test_toe_in_errors_are_negative_and_grow_with_the_angle(where: str, toe_in: float) -> None:
    n = np.linspace(40, 100, 25)
    errors = [TOE_IN[where](F, B, *SPLITS[where](x), toe_in) for x in n]
    more = [TOE_IN[where](F, B, *SPLITS[where](x), toe_in + math.radians(5)) for x in n]
    assert max(errors) < 0
    assert all(b < a for a, b in zip(errors, more, strict=True))
    assert all(b > a for a, b in pairwise(errors)), "larger displacement, smaller error"


@pytest.mark.parametrize("where", SPLITS)
@pytest.mark.parametrize("f_right", [5.0, 6.0])
def test_a_longer_right_lens_gives_positive_errors(where: str, f_right: float) -> None:
    errors = [FOCAL[where](F, B, *SPLITS[where](n), f_right) for n in range(1, 121)]
    # x_l = 0 puts f' out of the left form's divisor; then f' f B/(f x_r) - f B/x_r = (f'/f - 1) D, still > 0.
    # Right of the axes with x_r = 0 the two terms are equal: f' f B/(f' x_l) = f B/x_l.
    assert min(errors) >= -1e-12
    if where != "right":
        assert min(errors) > 0


def test_one_value_of_each_published_error_by_hand() -> None:
    turn = 4 * math.tan(math.radians(10))
    between = 4 * (8 - turn) / (60 + turn) - 32 / 60
    aside = 4 * (8 - turn) / (60 + 2 * turn) - 32 / 60
    assert t.toe_in_error_between(4, 8, 20, 40, math.radians(10)) == pytest.approx(between)
    assert t.toe_in_error_left_of_axes(4, 8, 10, 70, math.radians(10)) == pytest.approx(aside)
    assert t.toe_in_error_right_of_axes(4, 8, 70, 10, math.radians(10)) == pytest.approx(aside)
    assert t.focal_error_between(4, 8, 20, 40, 5) == pytest.approx(160 / (100 + 160) - 32 / 60)
    assert t.focal_error_left_of_axes(4, 8, 10, 70, 5) == pytest.approx(160 / (280 - 50) - 32 / 60)
    assert t.focal_error_right_of_axes(4, 8, 70, 10, 5) == pytest.approx(160 / (350 - 40) - 32 / 60)


@pytest.mark.parametrize("toe_in", TOE_INS)
@pytest.mark.parametrize("n", [40, 60, 80, 100])
def test_the_error_is_smaller_between_the_axes_than_aside(toe_in: float, n: float) -> None:
    size = {where: abs(TOE_IN[where](F, B, *SPLITS[where](n), toe_in)) for where in SPLITS}
    assert size["between"] < size["left"]
    assert size["between"] < size["right"]


@pytest.mark.parametrize(
    ("baseline", "n", "expected"), [(8, 1, 32.0), (16, 1, 64.0), (24, 1, 96.0), (24, 400, 0.24)]
)
def test_the_distance_curves_pass_their_published_points(baseline: float, n: float, expected: float) -> None:
    assert t.distance_between(F, baseline, n / 2, n / 2) == pytest.approx(expected)


def measured(
    x: float, z: float, f: float, f_right: float, baseline: float, toe_in: float
) -> tuple[float, float]:
    """Offsets a point gives in a left camera and in a right one turned left by toe_in."""
    return f * x / z, f_right * math.tan(math.atan((x - baseline) / z) + toe_in)


@given(x=st.floats(-0.3, 0.3), z=st.floats(0.4, 3.0), degrees=st.floats(-5.0, 0.9), ratio=st.floats(0.9, 1.1))
@settings(deadline=None, max_examples=60)
def test_the_exact_correction_undoes_toe_in_and_another_lens(
    x: float, z: float, degrees: float, ratio: float
) -> None:
    u_left, u_right = measured(x, z, 305.0, 305.0 * ratio, 0.08, math.radians(degrees))
    if u_left - u_right < 0.5:
        return
    found = t.range_toed_in(305.0, 0.08, u_left, u_right, math.radians(degrees), 305.0 * ratio)
    assert found == pytest.approx(z, rel=1e-6)


def test_one_degree_makes_one_metre_read_128() -> None:
    u_left, u_right = measured(0.0, 1.0, 305.0, 305.0, 0.08, math.radians(1.0))
    assert t.depth(305.0, 0.08, u_left - u_right) == pytest.approx(1.28, abs=0.005)
    assert t.range_toed_in(305.0, 0.08, u_left, u_right, math.radians(1.0)) == pytest.approx(1.0)


@pytest.mark.parametrize("degrees", [5.0, 10.0, 20.0])
def test_from_five_degrees_on_the_range_is_refused_with_the_reason(degrees: float) -> None:
    u_left, u_right = measured(0.0, 1.0, 305.0, 305.0, 0.08, math.radians(degrees))
    with pytest.raises(t.RangeError, match="turn the cameras parallel"):
        t.range_toed_in(305.0, 0.08, u_left, u_right, math.radians(degrees))


def test_no_correction_for_what_is_no_pair() -> None:
    with pytest.raises(t.RangeError, match="not two cameras side by side"):
        t.range_toed_in(305.0, 0.08, 10.0, -10.0, math.radians(60.0))
    with pytest.raises(t.RangeError, match="no ideal camera"):
        t.toed_in_offset(305.0, 305.0, 1e9, -0.1)
