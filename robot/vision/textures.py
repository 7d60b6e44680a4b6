"""Drawn pictures without a target: what a recognizer learns to refuse when no others are at hand."""

from __future__ import annotations

import cv2
import numpy as np

from robot.messages import Image


def texture(size: tuple[int, int], rng: np.random.Generator) -> Image:
    """A picture of noise in several octaves with shapes, stripes and letters on it.

    size: (width, height) in pixels. Returns (height, width, 3) BGR uint8, drawn from `rng` alone.

    >>> texture((80, 60), np.random.default_rng(0)).shape
    (60, 80, 3)
    """
    picture = _octaves(size, rng)
    for draw in rng.permutation(np.array(["boxes", "discs", "stripes", "letters"]))[:2]:
        _DRAW[str(draw)](picture, rng)
    return picture


def _octaves(size: tuple[int, int], rng: np.random.Generator) -> Image:
    width, height = size
    field = np.zeros((height, width, 3), np.float32)
    for octave in range(2, 7):
        cells = rng.normal(0.0, 1.0, (2**octave, 2**octave, 3)).astype(np.float32)
        # Most surfaces vary in brightness more than in hue.
        cells = 0.3 * cells + 0.7 * cells.mean(axis=2, keepdims=True) * 3**0.5
        field += cv2.resize(cells, size, interpolation=cv2.INTER_CUBIC) / octave
    mean, contrast = rng.uniform(60, 180, 3), rng.uniform(8, 45)
    return np.clip(mean + contrast * field, 0, 255).astype(np.uint8)


def _colour(rng: np.random.Generator) -> tuple[int, int, int]:
    blue, green, red = (int(c) for c in rng.integers(0, 256, 3))
    return blue, green, red


def _place(picture: Image, rng: np.random.Generator) -> tuple[int, int]:
    return int(rng.integers(picture.shape[1])), int(rng.integers(picture.shape[0]))


def _boxes(picture: Image, rng: np.random.Generator) -> None:
    for _ in range(int(rng.integers(3, 9))):
        (x, y), (w, h) = _place(picture, rng), (int(n) for n in rng.integers(10, 90, 2))
        cv2.rectangle(picture, (x, y), (x + w, y + h), _colour(rng), int(rng.choice([-1, 3])))


def _discs(picture: Image, rng: np.random.Generator) -> None:
    for _ in range(int(rng.integers(3, 9))):
        cv2.circle(
            picture, _place(picture, rng), int(rng.integers(5, 45)), _colour(rng), int(rng.choice([-1, 3]))
        )


def _stripes(picture: Image, rng: np.random.Generator) -> None:
    colour, step, slant = _colour(rng), int(rng.integers(8, 40)), int(rng.integers(-120, 120))
    for x in range(-120, picture.shape[1] + 120, step):
        cv2.line(picture, (x, 0), (x + slant, picture.shape[0]), colour, max(1, step // 4))


def _letters(picture: Image, rng: np.random.Generator) -> None:
    for _ in range(int(rng.integers(3, 9))):
        word = "".join(chr(int(c)) for c in rng.integers(65, 91, int(rng.integers(2, 8))))
        size = float(rng.uniform(0.4, 2.0))
        cv2.putText(picture, word, _place(picture, rng), cv2.FONT_HERSHEY_SIMPLEX, size, _colour(rng), 2)


_DRAW = {"boxes": _boxes, "discs": _discs, "stripes": _stripes, "letters": _letters}
