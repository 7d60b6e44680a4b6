"""Views of a target to be taught: which are fit to learn from, and why the others are not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Image
from robot.vision.prepared_view import FLAT_STD, FlatViewError, prepare
from robot.vision.windows import cut_out, grey_of, resize

Mask = NDArray[np.bool_]
Progress = Callable[[int, str], None]

MOST_VIEWS = 160
SMALLEST_PX = 24
BLURRED = "blurred (hold the camera still, focus)"
# Views of one object: correlation above this means one of the two adds nothing.
_SAME_VIEW = 0.995
# Share of a view's contrast that must lie in its finest detail; a sharp print has 0.2 and more.
_BLURRED = 0.08
_SHARPNESS_SIZE = 32
_COMPARED_SIZE = (16, 16)


class View(Protocol):
    """One look at the target, however it was made."""

    @property
    def image_bgr(self) -> Image: ...

    @property
    def box(self) -> Box: ...

    @property
    def depth_m(self) -> float | None: ...

    @property
    def mask(self) -> Mask | None: ...


@dataclass(frozen=True, slots=True, eq=False)
class TeachingView:
    """A BGR picture, the target's box in it (pixels), its distance in metres and its own pixels if known.

    mask: (H, W), True where the picture shows the target.
    """

    image_bgr: Image
    box: Box
    depth_m: float | None = None
    mask: Mask | None = None


@dataclass(frozen=True, slots=True)
class Choice:
    """Views fit to learn from, and how many were refused for which reason."""

    views: tuple[View, ...]
    refused: Counter[str]


def choose(views: Iterable[View], tell: Progress) -> Choice:
    """Sort the views: usable and distinct ones (at most 160, spread evenly), and the refused by reason."""
    kept: list[View] = []
    columns: list[NDArray[np.float64]] = []
    refused: Counter[str] = Counter()
    for count, view in enumerate(views, 1):
        tell(count, "looking at views")
        reason = fault_of(view)
        if reason is None:
            column = _compared(view)
            if columns and float(max(column @ other for other in columns)) > _SAME_VIEW:
                reason = "the same as another view"
            else:
                kept.append(view)
                columns.append(column)
        if reason is not None:
            refused[reason] += 1
    if len(kept) > MOST_VIEWS:
        refused["more than can be learnt"] = len(kept) - MOST_VIEWS
        kept = [kept[i] for i in np.linspace(0, len(kept) - 1, MOST_VIEWS).round().astype(int)]
    return Choice(tuple(kept), refused)


def fault_of(view: View) -> str | None:
    """Why a view cannot be learnt from, in words that go behind a number; None if it can."""
    image, box = view.image_bgr, view.box
    inside = box.clipped(image.shape[1], image.shape[0])
    if inside.area < 0.9 * box.area:
        return "cut off by the picture's border"
    if min(inside.w, inside.h) < SMALLEST_PX or min(view_of(view).shape[:2]) < SMALLEST_PX:
        return f"smaller than {SMALLEST_PX} px (go nearer)"
    grey = grey_of(view_of(view))
    if float(grey.std()) < 2 * FLAT_STD:
        return "without contrast (more light)"
    if sharpness(grey) < _BLURRED:
        return BLURRED
    return None


def sharpness(grey: NDArray[np.float32]) -> float:
    """Fine detail of a view relative to its content, about 0 (blurred) to 1.

    grey (H, W) float32, 0..255. Spread of the Laplacian over the spread of the grey values, both on the
    view brought to 32 px height, so that a large view is not called blurred for being large; sensor noise
    is averaged away by the same step.
    """
    width = max(8, round(grey.shape[1] * _SHARPNESS_SIZE / grey.shape[0]))
    small = resize(grey, (width, _SHARPNESS_SIZE)) if grey.shape[0] > _SHARPNESS_SIZE else grey
    content = float(small.std())
    return float(cv2.Laplacian(small, cv2.CV_32F).std()) / (4.0 * content) if content > 0 else 0.0


def _compared(view: View) -> NDArray[np.float64]:
    try:
        column = prepare(grey_of(view_of(view)), _COMPARED_SIZE)
    except FlatViewError:
        return np.zeros(_COMPARED_SIZE[0] * _COMPARED_SIZE[1])
    column = column - column.mean()
    return np.asarray(column / np.linalg.norm(column))


def view_of(view: View) -> Image:
    """The target's part of a view's picture, BGR uint8, at whole pixels."""
    return cut_out(view.image_bgr, view.box)
