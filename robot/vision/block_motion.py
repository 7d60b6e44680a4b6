"""Where did a block of the picture move to: diamond search at its best.

The published searches (`diamond.py`) walk downhill from one place and end in its valley, which after a fast
motion is the wrong one. Here the walk starts at the best of several predictions; where it does not end
nearby in a steep valley, a search of all placements in reduced pictures names one more start. Then the small
diamond walks on, and at the end the corners are tried that may yet be lower: valleys along slanting edges
are narrow. About ten of 225 places (window 7) are tested.

Source: [W] = Wu & Snášel, *A Vision-based Navigation System of Mobile Tracking Robot*, SMC 2010, section IV,
and what it leaves open (prediction, fast targets, sub-pixel, confidence); predictions as in Tourapis,
*Enhanced Predictive Zonal Search for Single and Multiple Frame Motion Estimation*, VCIP 2002.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import cv2

from robot.vision.diamond import (
    SMALL_DIAMOND,
    Displacement,
    Distortion,
    Grey,
    Motion,
    equiangular_vertex,
)
from robot.vision.reduced_search import reduced_search

_HERE: tuple[Displacement, ...] = ((0, 0),)
_SIDES = SMALL_DIAMOND[1:]
_CORNERS: tuple[Displacement, ...] = ((-1, -1), (1, -1), (-1, 1), (1, 1))
# A bottom is trusted when it has less than this share of its sides' mean distortion, and when it is reached
# in few steps from the prediction: on video blocks the cheapest choice measured that loses few.
_STEEP = 0.9
_TRUSTED_STEPS = 7
# Farther than this from the motion found is elsewhere: beyond the valley of one edge.
_APART_PX = 4
_SMALLEST_BLOCK_PX = 4


def predictions(last: Displacement, neighbours: Sequence[Displacement] = ()) -> tuple[Displacement, ...]:
    """Where to begin to look: no motion, the last motion, the median of the neighbours' motions.

    last: the block's motion one frame ago. neighbours: motions of blocks beside it in this frame; the
    median is taken of each axis by itself, of an even number the upper one.

    >>> predictions((3, -1), [(5, 0), (6, 1), (40, 0)])
    ((0, 0), (3, -1), (6, 0))
    """
    if not neighbours:
        return (0, 0), last
    middle = len(neighbours) // 2
    across, down = sorted(dx for dx, _ in neighbours), sorted(dy for _, dy in neighbours)
    return (0, 0), last, (across[middle], down[middle])


def predicted_search(
    distortion: Distortion, predicted: Iterable[Displacement] = _HERE, window: int = 7
) -> Motion:
    """Walk downhill from the best of the predicted places, over anything that has a distortion.

    Never farther than `window` from (0, 0) along either axis; predictions beyond are moved to its rim. Of
    equal predictions the first wins. The result is no higher than any of its four neighbours; its
    sub-pixel part is by `equiangular_vertex`. Raises ValueError for a window below 1 or no prediction.

    >>> motion = predicted_search(lambda dx, dy: abs(dx - 5) + abs(dy + 3), [(0, 0), (5, -2)])
    >>> motion.dx, motion.dy, motion.points
    (5, -3, 9)
    """
    if window < 1:
        raise ValueError(f"window must be at least 1, got {window}")
    walk = _Walk(distortion, (-window, window, -window, window))
    walk.begin(predicted)
    walk.finish()
    return walk.motion(1, 0)


def find_block(
    block: Grey,
    picture: Grey,
    left: int,
    top: int,
    predicted: Iterable[Displacement] = _HERE,
    window: int = 7,
) -> Motion:
    """Where in the picture the block is now: least mean absolute difference, from 0 to 255.

    block (h, w) and picture (H, W) of the same dtype, uint8 or float32; (left, top): where in the picture the
    block was. predicted: see `predictions`. window: farthest motion looked for along either axis, px.
    `points` counts the tested places; those in the reduced pictures count by their pixels, rounded up. The
    sub-pixel part is by `equiangular_vertex`, 0 along an axis where the picture or the window ends.

    Raises ValueError for pictures that are not grey or not of one dtype, a block smaller than 4 px, a window
    below 1, no prediction, or if no place within the window lies inside the picture.

    >>> import numpy as np
    >>> picture = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (120, 160), np.uint8), (0, 0), 2)
    >>> motion = find_block(picture[40:88, 60:108], picture, 60 - 20, 40 + 13, window=28)
    >>> motion.dx, motion.dy, motion.distortion
    (20, -13, 0.0)
    """
    walk = _Walk(_differences(block, picture, left, top), _limits(block, picture, left, top, window))
    walk.begin(predicted)
    walk.to_bottom(_TRUSTED_STEPS)
    reduced = None if walk.steep() else reduced_search(block, picture, left, top, window)
    if reduced is not None:
        walk.begin((reduced.best(),))
    walk.finish()
    return walk.motion(block.size, reduced.points if reduced else 0)


def confidence(block: Grey, picture: Grey, left: int, top: int, motion: Motion, window: int = 7) -> float:
    """How much better the block fits where it was found than anywhere else, 0..1.

    1 - (distortion there) / (least distortion more than 4 px away within the window). 1: a perfect match,
    nothing like it elsewhere; 0: elsewhere is as good (a bare or repeated surface, a wrong motion) or there
    is no elsewhere inside the picture. It falls as the found place fits worse and rises as the others do. The
    arguments are those of `find_block`; elsewhere is found by the reduced pictures and a walk from there, so
    that the value is seldom, and then slightly, too high.

    Raises ValueError as `find_block` and for a window below 5, within which there is no elsewhere.

    >>> import numpy as np
    >>> stripes = np.tile(np.array([0, 0, 0, 0, 200, 200, 200, 200], np.uint8), (80, 10))
    >>> confidence(stripes[16:64, 16:64], stripes, 16, 16, Motion(0, 0, 0.0, 1, 0.0, 0.0), window=12)
    0.0
    """
    if window <= _APART_PX:
        raise ValueError(f"window must be more than {_APART_PX} to have an elsewhere, got {window}")
    differences = _differences(block, picture, left, top)

    def elsewhere(dx: int, dy: int) -> float:
        near = max(abs(dx - motion.dx), abs(dy - motion.dy)) <= _APART_PX
        return math.inf if near else differences(dx, dy)

    walk = _Walk(elsewhere, _limits(block, picture, left, top, window))
    reduced = reduced_search(block, picture, left, top, window)
    rival = None if reduced is None else reduced.rival((motion.dx, motion.dy), _APART_PX)
    if rival is None:
        return 0.0
    walk.begin((rival,))
    walk.finish()
    if not 0 < walk.least < math.inf:
        return 0.0
    return min(1.0, max(0.0, 1 - motion.distortion * block.size / walk.least))


class _Walk:
    """Tested places with their distortions and the best of them; none is tested twice."""

    def __init__(self, distortion: Distortion, limits: tuple[int, int, int, int]) -> None:
        self._distortion = distortion
        self._limits = limits
        self._tested: dict[Displacement, float] = {}
        self._bottom: Displacement | None = None
        self._rises = math.inf, math.inf, math.inf, math.inf
        self.best: Displacement = (0, 0)
        self.least = math.inf

    def begin(self, places: Iterable[Displacement]) -> None:
        """Test places to walk from, each moved to the nearest one within the limits."""
        left, right, above, below = self._limits
        moved = [
            (dx, dy)
            if left <= dx <= right and above <= dy <= below
            else (min(max(dx, left), right), min(max(dy, above), below))
            for dx, dy in places
        ]
        self._look(moved, (0, 0))
        if not self._tested:
            raise ValueError("no prediction to begin with: give at least one, (0, 0) if nothing is known")

    def to_bottom(self, steps: int | None = None) -> None:
        """Walk until no side is lower, or that many steps."""
        while self.best != self._bottom and steps != 0:
            centre = self.best
            steps = None if steps is None else steps - 1
            self._look(_SIDES, centre)
            if self.best == centre:
                self._bottom, self._rises = centre, self._rises_about(centre)

    def steep(self) -> bool:
        """True if the walk is at a bottom that lies far below its sides."""
        return self.best == self._bottom and 4 * self.least <= _STEEP * (4 * self.least + sum(self._rises))

    def finish(self) -> None:
        """Walk until neither a side nor a corner that may be lower is lower."""
        self.to_bottom()
        while True:
            self._look(self._promising_corners(), self.best)
            if self.best == self._bottom:
                return
            self.to_bottom()

    def motion(self, pixels: int, reduced_points: int) -> Motion:
        """The bottom as a motion; distortions are divided by `pixels`."""
        (x, y), (west, east, north, south) = self.best, self._rises
        sub_x, sub_y = x + equiangular_vertex(west, 0.0, east), y + equiangular_vertex(north, 0.0, south)
        return Motion(x, y, self.least / pixels, len(self._tested) + reduced_points, sub_x, sub_y)

    def _look(self, pattern: Iterable[Displacement], centre: Displacement) -> None:
        """Test the pattern's places about a centre; only a lower one becomes the best."""
        centre_x, centre_y = centre
        left, right, above, below = self._limits
        tested, distortion = self._tested, self._distortion
        for dx, dy in pattern:
            x, y = place = centre_x + dx, centre_y + dy
            if place not in tested and left <= x <= right and above <= y <= below:
                value = tested[place] = distortion(x, y)
                if value < self.least:
                    self.best, self.least = place, value

    def _rises_about(self, centre: Displacement) -> tuple[float, float, float, float]:
        """How much higher the left, right, upper and lower sides are; inf beyond the limits."""
        (x, y), at, least = centre, self._tested.get, self.least
        return (
            at((x - 1, y), math.inf) - least,
            at((x + 1, y), math.inf) - least,
            at((x, y - 1), math.inf) - least,
            at((x, y + 1), math.inf) - least,
        )

    def _promising_corners(self) -> list[Displacement]:
        """Corners that may be lower than the bottom.

        On a convex paraboloid a x^2 + b y^2 + c x y + ... |c| is at most 2 sqrt(a b), so that a corner whose
        two sides rise by more than that together cannot be lower.
        """
        west, east, north, south = self._rises
        most = math.sqrt((west + east) * (north + south))
        rises = (west + north, east + north, west + south, east + south)
        return [corner for corner, rise in zip(_CORNERS, rises, strict=True) if rise < most]


