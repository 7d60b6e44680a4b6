"""Small grey stereo pairs of textured planes before one another, cast with both eyes: exact disparities.

It shares no code with the product, nor with the oracle of dense stereo it is made for.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

SAMPLES = 4
"""Rays of a pixel in each direction."""
MARGIN = 96
"""Texture to spare on each side of the picture, px."""


@dataclass(frozen=True)
class Layer:
    """A plane seen as d = disparity + across (u - w/2) + down (v - h/2), within a box of left-picture pixels.

    box: u0, v0, u1, v1 of the left picture; shade: mean grey level; contrast: standard deviation of its
    texture, grey levels; across, down: how the disparity changes from column to column and from row to row.
    """

    disparity: float
    box: tuple[float, float, float, float]
    shade: float
    seed: int
    contrast: float = 28.0
    across: float = 0.0
    down: float = 0.0


@dataclass(frozen=True)
class Scene:
    """A grey pair and the true disparity of each left pixel; seen: by the right eye too."""

    left: np.ndarray
    right: np.ndarray
    truth: np.ndarray
    seen: np.ndarray


def cast(
    layers: tuple[Layer, ...], width: int = 64, height: int = 48, noise: float = 1.0, seed: int = 0
) -> Scene:
    """See layers with both eyes; the first layer is behind all and fills the picture, later ones cover it."""
    rng = np.random.default_rng(seed)
    (left, truth), (right, right_truth) = (_see(layers, width, height, eye) for eye in (0.0, 1.0))
    rows, columns = np.indices(truth.shape)
    landing = np.clip(np.rint(columns - truth).astype(int), 0, width - 1)
    seen = (columns - truth >= 0) & (np.abs(right_truth[rows, landing] - truth) < 1.0)
    pictures = (
        np.clip(np.rint(eye + noise * rng.standard_normal(eye.shape)), 0, 255).astype(np.uint8)
        for eye in (left, right)
    )
    return Scene(*pictures, truth, seen)


def _see(layers: tuple[Layer, ...], width: int, height: int, eye: float) -> tuple[np.ndarray, np.ndarray]:
    """Grey levels and disparities of one eye's pixels: 0 the left eye, 1 the right one."""
    step = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    columns = (np.arange(width)[:, None] + step).ravel()
    rows = (np.arange(height)[:, None] + step).ravel()
    u, v = np.meshgrid(columns, rows)
    grey, disparity = np.zeros(u.shape), np.zeros(u.shape)
    for number, layer in enumerate(layers):
        # Column of the left picture that this eye's ray meets the plane at.
        at_left = (u + eye * (layer.disparity - layer.across * width / 2 + layer.down * (v - height / 2))) / (
            1 - eye * layer.across
        )
        plane = layer.disparity + layer.across * (at_left - width / 2) + layer.down * (v - height / 2)
        u0, v0, u1, v1 = layer.box
        inside = (u0 <= at_left) & (at_left < u1) & (v0 <= v) & (v < v1) | (number == 0)
        grey = np.where(inside, _texture(layer, at_left, v), grey)
        disparity = np.where(inside, plane, disparity)
    split = (height, SAMPLES, width, SAMPLES)
    middle = SAMPLES // 2
    return grey.reshape(split).mean(axis=(1, 3)), disparity.reshape(split)[:, middle, :, middle]


def _texture(layer: Layer, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(layer.seed)
    rough = rng.standard_normal((2 * MARGIN + 160, 2 * MARGIN + 240))
    cloud = sum(
        gain * _unit(cv2.GaussianBlur(rough, (0, 0), sigma)) for sigma, gain in ((0.8, 0.8), (2.5, 0.6))
    )
    shades = cv2.remap(
        np.float32(layer.shade + layer.contrast * cloud), np.float32(u + MARGIN), np.float32(v + MARGIN),
        cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT,
    )  # fmt: skip
    return np.clip(shades, 4.0, 251.0).astype(np.float64)


def _unit(field: np.ndarray) -> np.ndarray:
    return field / field.std()


TEXTURED_SCENES: dict[str, tuple[Layer, ...]] = {
    "wall": (Layer(6.0, (0, 0, 0, 0), 120, 1),),
    "slanted wall": (Layer(7.5, (0, 0, 0, 0), 120, 2, across=0.06, down=0.04),),
    "box before a wall": (Layer(3.0, (0, 0, 0, 0), 85, 3), Layer(10.0, (24, 12, 50, 38), 165, 4)),
    "three layers": (
        Layer(2.3, (0, 0, 0, 0), 70, 5),
        Layer(6.6, (10, 6, 40, 44), 130, 6),
        Layer(12.4, (34, 18, 58, 40), 190, 7),
    ),
    "floor and post": (
        Layer(6.0, (0, 0, 0, 0), 110, 8, down=0.2),
        Layer(12.0, (34, 0, 44, 40), 190, 9),
    ),
    "two shelves": (
        Layer(4.0, (0, 0, 0, 0), 140, 10),
        Layer(8.0, (0, 4, 64, 18), 80, 11),
        Layer(11.0, (16, 30, 60, 46), 200, 12),
    ),
}
"""Layers for 64 x 48 pictures and 16 disparities; each surface has its own texture and shade."""
