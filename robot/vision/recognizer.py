"""Recognition of one taught target: NMF encodings propose places, correlation and colour confirm them.

A picture is scanned over a pyramid of scales with r correlations a level (the rows of pinv(W)); the
windows whose encodings lie nearest to a training encoding are cut again at a finer size, prepared as the
training views were, and judged (`robot.vision.view_matching`). `robot.vision.recognizer_training` fits it.

Source: Wu & Snášel, *A Vision-based Navigation System of Mobile Tracking Robot*, SMC 2010, section II.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from robot.messages import Box, Detection, Image
from robot.vision.colour import layout_similarity
from robot.vision.named_arrays import below
from robot.vision.view_matching import (
    LEADING,
    AspectGroup,
    Judge,
    Picture,
    Placed,
    best_near,
    box_from,
    in_shape_of,
    one_for_each_place,
)
from robot.vision.windows import Floats, WindowStack, resize, suppress_overlaps, windows_near

# Window heights of the scan: from the farthest to the nearest target, a step well inside what refining mends.
HEIGHTS_PX: tuple[float, ...] = tuple(18.0 * 1.25**step for step in range(11))
_PLACES_PER_LEVEL = 12
_CANDIDATES = 22
_CANDIDATE_OVERLAP = 0.55
# How much colour agreement (-1..1) counts beside similarity when candidates are ranked.
_COLOUR_SHARE = 1.0
# A second, wider look is worth its time only for places neither hopeless nor sure, and only for a few.
_HOPELESS, _SURE = 0.08, 0.75
_SECOND_LOOKS = 3
_FINE_SCALES = (0.93, 1.0, 1.07)
_BOX_SCALES = (0.84, 0.92, 1.0, 1.09, 1.19)
# A box that was proposed by votes may be a good deal too large, too small or beside the target.
_WIDE_SCALES, _WIDE_REACH = (0.67, 0.82, 1.0, 1.22, 1.5), 3


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
        judged = [self.detection(place) for place in self.candidates(image, heights_px)]
        return one_for_each_place([detection for detection in judged if detection.score >= 0.5])

    def glance(self, image: Image, heights_px: Sequence[float]) -> list[Detection]:
        """Like `predict`, for a few heights."""
        return self.predict(image, heights_px)

    def score(self, image: Image, box: Box) -> float:
        """How surely the target is at (or a little beside) a box, 0..1; 0.5 is the threshold.

        Searches shifts of about a sixth and scales of about a fifth of the box, nothing farther away.
        """
        return self.refine(image, box).score

    def refine(self, image: Image, box: Box) -> Detection:
        """The best place at or near a box, with its score (which may be below 0.5)."""
        return self.detection(self.locate(Picture.of(image), box))

    def judged(self, picture: Picture, box: Box) -> Detection:
        """The best place about a box that was roughly proposed, with its score.

        Searches shifts of a third and sizes of about two thirds to one and a half of the box's.
        """
        roughly = [_best_roughly(picture, box, group) for group in self.groups]
        _, start, group = max(roughly, key=lambda rough: rough[0])
        (place,) = self._looked_at_again(picture, [best_near(picture, start, group, _FINE_SCALES, 2)])
        return self.detection(place)

    def detection(self, place: Placed) -> Detection:
        """A place with its score."""
        return Detection(place.box, self._score(place), self.label)

    def locate(self, picture: Picture, box: Box) -> Placed:
        """The best window near a box over all of the target's shapes."""
        tries = (best_near(picture, box, group, _BOX_SCALES, 4) for group in self.groups)
        return max(tries, key=self._score)

    def _score(self, place: Placed) -> float:
        return self.judge.score(place.evidence)

    def candidates(self, image: Image, heights_px: Sequence[float] | None = None) -> list[Placed]:
        """The best-looking windows of a picture with their evidence, the most promising first."""
        picture = Picture.of(image)
        heights = HEIGHTS_PX if heights_px is None else heights_px
        offered = [_proposals(picture, group, heights) for group in self.groups]
        boxes, merits = (np.concatenate(parts) for parts in zip(*offered, strict=True))
        owners = np.repeat(np.arange(len(self.groups)), [len(places) for places, _ in offered])
        kept = suppress_overlaps(boxes, merits, _CANDIDATE_OVERLAP, _CANDIDATES)
        places = [
            best_near(picture, box_from(boxes[i]), self.groups[owners[i]], _FINE_SCALES, 2) for i in kept
        ]
        return self._looked_at_again(picture, places)

    def _looked_at_again(self, picture: Picture, places: list[Placed]) -> list[Placed]:
        """The same places, the most promising doubtful ones searched more widely and in all shapes."""
        places = sorted(places, key=self._score, reverse=True)
        doubtful = [i for i, place in enumerate(places) if _HOPELESS < self._score(place) < _SURE]
        for i in doubtful[:_SECOND_LOOKS]:
            places[i] = max(places[i], self.locate(picture, places[i].box), key=self._score)
        return places

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Everything learnt as plain arrays, keyed 'judge', 'aspects', '0.layouts', '0.fine.inverse', ..."""
        arrays: dict[str, NDArray[np.generic]] = {
            "judge": self.judge.values(),
            "aspects": np.array([group.aspect for group in self.groups], np.float64),
        }
        for index, group in enumerate(self.groups):
            arrays |= {f"{index}.{key}": value for key, value in group.arrays().items()}
        return arrays

    @classmethod
    def from_arrays(cls, label: str, arrays: Mapping[str, NDArray[np.generic]]) -> Recognizer:
        """The inverse of `arrays`. Raises KeyError or ValueError where they do not fit together."""
        aspects = np.asarray(arrays["aspects"], np.float64)
        groups = tuple(
            AspectGroup.from_arrays(float(aspect), below(f"{index}.", arrays))
            for index, aspect in enumerate(aspects)
        )
        if not groups:
            raise ValueError("a recognizer needs at least one group of views")
        return cls(label, groups, Judge.of_values(arrays["judge"]))


def _best_roughly(picture: Picture, box: Box, group: AspectGroup) -> tuple[float, Box, AspectGroup]:
    """The small window about a box that looks most like a view, and its merit."""
    stack = windows_near(picture.grey, in_shape_of(group, box), group.coarse.size, _WIDE_SCALES, _WIDE_REACH)
    looks = group.coarse.correlation(group.coarse.prepared(stack.pixels)[0])
    leading = np.argsort(-looks.max(axis=1), kind="stable")[:LEADING]
    colours = layout_similarity(picture.colours.layouts(stack.boxes[leading]), group.layouts)
    merits = (looks[leading] + _COLOUR_SHARE * colours).max(axis=1)
    best = int(merits.argmax())
    return float(merits[best]), box_from(stack.boxes[leading[best]]), group


def _proposals(
    picture: Picture, group: AspectGroup, heights_px: Sequence[float]
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
