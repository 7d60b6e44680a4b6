"""A few dozen sure matches of a pair, searched along the rows to both sides and some rows up and down.

Dense matching takes two things for granted: that the left eye's picture is the left one, and that matches lie
in the same row. This does not, so that both can be tested. Corners of both pictures are matched by the
likeness of their surroundings, best in both directions and by a clear margin, then placed to a fraction of a
pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image
from robot.vision.half_size import half_size, to_full
from robot.vision.pair_input import grey_pair

Points = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

SMOOTHING_PX = 0.8
"""Standard deviation of the Gaussian that takes noise out of the half-size pictures."""
CORNERS = 160
"""At most so many of each eye; strong ones first."""
QUALITY, SPACING_PX = 0.01, 5
"""Least response of a corner as a share of the strongest one's; pixels between two, half-size picture."""
HALF_PX = 5
"""Half the side of a corner's surroundings, in the half-size picture."""
LEAST_CONTRAST = 2.5
"""Standard deviation of the surroundings, grey levels: less is a webcam's noise."""
GAINS = (0.25, 4.0)
"""The eyes' contrasts are made alike within this ratio: more would be made of noise."""
REACH_ROWS_PX = 24
"""Searched up and down: 4 degrees at the base's focal length."""
LEAST_CORRELATION, RIVAL_MARGIN = 0.8, 0.08
"""Least likeness of a match, and by how much it must exceed that of every other corner."""
FINE_WINDOW_PX = 21
"""Window of the fine search: a corner's surroundings in full pixels."""
FINE_STEP_PX = 4.0
"""The fine search may move a match by so much: its corners are whole half-size pixels."""
WORST_RESIDUAL = 12.0
"""Mean difference of a match's surroundings after the fine search, grey levels."""


@dataclass(frozen=True, slots=True, eq=False)
class PairMatches:
    """Matched points of a pair: left and right (N, 2) columns and rows, px; N may be 0."""

    left: Points
    right: Points

    def __len__(self) -> int:
        return len(self.left)


def pair_matches(left: Image, right: Image) -> PairMatches:
    """Match a rectified pair wherever it can be done without doubt.

    left, right: (H, W, 3) BGR or (H, W) grey uint8 of equal size. Raises ValueError for anything else.

    >>> noise = np.random.default_rng(1).integers(0, 255, (120, 260), np.uint8)
    >>> scene = cv2.GaussianBlur(noise, (0, 0), 2.0)
    >>> found = pair_matches(scene[2:, :240], scene[:-2, 12:252])
    >>> np.median(found.left - found.right, axis=0).round().tolist()
    [12.0, -2.0]
    """
    grey_left, grey_right = grey_pair(left, right)
    grey_right = _exposed_as(grey_left, grey_right)
    corners_left, about_left = _corners(_smooth_half(grey_left))
    corners_right, about_right = _corners(_smooth_half(grey_right))
    if not len(corners_left) or not len(corners_right):
        return PairMatches(np.zeros((0, 2)), np.zeros((0, 2)))
    alike = about_left @ about_right.T
    apart = np.abs(corners_left[:, None, 1] - corners_right[None, :, 1])
    alike[apart > REACH_ROWS_PX // 2 + 1] = -1.0
    one, other = _sure_pairs(alike)
    return _placed(grey_left, grey_right, to_full(corners_left[one]), to_full(corners_right[other]))


def _exposed_as(reference: Image, image: Image) -> Image:
    """The picture with the mean and spread of the reference: two webcams seldom expose alike."""
    (mean, spread), (wanted_mean, wanted_spread) = (
        (float(grey.mean()), float(grey[::4, ::4].std())) for grey in (image, reference)
    )
    gain = float(np.clip(wanted_spread / max(spread, 1.0), *GAINS))
    return np.asarray(cv2.addWeighted(image, gain, image, 0.0, wanted_mean - gain * mean), np.uint8)


def _smooth_half(grey: Image) -> Image:
    return np.asarray(cv2.GaussianBlur(half_size(grey), (3, 3), SMOOTHING_PX), np.uint8)


def _corners(grey: Image) -> tuple[Points, Floats]:
    """Corners (N, 2) of a half-size picture and their surroundings (N, patch), mean 0 and length 1."""
    height, width = grey.shape
    found = cv2.goodFeaturesToTrack(grey, CORNERS, QUALITY, SPACING_PX)
    corners = np.zeros((0, 2), np.intp) if found is None else np.rint(found.reshape(-1, 2)).astype(np.intp)
    u, v = corners.T
    inside = (u >= HALF_PX) & (u < width - HALF_PX) & (v >= HALF_PX) & (v < height - HALF_PX)
    corners = corners[inside]
    step = np.arange(-HALF_PX, HALF_PX + 1)
    about = grey[
        corners[:, 1, None, None] + step[:, None], corners[:, 0, None, None] + step[None, :]
    ].reshape(len(corners), len(step) ** 2)
    about = about.astype(np.float32)
    about -= about.mean(axis=1, keepdims=True)
    length = np.linalg.norm(about, axis=1)
    clear = length >= LEAST_CONTRAST * len(step)
    return corners[clear].astype(np.float64), about[clear] / length[clear, None]


def _sure_pairs(alike: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns that are well alike, and more so than either is with anything else, by a margin."""
    row, best = np.arange(len(alike)), alike.argmax(axis=1)
    peak = alike[row, best]
    rivals = alike.copy()
    rivals[row, best] = -1.0
    rival = np.maximum(rivals.max(axis=1), rivals.max(axis=0)[best])
    sure = (peak >= LEAST_CORRELATION) & (rival <= peak - RIVAL_MARGIN)
    return row[sure], best[sure]


def _placed(left: Image, right: Image, at_left: Points, at_right: Points) -> PairMatches:
    """The matches to a fraction of a pixel (Lucas-Kanade from where the corners were found)."""
    if not len(at_left):
        return PairMatches(at_left, at_right)
    fine, found, residual = cv2.calcOpticalFlowPyrLK(
        left, right, at_left.astype(np.float32)[:, None], at_right.astype(np.float32)[:, None].copy(),
        winSize=(FINE_WINDOW_PX, FINE_WINDOW_PX), maxLevel=0, flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 20, 0.01),
    )  # fmt: skip
    placed = np.asarray(fine, np.float64).reshape(-1, 2)
    near = np.abs(placed - at_right).max(axis=1) <= FINE_STEP_PX
    good = near & (found.ravel() == 1) & (residual.ravel() <= WORST_RESIDUAL)
    return PairMatches(at_left[good], placed[good])
