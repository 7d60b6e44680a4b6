"""How a target finder learns: windows, ferns, NMF views, and two judges from evidence kept apart.

Views and pictures without the target are split in three; each third is judged by a finder taught with the
other two. So a judge meets the target as it will be met later: sides not seen before, before backgrounds
not seen before, whole and half hidden, against what is taken for it elsewhere, and whole against
look-alikes. Halves are held against other prints in its outline instead: half of its own print with other
colours or turned upside down often is the target's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Image
from robot.vision.ferns import FernDetector, FernSettings, Sample
from robot.vision.half_views import best_half, commonness
from robot.vision.recognizer import HEIGHTS_PX
from robot.vision.recognizer_training import (
    FOLDS,
    UNJUDGED,
    background,
    evidence_in_scene,
    large_enough,
    learn_judge,
    look_alike,
    scene_with,
    unjudged,
)
from robot.vision.target_finder import HALVES_ASKED, PROPOSALS, TargetFinder
from robot.vision.view_matching import Evidence, Picture
from robot.vision.view_warps import View
from robot.vision.window_detector import WindowDetector
from robot.vision.window_training import TrainingPlan
from robot.vision.windows import Floats

Mask = NDArray[np.bool_]

FERNS = FernSettings(reference_px=32)
"""Targets are looked for from 18 px on: ferns of a larger reference would look at enlarged pictures."""
LESSON = TrainingPlan(reference_px=30.0, places=6000)
"""What the windows learn: small, as targets far away are; in cross-validation a third of it, as they only
propose there."""
HALF_MARGIN = 0.4
"""Of the way from the worst negatives to the median half: there are more halves than wholes to go wrong."""
SCENES = 2
"""Made of each view that was held out, whole and half hidden."""
COMMON_PICTURES, COMMON_PLACES = 24, 4
"""Without the target, from which it is learnt how common halves of views are; places of each."""
MOST_VALIDATED = 12
"""Views of each third with which recall is told, about."""
SCENE_SIZE = 352, 288
FOUND_IOU = 0.5

HalfEvidence = tuple[float, float, float]
"""Merit and colour agreement of the best half, votes of the ferns."""


@dataclass(frozen=True, slots=True)
class Validation:
    """What finders found of what they had not met: shares of views, whole and with one half hidden, put into
    pictures of other places; false alarms for each picture without the target."""

    recall: float
    half_recall: float
    false_alarms: float
    scenes: int
    pictures: int


@dataclass(frozen=True, slots=True, eq=False)
class Taught:
    """A target learnt, and how well by cross-validation."""

    finder: TargetFinder
    validation: Validation


@dataclass(slots=True)
class Evidences:
    """What speaks for places where the target is, and for places where it is not."""

    whole: list[Evidence] = field(default_factory=list)
    half: list[HalfEvidence] = field(default_factory=list)
    against_whole: list[Evidence] = field(default_factory=list)
    against_half: list[HalfEvidence] = field(default_factory=list)


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """A finder without judges, and what it has never met: views, pictures without the target."""

    finder: TargetFinder
    views: tuple[View, ...]
    negatives: tuple[Image, ...]


def fit(
    views: Sequence[View],
    negatives: Sequence[Image],
    label: str,
    seed: int,
    *,
    lesson: TrainingPlan = LESSON,
) -> Taught:
    """Learn a target from its views, with everything random drawn from `seed`.

    views: at least 4. negatives: BGR uint8 pictures without the target (64 px or more along each edge;
    smaller ones are ignored), at least one. lesson: how much the windows learn from. Raises ValueError for
    too few of either, FlatViewError for a view without contrast.
    """
    usable = large_enough(negatives)
    if not usable:
        raise ValueError("needs a picture of at least 64 x 64 px without the target")
    rng = np.random.default_rng(seed)
    folded = list(folds(views, usable, label, seed, lesson))
    evidences = [evidences_of(fold, rng) for fold in folded]
    finder = _taught(views, usable, label, seed, lesson)
    return Taught(judged(finder, evidences), validated(folded, evidences, rng))


def folds(
    views: Sequence[View], negatives: Sequence[Image], label: str, seed: int, lesson: TrainingPlan
) -> Iterator[Fold]:
    """Three finders without judges, each taught without a third of the views and of the negatives.

    Thirds are drawn at random: views often come in turns, and every third might be of one side.
    """
    rng = np.random.default_rng([seed, 3])
    third = replace(lesson, places=lesson.places // 3, drawn=lesson.drawn // 3, rounds=min(lesson.rounds, 2))
    mixed = [views[int(i)] for i in rng.permutation(len(views))]
    others = [negatives[int(i)] for i in rng.permutation(len(negatives))]
    for fold in range(FOLDS):
        known = [view for i, view in enumerate(mixed) if i % FOLDS != fold]
        without = [picture for i, picture in enumerate(others) if i % FOLDS != fold] or others
        finder = _taught(known, without, label, seed, third)
        yield Fold(finder, tuple(mixed[fold::FOLDS]), tuple(others[fold::FOLDS] or others))


def _taught(
    views: Sequence[View], negatives: Sequence[Image], label: str, seed: int, plan: TrainingPlan
) -> TargetFinder:
    recognizer = unjudged([view.crop for view in views], label, seed)
    samples = [Sample(view.image, view.box, label, view.mask) for view in views]
    ferns = FernDetector.fit(samples, negatives, settings=FERNS, seed=seed)
    windows = WindowDetector.fit(views, negatives, seed=seed, plan=plan)
    rare = tuple(np.zeros((len(group.layouts), 4), np.float32) for group in recognizer.groups)
    finder = TargetFinder(recognizer, windows, ferns, rare, UNJUDGED)
    return replace(finder, common=_common(finder, negatives))


def _common(finder: TargetFinder, negatives: Sequence[Image]) -> tuple[Floats, ...]:
    """How common each half of each view is at what is taken for the target in pictures without it."""
    chosen = np.linspace(0, len(negatives) - 1, min(COMMON_PICTURES, len(negatives)))
    places = []
    for image in (negatives[int(i)] for i in chosen):
        picture = Picture.of(image)
        places += [(picture, one.box) for one in finder.proposals(image, HEIGHTS_PX)[:COMMON_PLACES]]
    return tuple(commonness(places, group) for group in finder.recognizer.groups)


def judged(finder: TargetFinder, evidences: Sequence[Evidences]) -> TargetFinder:
    """The finder with judges learnt from these."""
    whole = learn_judge(
        [one for part in evidences for one in part.whole],
        [one for part in evidences for one in part.against_whole],
    )
    half = learn_judge(
        [one for part in evidences for one in part.half],
        [one for part in evidences for one in part.against_half],
        HALF_MARGIN,
    )
    return replace(finder, recognizer=replace(finder.recognizer, judge=whole), half_judge=half)


def validated(folded: Sequence[Fold], evidences: Sequence[Evidences], rng: np.random.Generator) -> Validation:
    """Three-fold cross-validation: no finder, and no judge, has met what it is asked here."""
    whole, half, false, pictures = [], [], 0, 0
    for index, fold in enumerate(folded):
        finder = judged(fold.finder, [e for i, e in enumerate(evidences) if i != index])
        for view in fold.views[:: -(-len(fold.views) // MOST_VALIDATED)]:
            image, box = _scene(view.crop, fold.negatives, rng)
            whole.append(_found(finder, image, box))
            half.append(_found(finder, half_hidden(image, box, fold.negatives, rng), box))
        for image in fold.negatives:
            false += len(finder.predict(image))
            pictures += 1
    return Validation(float(np.mean(whole)), float(np.mean(half)), false / pictures, len(whole), pictures)


def _scene(crop: Image, backgrounds: Sequence[Image], rng: np.random.Generator) -> tuple[Image, Box]:
    """A view in other light somewhere in a picture as large as the robot's."""
    part, box = scene_with(crop, backgrounds, rng)
    image = background(backgrounds, *SCENE_SIZE, rng)
    height, width = part.shape[:2]
    if width >= SCENE_SIZE[0] or height >= SCENE_SIZE[1]:
        return part, box
    x, y = int(rng.integers(SCENE_SIZE[0] - width)), int(rng.integers(SCENE_SIZE[1] - height))
    image[y : y + height, x : x + width] = part
    return image, Box(box.x + x, box.y + y, box.w, box.h)


