"""How a recognizer learns: views grouped by shape, two view spaces a group, a threshold from negatives.

The threshold is learnt on evidence of the kind the robot meets: views that were held out, put before
other backgrounds under other light, against the best-looking windows of pictures without the target and
against look-alikes (the target's own shape with another print).
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Image
from robot.vision.colour import ColourSums
from robot.vision.nmf_objectives import EUCLIDEAN, Objective
from robot.vision.nmf_rank import largest_rank
from robot.vision.prepared_view import Matrix
from robot.vision.recognizer import Recognizer
from robot.vision.view_matching import AspectGroup, Evidence, Judge, Picture
from robot.vision.viewspace import ViewSpace, window_size
from robot.vision.windows import grey_of

COARSE_PIXELS = 88
FINE_PIXELS = 560
COARSE_RANK = 12
FINE_RANK = 24
MOST_GROUPS = 3
# Views whose shapes differ by more than this factor are not stretched into one window.
GROUP_SPREAD = 1.35
FEWEST_VIEWS = 4
FOLDS = 3
UNJUDGED = Judge((1.0, 1.0, 1.0), 0.0)
_SMALLEST_NEGATIVE_PX = 64
# How strongly the judge is held to counting all evidence alike: one kind that happened to separate the
# lesson's pictures perfectly must not silence the others.
_PRIOR = 0.01
# Where between the negatives and the positives the threshold lies.
_MARGIN = 0.7
LEAST_MARGIN = 0.33
# The median held-out view gets this score, whatever the target.
_TYPICAL_SCORE = 0.9


def fit(
    views: Sequence[Image],
    negatives: Sequence[Image],
    label: str,
    seed: int,
    objective: Objective = EUCLIDEAN,
) -> Recognizer:
    """See `Recognizer.fit`. objective: what the factorisations minimise."""
    if len(views) < FEWEST_VIEWS:
        raise ValueError(f"at least {FEWEST_VIEWS} views are needed, got {len(views)}")
    usable = large_enough(negatives)
    rng = np.random.default_rng(seed)
    recognizer = unjudged(views, label, seed, objective)
    positives = _held_out_evidence(views, usable, label, seed, objective, rng)
    against = [place.evidence for picture in usable for place in recognizer.candidates(picture)]
    against += [evidence_in_scene(recognizer, look_alike(view, rng), usable, rng) for view in views]
    return Recognizer(label, recognizer.groups, learn_judge(positives, against))


def large_enough(negatives: Sequence[Image]) -> list[Image]:
    """The pictures in which something can be looked for."""
    return [picture for picture in negatives if min(picture.shape[:2]) >= _SMALLEST_NEGATIVE_PX]


def unjudged(views: Sequence[Image], label: str, seed: int, objective: Objective = EUCLIDEAN) -> Recognizer:
    """A recognizer whose judge has learnt nothing yet."""
    groups = tuple(
        _learn_group([views[i] for i in members], seed, objective) for members in shape_groups(views)
    )
    return Recognizer(label, groups, UNJUDGED)


def shape_groups(views: Sequence[Image]) -> list[list[int]]:
    """Indices of views gathered by width/height: up to three groups, none empty, in order of shape."""
    aspects = np.log([view.shape[1] / view.shape[0] for view in views])
    low, high = float(aspects.min()), float(aspects.max())
    count = min(MOST_GROUPS, max(1, int(np.ceil((high - low) / np.log(GROUP_SPREAD)))))
    bins = np.minimum(((aspects - low) / max(high - low, 1e-9) * count).astype(int), count - 1)
    return [members for b in range(count) if (members := [int(i) for i in np.nonzero(bins == b)[0]])]


def _learn_group(views: Sequence[Image], seed: int, objective: Objective) -> AspectGroup:
    aspect = float(np.exp(np.mean(np.log([view.shape[1] / view.shape[0] for view in views]))))
    greys = [grey_of(view) for view in views]
    sizes = window_size(aspect, COARSE_PIXELS), window_size(aspect, FINE_PIXELS)
    ranks = (
        min(rank, largest_rank(w * h, len(views)))
        for (w, h), rank in zip(sizes, (COARSE_RANK, FINE_RANK), strict=True)
    )
    coarse, fine = (
        ViewSpace.learn(greys, size, rank, seed, objective) for size, rank in zip(sizes, ranks, strict=True)
    )
    whole = [np.array([[0.0, 0.0, view.shape[1], view.shape[0]]]) for view in views]
    layouts = [ColourSums(view).layouts(box) for view, box in zip(views, whole, strict=True)]
    return AspectGroup(aspect, coarse, fine, np.concatenate(layouts))


# ------------------------------------------------------------------------------------------- evidence


def _held_out_evidence(
    views: Sequence[Image],
    backgrounds: Sequence[Image],
    label: str,
    seed: int,
    objective: Objective,
    rng: np.random.Generator,
) -> list[Evidence]:
    """Evidence for views as seen by recognizers that did not learn from them, two scenes a view."""
    folds = rng.permutation(len(views)) % FOLDS  # views often come in turns: every third may be of one side
    evidence: list[Evidence] = []
    for fold in range(FOLDS):
        taught = unjudged([v for v, f in zip(views, folds, strict=True) if f != fold], label, seed, objective)
        held = [v for v, f in zip(views, folds, strict=True) if f == fold]
        evidence += [evidence_in_scene(taught, view, backgrounds, rng) for view in held for _ in range(2)]
    return evidence


def evidence_in_scene(
    recognizer: Recognizer, view: Image, backgrounds: Sequence[Image], rng: np.random.Generator
) -> Evidence:
    """What speaks for the view's place in a scene made of it."""
    image, box = scene_with(view, backgrounds, rng)
    return recognizer.locate(Picture.of(image), box).evidence


