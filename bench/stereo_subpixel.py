"""How true, how honest and how locked to whole pixels measured disparities are, against exact ones.

Pixel locking: sub-pixel interpolation draws disparities towards whole pixels (or away from them). It shows in
the histogram of their fractional parts and in the mean error as a function of the true fraction
(Shimizu and Okutomi, 2001).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

GROSS_PX = 2.0
FINE_PX = 1.0
"""Errors above are mismatches, not interpolation: they are left out of the locking curve."""
FRACTION_BINS = 20


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Measured pixels: true and found disparity and claimed sigma in px, (N,) each; `grid` (N,) px is what to
    take away from a disparity to get it on the matcher's own grid of whole pixels (0 for a plain pair)."""

    true: Floats
    found: Floats
    sigma: Floats
    grid: Floats
    known: int

    @property
    def error(self) -> NDArray[np.float64]:
        """Found less true, px."""
        return self.found.astype(np.float64) - self.true


@dataclass(frozen=True, slots=True)
class SubPixel:
    """Figures of a set of measured disparities; NaN where there was none.

    median_error_px: median |error|; bias_px: median error; valid: share of the known non-occluded pixels that
    were measured; gross: share of the measured ones off by more than 2 px; within_1_sigma, within_2_sigma:
    shares of errors; fraction_amplitude and true_fraction_amplitude: amplitude at period 1 px of the
    histogram of fractional parts, relative to its mean, of found and true disparities;
    locking_px: amplitude at period 1 px of the mean error over the true fraction; locking_span_px: largest
    less smallest of that curve.
    """

    median_error_px: float
    bias_px: float
    valid: float
    gross: float
    within_1_sigma: float
    within_2_sigma: float
    fraction_amplitude: float
    true_fraction_amplitude: float
    locking_px: float
    locking_span_px: float


def take(
    true: Floats, mask: Mask, found: Floats, valid: Mask, sigma: Floats, grid: Floats | None = None
) -> Samples:
    """Pixels of `mask` that were measured; all maps (H, W), grid (H, W) or broadcastable to it, px."""
    chosen = mask & valid
    offsets = np.broadcast_to(np.float32(0.0) if grid is None else grid, true.shape)
    return Samples(true[chosen], found[chosen], sigma[chosen], offsets[chosen], int(np.count_nonzero(mask)))


def joined(parts: Iterable[Samples]) -> Samples:
    """The samples of several views as one set."""
    listed = list(parts)
    columns = [
        np.concatenate([getattr(part, name) for part in listed])
        for name in ("true", "found", "sigma", "grid")
    ]
    return Samples(columns[0], columns[1], columns[2], columns[3], sum(part.known for part in listed))


def figures(samples: Samples) -> SubPixel:
    """All figures of a set. See `SubPixel`.

    >>> true = np.linspace(3, 9, 1201, dtype=np.float32)
    >>> sigma = np.full(1201, 0.05, np.float32)
    >>> rounded = Samples(true, np.rint(true), sigma, np.zeros(1201, np.float32), 2402)
    >>> found = figures(rounded)
    >>> round(found.median_error_px, 2), found.valid, round(found.fraction_amplitude, 2)
    (0.25, 0.5, 2.0)
    """
    if not len(samples.true):
        nothing = float("nan")
        return SubPixel(nothing, nothing, 0.0, *[nothing] * 7)
    error = samples.error
    size = np.abs(error)
    one, two = (float(np.mean(size <= k * samples.sigma)) for k in (1, 2))
    curve = locking_curve(samples)
    return SubPixel(
        median_error_px=float(np.median(size)),
        bias_px=float(np.median(error)),
        valid=len(error) / samples.known,
        gross=float(np.mean(size > GROSS_PX)),
        within_1_sigma=one,
        within_2_sigma=two,
        fraction_amplitude=fraction_amplitude(samples.found - samples.grid),
        true_fraction_amplitude=fraction_amplitude(samples.true - samples.grid),
        locking_px=_first_harmonic(curve),
        locking_span_px=float(np.ptp(curve)),
    )


def fraction_amplitude(disparities: Floats) -> float:
    """Amplitude at period 1 px of the histogram of fractional parts over its mean: 0 even, 2 all alike."""
    turns = np.exp(2j * np.pi * disparities.astype(np.float64))
    return 2.0 * float(np.abs(turns.mean()))


def locking_curve(samples: Samples) -> NDArray[np.float64]:
    """Mean error (px) of pixels whose true fraction lies in each of 20 equal bins of [0, 1), less its mean.

    NaN everywhere if a bin stays empty.
    """
    error, fraction = samples.error, np.mod(samples.true - samples.grid, 1.0)
    fine = np.abs(error) <= FINE_PX
    bins = np.minimum((fraction[fine] * FRACTION_BINS).astype(np.intp), FRACTION_BINS - 1)
    counts = np.bincount(bins, minlength=FRACTION_BINS)
    if not counts.all():
        return np.full(FRACTION_BINS, np.nan)
    means = np.bincount(bins, error[fine], FRACTION_BINS) / counts
    return np.asarray(means - means.mean(), np.float64)


def _first_harmonic(curve: NDArray[np.float64]) -> float:
    phase = 2.0 * np.pi * (np.arange(len(curve)) + 0.5) / len(curve)
    return float(2.0 * np.abs(np.mean(curve * np.exp(1j * phase))))
