"""The oracle of dense stereo: METHODS 7's equations written out plainly.

Every sum is a loop over the window's offsets; nothing is pooled, pruned, binned or skipped. Slow: for
pictures of about 64 x 48 and 16 disparities. It shares no code with the product.

`exact_match` is equations (1)-(3), (7), the left-right check and (8). `clustered_volume` is the
approximation by K clustered intensities, (4)-(6), at full resolution: the second reference, which says how
much of a fast form's error is the clustering's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

Volume = np.ndarray
"""(disparities, H, W) float64."""


@dataclass(frozen=True)
class Weights:
    """The parameters of (1)-(3). Intensities in grey levels 0..255; lengths in pixels.

    radius: the window is (2 radius + 1)^2, cut at the picture's border; (2)'s sum over all j is meant, so at
    least twice sigma_spatial.
    """

    alpha: float = 1 / 3
    t1: float = 10.0
    t2: float = 10.0
    sigma_spatial: float = 4.0
    sigma_range: float = 20.0
    radius: int = 8


# ------------------------------------------------------------------------------- (1) to (3), (7): exact


def gradient(grey: np.ndarray) -> np.ndarray:
    """Central difference along the row, the border column repeated outwards. (H, W) float64."""
    wide = np.pad(np.asarray(grey, np.float64), ((0, 0), (1, 1)), mode="edge")
    return (wide[:, 2:] - wide[:, :-2]) / 2


def matching_cost(left: np.ndarray, right: np.ndarray, disparities: int, weights: Weights) -> Volume:
    """(1): M(u, d). Where u - d is outside the right picture the cost is the largest there is."""
    left, right = np.asarray(left, np.float64), np.asarray(right, np.float64)
    slope_left, slope_right = gradient(left), gradient(right)
    volume = np.full(
        (disparities, *left.shape), weights.alpha * weights.t1 + (1 - weights.alpha) * weights.t2
    )
    width = left.shape[1]
    for d in range(min(disparities, width)):
        shade = np.abs(left[:, d:] - right[:, : width - d])
        slope = np.abs(slope_left[:, d:] - slope_right[:, : width - d])
        volume[d, :, d:] = weights.alpha * np.minimum(shade, weights.t1) + (1 - weights.alpha) * np.minimum(
            slope, weights.t2
        )
    return volume


def aggregate(volume: Volume, grey: np.ndarray, weights: Weights) -> Volume:
    """(2), (3): a volume's mean over each pixel's window, weighted by nearness and likeness to its centre."""
    return weighted_sum(volume, grey, weights) / weighted_sum(np.ones((1, *grey.shape)), grey, weights)


def weighted_sum(volume: Volume, grey: np.ndarray, weights: Weights) -> Volume:
    """sum_j W(i, j) volume(j), the numerator of (2)."""
    grey = np.asarray(grey, np.float64)
    total = np.zeros_like(volume, dtype=np.float64)
    for near, (here, there) in _offsets(grey.shape, weights):
        like = np.exp(-((grey[here] - grey[there]) ** 2) / (2 * weights.sigma_range**2))
        total[:, *here] += near * like * volume[:, *there]
    return total


def _offsets(
    shape: tuple[int, ...], weights: Weights
) -> Iterator[tuple[float, tuple[tuple[slice, slice], tuple[slice, slice]]]]:
    """Each offset of the window: its spatial weight, the slices of the pixels i and of their neighbours j."""
    height, width = shape
    for dv in range(-min(weights.radius, height - 1), min(weights.radius, height - 1) + 1):
        for du in range(-min(weights.radius, width - 1), min(weights.radius, width - 1) + 1):
            near = float(np.exp(-(du * du + dv * dv) / (2 * weights.sigma_spatial**2)))
            here = slice(max(0, -dv), height - max(0, dv)), slice(max(0, -du), width - max(0, du))
            there = slice(max(0, dv), height + min(0, dv)), slice(max(0, du), width + min(0, du))
            yield near, (here, there)


def winners(volume: Volume) -> np.ndarray:
    """(7): the disparity of least cost at each pixel, (H, W) int; the smaller one of equals."""
    return volume.argmin(axis=0)


def sub_pixel(volume: Volume, best: np.ndarray) -> np.ndarray:
    """The vertex of the parabola through the least cost and its neighbours; whole at the search's ends."""
    last = len(volume) - 1
    middle = np.clip(best, 1, max(last - 1, 0))
    if last < 2:
        return best.astype(np.float64)
    before, at, after = (np.take_along_axis(volume, (middle + k)[None], 0)[0] for k in (-1, 0, 1))
    bend = before - 2 * at + after
    inner = (best == middle) & (bend > 1e-12)
    return best + np.where(inner, (before - after) / np.where(bend > 1e-12, 2 * bend, 1.0), 0.0)


# ------------------------------------------------------------------------------ left-right check and (8)


@dataclass(frozen=True)
class Match:
    """What the oracle says of the left picture.

    volume: (2)'s C; best: (7), int; values: `best` with sub-pixel; stable: the right eye's own search
    agrees; refined: (8)'s argmin, int; supported: a stable pixel lies in the window: elsewhere `refined` is
    meaningless.
    """

    volume: Volume
    best: np.ndarray
    values: np.ndarray
    stable: np.ndarray
    refined: np.ndarray
    supported: np.ndarray


