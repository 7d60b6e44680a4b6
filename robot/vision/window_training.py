"""What a window net learns from: the object's views as it will be met, and everything that is not it.

Views are put before other backgrounds, slightly warped, half of them with a side hidden, many in little
light. Against them stand windows of pictures without the object, windows beside the object, and, round after
round, those that the net of the round before took for the object ("hard negatives": Sung and Poggio,
"Example-based learning for view-based human face detection", PAMI 1998).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Image
from robot.vision.gradient_histograms import CELL_PX
from robot.vision.view_warps import Place, View, ViewWarps, Warp, background_cut, grey_bytes
from robot.vision.window_features import edge_cells, windows_of
from robot.vision.window_net import Course, Lessons, WindowNet, learnt

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

MARGIN_CELLS = 2
"""Cells around a training window: edges at its rim are told apart by what lies beyond."""
AT_ONCE = 64
"""Places whose cells are counted together."""
HIDDEN_SHARE = 0.3, 0.55
"""Of the object that is hidden where a side is."""
DARK_SHARE, DARKEST = 0.4, 0.2
"""So many places are dark; of the full light that is left at least."""
ELECTRONS_PER_GREY, READ_GREY = (3.0, 60.0), (0.0, 1.5)
"""Noise of a camera that sees little, from the cheapest one as it is to a good one made smaller."""
BESIDE = 0.4, 0.8
"""Of the window: so far off windows beside the object lie."""
BESIDE_SIZE = 0.6
"""Their sizes differ by up to the exponential of it."""
PER_PICTURE = 160
"""Windows taken at random from each picture without the object."""
HARD, LEAST_LOGIT = 60, -3.0
"""Windows of each such picture that look most like the object, and how much they must at least."""
PER_OCTAVE = 4


@dataclass(frozen=True, slots=True)
class TrainingPlan:
    """How much is learnt from, at which size.

    reference_px: edge of a square as large as the object at the size it is learnt and looked for. places:
    that show the object, made of all views together. drawn: pictures of nothing in particular, as those
    without the object show too little of the world. beside: of so many places, share that shows what is
    beside it. hidden: share with a side hidden. rounds: times the net is learnt anew, each time with the hard
    negatives of the rounds before.
    """

    reference_px: float = 36.0
    places: int = 8000
    drawn: int = 24
    beside: float = 0.5
    hidden: float = 0.5
    rounds: int = 3
    course: Course = field(default_factory=Course)


@dataclass(frozen=True, slots=True)
class WindowShape:
    """rows, columns of cells of a window; extent: (width, height) px of the object that fills it."""

    rows: int
    columns: int
    extent: tuple[float, float]

    @classmethod
    def of(cls, boxes: Sequence[Box], reference_px: float) -> WindowShape:
        """A window as large as a square of `reference_px`, of the boxes' mean shape.

        Raises ValueError for an empty box.
        """
        if min(min(box.w, box.h) for box in boxes) <= 0.0:
            raise ValueError(f"a sample's box must show at least 4 px of its image, got {boxes[0]}")
        aspect = math.exp(float(np.mean([math.log(box.w / box.h) for box in boxes])))
        width, height = reference_px * math.sqrt(aspect), reference_px / math.sqrt(aspect)
        rows, columns = (max(round(edge / CELL_PX), 2) for edge in (height, width))
        return cls(rows, columns, (width, height))


def trained(
    views: Sequence[View],
    negatives: Sequence[Image],
    shape: WindowShape,
    plan: TrainingPlan,
    rng: np.random.Generator,
) -> WindowNet:
    """A net that tells the object of these views from everything else, with everything random from `rng`."""
    shown, boxes = _shown(views, negatives, shape, plan, rng)
    pyramids = [list(_cells_of(image, shape, rng)) for image in negatives for _ in range(2)]
    others = [_beside(views, negatives, shape, round(plan.beside * len(shown)), rng)]
    others += [_some(pyramid, shape, PER_PICTURE, rng) for pyramid in pyramids]
    for left in reversed(range(plan.rounds)):
        without = np.concatenate(others)
        lessons = Lessons(
            np.concatenate([shown, without]),
            np.arange(len(shown) + len(without)) < len(shown),
            np.concatenate([boxes, np.zeros((len(without), 4), np.float32)]),
        )
        # Nets that only look for hard negatives need not be the best there are.
        course = replace(plan.course, epochs=plan.course.epochs // 2) if left else plan.course
        net = learnt(lessons, course, rng)
        if left:
            others += [_hard(net, pyramid, shape) for pyramid in pyramids]
    return net


def _shown(
    views: Sequence[View],
    negatives: Sequence[Image],
    shape: WindowShape,
    plan: TrainingPlan,
    rng: np.random.Generator,
) -> tuple[Floats, Floats]:
    """Windows (n, d) that show the object, and its boxes (n, 4) in them."""
    met, boxes = [], []
    for warps in _warps(views, shape, plan.places):
        place = warps.place(warps.drawn(rng), negatives, rng)
        met.append(_met(place, negatives, plan.hidden, rng))
        boxes.append(_box_in(place, shape))
    return _windows(met, shape), np.array(boxes, np.float32)


def _beside(
    views: Sequence[View],
    negatives: Sequence[Image],
    shape: WindowShape,
    count: int,
    rng: np.random.Generator,
) -> Floats:
    """Windows (n, d) that show a part of the object and its surroundings, or it as a part of them."""
    met = []
    for warps in _warps(views, shape, count):
        straight = warps.straight()
        away, off = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(*BESIDE)
        x = straight.middle[0] + off * math.cos(away) * shape.extent[0]
        y = straight.middle[1] + off * math.sin(away) * shape.extent[1]
        grow = math.exp(rng.uniform(-BESIDE_SIZE, BESIDE_SIZE))
        place = warps.place(Warp(0.0, grow, (x, y)), negatives, rng)
        met.append(_met(place, negatives, 0.0, rng))
    return _windows(met, shape)


def _warps(views: Sequence[View], shape: WindowShape, count: int) -> Iterator[ViewWarps]:
    """Each view in turn, `count` in all, at the size at which it is as large as the window's object."""
    size = (shape.columns + 2 * MARGIN_CELLS) * CELL_PX, (shape.rows + 2 * MARGIN_CELLS) * CELL_PX
    area = shape.extent[0] * shape.extent[1]
    ready = [ViewWarps(view, math.sqrt(area / max(view.box.area, 1.0)), size) for view in views]
    for index in range(count):
        yield ready[index % len(ready)]


