"""Cutting windows out of pictures: crops beyond the border, stacks of shifted windows, window statistics."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from robot.messages import Box

Floats = NDArray[np.float32]
Kind = TypeVar("Kind", np.uint8, np.float32)


LEAST_PART_PX = 8
"""Of a picture in which something can be looked for."""


class WindowStack(NamedTuple):
    """Windows cut about one place: pixels (k, n) float32, row by row; boxes (k, 4), x, y, w, h."""

    pixels: Floats
    boxes: NDArray[np.float64]


def grey_of(image: NDArray[np.uint8]) -> Floats:
    """Grey float32 (H, W), 0..255, of a BGR or grey uint8 picture."""
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    return np.asarray(grey, dtype=np.float32)


def crop(image: NDArray[np.uint8] | Floats, x: int, y: int, width: int, height: int) -> Floats:
    """The part of a picture at whole pixels; what lies outside repeats the picture's rim. Size as asked."""
    rows, columns = image.shape[:2]
    x0, y0 = min(max(x, 0), columns - 1), min(max(y, 0), rows - 1)
    x1, y1 = max(min(x + width, columns), x0 + 1), max(min(y + height, rows), y0 + 1)
    inside: NDArray[np.uint8] | Floats = image[y0:y1, x0:x1]
    left, top = min(max(x0 - x, 0), width - 1), min(max(y0 - y, 0), height - 1)
    right, bottom = max(width - left - inside.shape[1], 0), max(height - top - inside.shape[0], 0)
    if left or top or right or bottom:
        framed = cv2.copyMakeBorder(inside, top, bottom, left, right, cv2.BORDER_REPLICATE)
        inside = np.asarray(framed, np.float32)
    return np.asarray(inside[:height, :width], np.float32)


def cut_out(image: NDArray[Kind], box: Box) -> NDArray[Kind]:
    """What is in a box, as far as the picture goes, at whole pixels: (h, w[, 3]), at least a pixel."""
    inside = box.clipped(image.shape[1], image.shape[0])
    x0, y0 = math.floor(inside.x + 0.5), math.floor(inside.y + 0.5)
    x1, y1 = math.floor(inside.x + inside.w + 0.5), math.floor(inside.y + inside.h + 0.5)
    return image[y0 : max(y1, y0 + 1), x0 : max(x1, x0 + 1)]


def with_surroundings(
    image: NDArray[np.uint8], box: Box, share: float
) -> tuple[NDArray[np.uint8], Box] | None:
    """A box with so much of its edges around it, and the box in that part; None if less than 8 px are inside.

    >>> part, moved = with_surroundings(np.zeros((50, 60), np.uint8), Box(10, 20, 20, 10), 0.5)
    >>> part.shape, (moved.x, moved.y)
    ((20, 40), (10, 5))
    """
    beside = Box(
        box.x - share * box.w, box.y - share * box.h, (1 + 2 * share) * box.w, (1 + 2 * share) * box.h
    )
    inside = beside.clipped(image.shape[1], image.shape[0])
    x, y = int(inside.x), int(inside.y)
    part = np.ascontiguousarray(image[y : int(inside.y + inside.h), x : int(inside.x + inside.w)])
    return (part, Box(box.x - x, box.y - y, box.w, box.h)) if min(part.shape[:2]) >= LEAST_PART_PX else None


def resize(image: NDArray[np.uint8] | Floats, size: tuple[int, int]) -> Floats:
    """A picture brought to (width, height) without aliasing, float32."""
    shrinks = size[0] < image.shape[1] or size[1] < image.shape[0]
    method = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(np.asarray(image, np.float32), size, interpolation=method), np.float32)


def windows_near(
    grey: Floats, box: Box, size: tuple[int, int], scales: tuple[float, ...], reach: int
) -> WindowStack:
    """All windows of `size` within `reach` window pixels of a box, at several scales of the box.

    grey (H, W) float32. scales: factors on the box's size. Returns k = len(scales) (2 reach + 1)^2 windows
    or a few more or less by rounding, never none.
    """
    stacks = [_at_scale(grey, box, size, scale, reach) for scale in scales]
    return WindowStack(
        np.concatenate([stack.pixels for stack in stacks]), np.concatenate([stack.boxes for stack in stacks])
    )


def _at_scale(grey: Floats, box: Box, size: tuple[int, int], scale: float, reach: int) -> WindowStack:
    width, height = size
    (u, v), w, h = box.centre, box.w * scale, box.h * scale
    fx, fy = width / w, height / h
    x0, y0 = math.floor(u - w / 2 - reach / fx), math.floor(v - h / 2 - reach / fy)
    x1, y1 = math.ceil(u + w / 2 + reach / fx), math.ceil(v + h / 2 + reach / fy)
    region = crop(grey, x0, y0, x1 - x0, y1 - y0)
    columns, rows = max(round((x1 - x0) * fx), width), max(round((y1 - y0) * fy), height)
    views = sliding_window_view(resize(region, (columns, rows)), (height, width))
    fx, fy = columns / (x1 - x0), rows / (y1 - y0)
    left, top = np.meshgrid(x0 + np.arange(views.shape[1]) / fx, y0 + np.arange(views.shape[0]) / fy)
    sizes = np.full(left.size, width / fx), np.full(left.size, height / fy)
    return WindowStack(
        views.reshape(-1, width * height), np.column_stack([left.ravel(), top.ravel(), *sizes])
    )


def local_mean_std(grey: Floats, size: tuple[int, int]) -> tuple[Floats, Floats]:
    """Mean and standard deviation of every whole window of size (width, height) in a grey picture.

    Returns two (H - height + 1, W - width + 1) float32 arrays, indexed by the window's top left corner.
    """
    # Squares of values about zero, not about 128, keep the difference of large numbers small.
    centred = grey - np.float32(grey.mean())
    mean = cv2.boxFilter(centred, cv2.CV_64F, size, anchor=(0, 0), borderType=cv2.BORDER_REPLICATE)
    square = cv2.sqrBoxFilter(centred, cv2.CV_64F, size, anchor=(0, 0), borderType=cv2.BORDER_REPLICATE)
    std = np.sqrt(np.maximum(square - mean * mean, 0.0))
    rows, columns = grey.shape[0] - size[1] + 1, grey.shape[1] - size[0] + 1
    whole = np.s_[:rows, :columns]
    return (mean + grey.mean())[whole].astype(np.float32), std[whole].astype(np.float32)


def suppress_overlaps(
    boxes: NDArray[np.float64], scores: NDArray[np.float64], limit: float, most: int
) -> list[int]:
    """Indices of boxes that survive non-maximum suppression, best score first; equal scores keep their order.

    boxes (k, 4): x, y, w, h; scores (k,); limit: largest intersection over union two survivors may have;
    most: how many survivors are wanted at most.
    """
    far = boxes[:, :2] + boxes[:, 2:]
    areas = boxes[:, 2] * boxes[:, 3]
    order = np.argsort(-scores, kind="stable")
    kept: list[int] = []
    while len(order) and len(kept) < most:
        first, order = order[0], order[1:]
        kept.append(int(first))
        shared = np.minimum(far[order], far[first]) - np.maximum(boxes[order, :2], boxes[first, :2])
        overlap = np.maximum(shared, 0.0).prod(axis=1)
        order = order[overlap <= limit * (areas[order] + areas[first] - overlap)]
    return kept
