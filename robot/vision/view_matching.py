"""Windows of a picture held against a taught target's views: what speaks for a place, and how much.

Three kinds of evidence speak for a window: cosine of NMF encodings, normalised correlation with the nearest
training view, agreement of the colour layout. A `Judge` makes one score of them.

Source: Wu & Snášel, *A Vision-based Navigation System of Mobile Tracking Robot*, SMC 2010, section II;
colour is an addition, because a look-alike with another print has the same shape.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Detection, Image
from robot.vision.colour import LAYOUT_LENGTH, ColourSums, layout_similarity
from robot.vision.named_arrays import below
from robot.vision.picture_patch import coloured
from robot.vision.viewspace import ViewSpace
from robot.vision.windows import Floats, grey_of, windows_near

LEADING = 12
"""Windows with the nearest encodings of which the correlation is asked."""


class Evidence(NamedTuple):
    """What speaks for a window: cosine of encodings, correlation with the nearest view, colour agreement."""

    encoding: float
    correlation: float
    colour: float


@dataclass(frozen=True, slots=True)
class Judge:
    """Turns three pieces of evidence into a score 0..1 (logistic); 0.5 is the learnt threshold."""

    weights: tuple[float, float, float]
    bias: float

    def score(self, evidence: Sequence[float]) -> float:
        """Score of one window, 0..1."""
        logit = self.bias + sum(w * e for w, e in zip(self.weights, evidence, strict=True))
        return 1.0 / (1.0 + math.exp(-max(-30.0, min(30.0, logit))))

    def values(self) -> NDArray[np.float64]:
        """Weights and bias as an array (4,)."""
        return np.array([*self.weights, self.bias], np.float64)

    @classmethod
    def of_values(cls, values: NDArray[np.generic]) -> Judge:
        """The inverse of `values`. Raises ValueError where there are not four."""
        first, second, third, bias = (float(value) for value in np.asarray(values, np.float64))
        return cls((first, second, third), bias)


@dataclass(frozen=True, slots=True, eq=False)
class AspectGroup:
    """Training views of about one shape: aspect = width / height, small windows to scan, large ones to judge.

    layouts (m, 96): the views' colour layouts, in the order of the spaces' columns.
    """

    aspect: float
    coarse: ViewSpace
    fine: ViewSpace
    layouts: Floats

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Everything learnt but the aspect as plain arrays, keyed 'layouts', 'coarse.inverse', ..."""
        arrays: dict[str, NDArray[np.generic]] = {"layouts": self.layouts}
        for name, space in (("coarse", self.coarse), ("fine", self.fine)):
            arrays |= {f"{name}.{key}": value for key, value in space.arrays().items()}
        return arrays

    @classmethod
    def from_arrays(cls, aspect: float, arrays: Mapping[str, NDArray[np.generic]]) -> AspectGroup:
        """The inverse of `arrays`. Raises KeyError or ValueError where they do not fit together."""
        coarse, fine = (ViewSpace.from_arrays(below(f"{name}.", arrays)) for name in ("coarse", "fine"))
        layouts = np.asarray(arrays["layouts"], np.float32)
        if layouts.shape != (len(fine.columns), LAYOUT_LENGTH) or not aspect > 0:
            raise ValueError("the colour layouts do not fit the views")
        return cls(aspect, coarse, fine, layouts)


class Placed(NamedTuple):
    """A window judged: where, what speaks for it."""

    box: Box
    evidence: Evidence


class Picture(NamedTuple):
    """What is computed once for a picture: grey (H, W), sums of its colours."""

    grey: Floats
    colours: ColourSums

    @classmethod
    def of(cls, image: Image) -> Picture:
        """Of a BGR or grey uint8 image (H, W[, 3]); raises ValueError for any other (`picture_patch`)."""
        colours = coloured(image)
        return cls(grey_of(colours), ColourSums(colours))


def best_near(
    picture: Picture, box: Box, group: AspectGroup, scales: tuple[float, ...], reach: int
) -> Placed:
    """The window near a box that correlates best with a view, among those with the nearest encodings."""
    shaped = in_shape_of(group, box)
    stack = windows_near(picture.grey, shaped, group.fine.size, scales, reach)
    prepared, textured = group.fine.prepared(stack.pixels)
    nearest = group.fine.encoding_similarity(prepared).max(axis=1) - 2.0 * ~textured
    leading = np.argsort(-nearest, kind="stable")[:LEADING]
    correlations = group.fine.correlation(prepared[leading])
    row, view = (int(i) for i in np.unravel_index(int(correlations.argmax()), correlations.shape))
    best = stack.boxes[leading[row]]
    colours = layout_similarity(picture.colours.layouts(best[None]), group.layouts[view][None])
    evidence = Evidence(float(nearest[leading[row]]), float(correlations[row, view]), float(colours[0, 0]))
    return Placed(box_from(best), evidence)


def in_shape_of(group: AspectGroup, box: Box) -> Box:
    """The box of a group's shape with the same middle and height."""
    (u, v), height = box.centre, box.h
    return Box(u - group.aspect * height / 2, v - height / 2, group.aspect * height, height)


def one_for_each_place(detections: Sequence[Detection]) -> list[Detection]:
    """The best detections first, without those that share their middle with a better one.

    Overlap alone would not do: a part of a print often looks like the whole, much smaller.
    """
    kept: list[Detection] = []
    for detection in sorted(detections, key=lambda d: -d.score):
        if not any(_share_middle(detection.box, better.box) for better in kept):
            kept.append(detection)
    return kept


def _share_middle(box: Box, other: Box) -> bool:
    return _holds(box, other.centre) or _holds(other, box.centre)


def _holds(box: Box, point: tuple[float, float]) -> bool:
    return 0 <= point[0] - box.x <= box.w and 0 <= point[1] - box.y <= box.h


def box_from(edges: NDArray[np.float64]) -> Box:
    """A box from an array x, y, w, h."""
    x, y, width, height = (float(edge) for edge in edges)
    return Box(x, y, width, height)