def _differences(block: Grey, picture: Grey, left: int, top: int) -> Distortion:
    """Sum of absolute differences at a displacement that is known to lie inside the picture."""
    height, width = block.shape
    norm, l1 = cv2.norm, cv2.NORM_L1

    def differences(dx: int, dy: int) -> float:
        x, y = left + dx, top + dy
        return norm(block, picture[y : y + height, x : x + width], l1)

    return differences


def _limits(block: Grey, picture: Grey, left: int, top: int, window: int) -> tuple[int, int, int, int]:
    """(least dx, greatest dx, least dy, greatest dy) within the window and the picture; checks the input."""
    if block.ndim != 2 or picture.ndim != 2 or block.dtype != picture.dtype:
        raise ValueError("block and picture must be grey and of one dtype")
    if min(block.shape) < _SMALLEST_BLOCK_PX:
        raise ValueError(
            f"a block needs at least {_SMALLEST_BLOCK_PX} x {_SMALLEST_BLOCK_PX} px: {block.shape}"
        )
    if window < 1:
        raise ValueError(f"window must be at least 1, got {window}")
    height, width = block.shape
    right, below = picture.shape[1] - width - left, picture.shape[0] - height - top
    limits = max(-window, -left), min(window, right), max(-window, -top), min(window, below)
    if limits[0] > limits[1] or limits[2] > limits[3]:
        raise ValueError(f"no place within {window} px of ({left}, {top}) lies inside the picture")
    return limits
