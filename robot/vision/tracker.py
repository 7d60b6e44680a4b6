"""Following one target that changes its look, without drifting onto what is beside it: METHODS 9.

Every frame the target's looks (`target_look`) say where it is; how far their peak stands above the second one
says whether to believe it. In doubt the ferns (`target_memory`) are asked: what they do not know either is
lost. Only sure frames are learnt from. While lost nothing is learnt; the looks watch the place where it was
lost, the ferns the whole picture, and what the ferns find must fit its looks too. Two models that err
differently guard each other.

Source: after [T] by METHODS 9, whose ferns decide here and whose loop it keeps (motion and detection, gated
updates, loss, re-detection); the correlation filter in front is more exact than votes, and quicker.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Image, Track
from robot.vision.motion_prior import motion_prior
from robot.vision.picture_patch import bgr_of
from robot.vision.support import support_of
from robot.vision.target_look import Rates, Sighting, TargetLook
from robot.vision.target_memory import TargetMemory

Mask = NDArray[np.bool_]

SMALLEST_BOX_PX = 6.0


@dataclass(frozen=True, slots=True)
class TrackerSettings:
    """When the tracker believes, learns, gives up and starts again.

    sure_ratio: first peak over the second from which nobody else is asked; learn_ratio: from which a look is
    learnt. faint: of the usual peak, below which it is doubted whatever the ratio. usual_of: sure frames over
    whose peaks the usual one is the median; settle: frames in which peaks still fall from the first, perfect
    one. meet_every: frames between the ferns' looks once they know the target (earlier they look more often).
    seed: of the ferns.
    """

    sure_ratio: float = 1.8
    learn_ratio: float = 1.6
    faint: float = 0.45
    usual_of: int = 20
    settle: int = 20
    meet_every: int = 10
    rates: Rates = field(default_factory=Rates)
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Found:
    """What makes a place the lost target's. known: how much the ferns know it, 0 as its rivals, 1 as itself;
    usual: its peak over the usual one; ratio: over the second one; each at least."""

    known: float
    usual: float
    ratio: float

    def accepts(self, known: float, usual: float, ratio: float) -> bool:
        """Whether the place is the target's by this rule."""
        return known >= self.known and usual >= self.usual and ratio >= self.ratio


FOUND = (Found(known=0.4, usual=0.75, ratio=2.2), Found(known=0.1, usual=0.65, ratio=3.2))
"""Either the ferns are sure and the looks agree, or the looks stand out and the ferns do not object. Of 5700
places proposed in real sequences with the target painted over, none was accepted by either."""
NEAR_USUAL, NEAR_RATIO = 0.55, 1.8
"""Near where it was lost its looks alone are believed, and sooner: there are fewer places to be wrong about.
Least peak over the usual one, and over the second. Of 2967 such looks in real sequences that met no target,
none had .55 with a ratio of 1.4 or .5 with 1.7."""
FULL_RATIO = 4.0
"""A peak so much higher than the second is as sure as can be."""
SIZES_WHILE_LOST = (1.0, 1.0, 1.5, 1.0 / 1.5)
"""Of the last size, in turn: a target comes back nearer or farther too."""


