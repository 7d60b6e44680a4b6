"""Distance from two parallel cameras: the signed formula in use, and [W]'s under their own names.

[W]: J. Wu, V. Snasel, A Vision-based Navigation System of Mobile Tracking Robot, IEEE SMC 2010. f is the
focal length, B the distance between the cameras; distances come out in the unit of B, offsets are in the
unit of f.

The unsigned forms and the six error formulas are here to reproduce [W]'s figures. They are never used to
correct a range: the focal terms are exact, the toe-in terms are first order only, and their 2 f tan a aside
the axes has no geometric counterpart. `toed_in_offset` and `range_toed_in` are the exact correction.
"""

from __future__ import annotations

import math

MAX_TOE_IN = math.radians(45.0)
"""Beyond this two cameras no longer look the same way, and f tan a loses its meaning."""


class RangeError(ValueError):
    """These measurements have no distance; the words say why."""


# --------------------------------------------------------------------------------------------- in use


def depth(f: float, baseline: float, disparity: float) -> float:
    """D = f B / d with d = u_l - u_r, both from their principal points and positive to the right.

    Raises RangeError for d <= 0: such rays never meet before the cameras.

    >>> round(depth(305.0, 0.06, 6.1), 6)
    3.0
    """
    if not disparity > 0.0:
        raise RangeError(f"disparity {disparity:g} px: the rays do not meet before the cameras")
    return f * baseline / disparity


def depth_sigma(f: float, baseline: float, distance: float, disparity_sigma: float) -> float:
    """sigma_D = D^2 sigma_d / (f B), first order.

    >>> round(depth_sigma(305.0, 0.06, 3.0, 0.18), 4)  # 3 % at 3 m takes 0.18 px
    0.0885
    """
    return distance * distance * disparity_sigma / (f * baseline)


def farthest(f: float, baseline: float) -> float:
    """D_max: the distance of a displacement of one pixel, f B.

    >>> round(farthest(305.0, 0.08), 6)
    24.4
    """
    return f * baseline


def toed_in_offset(f: float, f_right: float, u_right: float, toe_in: float) -> float:
    """Where an ideal right camera sees what one turned left by `toe_in` radians sees at u_right.

    u_ideal = f tan(atan(u_right / f_right) - a), offsets from the principal point, positive to the right; f
    of the ideal (left) camera, f_right of the real one. Exact in the plane of the axes. Raises RangeError
    where the turned ray lies 90 degrees or more from the ideal axis.

    >>> toed_in_offset(305.0, 305.0, 0.0, 0.0)
    0.0
    """
    angle = math.atan(u_right / f_right) - toe_in
    if not abs(angle) < math.pi / 2:
        raise RangeError(
            f"the right ray points {math.degrees(angle):.0f} degrees off the axis: no ideal camera sees it"
        )
    return f * math.tan(angle)


def range_toed_in(
    f: float, baseline: float, u_left: float, u_right: float, toe_in: float, f_right: float | None = None
) -> float:
    """The true distance of a pair whose right camera is turned left by `toe_in` radians.

    u_left, u_right: measured offsets, positive to the right. Raises RangeError, with the reason, where the
    pair as measured has a naive disparity <= 0 (from about 5 degrees on: a small error of `toe_in` would
    then mean any distance) or the corrected rays do not meet.

    >>> one = math.radians(1.0)
    >>> u_right = 305.0 * math.tan(one - math.atan(0.08))  # straight ahead of the left camera, 1 m
    >>> round(range_toed_in(305.0, 0.08, 0.0, u_right, one), 6), round(-305.0 * 0.08 / u_right, 2)
    (1.0, 1.28)
    """
    if not abs(toe_in) <= MAX_TOE_IN:
        raise RangeError(
            f"toe-in of {math.degrees(toe_in):.1f} degrees: not two cameras side by side; mount them anew"
        )
    if not u_left > u_right:
        raise RangeError(
            f"toe-in of {math.degrees(toe_in):.1f} degrees turns the disparity to {u_left - u_right:.1f} px: "
            "too little is left to measure by; turn the cameras parallel"
        )
    return depth(f, baseline, u_left - toed_in_offset(f, f if f_right is None else f_right, u_right, toe_in))


# ----------------------------------------------------------- [W]'s three forms, offsets as magnitudes


def distance_between(f: float, baseline: float, x_left: float, x_right: float) -> float:
    """[W]: target between the two axes, D = f B / (x_l + x_r)."""
    return depth(f, baseline, x_left + x_right)


def distance_left_of_axes(f: float, baseline: float, x_left: float, x_right: float) -> float:
    """[W]: target left of the left axis, D = f B / (x_r - x_l)."""
    return depth(f, baseline, x_right - x_left)


def distance_right_of_axes(f: float, baseline: float, x_left: float, x_right: float) -> float:
    """[W]: target right of the right axis, D = f B / (x_l - x_r)."""
    return depth(f, baseline, x_left - x_right)


# ------------------------------------- [W]'s six errors: real minus measured, x are the measured offsets


def toe_in_error_between(f: float, baseline: float, x_left: float, x_right: float, toe_in: float) -> float:
    """[W]: f (B - f tan a)/(x_l + x_r + f tan a) - f B/(x_l + x_r); toe_in in radians."""
    turn = f * math.tan(toe_in)
    return f * (baseline - turn) / (x_left + x_right + turn) - distance_between(f, baseline, x_left, x_right)


def toe_in_error_left_of_axes(
    f: float, baseline: float, x_left: float, x_right: float, toe_in: float
) -> float:
    """[W]: f (B - f tan a)/(x_r - x_l + 2 f tan a) - f B/(x_r - x_l); toe_in in radians."""
    turn = f * math.tan(toe_in)
    measured = distance_left_of_axes(f, baseline, x_left, x_right)
    return f * (baseline - turn) / (x_right - x_left + 2 * turn) - measured


def toe_in_error_right_of_axes(
    f: float, baseline: float, x_left: float, x_right: float, toe_in: float
) -> float:
    """[W]: f (B - f tan a)/(x_l - x_r + 2 f tan a) - f B/(x_l - x_r); toe_in in radians."""
    turn = f * math.tan(toe_in)
    measured = distance_right_of_axes(f, baseline, x_left, x_right)
    return f * (baseline - turn) / (x_left - x_right + 2 * turn) - measured


def focal_error_between(f: float, baseline: float, x_left: float, x_right: float, f_right: float) -> float:
    """[W]: f' f B/(f' x_l + f x_r) - f B/(x_l + x_r); f_right is f'."""
    real = depth(f_right * f, baseline, f_right * x_left + f * x_right)
    return real - distance_between(f, baseline, x_left, x_right)


def focal_error_left_of_axes(
    f: float, baseline: float, x_left: float, x_right: float, f_right: float
) -> float:
    """[W]: f' f B/(f x_r - f' x_l) - f B/(x_r - x_l); f_right is f'."""
    real = depth(f_right * f, baseline, f * x_right - f_right * x_left)
    return real - distance_left_of_axes(f, baseline, x_left, x_right)


def focal_error_right_of_axes(
    f: float, baseline: float, x_left: float, x_right: float, f_right: float
) -> float:
    """[W]: f' f B/(f' x_l - f x_r) - f B/(x_l - x_r); f_right is f'."""
    real = depth(f_right * f, baseline, f_right * x_left - f * x_right)
    return real - distance_right_of_axes(f, baseline, x_left, x_right)
