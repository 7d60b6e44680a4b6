"""Recognition of one taught target: NMF encodings propose places, correlation and colour confirm them.

A picture is scanned over a pyramid of scales with r correlations a level (the rows of pinv(W)); the
windows whose encodings lie nearest to a training encoding are cut again at a finer size, prepared as the
training views were, and judged by three kinds of evidence: cosine of encodings, normalised correlation
with the nearest training view, agreement of the colour layout. `robot.vision.recognizer_training` fits it.

Source: Wu & Snášel, *A Vision-based Navigation System of Mobile Tracking Robot*, SMC 2010, section II;
colour is an addition, because a look-alike with another print has the same shape.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from robot.messages import Box, Detection, Image
from robot.vision.colour import LAYOUT_LENGTH, ColourSums, layout_similarity
from robot.vision.viewspace import ViewSpace
from robot.vision.windows import Floats, WindowStack, grey_of, resize, suppress_overlaps, windows_near

# Window heights of the scan: from the farthest to the nearest target, a step well inside what refining mends.
HEIGHTS_PX: tuple[float, ...] = tuple(18.0 * 1.25**step for step in range(11))
_PLACES_PER_LEVEL = 12
_CANDIDATES = 22
_CANDIDATE_OVERLAP = 0.55
# How much colour agreement (-1..1) counts beside similarity when candidates are ranked.
_COLOUR_SHARE = 1.0
_LEADING = 12
# A second, wider look is worth its time only for places neither hopeless nor sure, and only for a few.
_HOPELESS, _SURE = 0.08, 0.75
_SECOND_LOOKS = 3
_FINE_SCALES = (0.93, 1.0, 1.07)
_BOX_SCALES = (0.84, 0.92, 1.0, 1.09, 1.19)


class Evidence(NamedTuple):
    """What speaks for a window: cosine of encodings, correlation with the nearest view, colour agreement."""

    encoding: float
    correlation: float
    colour: float


@dataclass(frozen=True, slots=True)
class Judge:
    """Turns evidence into a score 0..1 by a logistic function; 0.5 is the learnt threshold."""

    weights: tuple[float, float, float]
    bias: float

    def score(self, evidence: Evidence) -> float:
        """Score of one window, 0..1."""
        logit = self.bias + sum(w * e for w, e in zip(self.weights, evidence, strict=True))
        return 1.0 / (1.0 + math.exp(-max(-30.0, min(30.0, logit))))


@dataclass(frozen=True, slots=True, eq=False)
class AspectGroup:
    """Training views of about one shape: aspect = width / height, small windows to scan, large ones to judge.

    layouts (m, 96): the views' colour layouts, in the order of the spaces' columns.
    """

    aspect: float
    coarse: ViewSpace
    fine: ViewSpace
    layouts: Floats


class Placed(NamedTuple):
    """A window judged: where, what speaks for it."""

    box: Box
    evidence: Evidence


@dataclass(frozen=True, slots=True, eq=False)
class Recognizer:
    """Finds one taught target in pictures. Make it with `Recognizer.fit` or `Recognizer.from_arrays`.

    >>> rng = np.random.default_rng(0)
    >>> poster = cv2.resize(rng.integers(0, 255, (8, 6, 3), np.uint8), (60, 80))
    >>> wall = cv2.resize(rng.integers(90, 160, (9, 12, 3), np.uint8), (352, 288))
    >>> views = [cv2.convertScaleAbs(poster, alpha=gain) for gain in (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)]
    >>> recognizer = Recognizer.fit(views, [wall], "poster", seed=0)
    >>> picture = wall.copy(); picture[100:180, 200:260] = poster
    >>> [(found.label, found.box.iou(Box(200, 100, 60, 80)) > 0.7) for found in recognizer.predict(picture)]
    [('poster', True)]
    """

    label: str
    groups: tuple[AspectGroup, ...]
    judge: Judge

    @staticmethod
    def fit(views: Sequence[Image], negatives: Sequence[Image], label: str, seed: int) -> Recognizer:
        """Learn a target from its views, with everything random drawn from `seed`.

        views: BGR uint8 pictures that the target just fills, at least 4, sizes and shapes may differ.
        negatives: BGR uint8 pictures without the target (64 px or more along each edge; smaller ones are
        ignored). Raises ValueError for too few views, FlatViewError for a view without contrast.
        """
        from robot.vision.recognizer_training import fit

        return fit(views, negatives, label, seed)

    def predict(self, image: Image, heights_px: Sequence[float] | None = None) -> list[Detection]:
        """All places where the target seems to be, best first, at most one for each place.

        image: BGR uint8 (H, W, 3). heights_px: heights of target to look for, in pixels; None searches
        18 to 170 px. Scores lie between 0.5 (the threshold learnt on negatives) and 1.
        """
        places = self.candidates(image, heights_px)
        judged = [Detection(place.box, self.judge.score(place.evidence), self.label) for place in places]
        return _one_for_each_place([detection for detection in judged if detection.score >= 0.5])

    def score(self, image: Image, box: Box) -> float:
        """How surely the target is at (or a little beside) a box, 0..1; 0.5 is the threshold.

        Searches shifts of about a sixth and scales of about a fifth of the box, nothing farther away.
        """
        return self.judge.score(self.locate(image, box).evidence)

    def refine(self, image: Image, box: Box) -> Detection:
        """The best place at or near a box, with its score (which may be below 0.5)."""
        place = self.locate(image, box)
        return Detection(place.box, self.judge.score(place.evidence), self.label)

    def locate(self, image: Image, box: Box) -> Placed:
        """The best window near a box over all of the target's shapes."""
        return self._locate(_Picture(grey_of(image), ColourSums(image)), box)

    def _locate(self, picture: _Picture, box: Box) -> Placed:
        tries = (_best_near(picture, box, group, _BOX_SCALES, 4) for group in self.groups)
        return max(tries, key=self._score)

    def _score(self, place: Placed) -> float:
        return self.judge.score(place.evidence)

    def candidates(self, image: Image, heights_px: Sequence[float] | None = None) -> list[Placed]:
        """The best-looking windows of a picture with their evidence, the most promising first."""
        picture = _Picture(grey_of(image), ColourSums(image))
        heights = HEIGHTS_PX if heights_px is None else heights_px
        offered = [_proposals(picture, group, heights) for group in self.groups]
        boxes, merits = (np.concatenate(parts) for parts in zip(*offered, strict=True))
        owners = np.repeat(np.arange(len(self.groups)), [len(places) for places, _ in offered])
        kept = suppress_overlaps(boxes, merits, _CANDIDATE_OVERLAP, _CANDIDATES)
        places = [_best_near(picture, _box(boxes[i]), self.groups[owners[i]], _FINE_SCALES, 2) for i in kept]
        return self._looked_at_again(picture, places)

    def _looked_at_again(self, picture: _Picture, places: list[Placed]) -> list[Placed]:
        """The same places, the most promising doubtful ones searched more widely and in all shapes."""
        places = sorted(places, key=self._score, reverse=True)
        doubtful = [i for i, place in enumerate(places) if _HOPELESS < self._score(place) < _SURE]
        for i in doubtful[:_SECOND_LOOKS]:
            places[i] = max(places[i], self._locate(picture, places[i].box), key=self._score)
        return places

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Everything learnt as plain arrays, keyed 'judge', 'aspects', '0.layouts', '0.fine.inverse', ..."""
        arrays: dict[str, NDArray[np.generic]] = {
            "judge": np.array([*self.judge.weights, self.judge.bias], np.float64),
            "aspects": np.array([group.aspect for group in self.groups], np.float64),
        }
        for index, group in enumerate(self.groups):
            arrays[f"{index}.layouts"] = group.layouts
            for name, space in (("coarse", group.coarse), ("fine", group.fine)):
                arrays |= {f"{index}.{name}.{key}": value for key, value in space.arrays().items()}
        return arrays

    @classmethod
    def from_arrays(cls, label: str, arrays: Mapping[str, NDArray[np.generic]]) -> Recognizer:
        """The inverse of `arrays`. Raises KeyError or ValueError where they do not fit together."""
        first, second, third, bias = (float(value) for value in np.asarray(arrays["judge"], np.float64))
        aspects = np.asarray(arrays["aspects"], np.float64)
        groups = tuple(_group(index, float(aspect), arrays) for index, aspect in enumerate(aspects))
        if not groups:
            raise ValueError("a recognizer needs at least one group of views")
        return cls(label, groups, Judge((first, second, third), bias))


def _group(index: int, aspect: float, arrays: Mapping[str, NDArray[np.generic]]) -> AspectGroup:
    coarse, fine = (ViewSpace.from_arrays(_below(f"{index}.{name}.", arrays)) for name in ("coarse", "fine"))
    layouts = np.asarray(arrays[f"{index}.layouts"], np.float32)
    if layouts.shape != (len(fine.columns), LAYOUT_LENGTH) or not aspect > 0:
        raise ValueError("the colour layouts do not fit the views")
    return AspectGroup(aspect, coarse, fine, layouts)


def _below(prefix: str, arrays: Mapping[str, NDArray[np.generic]]) -> dict[str, NDArray[np.generic]]:
    return {key.removeprefix(prefix): value for key, value in arrays.items() if key.startswith(prefix)}


def _one_for_each_place(detections: Sequence[Detection]) -> list[Detection]:
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


def _box(edges: NDArray[np.float64]) -> Box:
    x, y, width, height = (float(edge) for edge in edges)
    return Box(x, y, width, height)


class _Picture(NamedTuple):
    """What is computed once for a picture."""

    grey: Floats
    colours: ColourSums


def _best_near(
    picture: _Picture, box: Box, group: AspectGroup, scales: tuple[float, ...], reach: int
) -> Placed:
    """The window near a box that correlates best with a view, among those with the nearest encodings."""
    (u, v), height = box.centre, box.h
    shaped = Box(u - group.aspect * height / 2, v - height / 2, group.aspect * height, height)
    stack = windows_near(picture.grey, shaped, group.fine.size, scales, reach)
    prepared, textured = group.fine.prepared(stack.pixels)
    nearest = group.fine.encoding_similarity(prepared).max(axis=1) - 2.0 * ~textured
    leading = np.argsort(-nearest, kind="stable")[:_LEADING]
    correlations = group.fine.correlation(prepared[leading])
    row, view = (int(i) for i in np.unravel_index(int(correlations.argmax()), correlations.shape))
    best = stack.boxes[leading[row]]
    colours = layout_similarity(picture.colours.layouts(best[None]), group.layouts[view][None])
    evidence = Evidence(float(nearest[leading[row]]), float(correlations[row, view]), float(colours[0, 0]))
    return Placed(_box(best), evidence)


def _proposals(
    picture: _Picture, group: AspectGroup, heights_px: Sequence[float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The best windows over all scales: boxes (k, 4) of the full picture and their merit (k,).

    Merit joins look and colour for one and the same view, so that a window cannot borrow the look of one
    side and the colours of another.
    """
    levels = [_scan(picture.grey, group, height) for height in heights_px]
    none = _nothing(group.coarse.size)
    boxes = np.concatenate([none.boxes, *(level.boxes for level in levels)])
    pixels = np.concatenate([none.pixels, *(level.pixels for level in levels)])
    looks = group.coarse.correlation(group.coarse.prepared(pixels)[0])
    colours = layout_similarity(picture.colours.layouts(boxes), group.layouts)
    return boxes, (looks + _COLOUR_SHARE * colours).max(axis=1, initial=-2.0).astype(np.float64)


