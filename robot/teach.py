"""Teaching a target: choose the views that are fit to learn from, say why the others are not, learn.

Views come from a folder (`views_from_folder`), a video (`views_from_video`) or any iterable of objects
with the attributes of `TeachingView`, such as the simulator's teaching scenes. Negatives are the pictures'
own backgrounds and drawn textures, so that no other data are needed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from robot.errors import UserError
from robot.messages import Box, Image
from robot.model_file import Model
from robot.teach_sheet import THUMBNAIL, contact_sheet, png, thumbnail
from robot.teach_views import BLURRED, Progress, View, choose, view_of
from robot.vision import finder_training, view_warps
from robot.vision.finder_training import LESSON, Validation
from robot.vision.textures import texture
from robot.vision.window_training import TrainingPlan

FEWEST_VIEWS = 8
_BACKGROUNDS = 48
_TEXTURES = 12
# Below these shares, and above this many false alarms a picture, the model deserves a warning.
_LOW_RECALL, _LOW_HALF_RECALL, _MANY_FALSE = 0.5, 0.1, 0.1
_BLURRED_SHARE = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Lesson:
    """What came of teaching.

    model: ready to save. used: views learnt from. refused: reason in words -> how many views.
    warnings: sentences about what would make the model better. contact_sheet: BGR uint8 picture of the
    views, the used ones in order. validation: what was found of views not learnt from.
    """

    model: Model
    used: int
    refused: dict[str, int]
    warnings: tuple[str, ...]
    contact_sheet: Image
    validation: Validation

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
    lesson: TrainingPlan = LESSON,
) -> Lesson:
    """Learn a target called `name` from views of it.

    progress(count, words) is told about every view looked at and about each later stage. focal_px: focal
    length of the camera; with it and the views' depths the model knows the object's height. lesson: how much
    the windows learn from. The same views and seed give the same model.

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
    looks = [view_warps.View(view.image_bgr, view.box, view.mask) for view in chosen.views]
    taught = finder_training.fit(looks, negatives, name, seed, lesson=lesson)
    preview = png(thumbnail(max(crops, key=lambda crop: crop.size), 2 * THUMBNAIL))
    model = Model(
        name, taught.finder, len(crops), object_height(chosen.views, focal_px), created_from, preview
    )
    tell(len(crops), "done")
    warnings = (*warnings_for(chosen.views, chosen.refused), *warnings_of(taught.validation))
    sheet = contact_sheet(crops, [f"{name}: {len(crops)} views", found_words(taught.validation)])
    return Lesson(model, len(crops), dict(chosen.refused), warnings, sheet, taught.validation)


def found_words(validation: Validation) -> str:
    """What cross-validation found, in one line."""
    return (
        f"cross-validated in other pictures and light: {validation.recall:.0%} found whole, "
        f"{validation.half_recall:.0%} half hidden, {validation.false_alarms:.2f} false alarms a picture"
    )


def warnings_of(validation: Validation) -> list[str]:
    """What the cross-validation gives cause to mind, one sentence each."""
    said = []
    if validation.recall < _LOW_RECALL:
        said.append(
            f"only {validation.recall:.0%} of the views not learnt from were found: add views from more sides"
        )
    if validation.half_recall < _LOW_HALF_RECALL:
        said.append("half hidden it is seldom found: such a target should stand free")
    if validation.false_alarms > _MANY_FALSE:
        said.append(
            f"{validation.false_alarms:.2f} false alarms a picture: choose a target with more print or colour"
        )
    return said


def warnings_for(views: Sequence[View], refused: Counter[str]) -> list[str]:
    """What would make the model better, one sentence each."""
    said = []
    if refused[BLURRED] > _BLURRED_SHARE * (len(views) + sum(refused.values())):
        said.append(f"{refused[BLURRED]} views are blurred: hold the camera still, or give more light")
    heights = [view.box.h for view in views]
    if max(heights) < 1.25 * min(heights):
        said.append("all views show the target at about the same distance: add views from nearer and farther")
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
