"""Disparity maps of a perfect matcher on ray-cast rooms: exact, and invalid where one eye alone sees."""

from __future__ import annotations

import numpy as np
from rendered_pairs import Pair

from calib.model import StereoRig
from robot.vision.disparity import Disparity

SLACK_PX = 0.6


def exact_map(pair: Pair, rig: StereoRig, sigma_px: float = 0.1) -> Disparity:
    """True disparities; what something nearer hides from the right eye, or lies outside it, is not valid."""
    values = (rig.left.fx * rig.baseline / pair.depth).astype(np.float32)
    columns = np.arange(values.shape[1], dtype=np.float32) - values
    least = np.minimum.accumulate(columns[:, ::-1], axis=1)[:, ::-1]
    valid = (columns <= least + SLACK_PX) & (columns >= 0.0)
    return Disparity(values, valid, np.where(valid, np.float32(sigma_px), np.float32(np.inf)))


def without(found: Disparity, holes: np.ndarray) -> Disparity:
    """The same map with the pixels of `holes` (H, W) not measured, and nothing sensible guessed there."""
    values = np.where(holes, np.float32(0.0), found.values)
    sigma = np.where(holes, np.float32(np.inf), found.sigma_px)
    return Disparity(values, found.valid & ~holes, sigma)
