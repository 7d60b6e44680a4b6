"""Runs of unmeasured pixels along the rows of a map: what bounds them, and sums along them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Index = NDArray[np.int32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """For every pixel (H, W) of a map the known ones that bound its run along the row.

    inside: pixels that are not known. before, after: columns of the last known pixel at or before this one
    (-1: none), and of the first at or after it (W: none).

    >>> runs = Runs.of(np.array([[False, True, False, False, True]]))
    >>> runs.before.tolist(), runs.after.tolist()
    ([[-1, 1, 1, 1, 4]], [[1, 1, 4, 4, 4]])
    """

    inside: Mask
    before: Index
    after: Index

    @classmethod
    def of(cls, known: Mask) -> Runs:
        """The runs between known pixels (H, W)."""
        width = known.shape[1]
        column = np.arange(width, dtype=np.int32)
        before = np.maximum.accumulate(np.where(known, column, np.int32(-1)), axis=1)
        after = np.minimum.accumulate(np.where(known, column, np.int32(width))[:, ::-1], axis=1)[:, ::-1]
        return cls(~known, before, np.ascontiguousarray(after))

    @property
    def has_before(self) -> Mask:
        """Where something known lies before."""
        return np.asarray(self.before >= 0, np.bool_)

    @property
    def has_after(self) -> Mask:
        """Where something known lies after."""
        return np.asarray(self.after < self.inside.shape[1], np.bool_)

    @property
    def between(self) -> Mask:
        """Unmeasured pixels with something known to both sides."""
        return self.inside & self.has_before & self.has_after

    @property
    def length(self) -> Index:
        """Columns from the known pixel before to the one after."""
        return self.after - self.before

    def of_rows(self, rows: NDArray[np.intp]) -> Runs:
        """The runs of some rows alone."""
        return Runs(self.inside[rows], self.before[rows], self.after[rows])

    def total(self, counted: NDArray[Any]) -> NDArray[np.float64]:
        """Sum over each pixel's run, at every pixel of it; what is known counts nothing.

        counted (H, W): numbers or a mask; only meaningful for runs that are bounded to both sides.
        """
        summed = np.cumsum(np.where(self.inside, counted, 0), axis=1, dtype=np.float64)
        return np.asarray(at(summed, self.after) - at(summed, self.before), np.float64)

    def cheapest_cut(self, cost: Floats) -> tuple[Index, NDArray[np.float64], NDArray[np.float64]]:
        """Where each run is best cut in two, if `cost` is paid for every pixel up to the cut.

        Returns:
            The last column before the cut (that of `before` if it pays to take none), the least sum up to it
            (0 or less), and the sum over all of the run; each (H, W), at every pixel of the run.
        """
        summed = np.cumsum(np.where(self.inside, cost, 0.0), axis=1, dtype=np.float64)
        since = summed - at(summed, self.before)
        # Every run lies far below the one before, so a running minimum begins anew in each.
        begins = self.inside & (np.arange(since.shape[1]) == self.before + 1)
        below = np.cumsum(begins, axis=1) * (4.0 * float(np.abs(cost).sum()) + 1.0)
        least = np.minimum.accumulate(np.where(self.inside, since, 0.0) - below, axis=1) + below
        least = np.minimum(at(least, self.after - 1), 0.0)
        column = np.arange(since.shape[1], dtype=np.int32)
        cut = np.maximum.accumulate(np.where(self.inside & (since <= least), column, np.int32(-1)), axis=1)
        cut = np.where(least < 0.0, at(cut, self.after - 1), self.before)
        return np.asarray(cut, np.int32), least, at(summed, self.after) - at(summed, self.before)


def at(plane: NDArray[Any], columns: Index) -> NDArray[Any]:
    """Values of a plane (H, W) at one column for every pixel; columns outside take the nearest one."""
    height, width = plane.shape
    rows = np.arange(0, height * width, width, dtype=np.int32)[:, None]
    inside = np.minimum(np.maximum(columns, np.int32(0)), np.int32(width - 1))
    return np.take(np.ascontiguousarray(plane), inside + rows)
