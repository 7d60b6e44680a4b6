"""Half of a taught target: what speaks for a place where something hides the other half.

Each half of a window (upper, lower, left, right) is held against the same half of every training view, with
the mean and the spread of grey of that half alone: what hides the rest has no say in it. Both pieces of
evidence, correlation of grey and agreement of the colour layout, are asked of one and the same view.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot.messages import Box
from robot.vision.colour import GRID_COLUMNS, GRID_ROWS, layout_similarity
from robot.vision.view_matching import AspectGroup, Picture, box_from, in_shape_of
from robot.vision.viewspace import ViewSpace
from robot.vision.windows import Floats, windows_near

Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]

WIDE_SCALES, WIDE_REACH = (0.82, 1.0, 1.22), 2
SCALES, REACH = (0.9, 1.0, 1.11), 2
"""Sizes and shifts (window pixels) tried about a box, with small windows and then with large ones."""
COMMON_SHARE = 0.6
"""Of what is common that is taken off: how unlike all else a half is counts."""
COMMON_QUANTILE, LEAST_COMMON = 0.98, 0.5
"""Of the places without the target; flat places would make everything look rare."""
LEADING = 3
"""Windows of each half whose colours are asked."""
LEAST_CONTRAST = 0.35
"""Of a view's whole contrast that its half must have: a plain half correlates with anything plain."""
FLAT_STD = 3.0
"""Halves of windows that spread less, grey values, hold nothing but noise."""


@dataclass(frozen=True, slots=True, eq=False)
class HalfViews:
    """Halves of the views of one shape. common (m, 4): what places without the target reach of each half of
    each view, in correlation and colour together: a stripe on plain ground is soon found anywhere."""

    group: AspectGroup
    common: Floats


class HalfPlaced(NamedTuple):
    """A place by its best half: whole box, correlation (-1..1) and colour agreement (-1..1) of that half, and
    what places without the target reach of it."""

    box: Box
    correlation: float
    colour: float
    common: float

    @property
    def merit(self) -> float:
        """By which halves and places are compared."""
        return self.correlation + self.colour - COMMON_SHARE * self.common


NOWHERE = HalfPlaced(Box(0.0, 0.0, 0.0, 0.0), -1.0, -1.0, 0.0)
"""Where no half tells anything."""


def best_half(picture: Picture, box: Box, shapes: Sequence[HalfViews]) -> HalfPlaced:
    """The place about a box whose best half is most like that half of a view, over all of a target's shapes.

    Small windows say roughly where and of which shape, shifts of a third and sizes from four fifths to five
    fourths of the box's; large ones about the best of them say how much alike. `NOWHERE` if all are flat.
    """
    rough = [_best(picture, box, views, views.group.coarse, WIDE_SCALES, WIDE_REACH) for views in shapes]
    best = max(range(len(shapes)), key=lambda i: rough[i].merit)
    if rough[best] is NOWHERE:
        return NOWHERE
    return _best(picture, rough[best].box, shapes[best], shapes[best].group.fine, SCALES, REACH)


def commonness(places: Iterable[tuple[Picture, Box]], group: AspectGroup) -> Floats:
    """What these places without the target reach of each half of each view, (m, 4): see `HalfViews`."""
    reached = [_reached(picture, box, group) for picture, box in places]
    if not reached:
        return np.full((len(group.layouts), 4), LEAST_COMMON, np.float32)
    return np.quantile(np.stack(reached), COMMON_QUANTILE, axis=0).clip(LEAST_COMMON).astype(np.float32)


def _reached(picture: Picture, box: Box, group: AspectGroup) -> Floats:
    stack = windows_near(picture.grey, in_shape_of(group, box), group.fine.size, SCALES, REACH)
    found = np.empty((len(group.layouts), 4), np.float32)
    for index, (pixels, cells) in enumerate(zip(halves(*group.fine.size), _cells(), strict=True)):
        alike = _correlation(stack.pixels[:, pixels], group.fine.columns[:, pixels])
        windows = alike.argmax(axis=0)
        seen = picture.colours.layouts(stack.boxes[windows])
        colours = _agreement(seen, group.layouts, np.broadcast_to(cells, seen.shape))
        found[:, index] = alike[windows, np.arange(len(windows))] + colours
    return found


