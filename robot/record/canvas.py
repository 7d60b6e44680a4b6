"""Small drawing helpers on BGR images: text, label chips, corner brackets, washes. Colours are RGB."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from robot.messages import Box, Image, Points
from robot.record.palette import INK, Rgb, bgr

_REGULAR, _BOLD = cv2.FONT_HERSHEY_SIMPLEX, cv2.FONT_HERSHEY_DUPLEX


def text(
    canvas: Image, words: str, at: tuple[int, int], colour: Rgb, *, size: float = 0.4, bold: bool = False
) -> None:
    """Write words with their base line starting at `at` (u, v). size 1 is about 22 px high."""
    cv2.putText(canvas, words, at, _BOLD if bold else _REGULAR, size, bgr(colour), 1, cv2.LINE_AA)


def text_width(words: str, *, size: float = 0.4, bold: bool = False) -> int:
    """How many pixels wide `text` writes the words."""
    (width, _), _ = cv2.getTextSize(words, _BOLD if bold else _REGULAR, size, 1)
    return int(width)


def chip(canvas: Image, words: str, box: Box, colour: Rgb) -> None:
    """A filled label on top of a box, inside the image whatever the box."""
    height = canvas.shape[0]
    bottom = round(box.y) - 2
    if bottom < 15:  # no room above the box: sit on its lower edge
        bottom = min(round(box.y + box.h) + 17, height - 1)
    label(canvas, words, (round(box.x), bottom), colour)


def label(canvas: Image, words: str, at: tuple[int, int], colour: Rgb) -> None:
    """Words on a filled ground whose lower left corner is `at`, pushed sideways into the image."""
    wide = text_width(words, size=0.36, bold=True) + 8
    left = int(np.clip(at[0], 0, max(canvas.shape[1] - wide, 0)))
    bottom = at[1]
    cv2.rectangle(canvas, (left, bottom - 14), (left + wide, bottom), bgr(colour), -1)
    text(canvas, words, (left + 4, bottom - 4), INK, size=0.36, bold=True)


def corners(canvas: Image, box: Box, colour: Rgb, *, thickness: int) -> None:
    """The four corners of a box, dark-edged so that they show on any ground."""
    x0, y0, x1, y1 = (round(c) for c in (box.x, box.y, box.x + box.w, box.y + box.h))
    arm = max(round(0.25 * min(box.w, box.h)), 4)
    lines = [
        np.array([[x + dx * arm, y], [x, y], [x, y + dy * arm]], dtype=np.int32)
        for x, y, dx, dy in ((x0, y0, 1, 1), (x1, y0, -1, 1), (x1, y1, -1, -1), (x0, y1, 1, -1))
    ]
    cv2.polylines(canvas, lines, False, (0, 0, 0), thickness + 2, cv2.LINE_AA)
    cv2.polylines(canvas, lines, False, bgr(colour), thickness, cv2.LINE_AA)


def wash(canvas: Image, polygons: Sequence[Points], colour: Rgb, *, opacity: float) -> None:
    """Tint the insides of convex polygons (N, 2) px, each pixel once however many cover it."""
    if not polygons:
        return
    mask = np.zeros(canvas.shape[:2], dtype=np.uint8)
    for polygon in polygons:
        cv2.fillConvexPoly(mask, np.round(polygon * 8).astype(np.int32), 255, cv2.LINE_8, shift=3)
    tint = np.empty_like(canvas)
    tint[:] = bgr(colour)
    cv2.copyTo(cv2.addWeighted(canvas, 1.0 - opacity, tint, opacity, 0.0), mask, canvas)
