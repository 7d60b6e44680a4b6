"""Diamond search: where did a block move to, in a few tries.

The search knows only a distortion function of an integer displacement, so that it can be tested on bowls
and used on anything; `BlockDistortion` is the thin adapter to pictures. A large diamond (9 points) walks
downhill, a small one (5 points) finishes. The improved search of [W] tests both together in its first
step (13 points), which saves a step for slow targets. No displacement is tested twice.

Source: Wu & Snášel, *A Vision-based Navigation System of Mobile Tracking Robot*, SMC 2010, section IV;
Zhu & Ma, *A New Diamond Search Algorithm for Fast Block-Matching Motion Estimation*, 2000.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Displacement = tuple[int, int]
Grey = NDArray[np.uint8] | NDArray[np.float32]
Distortion = Callable[[int, int], float]

SMALL_DIAMOND: tuple[Displacement, ...] = ((0, 0), (0, -1), (-1, 0), (1, 0), (0, 1))
LARGE_DIAMOND: tuple[Displacement, ...] = (
    (0, 0), (0, -2), (-1, -1), (1, -1), (-2, 0), (2, 0), (-1, 1), (1, 1), (0, 2),
)  # fmt: skip
FIRST_STEP: tuple[Displacement, ...] = LARGE_DIAMOND + SMALL_DIAMOND[1:]


@dataclass(frozen=True, slots=True)
class Motion:
    """Where the distortion is least.

    (dx, dy): whole displacement, to the right and down. (sub_dx, sub_dy): the same refined by a
    quadratic through the neighbours, within half a pixel. distortion: its value there (low = sure).
    points: how many displacements were tested, those of the sub-pixel fit not counted.
    """

    dx: int
    dy: int
    distortion: float
    points: int
    sub_dx: float
    sub_dy: float


def diamond_search(distortion: Distortion, start: Displacement = (0, 0), window: int = 7) -> Motion:
    """Plain diamond search from `start`, never farther than `window` from it along either axis.

    Ties keep the centre. `distortion(dx, dy)` may return inf for a displacement that does not exist.

    >>> motion = diamond_search(lambda dx, dy: (dx + 4) ** 2 + (dy + 2) ** 2)
    >>> motion.dx, motion.dy, motion.points
    (-4, -2, 24)
    """
    return _search(_Probe(distortion, start, window), LARGE_DIAMOND, start)


def improved_diamond_search(distortion: Distortion, start: Displacement = (0, 0), window: int = 7) -> Motion:
    """Improved diamond search of [W]: both diamonds in the first step, then as the plain one.

    >>> motion = improved_diamond_search(lambda dx, dy: (dx + 2) ** 2 + dy**2)
    >>> motion.dx, motion.dy, motion.points
    (-2, 0, 21)
    """
    return _search(_Probe(distortion, start, window), FIRST_STEP, start)


def full_search(distortion: Distortion, start: Displacement = (0, 0), window: int = 7) -> Motion:
    """Test every displacement within `window` of `start`: slow and sure, the oracle of the other two."""
    probe = _Probe(distortion, start, window)
    around = range(-window, window + 1)
    best = probe.best(start, ((dx, dy) for dy in around for dx in around))
    return probe.motion(best)


def restarted_search(
    distortion: Distortion, starts: Iterable[Displacement], window: int = 7, *, good_enough: float
) -> Motion:
    """Improved diamond search from several starts in turn until one ends below `good_enough`.

    For a target that jumped: its true place may lie in another valley than the one next to the
    prediction. Returns the best motion found, with the points of all tries. At least one start is needed.
    """
    best: Motion | None = None
    points = 0
    for start in starts:
        motion = improved_diamond_search(distortion, start, window)
        points += motion.points
        if best is None or motion.distortion < best.distortion:
            best = motion
        if best.distortion < good_enough:
            break
    if best is None:
        raise ValueError("at least one start is needed")
    return Motion(best.dx, best.dy, best.distortion, points, best.sub_dx, best.sub_dy)


def _search(probe: _Probe, first_step: Iterable[Displacement], start: Displacement) -> Motion:
    centre = probe.best(start, first_step)
    if centre != start:
        while (lower := probe.best(centre, LARGE_DIAMOND)) != centre:
            centre = lower
    return probe.motion(probe.best(centre, SMALL_DIAMOND))


class _Probe:
    """Remembers every tested displacement, so that none is tested twice, and keeps to the window."""

    def __init__(self, distortion: Distortion, start: Displacement, window: int) -> None:
        if window < 1:
            raise ValueError(f"window must be at least 1, got {window}")
        self._distortion = distortion
        self._start = start
        self._window = window
        self._tested: dict[Displacement, float] = {}

    def at(self, dx: int, dy: int) -> float:
        value = self._tested.get((dx, dy))
        if value is None:
            value = self._tested[(dx, dy)] = float(self._distortion(dx, dy))
        return value

    def contains(self, dx: int, dy: int) -> bool:
        return abs(dx - self._start[0]) <= self._window and abs(dy - self._start[1]) <= self._window

    def best(self, centre: Displacement, pattern: Iterable[Displacement]) -> Displacement:
        """The pattern's point of least distortion about `centre`; the centre itself wins ties."""
        best, least = centre, self.at(*centre)
        for dx, dy in pattern:
            point = (centre[0] + dx, centre[1] + dy)
            if self.contains(*point) and (value := self.at(*point)) < least:
                best, least = point, value
        return best

    def motion(self, place: Displacement) -> Motion:
        (dx, dy), points = place, len(self._tested)
        value = self.at(dx, dy)
        sub_dx = dx + self._vertex((dx - 1, dy), value, (dx + 1, dy))
        sub_dy = dy + self._vertex((dx, dy - 1), value, (dx, dy + 1))
        return Motion(dx, dy, value, points, sub_dx, sub_dy)

    def _vertex(self, before: Displacement, value: float, after: Displacement) -> float:
        if before not in self._tested or after not in self._tested:
            return 0.0
        return parabola_vertex(self._tested[before], value, self._tested[after])


