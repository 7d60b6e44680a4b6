"""A stereo camera that shows what it is given."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from robot.hal.mock.script import Mock
from robot.messages import Image, StereoFrame

_TILE_PX: Final = 16


class MockCamera(Mock):
    """Shows pairs of pictures one after the other at `rate_hz`, and again from the start after the last.

    pairs: (left, right) BGR uint8 images (H, W, 3). Frame n is captured at n / rate_hz.

    >>> camera = MockCamera([wall_pair(64, 48)], rate_hz=25.0)
    >>> frame = camera.latest(now=0.05)
    >>> frame.seq, frame.captured_at, frame.left.shape
    (1, 0.04, (48, 64, 3))
    """

    def __init__(self, pairs: Sequence[tuple[Image, Image]], rate_hz: float = 25.0) -> None:
        super().__init__("camera")
        if not pairs:
            raise ValueError("a camera needs at least one pair of pictures")
        self.pairs = list(pairs)
        self._rate_hz = rate_hz
        self._last: StereoFrame | None = None

    def latest(self, now: float) -> StereoFrame | None:
        """The pair due at `now`; the last one while it fails."""
        if self._works(now, "latest"):
            seq = max(0, math.floor(now * self._rate_hz + 1e-6))
            if self._last is None or seq > self._last.seq:
                left, right = self.pairs[seq % len(self.pairs)]
                self._last = StereoFrame(left, right, captured_at=round(seq / self._rate_hz, 9), seq=seq)
        return self._last


def wall_pair(width: int, height: int, disparity_px: int = 8) -> tuple[Image, Image]:
    """A wall of grey tiles seen by both eyes with one disparity. Images (height, width, 3) uint8."""
    tiles = np.random.default_rng(0).integers(
        40, 216, (math.ceil(height / _TILE_PX), math.ceil((width + disparity_px) / _TILE_PX)), dtype=np.uint8
    )
    wall = np.kron(tiles, np.ones((_TILE_PX, _TILE_PX), dtype=np.uint8))[:height, : width + disparity_px]
    left, right = wall[:, :width], wall[:, disparity_px:]
    return np.repeat(left[:, :, None], 3, axis=2), np.repeat(right[:, :, None], 3, axis=2)