def _best(
    picture: Picture, box: Box, views: HalfViews, space: ViewSpace, scales: tuple[float, ...], reach: int
) -> HalfPlaced:
    group = views.group
    stack = windows_near(picture.grey, in_shape_of(group, box), space.size, scales, reach)
    leading = zip(*_leading(stack.pixels, space, views.common), strict=True)
    windows, known, alike, common = (np.concatenate(part) for part in leading)
    mine = _cells().repeat(len(windows) // 4, axis=0)
    colours = _agreement(picture.colours.layouts(stack.boxes[windows]), group.layouts[known], mine)
    best = int((alike + colours - COMMON_SHARE * common).argmax())
    if alike[best] <= -1.0:
        return NOWHERE
    box = box_from(stack.boxes[windows[best]])
    return HalfPlaced(box, float(alike[best]), float(colours[best]), float(common[best]))


def _leading(
    pixels: Floats, space: ViewSpace, common: Floats
) -> list[tuple[Indices, Indices, Floats, Floats]]:
    """Of each half the windows most like a view: which, which view, how much, how much is common."""
    found = []
    for index, half in enumerate(halves(*space.size)):
        alike = _correlation(pixels[:, half], space.columns[:, half])
        told = alike - COMMON_SHARE * common[:, index]
        leading = np.argsort(-told.max(axis=1), kind="stable")[:LEADING]
        views = told[leading].argmax(axis=1)
        found.append((leading, views, alike[leading, views], common[views, index]))
    return found


def _cells() -> Mask:
    """Which entries of a colour layout belong to each half, (4, 96)."""
    cells = halves(GRID_COLUMNS, GRID_ROWS)
    return np.concatenate([cells, cells], axis=1)


def _agreement(layouts: Floats, others: Floats, cells: Mask) -> Floats:
    """Colour agreement (k,) of each layout with the other of the same row, by those cells of it alone."""
    pairs = zip(layouts, others, cells, strict=True)
    return np.array([layout_similarity(a[None, c], b[None, c])[0, 0] for a, b, c in pairs], np.float32)


def halves(columns: int, rows: int) -> Mask:
    """Upper, lower, left and right half of a grid, (4, rows x columns); a middle line belongs to neither.

    >>> halves(2, 3).astype(int).tolist()
    [[1, 1, 0, 0, 0, 0], [0, 0, 0, 0, 1, 1], [1, 0, 1, 0, 1, 0], [0, 1, 0, 1, 0, 1]]
    """
    found = np.zeros((4, rows, columns), np.bool_)
    found[0, : rows // 2] = True
    found[1, rows - rows // 2 :] = True
    found[2, :, : columns // 2] = True
    found[3, :, columns - columns // 2 :] = True
    return found.reshape(4, -1)


def _correlation(windows: Floats, views: Floats) -> Floats:
    """Normalised correlation (k, m) of k windows with m views; -1 for flat windows and plain views."""
    (seen, contrast), (known, share) = _normalised(windows), _normalised(views)
    alike = seen @ known.T
    alike[contrast < FLAT_STD * np.sqrt(windows.shape[1])] = -1.0
    alike[:, share < LEAST_CONTRAST] = -1.0
    return np.asarray(alike, np.float32)


def _normalised(rows: Floats) -> tuple[Floats, Floats]:
    """Rows with mean 0 and length 1, and the lengths they had."""
    centred = rows - rows.mean(axis=1, keepdims=True)
    lengths = np.linalg.norm(centred, axis=1)
    return centred / np.maximum(lengths, 1e-6)[:, None], lengths
