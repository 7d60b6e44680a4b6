"""Where in a window a target is: a correlation filter learnt from its looks, many channels.

The filter is the ridge regression, over all cyclic shifts of the looks met, to a sharp peak at the target's
middle; in the Fourier domain that is a quotient of two running means, so learning a look costs one transform.

Source: Bolme et al., "Visual object tracking using adaptive correlation filters" (CVPR 2010); channels that
share a denominator: Danelljan et al., "Accurate scale estimation for robust visual tracking" (BMVC 2014).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Spectra = NDArray[np.complex64]

RIDGE = 1e-3
PEAK_CELLS = 3
"""About the highest point so many cells to each side are the same peak."""
LEAST_SECOND = 0.02
"""No place is less like the target than this: what a second peak is at least."""


@dataclass(frozen=True, slots=True, eq=False)
class CorrelationFilter:
    """A filter on a grid of cells. wanted: spectrum (rows, columns') of the answer wanted to the target;
    numerator (channels, rows, columns'), denominator (rows, columns'): running means."""

    shape: tuple[int, int]
    wanted: Spectra
    numerator: Spectra
    denominator: Floats

    @classmethod
    def learnt(cls, look: Floats, sigma_cells: float) -> CorrelationFilter:
        """From one look (channels, rows, columns), the target in its middle cell (rows // 2, columns // 2).

        >>> rng = np.random.default_rng(0)
        >>> look = rng.random((3, 20, 24), dtype=np.float32)
        >>> one = CorrelationFilter.learnt(look, 1.5)
        >>> np.unravel_index(one.response(np.roll(look, (2, -3), (1, 2))).argmax(), (20, 24))
        (np.int64(12), np.int64(9))
        """
        rows, columns = look.shape[1:]
        y, x = np.arange(rows) - rows // 2, np.arange(columns) - columns // 2
        bell = np.exp(-0.5 * (y[:, None] ** 2 + x[None, :] ** 2) / sigma_cells**2)
        wanted = np.asarray(scipy.fft.rfft2(np.fft.ifftshift(bell).astype(np.float32)), np.complex64)
        spectra = _spectra(look)
        return cls((rows, columns), wanted, np.conj(wanted) * spectra, _power(spectra))

    def and_met(self, look: Floats, rate: float) -> CorrelationFilter:
        """The filter after one more look; rate 0..1: its share."""
        spectra, old, new = _spectra(look), np.float32(1.0 - rate), np.float32(rate)
        numerator = old * self.numerator + new * (np.conj(self.wanted) * spectra)
        denominator = old * self.denominator + new * _power(spectra)
        return CorrelationFilter(self.shape, self.wanted, numerator, denominator)

    def response(self, look: Floats) -> Floats:
        """How well the target fits with its middle in each cell (rows, columns): 1 as learnt, 0 not."""
        product = np.einsum("crk,crk->rk", np.conj(self.numerator), _spectra(look))
        answer = scipy.fft.irfft2(product / (self.denominator + np.float32(RIDGE)), s=self.shape)
        return np.asarray(np.fft.fftshift(answer), np.float32)


def second_peak(response: Floats, row: int, column: int) -> float:
    """The highest answer beside the peak at (row, column), at least `LEAST_SECOND`."""
    beside = response.copy()
    reach = PEAK_CELLS
    beside[max(row - reach, 0) : row + reach + 1, max(column - reach, 0) : column + reach + 1] = -np.inf
    return max(float(beside.max()), LEAST_SECOND)


def _spectra(look: Floats) -> Spectra:
    return np.asarray(scipy.fft.rfft2(look), np.complex64)


def _power(spectra: Spectra) -> Floats:
    return np.asarray((spectra.real**2 + spectra.imag**2).sum(axis=0), np.float32)
