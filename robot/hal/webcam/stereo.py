"""The two eyes as one stereo camera: two devices paired by capture time, or one that shows both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from robot.clock import Clock
from robot.hal.faultbook import FaultBook
from robot.hal.webcam.pairing import Expected, EyeState, diagnosis, newest_pair
from robot.hal.webcam.reader import Reader, wait_all_newer
from robot.hal.webcam.source import TimedImage
from robot.messages import Fault, StereoFrame

_KINDS = ("missing", "link", "size", "stale", "unpaired")


class _Eyes:
    """What both kinds of stereo camera share: readers, faults, closing."""

    def __init__(self, readers: dict[str, Reader], expected: Expected, clock: Clock) -> None:
        self._readers = readers
        self._expected = expected
        self._since = clock.now()
        self._book = FaultBook("camera")
        self._last: StereoFrame | None = None
        self._closed = False

    def wait_newer(self, timeout: float) -> bool:
        """Wait until every eye has a picture newer than that of the newest pair; False after `timeout` s."""
        return wait_all_newer(tuple(self._readers.values()), self._seen_at(), timeout)

    def _seen_at(self) -> tuple[float, ...]:
        """Of each eye, when the picture shown last was taken."""
        return (-float("inf") if self._last is None else self._last.captured_at,)

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong; the evidence says with which eye."""
        if self._closed:
            return ()
        pair_at = None if self._last is None else self._last.captured_at
        eyes = [_state(name, reader) for name, reader in self._readers.items()]
        found = diagnosis(eyes, pair_at, self._since, self._expected, now)
        for kind in _KINDS:
            if kind in found:
                self._book.raised(kind, now, found[kind])
            else:
                self._book.cleared(kind)
        return self._book.open

    def close(self) -> None:
        """Release the devices."""
        self._closed = True
        for reader in self._readers.values():
            reader.close()

    def _fitting(self, reader: Reader, now: float) -> list[TimedImage]:
        size = self._expected.size
        return [picture for picture in reader.recent() if picture.at <= now and picture.size == size]

    def _show(self, left: TimedImage, right: TimedImage) -> StereoFrame:
        # The left picture's time: boxes and ranges are told of the left picture.
        seq = 0 if self._last is None else self._last.seq + 1
        self._last = StereoFrame(left.image, right.image, left.at, seq)
        return self._last


JITTER: Final = 0.05
"""Share of a period by which capture times are uncertain: eyes exactly half a period apart stay a pair."""


class WebcamPair(_Eyes):
    """`StereoCamera` over two readers that are running.

    Pictures are a pair if taken at most half a period and `JITTER` apart. size is (width, height) of each.
    Faults: `link` (a source is broken; it is opened again by itself), `missing` (no pair ever, or a video is
    over), `stale` (the newest pair is older than max_age although the sources say they run), `unpaired` (both
    deliver, but never at the same moment), `size`.
    """

    def __init__(
        self,
        left: Reader,
        right: Reader,
        clock: Clock,
        rate_hz: float,
        size: tuple[int, int],
        max_age: float = 0.45,
    ) -> None:
        if rate_hz <= 0:
            raise ValueError(f"rate_hz must be positive, got {rate_hz}")
        super().__init__({"left eye": left, "right eye": right}, Expected(size, max_age), clock)
        self._left, self._right = left, right
        self._tolerance = (0.5 + JITTER) / rate_hz
        self._shown = (-float("inf"), -float("inf"))

    def latest(self, now: float) -> StereoFrame | None:
        """The newest pair; one picture is never shown in two pairs."""
        if self._closed:
            return self._last
        # Only pictures not shown yet are paired: with eyes half a period apart the nearest one would change
        # from side to side, and a third of the pairs would be lost.
        left = [picture for picture in self._fitting(self._left, now) if picture.at > self._shown[0]]
        right = [picture for picture in self._fitting(self._right, now) if picture.at > self._shown[1]]
        pair = newest_pair(left, right, self._tolerance)
        if pair is not None:
            self._shown = (pair[0].at, pair[1].at)
            self._show(*pair)
        return self._last

    def _seen_at(self) -> tuple[float, ...]:
        return self._shown

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong; looks for a newer pair first."""
        self.latest(now)
        return super().faults(now)


class SideBySideCamera(_Eyes):
    """`StereoCamera` over one reader whose pictures show both eyes, the left one on the left.

    size is (width, height) of one eye: the device's pictures are twice as wide. Faults as with WebcamPair,
    but nothing can be unpaired.
    """

    def __init__(self, reader: Reader, clock: Clock, size: tuple[int, int], max_age: float = 0.45) -> None:
        super().__init__({"the camera": reader}, Expected((2 * size[0], size[1]), max_age), clock)
        self._reader = reader
        self._width = size[0]

    def latest(self, now: float) -> StereoFrame | None:
        """The newest picture, split."""
        if self._closed:
            return self._last
        pictures = self._fitting(self._reader, now)
        if pictures and (self._last is None or pictures[-1].at > self._last.captured_at):
            whole, at = pictures[-1].image, pictures[-1].at
            left = TimedImage(np.ascontiguousarray(whole[:, : self._width]), at)
            right = TimedImage(np.ascontiguousarray(whole[:, self._width :]), at)
            self._show(left, right)
        return self._last

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong; looks for a newer picture first."""
        self.latest(now)
        return super().faults(now)


def _state(name: str, reader: Reader) -> EyeState:
    pictures: Sequence[TimedImage] = reader.recent()
    state = reader.state
    if not pictures:
        return EyeState(name, state.broken, state.ended)
    return EyeState(name, state.broken, state.ended, pictures[-1].at, pictures[-1].size)
