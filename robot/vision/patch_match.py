"""One patch of the left picture found again in the right one, to a small part of a pixel, with honest doubt.

Two steps. `find` tries whole-pixel shifts along the row by normalised correlation, and refuses rivals and
matches that do not lead back. `refine` fits a slanted, bent patch of disparity, gain and a small skew of rows
to the grey values by weighted least squares on a cubic spline (no pixel locking, as a parabola over scores
has it; the bend keeps upright edges and round cups from reading too far).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, spline_filter

Grey = NDArray[np.float32]
Array = NDArray[np.float64]

LEAST_HALF_PX = 4
"""A patch smaller than this to either side holds too little to be told from others."""
LEAST_CORRELATION = 0.55
RIVAL_MARGIN = 0.06
"""So much worse any other place along the row must match."""
ROW_SKEW_PX = 1
"""Rows the right eye may be off by, up or down."""
PRIOR_SIGMA = np.array([1e6, 0.12, 0.12, 0.03, 0.25])
"""Known beforehand: nothing of the shift; slopes and bend (px per px), row skew (px)."""
NOISE_CORRELATION = 1.5
"""Residuals of neighbouring pixels are alike (lens blur, interpolation): sigma grows by this factor."""
SIGMA_FLOOR_PX = 0.025
"""What no fit can know: left-over calibration error, the spline's own error."""
INNER_SHARE = 0.55
"""Edge of the inner patch whose word is set against the whole one's."""
CLEARLY_APART, DISAGREEMENT_SHARE = 3.0, 0.5
"""Sigmas from which two fits mean two surfaces; share of their difference that is added to sigma."""
BEND_SHARE = 0.1
"""Share of the fitted bend that may be shape the fit cannot follow."""
ITERATIONS, SETTLED_PX, LARGEST_CORRECTION_PX = 6, 2e-3, 1.5


@dataclass(frozen=True, slots=True)
class Patch:
    """A rectangle of pixels: whole-pixel middle (u, v), half sizes; u_true, v_true the exact middle."""

    u: int
    v: int
    half_u: int
    half_v: int
    u_true: float
    v_true: float


@dataclass(frozen=True, slots=True)
class Place:
    """Where a patch was found: column difference u_l - u_r, rows further down, correlation -1..1."""

    shift: int
    lower: int
    correlation: float


@dataclass(frozen=True, slots=True)
class Fit:
    """Column difference u_l - u_r at the patch's exact middle and its standard deviation, px."""

    shift: float
    sigma: float
    correlation: float


def patch_at(u: float, v: float, half_u: float, half_v: float, width: int, height: int) -> Patch | None:
    """The patch about (u, v), shrunk alike on both sides to stay inside a width x height picture.

    None if that leaves less than `LEAST_HALF_PX`.

    >>> patch_at(20.4, 30.0, 8.0, 6.0, 100, 100)
    Patch(u=20, v=30, half_u=8, half_v=6, u_true=20.4, v_true=30.0)
    """
    if not (0 <= u < width and 0 <= v < height):
        return None
    column, row = min(round(u), width - 1), min(round(v), height - 1)
    room_u = min(column, width - 1 - column)
    room_v = min(row, height - 1 - row) - ROW_SKEW_PX
    half = min(round(half_u), room_u), min(round(half_v), room_v)
    return None if min(half) < LEAST_HALF_PX else Patch(column, row, *half, u, v)


def match(left: Grey, right: Grey, patch: Patch, shifts: tuple[int, int]) -> Fit | None:
    """Find the patch of `left` in `right` and measure its shift; None where there is doubt.

    left, right: (H, W) float32 grey of equal size. shifts: least and largest u_l - u_r to try, whole px.
    """
    place = find(left, right, patch, shifts)
    if place is None:
        return None
    whole = refine(left, right, patch, place)
    if whole is None:
        return None
    inner = refine(left, right, _inner(patch), replace(place, shift=round(whole.shift)))
    return whole if inner is None else _agreed(whole, inner)


# ------------------------------------------------------------------------------------- whole pixels


