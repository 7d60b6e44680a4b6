"""What a followed target looks like, and where it is near its last place: filter, colours and size joined.

A window about the target, larger than it, is brought to one working size. The correlation filter says how
well the target's gradients fit in each cell, the colours how much of a box about each cell is of the target;
the mean of both has its peak where the target is, and the scale filter says how large it is there.

Source: Bertinetto et al., "Staple" (CVPR 2016) for the two that complete each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from robot.messages import Box, Image
from robot.vision.colour_model import ColourModel, box_means
from robot.vision.correlation_filter import CorrelationFilter, second_peak
from robot.vision.diamond import parabola_vertex
from robot.vision.gradient_histograms import CELL_PX, gradient_histograms
from robot.vision.picture_patch import patch_of
from robot.vision.scale_filter import ScaleFilter

Floats = NDArray[np.float32]

ROOM = 1.5
"""Beside the target, of its mean edge, all in all: so far its motion may carry it."""
WINDOW_PX = 150.0
"""Mean edge of the window at working size."""
SIGMA_SHARE = 1.0 / 16.0
"""Of the target's mean edge: how sharp the wanted peak is."""
COLOUR_SHARE = 0.3
"""Of the joined answer."""


@dataclass(frozen=True, slots=True)
class Rates:
    """Shares of a new look in what is remembered of gradients, colours and size."""

    gradients: float = 0.015
    colours: float = 0.04
    size: float = 0.025


@dataclass(frozen=True, slots=True)
class Sighting:
    """Where the target fits best. peak: the filter's answer there, 1 as learnt, some 0.2 in real pictures;
    ratio: over the second peak's."""

    box: Box
    peak: float
    ratio: float


@dataclass(frozen=True, slots=True, eq=False)
class TargetLook:
    """A target's looks. Sees BGR uint8 pictures; never changes, `and_met` gives the next one.

    cells: (columns, rows) of the window; room: the window's (width, height) over the target's.
    """

    cells: tuple[int, int]
    room: tuple[float, float]
    gradients: CorrelationFilter
    colours: ColourModel
    size: ScaleFilter

    @classmethod
    def learnt(cls, image: Image, box: Box) -> TargetLook:
        """From what is in the box.

        >>> rng = np.random.default_rng(0)
        >>> scene = cv2.resize(rng.integers(0, 255, (24, 30, 3), np.uint8), (360, 288))
        >>> look = TargetLook.learnt(scene, Box(150, 100, 50, 60))
        >>> found = look.find(np.roll(scene, (3, -7), (0, 1)), Box(150, 100, 50, 60)).box
        >>> round(found.x), round(found.y)
        (143, 103)
        """
        around = 0.5 * ROOM * (box.w + box.h)
        window = box.w + around, box.h + around
        shrink = WINDOW_PX / math.sqrt(window[0] * window[1])
        columns, rows = (
            scipy.fft.next_fast_len(max(round(edge * shrink / CELL_PX), 4), real=True) for edge in window
        )
        cells, room = (columns, rows), (window[0] / box.w, window[1] / box.h)
        patch = _patch(image, box, cells, room)
        target = cells[0] / room[0], cells[1] / room[1]
        sigma = SIGMA_SHARE * math.sqrt(target[0] * target[1])
        return cls(
            cells,
            room,
            CorrelationFilter.learnt(_features(patch), sigma),
            ColourModel.learnt(patch, (CELL_PX * target[0], CELL_PX * target[1])),
            ScaleFilter.learnt(image, box.centre, (box.w, box.h)),
        )

    def and_met(self, image: Image, box: Box, rates: Rates) -> TargetLook:
        """The looks after one more, which shows the target in the box."""
        patch = _patch(image, box, self.cells, self.room)
        return TargetLook(
            self.cells,
            self.room,
            self.gradients.and_met(_features(patch), rates.gradients),
            self.colours.and_met(patch, self._target_px, rates.colours),
            self.size.and_met(image, box.centre, (box.w, box.h), rates.size),
        )

    def find(self, image: Image, box: Box) -> Sighting:
        """The target in a window about a box that has its last, or supposed, place and size."""
        patch = _patch(image, box, self.cells, self.room)
        fits = self.gradients.response(_features(patch))
        mine = box_means(self.colours.likelihood(patch), self._target_px)
        coloured = cv2.resize(mine, self.cells, interpolation=cv2.INTER_AREA)
        joined = (1.0 - COLOUR_SHARE) * fits + COLOUR_SHARE * coloured
        row, column = (int(i) for i in np.unravel_index(int(joined.argmax()), joined.shape))
        across = _vertex(joined[row], column) - self.cells[0] // 2
        down = _vertex(joined[:, column], row) - self.cells[1] // 2
        (u, v), peak = box.centre, float(fits[row, column])
        u += across * self.room[0] * box.w / self.cells[0]
        v += down * self.room[1] * box.h / self.cells[1]
        factor = self.size.factor(image, (u, v), (box.w, box.h))
        w, h = box.w * factor, box.h * factor
        return Sighting(Box(u - w / 2, v - h / 2, w, h), peak, peak / second_peak(fits, row, column))

    @property
    def _target_px(self) -> tuple[float, float]:
        """(width, height) of the target at working size."""
        return CELL_PX * self.cells[0] / self.room[0], CELL_PX * self.cells[1] / self.room[1]


def _patch(image: Image, box: Box, cells: tuple[int, int], room: tuple[float, float]) -> Image:
    size = room[0] * box.w, room[1] * box.h
    return patch_of(image, box.centre, size, (CELL_PX * cells[0], CELL_PX * cells[1]))


def _features(patch: Image) -> Floats:
    """Gradient histograms and mean colours (L, a, b), (channels, rows, columns), faded out to the rim."""
    grey = np.asarray(cv2.cvtColor(patch, cv2.COLOR_BGR2GRAY), np.uint8)
    gradients = gradient_histograms(grey)
    rows, columns = gradients.shape[1:]
    lab = cv2.resize(patch, (columns, rows), interpolation=cv2.INTER_AREA)
    colours = cv2.cvtColor(lab, cv2.COLOR_BGR2LAB).astype(np.float32) / np.float32(255.0) - np.float32(0.5)
    fade = np.hanning(rows + 2)[1:-1, None] * np.hanning(columns + 2)[None, 1:-1]
    return np.concatenate([gradients, colours.transpose(2, 0, 1)]) * fade.astype(np.float32)


def _vertex(line: Floats, at: int) -> float:
    """Place of the peak to a part of a cell."""
    if not 0 < at < len(line) - 1:
        return float(at)
    return at + parabola_vertex(-float(line[at - 1]), -float(line[at]), -float(line[at + 1]))