def exact_match(left: np.ndarray, right: np.ndarray, disparities: int, weights: Weights) -> Match:
    """The whole of METHODS 7 on a grey pair (H, W) uint8, both eyes searched alike."""
    return _match(left, right, disparities, weights, aggregate)


def clustered_match(
    left: np.ndarray, right: np.ndarray, disparities: int, weights: Weights, levels: int
) -> Match:
    """The same with (2) by K = 2^levels clustered intensities, (4)-(6)."""
    return _match(
        left, right, disparities, weights, lambda volume, grey, w: clustered_volume(volume, grey, w, levels)
    )


def _match(
    left: np.ndarray,
    right: np.ndarray,
    disparities: int,
    weights: Weights,
    mean: Callable[[Volume, np.ndarray, Weights], Volume],
) -> Match:
    volume = mean(matching_cost(left, right, disparities, weights), left, weights)
    # A flipped right eye's search is a left eye's.
    back = mean(matching_cost(right[:, ::-1], left[:, ::-1], disparities, weights), right[:, ::-1], weights)
    best = winners(volume)
    stable = left_right_stable(best, winners(back)[:, ::-1])
    refined, supported = refine(best, stable, left, disparities, weights)
    return Match(volume, best, sub_pixel(volume, best), stable, refined, supported)


def left_right_stable(left_best: np.ndarray, right_best: np.ndarray, tolerance: int = 1) -> np.ndarray:
    """True where the right picture's pixel that the left one was matched to finds its way back."""
    rows, columns = np.indices(left_best.shape)
    landing = columns - left_best
    inside = landing >= 0
    back = right_best[rows, np.where(inside, landing, 0)]
    return inside & (np.abs(back - left_best) <= tolerance)


def refine(
    best: np.ndarray, stable: np.ndarray, grey: np.ndarray, disparities: int, weights: Weights
) -> tuple[np.ndarray, np.ndarray]:
    """(8): the volume |d - D| on stable pixels, 0 on others, aggregated; its argmin and its support.

    It is the weighted median of the stable disparities in the window.
    """
    steps = np.arange(disparities)[:, None, None]
    volume = np.where(stable, np.abs(steps - best), 0).astype(np.float64)
    refined = winners(aggregate(volume, grey, weights))
    supported = weighted_sum(stable[None].astype(np.float64), grey, weights)[0] > 0
    return refined, supported


# ------------------------------------------------------------------------------- (4) to (6): clustered


def spatial_sum(field: np.ndarray, weights: Weights) -> np.ndarray:
    """S: the spatial Gaussian alone, summed over the same window. field (..., H, W)."""
    total = np.zeros_like(field, dtype=np.float64)
    for near, (here, there) in _offsets(field.shape[-2:], weights):
        total[..., *here] += near * field[..., *there]
    return total


def clusters(grey: np.ndarray, weights: Weights, levels: int) -> list[np.ndarray]:
    """The K = 2^levels sample intensities m_n, each (H, W).

    m = S(I); split the pixels at I >= m; each child's m = S(1_c I) / S(1_c); repeat. Where a child has no
    pixel in the window its parent's m stands.
    """
    grey = np.asarray(grey, np.float64)
    members = [np.ones(grey.shape, bool)]
    means = [_mean_of(members[0], grey, weights, grey)]
    for _ in range(levels):
        parents = [mean for mean in means for _ in range(2)]
        members = [
            half
            for member, mean in zip(members, means, strict=True)
            for half in (member & (grey >= mean), member & ~(grey >= mean))
        ]
        means = [
            _mean_of(member, grey, weights, parent) for member, parent in zip(members, parents, strict=True)
        ]
    return means


def _mean_of(member: np.ndarray, grey: np.ndarray, weights: Weights, otherwise: np.ndarray) -> np.ndarray:
    count = spatial_sum(member.astype(np.float64), weights)
    total = spatial_sum(np.where(member, grey, 0.0), weights)
    return np.where(count > 0, total / np.where(count > 0, count, 1.0), otherwise)


def clustered_volume(volume: Volume, grey: np.ndarray, weights: Weights, levels: int) -> Volume:
    """(4)-(6): C = sum_n g_n S(h_n M) / sum_n g_n S(h_n)."""
    means = clusters(grey, weights, levels)
    away = np.stack([(np.asarray(grey, np.float64) - mean) ** 2 for mean in means]) / weights.sigma_range**2
    share = np.exp(-away)
    # A common factor of all g_n(i) falls out of the quotient: take it out before it underflows.
    gain = np.exp(-(away - away.min(axis=0)))
    above = np.zeros_like(volume, dtype=np.float64)
    below = np.zeros(grey.shape)
    for g, h in zip(gain, share, strict=True):
        above += g * spatial_sum(h * volume, weights)
        below += g * spatial_sum(h, weights)
    return above / below


# ------------------------------------------------------------------------------------------ comparison


@dataclass(frozen=True)
class Agreement:
    """How a matcher compares with the oracle.

    within: share of the pixels both call measured whose values differ by at most 1 px; covered: share of the
    oracle's stable pixels that the matcher measures.
    """

    within: float
    covered: float


def agreement(values: np.ndarray, valid: np.ndarray, oracle: Match) -> Agreement:
    """Compare a map (H, W) with the oracle's stable pixels."""
    both = valid & oracle.stable
    if not both.any():
        return Agreement(0.0, 0.0)
    near = np.abs(values - oracle.values)[both] <= 1.0
    return Agreement(float(near.mean()), float(both.sum() / oracle.stable.sum()))
