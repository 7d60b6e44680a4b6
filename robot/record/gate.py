"""A base's passage drawn as a gate: its clear width, from the floor to the body's height.

Only what is safe looks like an open door. What is not safe is dashed, in the colour of warnings, and says so.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from robot.messages import Box, Image, Passage
from robot.record import palette
from robot.record.canvas import chip

_DASH_PX, _LINE_PX, _DARK = 10, 2, (0, 0, 0)
_OUTSIDE_PX = 16
"""So far beyond the picture a gate is cut off: none of that is seen."""


def gate_of(passage: Passage) -> Box:
    """The gate in pixels of the left picture; `passage` must be a base's (see `messages.Passage`).

    Its foot is right to a few pixels: what is seen from above looks a little shorter.

    >>> gate_of(Passage((100.0, 80.0), 30.0, 0.3, (1.0, 0.0, 0.16)))
    Box(x=70.0, y=48.0, w=60.0, h=64.0)
    """
    (u, v), half_wide = passage.centre, max(passage.radius_px, 1.0)
    half_high = half_wide * 2.0 * max(passage.position[2], 0.0) / max(passage.diameter, 1e-3)
    return Box(u - half_wide, v - half_high, 2.0 * half_wide, 2.0 * half_high)


def gate_words(passage: Passage) -> str:
    """What stands beside the gate.

    >>> gate_words(Passage((100.0, 80.0), 30.0, 0.3, (1.0, 0.0, 0.16)))
    '0.30 m wide, not safe'
    """
    return f"{passage.diameter:.2f} m wide" + ("" if passage.safe else ", not safe")


def gate_colour(passage: Passage) -> palette.Rgb:
    """The passage's colour if it is safe, else that of warnings."""
    return palette.PASSAGE if passage.safe else palette.WARNING


def draw_gate(canvas: Image, gate: Box, passage: Passage) -> None:
    """Draw the gate (pixels of this canvas), dark-edged; nothing is written."""
    colour = palette.bgr(gate_colour(passage))
    lines = _outline(gate, canvas) if passage.safe else _dashes(gate, canvas)
    cv2.polylines(canvas, lines, False, _DARK, _LINE_PX + 2)
    cv2.polylines(canvas, lines, False, colour, _LINE_PX)


def label_gate(canvas: Image, gate: Box, passage: Passage) -> None:
    """Write the gate's words on top of it."""
    chip(canvas, gate_words(passage), gate, gate_colour(passage))


def _outline(gate: Box, canvas: Image) -> list[np.ndarray]:
    corners = _corners(gate, canvas)
    return [np.rint([*corners, corners[0]]).astype(np.int32)]


def _dashes(gate: Box, canvas: Image) -> list[np.ndarray]:
    """Each side begins and ends with a dash, so that the corners show."""
    corners = _corners(gate, canvas)
    dashes: list[np.ndarray] = []
    for start, end in zip(corners, [*corners[1:], corners[0]], strict=True):
        parts = 2 * max(round(math.dist(start, end) / (2 * _DASH_PX)), 1) + 1
        ends = np.rint(np.linspace(start, end, parts + 1)).astype(np.int32)
        dashes += [ends[k : k + 2] for k in range(0, parts, 2)]
    return dashes


def _corners(gate: Box, canvas: Image) -> list[tuple[float, float]]:
    height, width = canvas.shape[:2]
    x0, x1 = (float(np.clip(x, -_OUTSIDE_PX, width + _OUTSIDE_PX)) for x in (gate.x, gate.x + gate.w))
    y0, y1 = (float(np.clip(y, -_OUTSIDE_PX, height + _OUTSIDE_PX)) for y in (gate.y, gate.y + gate.h))
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
