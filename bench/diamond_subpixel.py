"""Sub-pixel error of two fits to absolute differences, on real pictures shifted by parts of a pixel.

A picture is reduced four times by averaging, once as it is and once after leaving out 0 to 3 of its rows and
columns: two pictures of one scene from a camera whose pixels integrate, displaced by 0, 1/4, 1/2, 3/4 px.
Noise is added to both.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.diamond_video import EDGE, LEAST_TEXTURE, Picture, texture
from robot.vision.diamond import BlockDistortion, equiangular_vertex, full_search, parabola_vertex

FACTOR = 4
NOISE_GREY = (0.0, 2.0, 5.0)
FITS = {"parabola": parabola_vertex, "equiangular": equiangular_vertex}
_REACH, _BLOCKS = 3, 4


def rows(pictures: Sequence[Picture]) -> list[dict[str, Any]]:
    """For each noise and fit: root mean square and median error, bias at a quarter and three quarters, px.

    The bias is counted towards the whole pixel: positive where the fit answers too little of the shift.
    """
    found = []
    for noise in NOISE_GREY:
        errors: dict[str, list[tuple[int, float]]] = {name: [] for name in FITS}
        rng = np.random.default_rng(int(noise))
        for picture in pictures:
            for shift in range(FACTOR):
                _measure(picture, shift, noise, rng, errors)
        for name, told in errors.items():
            if told:
                found.append({"sequence": f"{name}, noise {noise:g}", **_figures(np.array(told))})
    return found


def _measure(
    picture: Picture,
    shift: int,
    noise: float,
    rng: np.random.Generator,
    errors: dict[str, list[tuple[int, float]]],
) -> None:
    still = _noisy(_reduced(picture, 0), noise, rng)
    moved = _noisy(_reduced(picture, shift), noise, rng)
    free = [extent - EDGE - 2 * _REACH for extent in still.shape[::-1]]
    if min(free) < 0:
        return
    for _ in range(_BLOCKS):
        left, top = (_REACH + int(rng.integers(extent + 1)) for extent in free)
        block = still[top : top + EDGE, left : left + EDGE]
        if texture(block) < LEAST_TEXTURE:
            continue
        distortion = BlockDistortion(block, moved, left, top)
        best = full_search(distortion, window=_REACH - 1)
        across = [distortion(best.dx + step, best.dy) for step in (-1, 0, 1)]
        down = [distortion(best.dx, best.dy + step) for step in (-1, 0, 1)]
        for name, fit in FITS.items():
            for whole, line in ((best.dx, across), (best.dy, down)):
                errors[name].append((shift, whole + fit(*line) + shift / FACTOR))


def _reduced(picture: Picture, shift: int) -> NDArray[np.float32]:
    height, width = (extent // FACTOR - 1 for extent in picture.shape)
    part = picture[shift : shift + height * FACTOR, shift : shift + width * FACTOR].astype(np.float32)
    return np.asarray(cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA), np.float32)


def _noisy(picture: NDArray[np.float32], noise: float, rng: np.random.Generator) -> Picture:
    return np.clip(np.rint(picture + rng.normal(0, noise, picture.shape)), 0, 255).astype(np.uint8)


def _figures(told: NDArray[np.float64]) -> dict[str, float]:
    shifts, errors = told[:, 0], told[:, 1]
    towards = np.concatenate([errors[shifts == 1], -errors[shifts == 3]])
    return {
        "blocks": len(errors) // 2,
        "rms px": round(float(np.sqrt(np.mean(errors**2))), 4),
        "median px": round(float(np.median(np.abs(errors))), 4),
        "bias px": round(float(np.median(towards)), 4),
    }