def find(left: Grey, right: Grey, patch: Patch, shifts: tuple[int, int]) -> Place | None:
    """The best whole-pixel place; None for a weak match, a rival, the search's rim or no way back."""
    there = _best_along_row(left, right, patch, (-shifts[1], -shifts[0]))
    if there is None:
        return None
    offset, lower, correlation = there
    back_patch = patch_at(patch.u + offset, patch.v, patch.half_u, patch.half_v, left.shape[1], left.shape[0])
    if back_patch is not None:
        back = _best_along_row(right, left, back_patch, shifts)
        if back is None or abs(back[0] + offset) > 1:
            return None
    return Place(-offset, lower, correlation)


def _best_along_row(
    source: Grey, target: Grey, patch: Patch, offsets: tuple[int, int]
) -> tuple[int, int, float] | None:
    """Column offset, row offset and correlation of source's patch in target, if the match is clear."""
    first = max(patch.u + offsets[0] - patch.half_u, 0)
    last = min(patch.u + offsets[1] + patch.half_u, target.shape[1] - 1)
    if last - first < 2 * patch.half_u + 4:
        return None
    rows = slice(patch.v - patch.half_v, patch.v + patch.half_v + 1)
    template = source[rows, patch.u - patch.half_u : patch.u + patch.half_u + 1]
    band = target[rows.start - ROW_SKEW_PX : rows.stop + ROW_SKEW_PX, first : last + 1]
    scores = cv2.matchTemplate(band, template, cv2.TM_CCOEFF_NORMED)
    by_column = scores.max(axis=0)
    best = int(by_column.argmax())
    if not _clear(by_column, best):
        return None
    lower = int(scores[:, best].argmax()) - ROW_SKEW_PX
    return first + best + patch.half_u - patch.u, lower, float(by_column[best])


def _clear(scores: NDArray[np.float32], best: int) -> bool:
    """True if the peak is high, inside the search, and no other place comes near it."""
    peak = float(scores[best])
    if not LEAST_CORRELATION <= peak <= 1.001 or best in (0, len(scores) - 1):
        return False
    low = high = best
    while low > 0 and scores[low - 1] < scores[low]:
        low -= 1
    while high < len(scores) - 1 and scores[high + 1] < scores[high]:
        high += 1
    others = np.concatenate([scores[:low], scores[high + 1 :]])
    return not len(others) or float(others.max()) < peak - RIVAL_MARGIN


# -------------------------------------------------------------------------------- parts of a pixel


def refine(left: Grey, right: Grey, patch: Patch, place: Place) -> Fit | None:
    """Least squares about `place`: shift, its slopes along u and v, its bend along u, row skew, gain, offset.

    Gauss-Newton with the left patch's own gradient (inverse-compositional, Baker & Matthews 2004).
    None if the patch is flat or the fit runs away.
    """
    x, y, template = _samples(left, patch)
    along_u, along_v = _gradients(left, patch)
    jacobian = np.column_stack([along_u, along_u * x, along_u * y, along_u * x * x / patch.half_u, -along_v])
    if not float(along_u @ along_u) > 0.0:
        return None
    nearness = np.exp(-0.5 * ((x / (0.6 * patch.half_u)) ** 2 + (y / (0.6 * patch.half_v)) ** 2))
    warp = _Warp(right, patch, place, x, y)
    start = np.array([float(place.shift), 0.0, 0.0, 0.0, float(place.lower)])
    parameters = start.copy()
    for _ in range(ITERATIONS):
        residual, _ = _residual(template, warp(parameters), nearness)
        weights, noise = _robust(residual, nearness)
        prior = (noise / PRIOR_SIGMA) ** 2
        weighted = jacobian * weights[:, None]
        normal = weighted.T @ jacobian + np.diag(prior)
        step = np.linalg.solve(normal, weighted.T @ residual + prior * (parameters - start))
        parameters = parameters - step
        if not abs(parameters[0] - place.shift) < LARGEST_CORRECTION_PX:
            return None
        if abs(step[0]) < SETTLED_PX:
            break
    inverse = np.linalg.inv(normal)
    spread = inverse @ (weighted.T @ weighted * noise**2 + np.diag(prior) * noise**2) @ inverse
    _, correlation = _residual(template, warp(parameters), nearness)
    unknown = np.hypot(SIGMA_FLOOR_PX, BEND_SHARE * parameters[3] * patch.half_u)
    sigma = float(np.hypot(NOISE_CORRELATION * np.sqrt(spread[0, 0]), unknown))
    return Fit(float(parameters[0]), sigma, correlation)


