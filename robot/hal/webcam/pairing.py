"""Which two pictures belong together, and what is wrong when none do. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robot.hal.webcam.source import TimedImage


def newest_pair(
    left: Sequence[TimedImage], right: Sequence[TimedImage], tolerance: float
) -> tuple[TimedImage, TimedImage] | None:
    """The newest left and right picture taken at the same moment, at most `tolerance` seconds apart.

    Two pictures are a pair if each is the other's nearest in time: so a right picture that has come before
    its own left one is not given to the left one before. Of two equally near the newer counts.

    >>> import numpy as np
    >>> eye = lambda *times: [TimedImage(np.zeros((1, 1, 3), np.uint8), at) for at in times]
    >>> pair = newest_pair(eye(0.00, 0.04), eye(0.01, 0.05, 0.09), tolerance=0.02)
    >>> pair and (pair[0].at, pair[1].at)
    (0.04, 0.05)
    """
    if not left or not right:
        return None
    for one in sorted(left, key=lambda picture: picture.at, reverse=True):
        other = _nearest(one.at, right)
        if abs(other.at - one.at) <= tolerance and _nearest(other.at, left) is one:
            return one, other
    return None


@dataclass(frozen=True, slots=True)
class EyeState:
    """What is known of one eye: broken says why it does not deliver; newest_at: its newest picture's time."""

    name: str
    broken: str = ""
    ended: bool = False
    newest_at: float | None = None
    size: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True)
class Expected:
    """What an eye is to give: picture size (width, height); none older than max_age seconds."""

    size: tuple[int, int]
    max_age: float = 0.45


def diagnosis(
    eyes: Sequence[EyeState], pair_at: float | None, since: float, expected: Expected, now: float
) -> dict[str, str]:
    """Camera faults by kind with their evidence, which names the eye. Empty if nothing is wrong.

    pair_at: capture time of the newest pair (None before the first); since: when it all began.
    """
    found: dict[str, str] = {}
    ended = [f"{eye.name}: {eye.broken}" for eye in eyes if eye.ended]
    broken = [f"{eye.name}: {eye.broken}" for eye in eyes if eye.broken and not eye.ended]
    odd = [
        f"{eye.name} gives {eye.size[0]} x {eye.size[1]}, not {expected.size[0]} x {expected.size[1]}"
        for eye in eyes
        if eye.size is not None and eye.size != expected.size
    ]
    for kind, evidence in (("missing", ended), ("link", broken), ("size", odd)):
        if evidence:
            found[kind] = "; ".join(evidence)
    if not found and now - (since if pair_at is None else pair_at) > expected.max_age:
        found.update(_without_pairs(eyes, pair_at, expected, now))
    return found


def _without_pairs(
    eyes: Sequence[EyeState], pair_at: float | None, expected: Expected, now: float
) -> dict[str, str]:
    """All sources say they run, yet there is no new pair."""
    ages = {eye.name: None if eye.newest_at is None else now - eye.newest_at for eye in eyes}
    silent = {name: age for name, age in ages.items() if age is None or age > expected.max_age}
    if silent:
        words = (
            f"{name}: no picture yet" if age is None else f"{name}: newest picture {age:.1f} s old"
            for name, age in silent.items()
        )
        return {"missing" if pair_at is None else "stale": "; ".join(words)}
    times = [eye.newest_at for eye in eyes if eye.newest_at is not None]
    return {"unpaired": f"newest pictures {1e3 * (max(times) - min(times)):.0f} ms apart"}


def _nearest(at: float, pictures: Sequence[TimedImage]) -> TimedImage:
    return min(pictures, key=lambda picture: (abs(picture.at - at), -picture.at))
