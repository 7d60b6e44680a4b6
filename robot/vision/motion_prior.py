"""How far a target moved since the last frame, before anyone asks what it looks like: METHODS 3.

The target's box is one block, brought to one working size whatever its range; a diamond search from no motion
and from the last motion says where the block is now. It knows neighbouring frames alone and would drift, so
it is believed only as the place around which the target is then looked for.
"""

from __future__ import annotations

import cv2
import numpy as np

from robot.messages import Box, Image
from robot.vision.block_motion import confidence, find_block, predictions
from robot.vision.picture_patch import patch_of

BLOCK_PX = 32
"""Mean edge of the block at working size."""
WINDOW_PX = 24
"""Farthest motion at working size: three quarters of the target's mean edge."""
LEAST_CONFIDENCE = 0.3
"""Below it the block is as good elsewhere: no motion is told."""


def motion_prior(
    before: Image, now: Image, box: Box, last: tuple[float, float] = (0.0, 0.0)
) -> tuple[float, float]:
    """How far (right, down) px what was in the box has moved; (0, 0) in doubt.

    Args:
        before, now: two frames (H, W, 3) uint8 BGR.
        box: where the target was in the first one.
        last: its motion one frame earlier, px.

    >>> rng = np.random.default_rng(0)
    >>> scene = cv2.resize(rng.integers(0, 255, (24, 30, 3), np.uint8), (360, 288))
    >>> across, down = motion_prior(scene, np.roll(scene, (9, -21), (0, 1)), Box(150, 100, 60, 60))
    >>> round(across), round(down)
    (-21, 9)
    """
    shrink = BLOCK_PX / (box.w * box.h) ** 0.5
    width, height = (max(round(edge * shrink), 8) for edge in (box.w, box.h))
    per_px = box.w / width, box.h / height
    wide = width + 2 * WINDOW_PX, height + 2 * WINDOW_PX
    about = wide[0] * per_px[0], wide[1] * per_px[1]
    block = _grey(patch_of(before, box.centre, (box.w, box.h), (width, height)))
    picture = _grey(patch_of(now, box.centre, about, wide))
    if block.std() < 2.0:
        return 0.0, 0.0
    start = round(last[0] / per_px[0]), round(last[1] / per_px[1])
    motion = find_block(block, picture, WINDOW_PX, WINDOW_PX, predictions(start), WINDOW_PX)
    if confidence(block, picture, WINDOW_PX, WINDOW_PX, motion, WINDOW_PX) < LEAST_CONFIDENCE:
        return 0.0, 0.0
    return motion.sub_dx * per_px[0], motion.sub_dy * per_px[1]


def _grey(patch: Image) -> Image:
    return np.asarray(cv2.cvtColor(patch, cv2.COLOR_BGR2GRAY), np.uint8)