def _nothing(size: tuple[int, int]) -> WindowStack:
    return WindowStack(np.empty((0, size[0] * size[1]), np.float32), np.empty((0, 4)))


def _scan(grey: Floats, group: AspectGroup, target_height_px: float) -> WindowStack:
    """The most similar windows of one pyramid level, with their boxes in the full picture."""
    width, height = group.coarse.size
    rows, columns = grey.shape
    level_columns = round(columns * width / (group.aspect * target_height_px))
    level_rows = round(rows * height / target_height_px)
    if level_columns < width or level_rows < height:
        return _nothing(group.coarse.size)
    level = resize(grey, (level_columns, level_rows))
    v, u = _peaks(group.coarse.similarity_map(level), _PLACES_PER_LEVEL)
    step = np.array([columns / level_columns, rows / level_rows])
    size = np.broadcast_to(step * group.coarse.size, (len(u), 2))
    windows = sliding_window_view(level, (height, width))[v, u].reshape(len(u), width * height)
    return WindowStack(windows, np.concatenate([np.column_stack([u, v]) * step, size], axis=1))


def _peaks(values: Floats, count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of the highest positive local maxima (over 5 x 5 neighbours) of a map."""
    highest = cv2.dilate(values, np.ones((5, 5), np.uint8))
    rows, columns = np.nonzero((values >= highest) & (values > 0.0))
    order = np.argsort(-values[rows, columns], kind="stable")[:count]
    return rows[order], columns[order]
