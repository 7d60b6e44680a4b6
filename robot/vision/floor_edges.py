"""Edges of the floor by themselves: where its height jumps from one cell of a sector to a next one.

Heights over the nominal floor are blurred by how the base is tipped: half a degree lifts what lies a metre
and a half away by a centimetre, and a plane fitted to a floor with a step in it leans to hide the step. A
jump between two neighbouring places shows none of that. Source: METHODS 10 wants steps down found; ours.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

LEAST_PIXELS = 6.0
"""Pixels a cell's height is averaged over at least."""
REACH_CELLS, REACH_M = 5, 0.25
"""An edge hides or blurs some cells behind it: so far apart two cells are still compared."""
FARTHEST_M = 1.6
"""Beyond, a picture row spans more than an edge hides, and matching errors look like edges."""
JUMP_SHARE, SIGMAS = 0.6, 1.0
"""Of the step height, and standard deviations of a pixel's height, that make a jump of it."""
ALIKE_SECTORS = 5
"""Most of so many neighbouring sectors must see the edge at the same ring or the one beside it."""


def height_jumps(
    height_sum: Floats, sigma_sum: Floats, count: Floats, rings: Floats, step_height: float
) -> Mask:
    """Cells (sectors, rings) behind which the floor lies higher or lower by nearly a step.

    Args:
        height_sum, sigma_sum, count: of the pixels measured in each cell, (S, R): summed heights over the
            floor, their summed standard deviations, metres; and how many.
        rings: edges of the rings, (R + 1,), metres.
        step_height: what stands up or falls away so much is an obstacle, metres.

    >>> count = np.full((7, 6), 20, np.float32)
    >>> height = np.where(np.arange(6) < 3, 0.0, -0.03) * count
    >>> found = height_jumps(height, 0.001 * count, count, np.linspace(0.5, 0.74, 7, dtype=np.float32), 0.03)
    >>> found[3].nonzero()[0].tolist()
    [3]
    """
    known = count >= LEAST_PIXELS
    some = np.maximum(count, np.float32(1.0))
    height, sigma = height_sum / some, sigma_sum / some
    found = np.zeros(known.shape, np.bool_)
    nearer = np.zeros(known.shape, np.bool_)
    for apart in range(1, min(REACH_CELLS, known.shape[1] - 1) + 1):
        here, there = slice(None, -apart), slice(apart, None)
        gate = JUMP_SHARE * step_height + SIGMAS * np.hypot(sigma[:, here], sigma[:, there])
        jump = known[:, here] & known[:, there] & (np.abs(height[:, there] - height[:, here]) > gate)
        jump &= (rings[apart:-1] - rings[1:-apart] < REACH_M) & (rings[apart:-1] < FARTHEST_M)
        # An edge between cells nearer to each other is the same one, and better placed.
        nearer = nearer[:, :-1] | nearer[:, 1:]
        found[:, 1 : 1 + jump.shape[1]] |= jump & ~nearer
        nearer |= jump
    wide = cv2.dilate(found.view(np.uint8), np.ones((1, 3), np.uint8)).astype(np.float32)
    held = cv2.blur(wide, (1, ALIKE_SECTORS), borderType=cv2.BORDER_REPLICATE) > 0.5
    return np.asarray(found & held, np.bool_)