def parabola_vertex(before: float, value: float, after: float) -> float:
    """Place of the least value of the parabola through (-1, before), (0, value), (1, after), within +-0.5.

    0 where the three do not form a valley.

    >>> parabola_vertex(1.5**2, 0.5**2, 0.5**2)
    0.5
    """
    bend = before - 2 * value + after
    if not (bend > 0 and math.isfinite(bend)):
        return 0.0
    return min(max((before - after) / (2 * bend), -0.5), 0.5)


def equiangular_vertex(before: float, value: float, after: float) -> float:
    """Place of the least value of the V of equal slopes through (-1, before), (0, value), (1, after).

    Within +-0.5; 0 where the three do not form a valley. Absolute differences grow linearly from their
    least value, so that this is less biased for them than `parabola_vertex` (`bench.diamond` measures both).

    Source: Shimizu & Okutomi, *Sub-pixel estimation error cancellation on area-based matching*, IJCV 2005.

    >>> equiangular_vertex(1.25, 0.25, 0.75)
    0.25
    """
    rise = max(before, after) - value
    if not (rise > 0 and math.isfinite(rise) and min(before, after) >= value):
        return 0.0
    return (before - after) / (2 * rise)


class BlockDistortion:
    """Mean absolute difference between a block and the picture's part at a displacement.

    block (h, w) and picture (H, W) of the same dtype, uint8 or float32. (left, top): where in the
    picture the block lies at displacement (0, 0). A part that leaves the picture has distortion inf.

    >>> picture = np.zeros((20, 20), np.uint8); picture[8:12, 9:13] = 200
    >>> block = np.full((4, 4), 200, np.uint8)
    >>> motion = improved_diamond_search(BlockDistortion(block, picture, 8, 8))
    >>> motion.dx, motion.dy, motion.distortion
    (1, 0, 0.0)
    """

    def __init__(
        self,
        block: Grey,
        picture: Grey,
        left: int,
        top: int,
    ) -> None:
        if block.ndim != 2 or picture.ndim != 2 or block.dtype != picture.dtype:
            raise ValueError("block and picture must be grey and of one dtype")
        self._block = block
        self._picture = picture
        self._left = left
        self._top = top

    def __call__(self, dx: int, dy: int) -> float:
        """Mean absolute difference at displacement (dx, dy), in grey values."""
        height, width = self._block.shape
        x, y = self._left + dx, self._top + dy
        if x < 0 or y < 0 or x + width > self._picture.shape[1] or y + height > self._picture.shape[0]:
            return float("inf")
        part = self._picture[y : y + height, x : x + width]
        return float(cv2.norm(self._block, part, cv2.NORM_L1)) / self._block.size
