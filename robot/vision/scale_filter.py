"""How much larger or smaller a target has become: a one-dimensional correlation filter over its size.

Source: Danelljan et al., "Accurate scale estimation for robust visual tracking" (BMVC 2014).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image
from robot.vision.gradient_histograms import CELL_PX, gradient_histograms
from robot.vision.picture_patch import patch_of

SIZES = 33
STEP = 1.02
"""From one size tried to the next."""
AREA_PX = 512
"""Of the small picture of the target, by which its size is told."""
RIDGE = 1e-2


@dataclass(frozen=True, slots=True, eq=False)
class ScaleFilter:
    """Tells the target's size. out: (columns, rows) of the small picture; numerator (features, SIZES),
    denominator (SIZES): running means of spectra."""

    out: tuple[int, int]
    numerator: NDArray[np.complex64]
    denominator: NDArray[np.float32]

    @classmethod
    def learnt(cls, image: Image, centre: tuple[float, float], size: tuple[float, float]) -> ScaleFilter:
        """From one look at a target of this (width, height) px in a BGR picture."""
        grow = (AREA_PX / (size[0] * size[1])) ** 0.5
        out = _cells(size[0] * grow), _cells(size[1] * grow)
        spectra = _spectra(image, centre, size, out)
        return cls(out, np.conj(_WANTED) * spectra, _power(spectra))

    def and_met(
        self, image: Image, centre: tuple[float, float], size: tuple[float, float], rate: float
    ) -> ScaleFilter:
        """The filter after one more look; rate 0..1: its share."""
        spectra = _spectra(image, centre, size, self.out)
        old, new = np.float32(1.0 - rate), np.float32(rate)
        numerator = old * self.numerator + new * (np.conj(_WANTED) * spectra)
        return ScaleFilter(self.out, numerator, old * self.denominator + new * _power(spectra))

    def factor(self, image: Image, centre: tuple[float, float], size: tuple[float, float]) -> float:
        """Its size over the one supposed, 0.73 to 1.37.

        >>> rng = np.random.default_rng(1)
        >>> wall = cv2.resize(rng.integers(0, 255, (24, 24, 3), np.uint8), (240, 240))
        >>> one = ScaleFilter.learnt(wall, (120.0, 120.0), (60.0, 60.0))
        >>> larger = cv2.resize(wall, (264, 264))
        >>> round(one.factor(larger, (132.0, 132.0), (60.0, 60.0)), 2)
        1.1
        """
        product = np.einsum("fk,fk->k", np.conj(self.numerator), _spectra(image, centre, size, self.out))
        answer = np.fft.ifft(product / (self.denominator + RIDGE)).real
        return float(_FACTORS[(int(np.argmax(answer)) + SIZES // 2) % SIZES])


_FACTORS = STEP ** (np.arange(SIZES) - SIZES // 2).astype(np.float64)
_WINDOW = np.hanning(SIZES + 2)[1:-1].astype(np.float32)
_SIGMA = SIZES**0.5 / 4.0
_WANTED = np.fft.fft(np.fft.ifftshift(np.exp(-0.5 * ((np.arange(SIZES) - SIZES // 2) / _SIGMA) ** 2))).astype(
    np.complex64
)


def _cells(edge: float) -> int:
    return max(int(edge) // CELL_PX, 2) * CELL_PX


def _spectra(
    image: Image, centre: tuple[float, float], size: tuple[float, float], out: tuple[int, int]
) -> NDArray[np.complex64]:
    """Spectra (features, SIZES) over size of what the target's small picture shows at every size."""
    largest = float(_FACTORS[-1])
    # One larger patch first: the picture itself may be much finer than the small pictures.
    whole = tuple(2 * round(edge * largest) for edge in out)
    near = patch_of(image, centre, (size[0] * largest, size[1] * largest), (whole[0], whole[1]))
    grey = np.asarray(cv2.cvtColor(near, cv2.COLOR_BGR2GRAY), np.uint8)
    middle = whole[0] / 2, whole[1] / 2
    tall = np.empty((SIZES, out[1], out[0]), np.uint8)
    for i, factor in enumerate(_FACTORS):
        share = float(factor) / largest
        tall[i] = patch_of(grey, middle, (whole[0] * share, whole[1] * share), out)
    found = gradient_histograms(tall.reshape(-1, out[0]))
    by_size = found.reshape(len(found), SIZES, out[1] // CELL_PX, out[0] // CELL_PX)
    features = by_size.transpose(0, 2, 3, 1).reshape(-1, SIZES) * _WINDOW
    return np.asarray(np.fft.fft(features, axis=1), np.complex64)


def _power(spectra: NDArray[np.complex64]) -> NDArray[np.float32]:
    return np.asarray((spectra.real**2 + spectra.imag**2).sum(axis=0), np.float32)
