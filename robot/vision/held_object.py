"""What a person holds before the eyes: found by depth alone, whatever it looks like.

The nearest surface in the middle of the picture is taken for it, with all that is connected to it and hardly
farther away, if what is seen around it is clearly farther. An arm that reaches in from below is cut off where
the shape narrows.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.model import StereoRig
from robot.messages import Box
from robot.vision.disparity import Disparity

Mask = NDArray[np.bool_]
Floats = NDArray[np.float32]

FARTHEST_M = 0.9
THICK_M = 0.15
"""Of the object, from its nearest point."""
CLEAR_M, CLEAR_SHARE = 0.1, 0.7
"""So much farther than the object must be what is seen around it, and for so much of its outline."""
MIDDLE = 0.6
"""Of the picture's edges: where the object must be."""
NEAREST_QUANTILE = 0.05
LEAST_SHARE, MOST_SHARE = 0.01, 0.4
"""Of the picture that it must fill, and that it may."""
HOLES_PX, RING_PX = 9, 7
WIDE = 0.8
"""Of the picture's width: what is wider is a floor or a wall."""
WRIST = 0.6
"""Of the widest row: a narrower one below it is the arm's."""

AWAY = "hold the object 0.3 to 0.8 m before the eyes"


@dataclass(frozen=True, slots=True, eq=False)
class HeldObject:
    """Box (pixels) and mask (H, W) of the object in the left picture, its median distance along the axis."""

    box: Box
    mask: Mask
    depth_m: float


@dataclass(frozen=True, slots=True)
class NotHeld:
    """Why nothing was taken for held, with the cure: words for the person."""

    words: str


NOTHING = NotHeld(f"nothing is held before the eyes: {AWAY}")


def held_object(disparity: Disparity, rig: StereoRig) -> HeldObject | NotHeld:
    """The object held before the eyes, or why there is none."""
    depth = np.where(
        disparity.valid & (disparity.values > 0.5),
        rig.left.fx * rig.baseline / np.maximum(disparity.values, 0.5),
        np.inf,
    ).astype(np.float32)
    height, width = depth.shape
    middle = _middle(depth)
    near = middle[middle < FARTHEST_M]
    if near.size < LEAST_SHARE * depth.size:
        return NOTHING
    nearest = float(np.quantile(near, NEAREST_QUANTILE))
    mask = _shape(depth < nearest + THICK_M)
    if mask.any(axis=0).sum() > WIDE * width:
        return NOTHING  # a floor or a wall goes from rim to rim
    if mask[:, 0].any() or mask[:, -1].any() or mask[0].any():
        return NotHeld("it reaches out of the picture: hold it in the middle, or farther away")
    if mask[-1].any():
        mask = _without_arm(mask)
        if mask[-1].any():
            return NotHeld("it reaches out of the picture below: hold it higher, or farther away")
    share = float(mask.sum()) / (height * width)
    if share > MOST_SHARE:
        return NotHeld("it fills the picture: hold it farther away")
    if share < LEAST_SHARE:
        return NotHeld("it is too small: hold it nearer")
    if not _stands_free(mask, depth, nearest + THICK_M + CLEAR_M):
        return NotHeld("something is close behind or beside it: hold it freely before the eyes")
    return HeldObject(_box_of(mask), mask, float(np.median(depth[mask & np.isfinite(depth)])))


def _middle(depth: Floats) -> Floats:
    height, width = depth.shape
    rows, columns = (round((1.0 - MIDDLE) / 2 * edge) for edge in (height, width))
    return depth[rows : height - rows, columns : width - columns]


def _shape(near: Mask) -> Mask:
    """The largest connected piece of what is near, holes and unmeasured gaps filled."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (HOLES_PX, HOLES_PX))
    framed = np.pad(near.astype(np.uint8), HOLES_PX)
    closed = cv2.morphologyEx(cv2.morphologyEx(framed, cv2.MORPH_CLOSE, disc), cv2.MORPH_OPEN, disc)
    inner = closed[HOLES_PX:-HOLES_PX, HOLES_PX:-HOLES_PX]
    outlines, _ = cv2.findContours(inner, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = np.zeros(near.shape, np.uint8)
    if outlines:
        cv2.drawContours(filled, [max(outlines, key=cv2.contourArea)], -1, 1, cv2.FILLED)
    return filled.astype(np.bool_)


def _without_arm(mask: Mask) -> Mask:
    """The shape above the row where, below its widest one, it has become narrow."""
    widths = mask.sum(axis=1)
    widest = int(widths.argmax())
    narrow = np.nonzero(widths[widest:] < WRIST * widths[widest])[0]
    found = mask.copy()
    if narrow.size:
        found[widest + int(narrow[0]) :] = False
    return found


def _stands_free(mask: Mask, depth: Floats, beyond: float) -> bool:
    """Whether what is measured around the shape is mostly farther away; the cut of an arm does not count."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * RING_PX + 1, 2 * RING_PX + 1))
    around = cv2.dilate(mask.astype(np.uint8), disc).astype(np.bool_) & ~mask
    around[np.nonzero(mask.any(axis=1))[0][-1] + 1 :] = False
    measured = around & np.isfinite(depth)
    return bool(measured.sum() > 0 and (depth[measured] > beyond).mean() >= CLEAR_SHARE)


def _box_of(mask: Mask) -> Box:
    rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
    x, y = float(columns[0]), float(rows[0])
    return Box(x, y, float(columns[-1]) + 1.0 - x, float(rows[-1]) + 1.0 - y)
