"""What `robot look` leaves: the left eye with box and passage, its depth beside it, a scale in metres."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.look_measure import Look, Sight, depths, mount_over
from robot.messages import Box, Image, Passage
from robot.record import palette
from robot.record.canvas import chip, corners, label, text, text_width
from robot.record.gate import draw_gate, gate_of, label_gate

LEAST_HEIGHT_PX = 480
"""Smaller pictures are enlarged by a whole factor, so that words stay small beside them."""
SCALE_WIDTH_PX, CAPTION_PX, GAP_PX = 74, 30, 6
UNMEASURED = (54, 50, 46)
TICKS = 7


def draw(found: Look) -> Image:
    """Picture, depth map, scale and caption as one BGR uint8 image; `found` is left as it is."""
    factor = max(1, math.ceil(LEAST_HEIGHT_PX / found.picture.shape[0]))
    inverse = _inverse_depth(found)
    low, high = _span(inverse)
    eye = _enlarged(_coloured(found.picture), factor, cv2.INTER_CUBIC)
    depth_map = _enlarged(_depth_colours(inverse, low, high), factor, cv2.INTER_NEAREST)
    for canvas in (eye, depth_map):
        draw_obstacles(canvas, found, factor)
        draw_passage(canvas, found, factor)
        for sight in found.sights:
            _draw_sight(canvas, sight, factor)
    gap = _ground(eye.shape[0], GAP_PX)
    panels = np.hstack([eye, gap, depth_map, gap, _scale(eye.shape[0], low, high)])
    return np.vstack([panels, _caption(found, panels.shape[1], eye.shape[1] + GAP_PX)])


def _inverse_depth(found: Look) -> NDArray[np.float64]:
    """1/Z in 1/m, NaN where unmeasured: linear in disparity, so near and far keep equal detail."""
    inverse: NDArray[np.float64] = 1.0 / depths(found.disparity, found.rig)
    return inverse


def _span(inverse: NDArray[np.float64]) -> tuple[float, float]:
    known = inverse[np.isfinite(inverse)]
    if not len(known):
        return 0.1, 1.0
    low, high = (float(c) for c in np.percentile(known, [1.0, 99.0]))
    return (low, high) if high - low > 1e-3 else (low - 5e-4, high + 5e-4)


def _depth_colours(inverse: NDArray[np.float64], low: float, high: float) -> Image:
    level = np.clip((np.nan_to_num(inverse, nan=low) - low) / (high - low) * 255.0, 0.0, 255.0)
    colours = np.asarray(cv2.applyColorMap(level.astype(np.uint8), cv2.COLORMAP_VIRIDIS), dtype=np.uint8)
    colours[~np.isfinite(inverse)] = UNMEASURED
    return colours


def _coloured(image: Image) -> Image:
    picture = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image
    return np.asarray(picture, dtype=np.uint8)


def _enlarged(image: Image, factor: int, interpolation: int) -> Image:
    if factor == 1:
        return image.copy()
    size = image.shape[1] * factor, image.shape[0] * factor
    return np.asarray(cv2.resize(image, size, interpolation=interpolation), dtype=np.uint8)


def _enlarged_box(box: Box, factor: int) -> Box:
    return Box(box.x * factor, box.y * factor, box.w * factor, box.h * factor)


def _ground(height: int, width: int) -> Image:
    ground = np.empty((height, width, 3), dtype=np.uint8)
    ground[:] = palette.bgr(palette.INK)
    return ground


def _scale(height: int, low: float, high: float) -> Image:
    """A bar of the colours, near on top, with metres beside it."""
    panel = _ground(height, SCALE_WIDTH_PX)
    top, bottom = 24, height - 12
    ramp = np.linspace(255, 0, bottom - top).astype(np.uint8)[:, None]
    panel[top:bottom, 6:22] = cv2.applyColorMap(np.repeat(ramp, 16, axis=1), cv2.COLORMAP_VIRIDIS)
    text(panel, "metres", (6, 15), palette.PAPER, size=0.38)
    for share in np.linspace(0.0, 1.0, TICKS):
        inverse = high + (low - high) * float(share)
        row = round(top + float(share) * (bottom - top - 1))
        cv2.line(panel, (22, row), (26, row), palette.bgr(palette.PAPER), 1)
        words = f"{1.0 / inverse:.2f}" if inverse > 1e-3 else "far"
        text(panel, words, (30, row + 4), palette.PAPER, size=0.38)
    return panel


def draw_obstacles(canvas: Image, found: Look, factor: int) -> None:
    """Where the things that stand on the floor touch it."""
    if found.ways is None or found.floor is None or not len(found.ways.obstacles):
        return
    rotation, eye = mount_over(found.floor, found.rig).left_eye(0.0, found.floor.tilt)
    feet = np.column_stack([found.ways.obstacles, np.zeros(len(found.ways.obstacles))])
    seen = (feet - eye) @ rotation
    camera = found.rig.left
    for x, y, z in seen[seen[:, 2] > 0.05].tolist():
        at = (camera.fx * x / z + camera.cx + 0.5) * factor, (camera.fy * y / z + camera.cy + 0.5) * factor
        cv2.circle(canvas, (round(at[0]), round(at[1])), 4, (0, 0, 0), -1, cv2.LINE_AA)
        cv2.circle(
            canvas, (round(at[0]), round(at[1])), 3, palette.bgr(palette.OBSTACLE_NEAR), -1, cv2.LINE_AA
        )


def draw_passage(canvas: Image, found: Look, factor: int) -> None:
    """The way over the floor where that is known, else the largest hole in the picture."""
    if found.ways is not None and found.ways.passage is not None:
        gate = _enlarged_box(gate_of(found.ways.passage), factor)
        draw_gate(canvas, gate, found.ways.passage)
        label_gate(canvas, gate, found.ways.passage)
    elif found.passage is not None:
        _draw_hole(canvas, found.passage, factor)


def _draw_hole(canvas: Image, passage: Passage, factor: int) -> None:
    u, v = (round((c + 0.5) * factor) for c in passage.centre)
    radius = max(round(passage.radius_px * factor), 1)
    for colour, thickness in (((0, 0, 0), 4), (palette.bgr(palette.PASSAGE), 2)):
        cv2.circle(canvas, (u, v), radius, colour, thickness, cv2.LINE_AA)
    words = f"free {passage.diameter:.2f} m"
    label(canvas, words, (u - (text_width(words, size=0.36, bold=True) + 8) // 2, v + 7), palette.PASSAGE)


def _draw_sight(canvas: Image, sight: Sight, factor: int) -> None:
    box = _enlarged_box(sight.box, factor)
    corners(canvas, box, palette.TARGET, thickness=2)
    centre = round(box.centre[0]), round(box.centre[1])
    cv2.drawMarker(canvas, centre, palette.bgr(palette.TARGET), cv2.MARKER_CROSS, 9, 1, cv2.LINE_AA)
    named = [sight.label] if sight.label else []
    measured = "no range" if sight.distance is None else f"{sight.distance:.2f} m +-{sight.sigma:.3f}"
    chip(canvas, "  ".join([*named, measured]), box, palette.TARGET)


def _caption(found: Look, width: int, second: int) -> Image:
    bar = _ground(CAPTION_PX, width)
    text(bar, "left eye", (8, 20), palette.PAPER, size=0.42)
    share = 100.0 * float(found.disparity.valid.mean())
    text(bar, f"distance, {share:.0f} % measured (dark: not)", (second + 8, 20), palette.PAPER, size=0.42)
    return bar