def _met(place: Place, others: Sequence[Image], hidden: float, rng: np.random.Generator) -> Image:
    """The place as it might be met: with a side hidden by something else, in little light."""
    image = place.image
    if rng.random() < hidden:
        rows, columns = image.shape
        hider = background_cut(others, (columns, rows), rng)
        image = np.where(_side(place.mask, rng), hider, image).astype(np.uint8)
    return darkened(image, rng) if rng.random() < DARK_SHARE else image


def _side(mask: Mask, rng: np.random.Generator) -> Mask:
    """The part of a place on one side, above, below, left or right, with some share of the object's mask."""
    side, share = int(rng.integers(4)), rng.uniform(*HIDDEN_SHARE)
    found = np.zeros(mask.shape, np.bool_)
    lying = np.nonzero(mask)[side // 2]
    if not lying.size:
        return found
    edge = int(np.sort(lying)[int((share if side % 2 else 1.0 - share) * (len(lying) - 1))])
    beyond = found if side // 2 == 0 else found.T
    if side % 2:
        beyond[:edge] = True
    else:
        beyond[edge:] = True
    return found


def darkened(image: Image, rng: np.random.Generator) -> Image:
    """A grey uint8 picture in a part of its light, with the noise of a camera that sees little."""
    light = rng.uniform(DARKEST, 1.0) * image.astype(np.float64)
    electrons = math.exp(rng.uniform(*np.log(ELECTRONS_PER_GREY)))
    noise = np.sqrt(light / electrons + rng.uniform(*READ_GREY) ** 2)
    return np.clip(np.rint(light + noise * rng.normal(0.0, 1.0, light.shape)), 0, 255).astype(np.uint8)


def _windows(places: Sequence[Image], shape: WindowShape) -> Floats:
    """The windows in the middle of places, (n, d)."""
    windows = []
    for start in range(0, len(places), AT_ONCE):
        column = np.concatenate(places[start : start + AT_ONCE])
        cells = edge_cells(column)
        # Places above and below change no more than cells of the margin.
        each = cells.reshape(-1, shape.rows + 2 * MARGIN_CELLS, *cells.shape[1:])
        inner = each[:, MARGIN_CELLS:-MARGIN_CELLS, MARGIN_CELLS:-MARGIN_CELLS]
        windows.append(inner.reshape(len(inner), -1))
    return np.concatenate(windows)


def _box_in(place: Place, shape: WindowShape) -> tuple[float, float, float, float]:
    """The object's box over the window's: offset of its middle, logarithms of its edges."""
    rows, columns = place.image.shape
    width, height = shape.extent
    return (
        (place.middle[0] - (columns / 2 - 0.5)) / width,
        (place.middle[1] - (rows / 2 - 0.5)) / height,
        math.log(place.extent[0] / width),
        math.log(place.extent[1] / height),
    )


def _cells_of(image: Image, shape: WindowShape, rng: np.random.Generator) -> Iterator[Floats]:
    """Edge cells of a picture without the object, dark or not, mirrored or not, at sizes of a pyramid."""
    grey = grey_bytes(image)
    if rng.random() < 0.5:
        grey = np.ascontiguousarray(grey[:, ::-1])
    if rng.random() < 0.5:
        grey = darkened(grey, rng)
    smallest = max(shape.rows * CELL_PX / grey.shape[0], shape.columns * CELL_PX / grey.shape[1])
    shrink = 2.0 ** (-rng.uniform(0.0, 1.0 / PER_OCTAVE))
    while shrink >= smallest or smallest >= 1.0:
        size = (max(round(edge * max(shrink, smallest)), CELL_PX) for edge in reversed(grey.shape))
        yield edge_cells(np.asarray(cv2.resize(grey, tuple(size), interpolation=cv2.INTER_AREA), np.uint8))
        if smallest >= 1.0:
            return
        shrink *= 2.0 ** (-1.0 / PER_OCTAVE)


def _all_windows(cells: Floats, shape: WindowShape) -> Floats:
    if cells.shape[0] < shape.rows or cells.shape[1] < shape.columns:
        return np.zeros((0, shape.rows * shape.columns * cells.shape[2]), np.float32)
    windows = windows_of(cells, shape.rows, shape.columns)
    return windows.reshape(-1, windows.shape[2])


def _some(pyramid: Sequence[Floats], shape: WindowShape, count: int, rng: np.random.Generator) -> Floats:
    """Windows (n, d) of a picture at random, at every size about as many."""
    found = [np.zeros((0, shape.rows * shape.columns * pyramid[0].shape[2]), np.float32)]
    for cells in pyramid:
        windows = _all_windows(cells, shape)
        found.append(windows[rng.permutation(len(windows))[: math.ceil(count / len(pyramid))]])
    return np.concatenate(found)


def _hard(net: WindowNet, pyramid: Sequence[Floats], shape: WindowShape) -> Floats:
    """The windows (n, d) of a picture that look most like the object."""
    windows, logits = [], []
    for cells in pyramid:
        every = _all_windows(cells, shape)
        told = net.answers(every)[:, 0]
        leading = np.argsort(-told, kind="stable")[:HARD]
        windows.append(every[leading])
        logits.append(told[leading])
    told = np.concatenate(logits)
    leading = np.argsort(-told, kind="stable")[:HARD]
    return np.concatenate(windows)[leading[told[leading] > LEAST_LOGIT]]
