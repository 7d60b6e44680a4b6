"""Where in the picture is a block, roughly: all placements tried in pictures reduced by a whole factor.

The coarse level of a two-level pyramid. Both pictures are averaged over cells of up to 6 x 6 px, on grids
that coincide at no motion; a reduced block of 8 x 8 cells tries all placements in about the time of ten at
full size. The best cell is refined by a parabola: squared differences are round at their least value.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.vision.diamond import Displacement, Grey, parabola_vertex

_REDUCTION = 6
# A reduced block of fewer cells across than this says too little.
_LEAST_REDUCED_PX = 8


class ReducedSearch(NamedTuple):
    """Squared differences of all placements of a reduced block.

    surface: (rows, columns), cell (above, before) is no motion, its neighbours lie `factor` px away. points:
    what the search cost in placements at full size, by its pixels and rounded up.
    """

    surface: NDArray[np.float32]
    factor: int
    before: int
    above: int
    points: int

    def displacement(self, row: float, column: float) -> Displacement:
        """Of a cell, or a place between cells, in px of full size."""
        return round((column - self.before) * self.factor), round((row - self.above) * self.factor)

    def best(self) -> Displacement:
        """The best placement, to a part of a cell."""
        row, column = divmod(int(self.surface.argmin()), self.surface.shape[1])
        across = _vertex_of(self.surface[row].tolist(), column)
        down = _vertex_of(self.surface[:, column].tolist(), row)
        return self.displacement(row + down, column + across)

    def rival(self, found: Displacement, apart_px: int) -> Displacement | None:
        """The best placement farther than `apart_px` along an axis from the found one, if there is any."""
        rows, columns = np.indices(self.surface.shape)
        far_across = np.abs((columns - self.before) * self.factor - found[0]) > apart_px
        far_down = np.abs((rows - self.above) * self.factor - found[1]) > apart_px
        values = np.where(far_across | far_down, self.surface, np.inf)
        row, column = divmod(int(values.argmin()), values.shape[1])
        return self.displacement(row, column) if np.isfinite(values[row, column]) else None


def reduced_search(block: Grey, picture: Grey, left: int, top: int, window: int) -> ReducedSearch | None:
    """Try all placements within `window` px in pictures reduced by a whole factor, at most 6.

    block (h, w) and picture (H, W), both uint8 or float32; (left, top): where in the picture the block was.
    None where the picture has no room for one placement in whole cells.

    >>> picture = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (120, 160), np.uint8), (0, 0), 4)
    >>> found = reduced_search(picture[40:88, 60:108], picture, 60 - 18, 40 + 12, window=28)
    >>> found.best(), found.points
    ((18, -12), 3)
    """
    factor = min(_REDUCTION, max(1, min(block.shape) // _LEAST_REDUCED_PX))
    rows, columns = block.shape[0] // factor, block.shape[1] // factor
    reach = -(-window // factor)
    # Whole cells of margin, as many as the picture has on each side: so both reduced grids coincide.
    before, above = min(reach, left // factor), min(reach, top // factor)
    after = min(reach, (picture.shape[1] - left) // factor - columns)
    below = min(reach, (picture.shape[0] - top) // factor - rows)
    if before + after < 0 or above + below < 0:
        return None
    region = picture[
        top - above * factor : top + (rows + below) * factor,
        left - before * factor : left + (columns + after) * factor,
    ]
    size = columns + before + after, rows + above + below
    around = cv2.resize(region, size, interpolation=cv2.INTER_AREA)
    whole_cells = block[: rows * factor, : columns * factor]
    small = cv2.resize(whole_cells, (columns, rows), interpolation=cv2.INTER_AREA)
    surface = np.asarray(cv2.matchTemplate(around, small, cv2.TM_SQDIFF), np.float32)
    points = math.ceil(surface.size * rows * columns / block.size)
    return ReducedSearch(surface, factor, before, above, points)


def _vertex_of(line: list[float], index: int) -> float:
    """Part of a cell from the least value of a line to the vertex of its parabola; 0 at the line's ends."""
    if not 0 < index < len(line) - 1:
        return 0.0
    return parabola_vertex(*line[index - 1 : index + 2])