def scene_with(view: Image, backgrounds: Sequence[Image], rng: np.random.Generator) -> tuple[Image, Box]:
    """A picture of the view at a random size before a random background, in random light, and its box."""
    height = int(rng.integers(20, 110))
    width = max(8, round(height * view.shape[1] / view.shape[0]))
    # Beyond its own pixels a view would only be blown up.
    if height > view.shape[0]:
        height, width = view.shape[:2]
    small = cv2.resize(view, (width, height), interpolation=cv2.INTER_AREA)
    frame = background(backgrounds, 2 * width, 2 * height, rng)
    x, y = width // 2, height // 2
    frame[y : y + height, x : x + width] = small
    return in_other_light(frame, rng), Box(x, y, width, height)


def background(backgrounds: Sequence[Image], width: int, height: int, rng: np.random.Generator) -> Image:
    """A part of one of the pictures, (height, width, 3), at a random scale; plain grey without pictures."""
    if not backgrounds:
        return np.full((height, width, 3), int(rng.integers(30, 220)), np.uint8)
    picture = backgrounds[int(rng.integers(len(backgrounds)))]
    scale = max(width / picture.shape[1], height / picture.shape[0], float(rng.uniform(0.3, 1.0)))
    columns, rows = max(width, round(scale * picture.shape[1])), max(height, round(scale * picture.shape[0]))
    sized = cv2.resize(picture, (columns, rows), interpolation=cv2.INTER_AREA)
    x, y = int(rng.integers(columns - width + 1)), int(rng.integers(rows - height + 1))
    return np.array(sized[y : y + height, x : x + width], np.uint8)


def in_other_light(image: Image, rng: np.random.Generator) -> Image:
    """The picture as a camera might see it on another day: gain, response, tint, blur and noise drawn."""
    light = np.asarray(image, np.float64) / 255.0
    light = np.power(light, rng.uniform(0.8, 1.25)) * rng.uniform(0.25, 1.05)
    light = light * rng.uniform(0.92, 1.08, 3)
    blur = float(rng.uniform(0.0, 0.8))
    if blur > 0.3:
        light = np.asarray(cv2.GaussianBlur(light, (0, 0), blur), np.float64)
    noise = np.sqrt(0.0004 * light + 0.00004) * rng.standard_normal(light.shape)
    return np.clip(255.0 * (light + noise) + 0.5, 0, 255).astype(np.uint8)


def look_alike(view: Image, rng: np.random.Generator) -> Image:
    """The target's shape with another print: the middle turned upside down, or its hues turned."""
    other = view.copy()
    if rng.random() < 0.5:
        hsv = cv2.cvtColor(other, cv2.COLOR_BGR2HSV)
        hsv[..., 0] = (hsv[..., 0].astype(int) + int(rng.integers(40, 141))) % 180
        return np.asarray(cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR), np.uint8)
    rows, columns = view.shape[0] // 8, view.shape[1] // 8
    middle = np.s_[rows : view.shape[0] - rows, columns : view.shape[1] - columns]
    other[middle] = view[middle][::-1, ::-1]
    return other


# ------------------------------------------------------------------------------------------ threshold


def learn_judge(
    positives: Sequence[tuple[float, float, float]],
    negatives: Sequence[tuple[float, float, float]],
    least_margin: float = LEAST_MARGIN,
) -> Judge:
    """Weights and threshold that separate two sets of evidence; no evidence ever counts against the target.

    Logistic regression with weights >= 0, both sets counting equally. The threshold (score 0.5) lies seven
    tenths of the way from the 99.95 % quantile of the negatives to the 5 % quantile of the positives, at
    least `least_margin` of the way to their median: a false find is worse than a second look.
    """
    good = np.asarray(positives, np.float64).reshape(-1, 3)
    bad = np.asarray(negatives, np.float64).reshape(-1, 3)
    if not len(bad):
        bad = np.zeros((1, 3))
    weights = _separating_weights(good, bad)
    poorest, typical = (float(q) for q in np.quantile(good @ weights, (0.05, 0.5)))
    against = float(np.quantile(bad @ weights, 0.9995))
    threshold = against + max(_MARGIN * (poorest - against), least_margin * (typical - against), 0.0)
    slope = np.log(_TYPICAL_SCORE / (1 - _TYPICAL_SCORE)) / max(typical - threshold, 0.02)
    first, second, third = (float(slope * weight) for weight in weights)
    return Judge((first, second, third), float(-slope * threshold))


def _separating_weights(good: Matrix, bad: Matrix, rounds: int = 400) -> NDArray[np.float64]:
    """Non-negative weights of length 1 by projected gradient descent on the balanced logistic loss."""
    everything = np.concatenate([good, bad])
    centre, spread = everything.mean(axis=0), everything.std(axis=0) + 1e-3
    x = (everything - centre) / spread
    y = np.concatenate([np.ones(len(good)), np.zeros(len(bad))])
    share = np.concatenate([np.full(len(good), 0.5 / len(good)), np.full(len(bad), 0.5 / len(bad))])
    weights, bias = np.ones(3), 0.0
    for _ in range(rounds):
        error = share * (1.0 / (1.0 + np.exp(-np.clip(x @ weights + bias, -30, 30))) - y)
        weights = np.maximum(weights - 2.0 * (x.T @ error + _PRIOR * (weights - 1.0)), 0.0)
        bias -= 2.0 * float(error.sum())
    scaled = weights / spread
    length = float(np.linalg.norm(scaled))
    return np.asarray(scaled / length if length > 0 else np.full(3, 3**-0.5))