def _found(finder: TargetFinder, image: Image, box: Box) -> bool:
    return any(one.box.iou(box) > FOUND_IOU for one in finder.predict(image))


def evidences_of(fold: Fold, rng: np.random.Generator) -> Evidences:
    """What a fold's finder sees in what it never met."""
    found, finder = Evidences(), fold.finder
    for view in fold.views:
        crop = view.crop
        for _ in range(SCENES):
            found.whole.append(evidence_in_scene(finder.recognizer, crop, fold.negatives, rng))
            scene, box = scene_with(crop, fold.negatives, rng)
            found.half.append(_half_evidence(finder, half_hidden(scene, box, fold.negatives, rng), box))
        found.against_whole.append(
            evidence_in_scene(finder.recognizer, look_alike(crop, rng), fold.negatives, rng)
        )
        scene, box = scene_with(other_print(crop, fold.negatives, rng), fold.negatives, rng)
        found.against_half.append(_half_evidence(finder, scene, box))
    for image in fold.negatives:
        # What NMF alone would propose wrongly counts too: it may be asked to look alone.
        found.against_whole += [place.evidence for place in finder.recognizer.candidates(image)]
        picture = Picture.of(image)
        for taken in _taken(finder, image):
            found.against_whole += [finder.recognizer.locate(picture, box).evidence for box in taken]
            for box in taken[:HALVES_ASKED]:
                half = best_half(picture, box, finder.halves())
                found.against_half.append((half.merit, half.colour, finder.votes(image, box)))
    return found


