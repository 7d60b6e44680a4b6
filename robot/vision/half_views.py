"""Half of a taught target: what speaks for a place where something hides the other half.

Each half of a window (upper, lower, left, right) is held against the same half of every training view, with
the mean and the spread of grey of that half alone: what hides the rest has no say in it. Both pieces of
evidence, correlation of grey and agreement of the colour layout, are asked of one and the same view.
"""

from __future__ import annotations

from collections.abc import Sequence
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
LEADING = 3
"""Windows of each half whose colours are asked."""
LEAST_CONTRAST = 0.5
"""Of a view's whole contrast that its half must have: a plain half correlates with anything plain."""
FLAT_STD = 3.0
"""Halves of windows that spread less, grey values, hold nothing but noise."""


class HalfPlaced(NamedTuple):
    """A place by its best half: whole box, correlation (-1..1) and colour agreement (-1..1) of that half."""

    box: Box
    correlation: float
    colour: float

    @property
    def merit(self) -> float:
        """By which halves and places are compared."""
        return self.correlation + self.colour


NOWHERE = HalfPlaced(Box(0.0, 0.0, 0.0, 0.0), -1.0, -1.0)
"""Where no half tells anything."""


def best_half(picture: Picture, box: Box, groups: Sequence[AspectGroup]) -> HalfPlaced:
    """The place about a box whose best half is most like that half of a view, over all of a target's shapes.

    Small windows say roughly where and of which shape, shifts of a third and sizes from two thirds to one and
    a half of the box's; large ones about the best of them say how much alike. `NOWHERE` if all are flat.
    """
    rough = [_best(picture, box, group, group.coarse, WIDE_SCALES, WIDE_REACH) for group in groups]
    best = max(range(len(groups)), key=lambda i: rough[i].merit)
    if rough[best] is NOWHERE:
        return NOWHERE
    return _best(picture, rough[best].box, groups[best], groups[best].fine, SCALES, REACH)


def _best(
    picture: Picture, box: Box, group: AspectGroup, space: ViewSpace, scales: tuple[float, ...], reach: int
) -> HalfPlaced:
    stack = windows_near(picture.grey, in_shape_of(group, box), space.size, scales, reach)
    windows, views, alike = (
        np.concatenate(part) for part in zip(*_leading(stack.pixels, space), strict=True)
    )
    cells = halves(GRID_COLUMNS, GRID_ROWS)
    mine = np.concatenate([cells, cells], axis=1).repeat(len(windows) // len(cells), axis=0)
    colours = _agreement(picture.colours.layouts(stack.boxes[windows]), group.layouts[views], mine)
    best = int((alike + colours).argmax())
    if alike[best] <= -1.0:
        return NOWHERE
    return HalfPlaced(box_from(stack.boxes[windows[best]]), float(alike[best]), float(colours[best]))


def _leading(pixels: Floats, space: ViewSpace) -> list[tuple[Indices, Indices, Floats]]:
    """Of each half the windows most like a view: which, which view, how much."""
    found = []
    for half in halves(*space.size):
        alike = _correlation(pixels[:, half], space.columns[:, half])
        leading = np.argsort(-alike.max(axis=1), kind="stable")[:LEADING]
        views = alike[leading].argmax(axis=1)
        found.append((leading, views, alike[leading, views]))
    return found


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
