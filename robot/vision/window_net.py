"""A small net that looks at one window of a picture: is it the object, and where exactly is its box?

One hidden layer. Four of the five answers are the box, so a window a little beside the object, or one of
another shape, still tells the right box. Learnt with Adam (Kingma and Ba, 2015) in the space of the
windows' principal components: many times fewer numbers, and the steps go equally well along all of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

ANSWERS = 5
"""Logit of the object; of its box, over the window's: middle (x, y), logarithms of width and height."""
LEAK = 0.1
"""Slope of a hidden unit below 0: one that is never above would learn nothing any more."""


@dataclass(frozen=True, slots=True)
class Course:
    """How a net learns. components: of the windows; hidden: units; dropped: share of components left out of
    each look, so that it relies on none; epochs, batch, rate: of Adam, the rate falls to 0 as a cosine;
    decay: of the weights; box_share: weight of the box against the logit."""

    components: int = 192
    hidden: int = 64
    dropped: float = 0.15
    epochs: int = 12
    batch: int = 256
    rate: float = 3e-3
    decay: float = 1e-2
    box_share: float = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Lessons:
    """Windows (n, d) float32 to learn from: which show the object (n,), and where they do its box (n, 4)."""

    windows: Floats
    shows: NDArray[np.bool_]
    boxes: Floats


@dataclass(frozen=True, slots=True, eq=False)
class WindowNet:
    """Weights: first (d, h), its bias (h,), second (h, 5), its bias (5,), all float32.

    >>> rng = np.random.default_rng(0)
    >>> windows = rng.normal(size=(4000, 20)).astype(np.float32)
    >>> shows = windows[:, 0] + windows[:, 1] > 0.0
    >>> course = Course(components=20, hidden=8, dropped=0.0, epochs=60)
    >>> net = learnt(Lessons(windows, shows, np.zeros((4000, 4), np.float32)), course, rng)
    >>> bool(((net.answers(windows)[:, 0] > 0.0) == shows).mean() > 0.95)
    True
    """

    first: Floats
    first_bias: Floats
    second: Floats
    second_bias: Floats

    def answers(self, windows: Floats) -> Floats:
        """(n, 5) for windows (n, d): logit of the object and its box, see `ANSWERS`."""
        return self.from_hidden(windows @ self.first)

    def from_hidden(self, sums: Floats) -> Floats:
        """The same from what the first layer makes of the windows (n, h), before its bias."""
        hidden = sums + self.first_bias
        return np.asarray(np.maximum(hidden, LEAK * hidden) @ self.second + self.second_bias, np.float32)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """All weights as plain arrays."""
        return {
            "first": self.first,
            "first_bias": self.first_bias,
            "second": self.second,
            "second_bias": self.second_bias,
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[np.generic]]) -> WindowNet:
        """The inverse of `arrays`. Raises KeyError or ValueError where they do not fit together."""
        names = ("first", "first_bias", "second", "second_bias")
        weights = [np.asarray(arrays[name], np.float32) for name in names]
        hidden = weights[1].shape
        fits = len(hidden) == 1 and weights[0].shape[1:] == hidden and weights[0].ndim == 2
        if not fits or weights[2].shape != (*hidden, ANSWERS) or weights[3].shape != (ANSWERS,):
            raise ValueError("the weights of a window net do not fit together")
        if not all(np.isfinite(one).all() for one in weights):
            raise ValueError("the weights of a window net hold impossible numbers")
        return cls(*weights)


def learnt(lessons: Lessons, course: Course, rng: np.random.Generator) -> WindowNet:
    """A net that has learnt from these windows. The same lessons and generator give the same net."""
    mean, to_components = _principal(lessons.windows, course.components, rng)
    inputs = np.asarray((lessons.windows - mean) @ to_components, np.float32)
    weights = _begin(inputs.shape[1], course.hidden, rng)
    moments = [(np.zeros_like(w), np.zeros_like(w)) for w in weights]
    batches = max(len(inputs) // course.batch, 1)
    step, steps = 0, course.epochs * batches
    for _ in range(course.epochs):
        order = rng.permutation(len(inputs))
        for chosen in np.array_split(order, batches):
            slopes = _slopes(
                weights, inputs[chosen], lessons.shows[chosen], lessons.boxes[chosen], course, rng
            )
            rate = 0.5 * course.rate * (1.0 + math.cos(math.pi * step / steps))
            step += 1
            _adam_step(weights, slopes, moments, step, rate, course.decay)
    first, first_bias, second, second_bias = weights
    folded = to_components @ first
    return WindowNet(folded, first_bias - mean @ folded, second, second_bias)


def _principal(windows: Floats, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Mean (d,) of the windows, and what makes `count` components (d, c) of about equal spread of them."""
    some = windows[rng.permutation(len(windows))[:8000]].astype(np.float64)
    mean = some.mean(axis=0)
    spread, axes = np.linalg.eigh(np.cov(some - mean, rowvar=False))
    spread, axes = spread[::-1][:count], axes[:, ::-1][:, :count]
    # What hardly varies is noise; it is not blown up to the size of the rest.
    return mean.astype(np.float32), (axes / np.sqrt(spread + 0.1 * spread.mean())).astype(np.float32)


def _begin(inputs: int, hidden: int, rng: np.random.Generator) -> list[Floats]:
    first = rng.normal(0.0, 1.0 / math.sqrt(inputs), (inputs, hidden))
    second = rng.normal(0.0, 1.0 / math.sqrt(hidden), (hidden, ANSWERS))
    second[:, 1:] *= 0.1
    zeros = np.zeros(hidden), np.zeros(ANSWERS)
    return [np.asarray(w, np.float32) for w in (first, zeros[0], second, zeros[1])]


def _slopes(
    weights: list[Floats],
    inputs: Floats,
    shows: NDArray[np.bool_],
    boxes: Floats,
    course: Course,
    rng: np.random.Generator,
) -> list[Floats]:
    """Slopes of the loss: logistic for the object; for boxes, where there is one, Huber's."""
    first, first_bias, second, second_bias = weights
    kept = rng.random(inputs.shape, dtype=np.float32) >= course.dropped
    seen = inputs * kept / np.float32(1.0 - course.dropped)
    sums = seen @ first + first_bias
    hidden = np.maximum(sums, LEAK * sums)
    answers = hidden @ second + second_bias
    slope = np.empty_like(answers)
    slope[:, 0] = 1.0 / (1.0 + np.exp(-np.clip(answers[:, 0], -30.0, 30.0))) - shows
    slope[:, 1:] = course.box_share * shows[:, None] * np.clip(4.0 * (answers[:, 1:] - boxes), -1.0, 1.0)
    slope /= np.float32(len(inputs))
    back = (slope @ second.T) * np.where(sums > 0.0, np.float32(1.0), np.float32(LEAK))
    return [seen.T @ back, back.sum(axis=0), hidden.T @ slope, slope.sum(axis=0)]


def _adam_step(
    weights: list[Floats],
    slopes: list[Floats],
    moments: list[tuple[Floats, Floats]],
    step: int,
    rate: float,
    decay: float,
) -> None:
    """Change the weights in place. Weights (not biases) also fall by `decay`, apart from the slopes."""
    for weight, slope, (mean, square) in zip(weights, slopes, moments, strict=True):
        mean += 0.1 * (slope - mean)
        square += 0.001 * (slope * slope - square)
        size = np.sqrt(square / (1.0 - 0.999**step)) + 1e-8
        change = (mean / (1.0 - 0.9**step)) / size
        if weight.ndim == 2:
            change += decay * weight
        weight -= np.asarray(rate * change, np.float32)