def _taken(finder: TargetFinder, image: Image) -> tuple[list[Box], list[Box]]:
    """What windows and what ferns take for the target where it is not, most likely first of each.

    A judge that met only what windows propose would believe the ferns blindly: it never saw them wrong.
    """
    own = finder.ferns.classes[finder.label].extent[1]
    scales = [height / own for height in sorted(HEIGHTS_PX)]
    voted = finder.ferns.predict(image, scales, most=PROPOSALS)
    return [one.box for one in finder.proposals(image, HEIGHTS_PX)], [one.box for one in voted]


def other_print(crop: Image, others: Sequence[Image], rng: np.random.Generator) -> Image:
    """The target's outline around something else: the rim of a view about a part of another picture."""
    height, width = crop.shape[:2]
    rows, columns = max(height // 8, 1), max(width // 8, 1)
    other = crop.copy()
    inner = other[rows : height - rows, columns : width - columns]
    inner[:] = background(others, inner.shape[1], inner.shape[0], rng)
    return other


def _half_evidence(finder: TargetFinder, image: Image, box: Box) -> HalfEvidence:
    half = best_half(Picture.of(image), box, finder.halves())
    return half.merit, half.colour, finder.votes(image, box)


def half_hidden(image: Image, box: Box, hiders: Sequence[Image], rng: np.random.Generator) -> Image:
    """The picture with one half of the box (upper, lower, left or right) covered by part of a hider."""
    x0, y0, x1, y1 = int(box.x), int(box.y), int(np.ceil(box.x + box.w)), int(np.ceil(box.y + box.h))
    middle = (x0 + x1) // 2, (y0 + y1) // 2
    parts = (x0, y0, x1, middle[1]), (x0, middle[1], x1, y1), (x0, y0, middle[0], y1), (middle[0], y0, x1, y1)
    left, top, right, bottom = parts[int(rng.integers(len(parts)))]
    covered = image.copy()
    covered[top:bottom, left:right] = background(hiders, right - left, bottom - top, rng)
    return covered
