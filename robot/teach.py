"""Teaching a target: choose the views that are fit to learn from, say why the others are not, learn.

Views come from a folder (`views_from_folder`), a video (`views_from_video`) or any iterable of objects
with the attributes of `TeachingView`, such as the simulator's teaching scenes. Negatives are the pictures'
own backgrounds and drawn textures, so that no other data are needed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.errors import UserError
from robot.messages import Box, Image
from robot.model_file import Model
from robot.vision.prepared_view import FLAT_STD, FlatViewError, prepare
from robot.vision.recognizer import Recognizer
from robot.vision.textures import texture
from robot.vision.windows import grey_of, resize

Progress = Callable[[int, str], None]

FEWEST_VIEWS = 8
MOST_VIEWS = 160
SMALLEST_PX = 24
# Views of one object: correlation above this means one of the two adds nothing.
_SAME_VIEW = 0.995
# Share of a view's contrast that must lie in its finest detail; a sharp print has 0.2 and more.
_BLURRED = 0.08
_SHARPNESS_SIZE = 32
_COMPARED_SIZE = (16, 16)
_BACKGROUNDS = 48
_TEXTURES = 12
_THUMBNAIL = 72
_PREVIEW_COLUMNS = 10


class View(Protocol):
    """One look at the target, however it was made."""

    @property
    def image_bgr(self) -> Image: ...

    @property
    def box(self) -> Box: ...

    @property
    def depth_m(self) -> float | None: ...


@dataclass(frozen=True, slots=True, eq=False)
class TeachingView:
    """A BGR picture, the target's box in it (pixels), and its distance in metres if known."""

    image_bgr: Image
    box: Box
    depth_m: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Lesson:
    """What came of teaching.

    model: ready to save. used: views learnt from. refused: reason in words -> how many views.
    warnings: sentences about what would make the model better. contact_sheet: BGR uint8 picture of the
    views, the used ones in order.
    """

    model: Model
    used: int
    refused: dict[str, int]
    warnings: tuple[str, ...]
    contact_sheet: Image

    def summary(self) -> str:
        """One line for people: how many views were used and why others were not."""
        return f"{self.used} views used" + "".join(f", {n} refused: {why}" for why, n in self.refused.items())


def teach(
    views: Iterable[View],
    name: str,
    seed: int,
    progress: Progress | None = None,
    *,
    focal_px: float | None = None,
    created_from: str = "",
) -> Lesson:
    """Learn a target called `name` from views of it.

    progress(count, words) is told about every view looked at and about each later stage. focal_px: focal
    length of the camera; with it and the views' depths the model knows the object's height. The same
    views and seed give the same model.

    Raises UserError when fewer than 8 distinct, sharp views of at least 24 px are left, naming how many
    were refused for which reason.

    >>> lesson = teach([], "cup", seed=0)
    Traceback (most recent call last):
    robot.errors.UserError: 0 of 0 views can be used, 8 are needed: take more pictures from other sides
    """
    _check_name(name)
    tell = progress or (lambda count, words: None)
    chosen = choose(views, tell)
    if len(chosen.views) < FEWEST_VIEWS:
        raise UserError(_too_few(len(chosen.views), chosen.refused))
    crops = [view_of(view) for view in chosen.views]
    tell(len(crops), "learning")
    negatives = background_regions(chosen.views, seed) + drawn_negatives(seed)
    recognizer = Recognizer.fit(crops, negatives, name, seed)
    sheet = contact_sheet(crops)
    preview = _png(thumbnail(max(crops, key=lambda crop: crop.size), 2 * _THUMBNAIL))
    height = object_height(chosen.views, focal_px)
    model = Model(name, recognizer, len(crops), height, created_from, preview)
    tell(len(crops), "done")
    return Lesson(model, len(crops), dict(chosen.refused), tuple(warnings_for(chosen.views)), sheet)


# --------------------------------------------------------------------------------- choosing the views


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
        return "blurred (hold the camera still, focus)"
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
    height, width = view.image_bgr.shape[:2]
    box = view.box.clipped(width, height)
    x0, y0 = int(np.floor(box.x + 0.5)), int(np.floor(box.y + 0.5))
    x1, y1 = int(np.floor(box.x + box.w + 0.5)), int(np.floor(box.y + box.h + 0.5))
    return view.image_bgr[y0 : max(y1, y0 + 1), x0 : max(x1, x0 + 1)]


