"""Eyes of the robot on the fault bench: a camera whose pictures can be spoilt, and vision that is scripted.

Only floor and track are scripted. The picture checks are those of robot/vision/health.py, a moved base is
judged by robot/displacement.py, and what the camera tells of itself is the webcam driver's own diagnosis.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from calib.model import StereoRig
from robot import displacement
from robot.displacement import Displacement
from robot.hal.faultbook import FaultBook
from robot.hal.webcam.pairing import Expected, EyeState, diagnosis
from robot.messages import (
    Clearance,
    EgoMotion,
    Fault,
    FreeSpace,
    Health,
    Image,
    Percepts,
    Pose2,
    StereoFrame,
    Timed,
    Twist,
    View,
    Want,
)
from robot.vision import health, misrectified
from robot.vision.misrectified import Rectification
from robot.vision.pair_check import check_pair

WIDTH, HEIGHT = 160, 120
DISPARITY_PX = 8
TILE_PX = 10
PERIOD_S = 0.04
EXPOSED_BEFORE_S = 0.01
"""A picture comes to the loop so long after it was taken: the shorter, the later old age is noticed."""
TOO_OLD_S = 0.8
DARK, LIT = 0.12, 0.5
"""Brightness of the room with the light switched off, without and with the lamp, as a share."""
PAIRS = 6
BUMPED_ROWS = 2
RIG = StereoRig.parallel(WIDTH, HEIGHT, 140.0, 0.06)
FLOOR_EVERY, SIGNS_EVERY, MOTION_EVERY = 3, 2, 3
"""Good pictures from look to look at the floor, at the eyes' order, at the base's own motion."""

Pair = tuple[Image, Image]
_NONE = np.zeros(0)
_FLOOR = FreeSpace(_NONE, _NONE, _NONE, np.zeros((0, 2)))


@lru_cache(maxsize=1)
def textured_pairs() -> tuple[Pair, ...]:
    """Tiles on a wall, each pair with noise of its own. Images (HEIGHT, WIDTH, 3) uint8."""
    rng = np.random.default_rng(5)
    rows, columns = math.ceil(HEIGHT / TILE_PX), math.ceil((WIDTH + DISPARITY_PX) / TILE_PX)
    tiles = rng.integers(30, 226, (rows, columns))
    wall = np.kron(tiles, np.ones((TILE_PX, TILE_PX), dtype=np.int64))[:HEIGHT, : WIDTH + DISPARITY_PX]
    return tuple((_seen(wall[:, :WIDTH], rng), _seen(wall[:, DISPARITY_PX:], rng)) for _ in range(PAIRS))


def _seen(wall: np.ndarray[tuple[int, ...], np.dtype[np.int64]], rng: np.random.Generator) -> Image:
    noisy = np.clip(wall + rng.integers(-3, 4, wall.shape), 0, 255).astype(np.uint8)
    return np.repeat(noisy[:, :, None], 3, axis=2)


class ScriptedCamera:
    """`StereoCamera` that gives a new pair every period, unless it is spoilt.

    spoilt: '' or one of 'missing' (no pair at all), 'stopped' (none any more, and nobody knows why), 'old'
    (pairs that were taken long ago), 'frozen', 'black', 'odd' (of another size), 'odd told' (the driver keeps
    them back), 'swapped', 'bumped', 'unpaired', 'unplugged'. dark: the room's light is off; lamp: its light.
    """

    def __init__(self, lamp: Callable[[], float], spoilt: str = "") -> None:
        self.spoilt = spoilt
        self.dark = False
        self.lamp_works = True
        self._lamp = lamp
        self._book = FaultBook("camera")
        self._last: StereoFrame | None = None
        self._due = -math.inf

    def latest(self, now: float) -> StereoFrame | None:
        """The newest pair."""
        if now >= self._due - 1e-9:
            self._due = now + PERIOD_S
            if self.spoilt not in ("missing", "stopped", "odd told", "unpaired", "unplugged"):
                self._take(now)
        return self._last

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What the webcam driver would say of such eyes."""
        pair_at = None if self._last is None else self._last.captured_at
        found = diagnosis(self._eyes(now), pair_at, 0.0, Expected((WIDTH, HEIGHT)), now)
        for kind in ("missing", "link", "size", "stale", "unpaired"):
            if kind in found:
                self._book.raised(kind, now, found[kind])
            else:
                self._book.cleared(kind)
        return self._book.open

    def close(self) -> None:
        """Nothing to release."""

    def _eyes(self, now: float) -> tuple[EyeState, EyeState]:
        newest = None if self._last is None else self._last.captured_at
        left = right = newest
        size = (WIDTH, HEIGHT)
        if self.spoilt == "unpaired":
            left, right = now - 0.005, now - 0.03
        if self.spoilt == "odd told":
            left, size = now, (2 * WIDTH, HEIGHT)
        broken = "no such device" if self.spoilt == "unplugged" else ""
        return EyeState("left eye", broken, False, left, size), EyeState("right eye", "", False, right, size)

    def _take(self, now: float) -> None:
        seq = 0 if self._last is None else self._last.seq + 1
        taken = now - (TOO_OLD_S if self.spoilt == "old" else EXPOSED_BEFORE_S)
        if self.spoilt == "frozen" and self._last is not None:
            left, right = self._last.left, self._last.right
        else:
            left, right = self._exposed(textured_pairs()[seq % PAIRS])
        self._last = StereoFrame(left, right, taken, seq)

    def _exposed(self, pair: Pair) -> Pair:
        left, right = pair
        if self.spoilt == "black":
            return np.zeros_like(left), np.zeros_like(right)
        if self.spoilt == "odd":
            return left[: HEIGHT // 2], right[: HEIGHT // 2]
        if self.spoilt == "swapped":
            left, right = right, left
        if self.spoilt == "bumped":
            right = np.roll(right, BUMPED_ROWS, axis=0)
        if not self.dark:
            return left, right
        share = LIT if self.lamp_works and self._lamp() > 0.5 else DARK
        return (left * share).astype(np.uint8), (right * share).astype(np.uint8)


class ScriptedVision:
    """`PerceptionLike` that sees free floor in every good picture.

    told: faults of vision's own, by key. pushed: the eyes see the base move otherwise than its wheels.
    """

    def __init__(self) -> None:
        self.told: dict[str, Fault] = {}
        self.pushed = False
        self.forgotten = 0
        self._percepts = Percepts()
        self._previous: StereoFrame | None = None
        self._swapped = False
        self._rectification = Rectification()
        self._good = 0
        self._displacement = Displacement()

    def submit(self, view: View, wants: frozenset[Want], now: float) -> None:
        """Check the picture; take what it shows if it is good."""
        frame = view.frame
        fault = health.picture_fault(frame, self._previous)
        if frame.left.shape[:2] != (HEIGHT, WIDTH):
            fault = "size"
        self._previous = frame
        told = "swapped" if fault is None and self._swapped else fault
        at = frame.captured_at
        self._see(health=Timed(Health(health.brightness(frame.left), told), at))
        if fault is not None:
            return
        self._good += 1
        if self._good % SIGNS_EVERY == 0:
            check = check_pair(frame.left, frame.right, RIG)
            self._swapped = check.swapped
            self._rectification = misrectified.updated(self._rectification, check, at)
        if self._swapped:
            return
        if self._good % FLOOR_EVERY == 0:
            self._see(free_space=Timed(_FLOOR, at))
        if self._good % MOTION_EVERY == 0:
            self._see(motion=Timed(self._motion(at), at))

    def collect(self, now: float) -> Percepts:
        """What was seen."""
        self._displacement = displacement.updated(self._displacement, self._percepts.motion, now)
        return self._percepts

    def faults(self, now: float) -> tuple[Fault, ...]:
        """Those told, a base that was moved, eyes that no longer stand as calibrated."""
        seen = (*displacement.faults(self._displacement), *misrectified.faults(self._rectification))
        return (*self.told.values(), *seen)

    def set_down(self) -> None:
        """A person armed the robot."""

    def forget_target(self) -> None:
        """Count it."""
        self.forgotten += 1

    def clearance(self, pose: Pose2, twist: Twist, now: float) -> Clearance:
        """Room enough."""
        return Clearance(1.5, "range")

    def may_turn(self, pose: Pose2) -> bool:
        """Room enough."""
        return True

    def _see(
        self,
        health: Timed[Health] | None = None,
        free_space: Timed[FreeSpace] | None = None,
        motion: Timed[EgoMotion] | None = None,
    ) -> None:
        before = self._percepts
        self._percepts = Percepts(
            health=health or before.health,
            free_space=free_space or before.free_space,
            motion=motion or before.motion,
        )

    def _motion(self, at: float) -> EgoMotion:
        eyes = Pose2(0.0, 0.03, 0.0) if self.pushed else Pose2()
        deviation = 12.0 if self.pushed else 1.0
        sigma = (0.002, 0.002, 0.004)
        return EgoMotion(
            at - MOTION_EVERY * PERIOD_S, Pose2(), eyes, 0.0, 0.0, 0.0, sigma, deviation, 90, 85, 0.01
        )