def _inner(patch: Patch) -> Patch:
    half_u, half_v = (max(round(INNER_SHARE * half), LEAST_HALF_PX) for half in (patch.half_u, patch.half_v))
    return replace(patch, half_u=half_u, half_v=half_v)


def _agreed(whole: Fit, inner: Fit) -> Fit:
    """One fit out of the whole patch's and that of its inner part; where they differ, doubt grows.

    The whole patch sees more texture; but where the two differ clearly the surface is not plane (an edge, a
    cup's curve), and the inner part is nearer to what stands in the middle.
    """
    apart = abs(whole.shift - inner.shift)
    chosen = inner if apart > CLEARLY_APART * inner.sigma else whole
    return Fit(chosen.shift, float(np.hypot(chosen.sigma, DISAGREEMENT_SHARE * apart)), chosen.correlation)


class _Warp:
    """The right patch where the parameters (shift, slope_u, slope_v, bend, lower) put it."""

    def __init__(self, right: Grey, patch: Patch, place: Place, x: Array, y: Array) -> None:
        column = patch.u - place.shift
        reach = patch.half_u + 8
        left, right_end = max(column - reach, 0), min(column + reach + 1, right.shape[1])
        top = max(patch.v - patch.half_v - 6, 0)
        self._spline = spline_filter(
            right[top : patch.v + patch.half_v + 7, left:right_end], order=3, mode="mirror"
        )
        self._x, self._y = x, y
        self._bent = x * x / patch.half_u
        self._u, self._v = patch.u_true - left + x, patch.v_true - top + y

    def __call__(self, parameters: Array) -> Array:
        shift, slope_u, slope_v, bend, lower = parameters
        columns = self._u - (shift + slope_u * self._x + slope_v * self._y + bend * self._bent)
        values: Array = map_coordinates(
            self._spline, (self._v + lower, columns), order=3, mode="mirror", prefilter=False
        )
        return values


def _samples(left: Grey, patch: Patch) -> tuple[Array, Array, Array]:
    """Offsets x, y of the patch's pixels from its exact middle, and their grey values."""
    window = _window(left, patch).astype(np.float64)
    v, u = np.mgrid[-patch.half_v : patch.half_v + 1, -patch.half_u : patch.half_u + 1].astype(np.float64)
    return (u + patch.u - patch.u_true).ravel(), (v + patch.v - patch.v_true).ravel(), window.ravel()


def _gradients(left: Grey, patch: Patch) -> tuple[Array, Array]:
    """Grey levels per pixel along u and v at the patch's pixels."""
    window = _window(left, patch).astype(np.float64)
    along_v, along_u = np.gradient(window)
    return along_u.ravel(), along_v.ravel()


def _window(image: Grey, patch: Patch) -> Grey:
    return image[
        patch.v - patch.half_v : patch.v + patch.half_v + 1,
        patch.u - patch.half_u : patch.u + patch.half_u + 1,
    ]


def _residual(template: Array, warped: Array, weights: Array) -> tuple[Array, float]:
    """Template less warped patch, gain and offset taken out; and their weighted correlation."""
    total = weights.sum()
    t = template - weights @ template / total
    w = warped - weights @ warped / total
    own, cross, other = weights @ (t * t), weights @ (t * w), weights @ (w * w)
    if own <= 0.0 or other <= 0.0:
        return t - w, 0.0
    gain = float(np.clip(np.sqrt(own / other), 0.5, 2.0))
    return t - gain * w, float(cross / np.sqrt(own * other))


def _robust(residual: Array, nearness: Array) -> tuple[Array, float]:
    """Weights that trust neither far nor odd pixels (Huber), and the residuals' standard deviation."""
    near = nearness > 0.3
    noise = max(1.4826 * float(np.median(np.abs(residual[near]))), 0.3)
    odd = np.maximum(np.abs(residual) / (1.345 * noise), 1.0)
    return nearness / odd, noise