class OnlineTracker:
    """Follows one box through frames given in order. Knows no clock: the same frames give the same track.

    >>> import cv2
    >>> rng = np.random.default_rng(0)
    >>> scene = cv2.resize(rng.integers(0, 255, (24, 30, 3), np.uint8), (360, 288))
    >>> tracker = OnlineTracker()
    >>> tracker.start(scene, Box(150, 100, 50, 60))
    >>> track = tracker.update(np.roll(scene, (3, -7), (0, 1)))
    >>> track.lost, round(track.box.x), round(track.box.y)
    (False, 143, 103)
    """

    def __init__(self, settings: TrackerSettings | None = None) -> None:
        self._settings = settings or TrackerSettings()
        self._box: Box | None = None

    @property
    def box(self) -> Box | None:
        """Where the target was last seen or, while lost, is guessed; None before `start`."""
        return self._box

    @property
    def support(self) -> Mask | None:
        """Which pixels (H, W) of the last picture are the target's; None while it is lost or before `start`.

        Worked out when asked for (2 ms).
        """
        if self._box is None or self._lost_for:
            return None
        return support_of(self._before, self._box, self._look.colours)

    def start(self, image: Image, box: Box) -> None:
        """Begin to follow what is in `box` (pixels, partly inside) of a BGR or grey uint8 picture.

        Raises:
            ValueError: a box of which less than 6 px are inside the picture; a picture that is not uint8, has
                an alpha channel or is tiny.
        """
        picture = bgr_of(image)
        inside = box.clipped(picture.shape[1], picture.shape[0])
        if min(inside.w, inside.h) < SMALLEST_BOX_PX:
            raise ValueError(
                f"the box to track must show at least {SMALLEST_BOX_PX:.0f} px of picture: {box}"
            )
        self._look = TargetLook.learnt(picture, box)
        self._memory = TargetMemory.learnt(picture, box, self._settings.seed)
        self._box, self._motion, self._before = box, (0.0, 0.0), picture
        self._frames = self._met_at = self._lost_for = 0
        self._peaks: deque[float] = deque(maxlen=self._settings.usual_of)

    def update(self, image: Image, scale: float = 1.0, shift: tuple[float, float] = (0.0, 0.0)) -> Track:
        """Find the target in the next frame.

        scale: expected size over the last frame's size (range before / range now). shift: how far the
        head's own motion moves the picture's content, in px to the right and down. velocity_px of the
        result is the motion in the picture beyond that shift, px per frame. While lost the box stays
        where it was last (moved by shift), and the search goes on in the whole picture.

        Raises:
            RuntimeError: before `start`.
            ValueError: a picture that is not uint8, has an alpha channel or is tiny.
        """
        if self._box is None:
            raise RuntimeError("start the tracker with a box before updating it")
        picture = bgr_of(image)
        self._frames += 1
        expected = _kept_inside(_moved(_scaled(self._box, scale), *shift), picture)
        sighting = self._sought(picture, expected) if self._lost_for else self._followed(picture, expected)
        self._before = picture
        if sighting is None:
            self._lost_for += 1
            self._box, self._motion = expected, (0.0, 0.0)
            return Track(expected, (0.0, 0.0), 0.0, lost=True)
        self._lost_for = 0
        (u0, v0), (u1, v1) = self._box.centre, sighting.box.centre
        self._motion = (u1 - u0 - shift[0], v1 - v0 - shift[1])
        self._box = sighting.box
        self._learn(picture, sighting)
        return Track(self._box, self._motion, min(sighting.ratio / FULL_RATIO, 1.0), lost=False)

    def _followed(self, picture: Image, expected: Box) -> Sighting | None:
        """The target near where it must be; None if neither its looks nor the ferns know it there."""
        sighting = self._look.find(picture, expected)
        if not self._clear(sighting):
            sighting = max(sighting, self._where_the_block_went(picture, expected), key=lambda s: s.ratio)
        # In the first frames looks have seen one background only, and would find the target by it.
        settled = self._frames > self._settings.settle
        sure = settled and self._clear(sighting)
        return sighting if sure or self._memory.holds(picture, sighting.box) else None

    def _where_the_block_went(self, picture: Image, expected: Box) -> Sighting:
        """The target about where its block in the last frame is now: it may have left the window."""
        assert self._box is not None
        (u0, v0), (u1, v1) = self._box.centre, expected.centre
        last = u1 - u0 + self._motion[0], v1 - v0 + self._motion[1]
        across, down = motion_prior(self._before, picture, self._box, last)
        return self._look.find(picture, _moved(expected, u0 - u1 + across, v0 - v1 + down))

    def _sought(self, picture: Image, expected: Box) -> Sighting | None:
        """The lost target: near its last place by its looks, or anywhere by the ferns and its looks."""
        near = self._look.find(picture, expected)
        # Lost before anything was learnt there is no usual peak, and a ratio alone is not enough.
        if self._peaks and self._over_usual(near) >= NEAR_USUAL and near.ratio >= NEAR_RATIO:
            return near
        supposed = _scaled(expected, SIZES_WHILE_LOST[self._lost_for % len(SIZES_WHILE_LOST)])
        for place, known in self._memory.proposals(picture, supposed):
            sighting = self._look.find(picture, place)
            if any(rule.accepts(known, self._over_usual(sighting), sighting.ratio) for rule in FOUND):
                return sighting
        return None

    def _learn(self, picture: Image, sighting: Sighting) -> None:
        """Take a sure frame into the looks, and now and then into the ferns."""
        if sighting.ratio < self._settings.learn_ratio or self._faint(sighting):
            return
        self._look = self._look.and_met(picture, sighting.box, self._settings.rates)
        self._peaks.append(sighting.peak)
        # At first everything is new: the ferns look at every frame, then ever more rarely.
        if self._frames - self._met_at >= min(max(self._frames // 3, 1), self._settings.meet_every):
            self._met_at = self._frames
            self._memory = self._memory.and_met(picture, sighting.box, self._settings.seed + self._frames)

    def _clear(self, sighting: Sighting) -> bool:
        """Whether the looks leave no doubt."""
        return sighting.ratio >= self._settings.sure_ratio and not self._faint(sighting)

    def _faint(self, sighting: Sighting) -> bool:
        settled = self._frames > self._settings.settle
        return settled and sighting.peak < self._settings.faint * self._usual_peak

    def _over_usual(self, sighting: Sighting) -> float:
        return sighting.peak / max(self._usual_peak, 1e-6)

    @property
    def _usual_peak(self) -> float:
        return float(np.median(self._peaks)) if self._peaks else 0.0


def _moved(box: Box, du: float, dv: float) -> Box:
    return Box(box.x + du, box.y + dv, box.w, box.h)


def _scaled(box: Box, factor: float) -> Box:
    (u, v), w, h = box.centre, box.w * factor, box.h * factor
    return Box(u - w / 2, v - h / 2, w, h)


def _kept_inside(box: Box, picture: Image) -> Box:
    """The box with its middle inside the picture: nobody sees farther."""
    u, v = (min(max(c, 0.0), float(n)) for c, n in zip(box.centre, reversed(picture.shape[:2]), strict=True))
    return Box(u - box.w / 2, v - box.h / 2, box.w, box.h)
