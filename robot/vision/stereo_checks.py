"""What of a matcher's map counts as measured. Doubt means not measured: free space is made of this.

A value counts if both eyes chose it, the windows really look alike, its doubt is small, it does not touch a
jump of depth, it lies on a surface and nothing hides it from the right eye. What is nearer than the search
thus comes out unmeasured, never far: chance matches fail one of these.
"""

from __future__ import annotations

import cv2
import numpy as np

from robot.messages import Image
from robot.vision.disparity import Disparity, Floats, Mask
from robot.vision.stereo_refinement import WINDOW, Window, doubled, fit

MAX_SIGMA_PX = 0.6
"""A match less certain than this is no measurement."""
HIDDEN_SLACK_PX = 1.0
"""Noise makes columns cross by less than this."""
MAX_JUMP_PX = 1.5
"""Between the left and the right neighbour; a surface seen so obliquely is not measured."""
SPECK_PX, SURFACE_STEP_PX = 400, 1.0
"""A surface smaller than this is a false match; neighbours on one surface differ by less than this."""


def measured(left: Image, right: Image, coarse: Floats, stable: Mask, window: Window = WINDOW) -> Disparity:
    """The map's last step: values fitted to the grey values (H, W) uint8, and checked.

    coarse (H, W) float32 px, filled everywhere; stable (H, W): where both eyes chose that value.
    """
    found = fit(left, right, coarse, window)
    valid = stable & found.good
    values = np.maximum(np.where(valid, found.values, coarse), np.float32(0.0))
    columns = np.arange(left.shape[1], dtype=np.float32)
    valid &= (values > 0.0) & (values <= columns) & (found.sigma_px <= MAX_SIGMA_PX) & ~_torn(values)
    coarse_valid = _on_surfaces(values[::2, ::2], valid[::2, ::2])
    coarse_valid &= ~_hidden(columns[::2] - values[::2, ::2], coarse_valid)
    valid &= doubled(coarse_valid.view(np.uint8)).view(np.bool_)[: left.shape[0], : left.shape[1]]
    return Disparity(values, valid, np.where(valid, found.sigma_px, np.float32(np.inf)))


def _torn(values: Floats) -> Mask:
    """Pixels at a jump of the disparity: blocks that see two surfaces measure neither."""
    torn: Mask = np.zeros(values.shape, np.bool_)
    torn[:, 1:-1] = np.abs(values[:, 2:] - values[:, :-2]) > MAX_JUMP_PX
    return torn


def _on_surfaces(values: Floats, valid: Mask) -> Mask:
    """What lies on a surface of at least `SPECK_PX` (at half the size): false matches have few neighbours."""
    sixteenths = np.where(valid, 16.0 * values + 16.0, 0.0).astype(np.int16)
    surfaces, _ = cv2.filterSpeckles(sixteenths, 0, SPECK_PX // 4, round(16 * SURFACE_STEP_PX))
    kept: Mask = np.asarray(surfaces) > 0
    return kept


def _hidden(right_columns: Floats, valid: Mask) -> Mask:
    """Pixels that something to their right hides from the right eye: no measurement, whatever was filled in.

    right_columns: where each left pixel lies in the right picture; it must rise from left to right.
    """
    bound = np.where(valid, right_columns, np.float32(np.inf))
    least = np.minimum.accumulate(bound[:, ::-1], axis=1)[:, ::-1]
    hidden: Mask = right_columns > least + np.float32(HIDDEN_SLACK_PX)
    return hidden