def warnings_for(views: Iterable[View]) -> list[str]:
    """What would make the model better, one sentence each."""
    views = list(views)
    said = []
    heights = [view.box.h for view in views]
    if max(heights) < 1.25 * min(heights):
        said.append("all views show the target at about the same size: add views from nearer and farther")
    light = [float(view_of(view).mean()) for view in views]
    if max(light) - min(light) < 12.0:
        said.append("all views were taken in the same light: add darker and brighter ones")
    if len(views) < 20:
        said.append(f"only {len(views)} views: 40 or more from all round make finding surer")
    return said


def object_height(views: Iterable[View], focal_px: float | None) -> float | None:
    """The object's height in metres by the views that have a depth; None without depth or focal length."""
    if focal_px is None:
        return None
    heights = [view.box.h * view.depth_m / focal_px for view in views if view.depth_m]
    return float(np.median(heights)) if heights else None


def _check_name(name: str) -> None:
    if not name.strip() or len(name) > 64 or not name.isprintable():
        raise UserError("the target's name must be 1 to 64 printable characters: give --name NAME")


def _too_few(usable: int, refused: Counter[str]) -> str:
    total = usable + sum(refused.values())
    reasons = "".join(f"; {count} {reason}" for reason, count in refused.most_common())
    cure = "take more pictures from other sides"
    return f"{usable} of {total} views can be used, {FEWEST_VIEWS} are needed{reasons}: {cure}"


# ------------------------------------------------------------------------------------------ negatives


def background_regions(views: Iterable[View], seed: int) -> list[Image]:
    """Parts of the pictures outside the target's box (a little enlarged), up to 48, chosen by the seed."""
    regions = [region for view in views for region in _around(view.image_bgr, view.box)]
    order = np.random.default_rng(seed).permutation(len(regions))[:_BACKGROUNDS]
    return [regions[i] for i in sorted(order)]


def _around(image: Image, box: Box, least_px: int = 64) -> list[Image]:
    """The four strips beside, above and below a box that are large enough to look for anything in."""
    height, width = image.shape[:2]
    x0, x1 = int(box.x - 0.1 * box.w), int(np.ceil(box.x + 1.1 * box.w))
    y0, y1 = int(box.y - 0.1 * box.h), int(np.ceil(box.y + 1.1 * box.h))
    strips = (
        image[:, : max(x0, 0)],
        image[:, min(x1, width) :],
        image[: max(y0, 0)],
        image[min(y1, height) :],
    )
    return [strip for strip in strips if min(strip.shape[:2]) >= least_px]


def drawn_negatives(seed: int, count: int = _TEXTURES) -> list[Image]:
    """Pictures of drawn textures and shapes, 240 x 200 px, the same for the same seed."""
    streams = np.random.SeedSequence(seed).spawn(count)
    return [texture((240, 200), np.random.default_rng(stream)) for stream in streams]


# ------------------------------------------------------------------------------------------- pictures


def contact_sheet(crops: Iterable[Image]) -> Image:
    """All views side by side, ten a row, each fitted into 72 x 72 px; BGR uint8."""
    tiles = [thumbnail(crop, _THUMBNAIL) for crop in crops]
    blank = np.full_like(tiles[0], 32)
    tiles += [blank] * (-len(tiles) % _PREVIEW_COLUMNS)
    rows = [np.hstack(tiles[i : i + _PREVIEW_COLUMNS]) for i in range(0, len(tiles), _PREVIEW_COLUMNS)]
    return np.asarray(np.vstack(rows), np.uint8)


def thumbnail(image: Image, edge: int) -> Image:
    """The picture fitted into a dark square of `edge` pixels."""
    factor = (edge - 4) / max(image.shape[:2])
    size = max(1, round(image.shape[1] * factor)), max(1, round(image.shape[0] * factor))
    tile = np.full((edge, edge, 3), 32, np.uint8)
    x, y = (edge - size[0]) // 2, (edge - size[1]) // 2
    tile[y : y + size[1], x : x + size[0]] = np.clip(resize(image, size) + 0.5, 0, 255).astype(np.uint8)
    return tile


def _png(image: Image) -> bytes:
    done, data = cv2.imencode(".png", image)
    if not done:
        raise RuntimeError("the preview picture could not be encoded")
    return bytes(data.tobytes())
