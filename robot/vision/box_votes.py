"""One detection for each object of many windows' boxes: the windows about an object vote for its box.

As in Hough voting, each window votes for a place and size, the better the more it is sure; a maximum
gathers the votes of boxes that largely overlap, and its box is their mean (one step of mean shift).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

SAME = 0.5
"""Overlap (intersection over union) from which two windows tell of one box."""
APART = 0.25
"""Overlap up to which two boxes may be of two objects."""
MOST_VOTES = 300


@dataclass(frozen=True, slots=True, eq=False)
class BoxVotes:
    """Boxes (n, 4) float32: left, top, right, bottom in pixels; logits (n,): of each being the object's."""

    boxes: Floats
    logits: Floats


def counted(votes: BoxVotes, most: int) -> BoxVotes:
    """The maxima, best first, at most `most`; a logit is the logarithm of its voters' odds together.

    >>> one, near, far = [10, 10, 30, 30], [12, 10, 32, 30], [60, 10, 90, 40]
    >>> found = counted(BoxVotes(np.array([one, near, far], np.float32), np.array([2, 2, 1], np.float32)), 9)
    >>> found.boxes.tolist(), [round(float(logit), 2) for logit in found.logits]
    ([[11.0, 10.0, 31.0, 30.0], [60.0, 10.0, 90.0, 40.0]], [2.69, 1.0])
    """
    order = np.argsort(-votes.logits, kind="stable")[:MOST_VOTES]
    boxes, logits = votes.boxes[order].astype(np.float64), votes.logits[order].astype(np.float64)
    free = np.ones(len(boxes), np.bool_)
    means, sums = [], []
    for index in range(len(boxes)):
        if free[index]:
            overlap = overlaps(boxes[index], boxes)
            mine = overlap > SAME
            mine[index] = True
            weights = 1.0 / (1.0 + np.exp(-logits[mine]))
            means.append(weights @ boxes[mine] / weights.sum())
            sums.append(float(np.logaddexp.reduce(logits[mine])))
            free &= overlap <= APART
            free[index] = False
    return _apart(np.array(means).reshape(-1, 4), np.array(sums), most)


def _apart(boxes: NDArray[np.float64], logits: NDArray[np.float64], most: int) -> BoxVotes:
    """Means may have moved together: of those the best stays."""
    kept: list[int] = []
    for index in np.argsort(-logits, kind="stable"):
        if len(kept) < most and (overlaps(boxes[index], boxes[kept]) <= APART).all():
            kept.append(int(index))
    return BoxVotes(boxes[kept].astype(np.float32), logits[kept].astype(np.float32))


def overlaps(box: NDArray[np.float64], boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Intersection over union (n,) of one box (4,) with others (n, 4): left, top, right, bottom."""
    near, far = np.maximum(box[:2], boxes[:, :2]), np.minimum(box[2:], boxes[:, 2:])
    shared = np.maximum(far - near, 0.0).prod(axis=1)
    areas = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)
    return np.asarray(shared / np.maximum(areas + (box[2:] - box[:2]).prod() - shared, 1e-9))
