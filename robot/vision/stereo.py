"""Dense disparity of a rectified pair by semi-global matching (OpenCV), behind the call all matchers keep."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Image


@dataclass(frozen=True, slots=True, eq=False)
class Disparity:
    """values (H, W) float32 px; valid (H, W) bool; sigma_px one number: standard deviation of a valid value."""

    values: NDArray[np.float32]
    valid: NDArray[np.bool_]
    sigma_px: float


class SemiGlobalMatcher:
    """(left, right) -> Disparity."""

    def __init__(self, disparities: int = 64) -> None:
        self.disparities = disparities
        self._matcher = _sgbm(disparities)
        self._coarse = _sgbm(disparities)

    def __call__(self, left: Image, right: Image) -> Disparity:
        """Match the pair."""
        grey_l, grey_r = (cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) for image in (left, right))
        fine = self._match(self._matcher, grey_l, grey_r)
        half_l, half_r = (cv2.resize(g, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for g in (grey_l, grey_r))
        coarse = 2.0 * cv2.resize(self._match(self._coarse, half_l, half_r), grey_l.shape[::-1], interpolation=cv2.INTER_NEAREST)
        too_near = coarse >= self.disparities - 2
        valid = (fine > 0.3) & ~(cv2.dilate(too_near.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0)
        return Disparity(fine, valid, 0.25)

    def _match(self, matcher: cv2.StereoSGBM, left: Image, right: Image) -> NDArray[np.float32]:
        pad = self.disparities
        l, r = (cv2.copyMakeBorder(g, 0, 0, pad, 0, cv2.BORDER_REPLICATE) for g in (left, right))
        found = matcher.compute(l, r)[:, pad:].astype(np.float32) / 16.0
        return found


def _sgbm(disparities: int) -> cv2.StereoSGBM:
    return cv2.StereoSGBM.create(
        minDisparity=0, numDisparities=disparities, blockSize=5, P1=8 * 25, P2=32 * 25, disp12MaxDiff=1,
        preFilterCap=31, uniquenessRatio=10, speckleWindowSize=60, speckleRange=2, mode=cv2.StereoSGBM_MODE_SGBM_3WAY,
    )
