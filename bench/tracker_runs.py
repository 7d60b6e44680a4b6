"""Trackers run over sequences, frame by frame in turn, so that their times may be compared."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from bench.tracker_peers import Peer
from bench.tracker_sequences import Filmed
from robot.messages import Box, Image, Track


class Tracker(Protocol):
    """What the bench asks of a tracker."""

    def start(self, image: Image, box: Box) -> None:
        """Begin to follow what is in the box."""

    def update(self, image: Image) -> Track:
        """Find it in the next frame."""


@dataclass(frozen=True, slots=True)
class Run:
    """What a tracker said of each frame (of the first: the given box), and seconds of its updates."""

    tracks: tuple[Track, ...]
    seconds: tuple[float, ...]

    @property
    def ms(self) -> float:
        """Median of an update."""
        return 1000.0 * float(np.median(self.seconds))


def run(film: Filmed, trackers: Mapping[str, Tracker]) -> dict[str, Run]:
    """Every tracker over the film, begun on the first frame's truth; each frame is shown to all in turn."""
    box = film.truth[0]
    assert box is not None
    for tracker in trackers.values():
        tracker.start(film.frames[0], box)
    tracks: dict[str, list[Track]] = {name: [Track(box, (0.0, 0.0), 1.0, False)] for name in trackers}
    seconds: dict[str, list[float]] = {name: [] for name in trackers}
    for frame in film.frames[1:]:
        for name, tracker in trackers.items():
            start = time.perf_counter()
            tracks[name].append(tracker.update(frame))
            taken = time.perf_counter() - start
            seconds[name].append(tracker.seconds if isinstance(tracker, Peer) else taken)
    return {name: Run(tuple(tracks[name]), tuple(seconds[name])) for name in trackers}
