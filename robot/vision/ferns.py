"""Detection of taught objects by random ferns and Hough voting: METHODS 8.

Small places of the training views are sorted into the leaves of ferns (`fern_features`), each leaf remembers
how often it was met on the object and on the background, and where the object's middle lay. In a new picture
every place votes (`hough`); the places and sizes with most votes are found by mean shift in (x, y, scale),
and those who voted for them tell which pixels belong to the object.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Image
from robot.vision.fern_features import Ferns, Leaves, channels
from robot.vision.fern_learning import Experience, places_of, places_without
from robot.vision.hough import Codebook, Voters, peak_of, smoothed
from robot.vision.mean_shift import Peak, peaks
from robot.vision.named_arrays import below
from robot.vision.picture_patch import checked
from robot.vision.view_warps import Place

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

LEVELS_PER_OCTAVE = 4
FINER_SCORE = 0.2
"""Power of a level's size by which its votes are too many: a finer one shows more places of the object."""
VOTER_STEPS = 2.5
"""Grid steps (standard deviation) about a maximum within which a vote was for it."""


@dataclass(frozen=True, slots=True)
class FernSettings:
    """How the detector looks. ferns, bits: F and S; reach_px: of a test; step_px: of the grid; reference_px:
    longer edge of an object at the size it is learnt and looked for; warps: views made of each sample."""

    ferns: int = 12
    bits: int = 8
    reach_px: int = 6
    step_px: int = 2
    reference_px: int = 48
    warps: int = 3


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """A training view: what is in `box` of a BGR or grey uint8 image is a `label`.

    mask (H, W): which pixels of the image belong to it; None: all in the box.
    """

    image: Image
    box: Box
    label: str
    mask: Mask | None = None


@dataclass(frozen=True, slots=True, eq=False)
class HoughDetection:
    """An object found. score: about 1 for views like those learnt; scale: its size over the
    reference's; support (H, W): pixels of the image that voted for it."""

    box: Box
    score: float
    label: str
    scale: float
    support: Mask


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """One class: what was met of it, extent (width, height) at reference size, votes, a score's unit."""

    experience: Experience
    extent: tuple[float, float]
    codebook: Codebook
    unit: float


@dataclass(frozen=True, slots=True, eq=False)
class _Level:
    """A picture of the pyramid: size over the full picture's, and its leaves."""

    shrink: float
    leaves: Leaves


