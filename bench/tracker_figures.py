"""What is said of a tracker: overlap with the truth, success curve, recovery, false locks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bench.tracker_sequences import AWAY, BEFORE, COVERED
from robot.messages import Box, Track

Truth = Sequence[Box | None]
THRESHOLDS = np.linspace(0.0, 1.0, 21)
"""Overlaps of the success curve (Wu, Lim, Yang, "Online object tracking: a benchmark", CVPR 2013)."""
FRAMES_PER_SECOND = 25
HELD = 0.5
"""Overlap from which a target counts as held."""
LAST = 5
"""Frames before the occlusion over which a tracker is asked whether it holds the target."""


def overlaps(tracks: Sequence[Track | None], truth: Truth) -> NDArray[np.float64]:
    """Intersection over union of each frame, NaN where the target is not visible; 0 where it is given up."""
    return np.array(
        [
            np.nan if box is None else 0.0 if track is None or track.lost else track.box.iou(box)
            for track, box in zip(tracks, truth, strict=True)
        ]
    )


def success_auc(overlap: NDArray[np.float64]) -> float:
    """Area under the success curve: mean over the thresholds of the share of frames above them.

    >>> success_auc(np.array([1.0, 0.0, np.nan]))
    0.47619...
    """
    seen = overlap[~np.isnan(overlap)]
    return float(np.mean([(seen > threshold).mean() for threshold in THRESHOLDS])) if len(seen) else 0.0


def false_locks(tracks: Sequence[Track | None], truth: Truth) -> int:
    """Frames in which the target is not visible and the tracker says that it holds it."""
    return sum(
        track is not None and not track.lost for track, box in zip(tracks, truth, strict=True) if box is None
    )


def held_before_cover(overlap: NDArray[np.float64]) -> bool:
    """Whether the target was held just before it was half covered."""
    return bool(np.nanmean(overlap[BEFORE - LAST : BEFORE]) >= HELD)


def after_cover(overlap: NDArray[np.float64]) -> float:
    """Mean overlap in as many frames after the occlusion as it lasted."""
    return float(np.nanmean(overlap[BEFORE + COVERED : BEFORE + 2 * COVERED]))


def found_again_s(overlap: NDArray[np.float64]) -> float:
    """Seconds from the target's return to the first frame in which it is held; inf if never."""
    back = np.flatnonzero(overlap[BEFORE + AWAY :] >= HELD)
    return float(back[0]) / FRAMES_PER_SECOND if len(back) else float("inf")