@dataclass(frozen=True, slots=True, eq=False)
class FernDetector:
    """Finds taught objects in pictures. Make it with `FernDetector.fit`; it never changes.

    >>> rng = np.random.default_rng(0)
    >>> poster = cv2.resize(rng.integers(0, 255, (8, 6), np.uint8), (60, 80))
    >>> walls = [cv2.resize(rng.integers(0, 255, (18, 22), np.uint8), (176, 144)) for _ in range(3)]
    >>> samples = [Sample(poster, Box(0, 0, 60, 80), "poster")] * 2
    >>> detector = FernDetector.fit(samples, walls[:2], seed=0)
    >>> picture = walls[2].copy(); picture[30:110, 70:130] = poster
    >>> found = detector.predict(picture)[0]
    >>> found.label, found.box.iou(Box(70, 30, 60, 80)) > 0.7
    ('poster', True)
    """

    settings: FernSettings
    ferns: Ferns
    background: NDArray[np.float32]
    classes: dict[str, _Known]

    @classmethod
    def fit(
        cls,
        samples: Sequence[Sample],
        negatives: Sequence[Image],
        *,
        settings: FernSettings = FernSettings(),
        seed: int = 0,
    ) -> FernDetector:
        """Learn objects from samples, one or more classes.

        Args:
            samples: views of the objects, at least 2 of each class.
            negatives: BGR or grey uint8 pictures without any of them, at least 1.
            settings: how it looks.
            seed: of all that is random.

        Raises:
            ValueError: too few samples or negatives; a box that lies outside its image.
        """
        if not samples or not negatives:
            raise ValueError("needs samples of an object and pictures without it")
        rng = np.random.default_rng(seed)
        ferns = Ferns.random(settings.ferns, settings.bits, settings.reach_px, rng)
        blank = cls(settings, ferns, np.zeros((ferns.count, ferns.leaf_count), np.float32), {})
        return blank.partial_fit(samples, negatives, seed=seed)

    def partial_fit(
        self, samples: Sequence[Sample], negatives: Sequence[Image] = (), *, seed: int = 0
    ) -> FernDetector:
        """A detector that has met these samples and negatives too; new labels are new classes."""
        rng = np.random.default_rng([seed, 1])
        background = self.background.copy()
        for image in negatives:
            for place in places_without(image, self.settings.reference_px, rng):
                met = self.ferns.leaves(channels(place), self.settings.step_px)
                for fern, leaves in enumerate(met.reshape(len(met), -1)):
                    background[fern] += np.bincount(leaves, minlength=self.ferns.leaf_count)
        labels = list(dict.fromkeys([*self.classes, *(sample.label for sample in samples)]))
        known = {}
        for label in labels:
            before = self.classes[label].experience if label in self.classes else None
            views = [s for s in samples if s.label == label]
            known[label] = self._learnt(before, views, background, negatives, rng)
        return replace(self, background=background, classes=known)

    def _learnt(
        self,
        before: Experience | None,
        views: Sequence[Sample],
        background: NDArray[np.float32],
        negatives: Sequence[Image],
        rng: np.random.Generator,
    ) -> _Known:
        settings = self.settings
        if before is None:
            aspects = [math.log(s.box.w / s.box.h) for s in views]
            before = Experience.none(
                self.ferns, math.exp(float(np.mean(aspects))), settings.reference_px, settings.step_px
            )
        places: list[Place] = []
        for sample in views:
            places += places_of(
                sample.image, sample.box, sample.mask, negatives, settings.reference_px, settings.warps, rng
            )
        experience = before
        if places:
            experience = before.and_met(self.ferns, places, settings.step_px)
        return _known(experience, background)

    def predict(
        self, image: Image, scales: Sequence[float] | None = None, *, least_score: float = 0.2, most: int = 10
    ) -> list[HoughDetection]:
        """Objects in a picture, best first.

        Args:
            image: (H, W[, 3]) uint8.
            scales: sizes of objects over the reference's that are looked for; None: from 1 to where the
                object would fill the picture.
            least_score: what scores less is not told.
            most: of each class.

        Raises:
            ValueError: the image is not uint8, or neither grey nor BGR.
        """
        levels = self._levels(image, scales)
        found = []
        for label, known in self.classes.items():
            maps = [_votes(level, known) for level in levels]
            above, beside = known.codebook.margin
            shrinks, step = [level.shrink for level in levels], self.settings.step_px
            spots = peaks(maps, shrinks, (beside, above), step, known.extent, least_score, most)
            found += self._explained(spots, levels, known, label, image.shape[:2], least_score)
        return sorted(found, key=lambda d: -d.score)

    def vote_map(self, image: Image, label: str, scales: Sequence[float] | None = None) -> Floats:
        """Votes (H, W) float32 for a middle of the object at each pixel, at the size with most: for people.

        As high as the score of a detection there would be. Raises KeyError for a label not learnt.
        """
        known, step = self.classes[label], self.settings.step_px
        above, beside = known.codebook.margin
        best = np.zeros(image.shape[:2], np.float32)
        for level in self._levels(image, scales):
            rows, columns = level.leaves.shape[1:]
            inner = _votes(level, known)[above : above + rows, beside : beside + columns]
            scale = step / level.shrink
            to_picture = np.array([[scale, 0.0, 0.0], [0.0, scale, 0.0]])
            best = np.maximum(best, cv2.warpAffine(inner, to_picture, (image.shape[1], image.shape[0])))
        return np.asarray(best, np.float32)

    def support(self, image: Image, label: str, box: Box) -> Mask:
        """Pixels (H, W) that vote for an object whose box is known, wherever it was found.

        Raises KeyError for a label not learnt, ValueError for an empty box.
        """
        known = self.classes[label]
        if min(box.w, box.h) <= 0.0:
            raise ValueError(f"nothing can vote for an empty box: {box}")
        scale = math.sqrt(box.area / (known.extent[0] * known.extent[1]))
        spot = Peak(*box.centre, scale, 1.0)
        return self._voters(spot, self._levels(image, [scale]), known).support(image.shape[:2])

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Everything learnt as plain arrays, keyed 'settings', 'background', 'tests.first', '0.met', ...

        Classes are numbered in the order of `classes`; their names are not in the arrays.
        """
        arrays: dict[str, NDArray[np.generic]] = {
            "settings": np.array(astuple(self.settings), np.int32),
            "background": self.background,
        }
        arrays |= {f"tests.{key}": value for key, value in self.ferns.arrays().items()}
        for index, known in enumerate(self.classes.values()):
            arrays |= {f"{index}.{key}": value for key, value in known.experience.arrays().items()}
        return arrays

    @classmethod
    def from_arrays(cls, labels: Sequence[str], arrays: Mapping[str, NDArray[np.generic]]) -> FernDetector:
        """The inverse of `arrays`. Raises KeyError or ValueError where they do not fit together."""
        settings = FernSettings(*(int(value) for value in arrays["settings"]))
        ferns = Ferns.from_arrays(below("tests.", arrays))
        background = np.asarray(arrays["background"], np.float32)
        sane = 1 <= settings.step_px <= 16 and 8 <= settings.reference_px <= 512
        if background.shape != (ferns.count, ferns.leaf_count) or not sane:
            raise ValueError("the arrays of a fern detector do not fit together")
        if not np.isfinite(background).all() or background.min() < 0.0:
            raise ValueError("the ferns' background holds impossible numbers")
        learnt = [Experience.from_arrays(below(f"{i}.", arrays)) for i in range(len(labels))]
        for one in learnt:
            narrow, long = sorted(one.extent)
            fits = one.met.shape == background.shape and 0.99 < long / settings.reference_px < 1.01
            if not fits or narrow < 2.0:
                raise ValueError("what was learnt does not fit the ferns")
        known = {name: _known(one, background) for name, one in zip(labels, learnt, strict=True)}
        return cls(settings, ferns, background, known)

    def _levels(self, image: Image, scales: Sequence[float] | None) -> list[_Level]:
        height, width = checked(image).shape[:2]
        if scales is None:
            largest = max(1.0, 1.2 * max(height, width) / self.settings.reference_px)
            count = 1 + math.floor(LEVELS_PER_OCTAVE * math.log2(largest))
            scales = [2.0 ** (level / LEVELS_PER_OCTAVE) for level in range(count)]
        levels = []
        for scale in scales:
            size = max(round(width / scale), 8), max(round(height / scale), 8)
            small = cv2.resize(image, size, interpolation=cv2.INTER_AREA) if scale != 1.0 else image
            planes = channels(np.asarray(small, np.uint8))
            levels.append(_Level(size[0] / width, self.ferns.leaves(planes, self.settings.step_px)))
        return levels

    def _explained(
        self,
        spots: Sequence[Peak],
        levels: Sequence[_Level],
        known: _Known,
        label: str,
        shape: tuple[int, ...],
        least_score: float,
    ) -> list[HoughDetection]:
        """Detections at these spots, best first: who voted for a better one does not count for the next.

        Half an object is often like the whole (two wheels, two edges): it makes weaker maxima beside it.
        """
        found: list[HoughDetection] = []
        for spot in spots:
            voters = self._voters(spot, levels, known)
            share = voters.outside([d.box for d in found])
            if spot.score * share < least_score:
                continue
            width, height = (edge * spot.scale for edge in known.extent)
            box = Box(spot.u - width / 2, spot.v - height / 2, width, height)
            support = voters.support(shape)
            found.append(HoughDetection(box, spot.score * share, label, spot.scale, support))
        return found

    def _voters(self, spot: Peak, levels: Sequence[_Level], known: _Known) -> Voters:
        """Who voted for the spot, on the grid of the level nearest to its scale."""
        level = min(levels, key=lambda one: abs(math.log(one.shrink * spot.scale)))
        per_step = level.shrink / self.settings.step_px
        reach = [math.ceil(0.6 * edge * spot.scale * per_step) + 1 for edge in reversed(known.extent)]
        centre = spot.v * per_step, spot.u * per_step
        (y0, x0), (y1, x1) = (
            [
                min(max(round(c) + sign * r + (sign > 0), 0), n)
                for c, r, n in zip(centre, reach, level.leaves.shape[1:], strict=True)
            ]
            for sign in (-1, 1)
        )
        leaves = level.leaves[:, y0:y1, x0:x1]
        votes = known.codebook.voters(leaves, (centre[0] - y0, centre[1] - x0), VOTER_STEPS)
        return Voters(votes, (x0 / per_step, y0 / per_step), 1.0 / per_step)


def _votes(level: _Level, known: _Known) -> Floats:
    """Votes for each middle on a level's grid with its margin, in units of a score."""
    unit = np.float32(known.unit * level.shrink**FINER_SCORE)
    return np.asarray(smoothed(known.codebook.counted(level.leaves)) / unit, np.float32)


def _known(experience: Experience, background: NDArray[np.float32]) -> _Known:
    codebook = experience.codebook(background)
    unit = peak_of(experience.votes_of_a_view(codebook), experience.places_of_a_view, codebook.square_shift)
    return _Known(experience, experience.extent, codebook, unit)
