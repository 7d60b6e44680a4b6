"""A camera whose pairs come rectified: what stands behind it is any other stereo camera."""

from __future__ import annotations

from collections.abc import Callable

from robot.hal.interfaces import StereoCamera
from robot.messages import Fault, Image, StereoFrame

Rectify = Callable[[Image, Image], tuple[Image, Image]]


class RectifiedCamera:
    """Rectifies each new pair once. Pairs of another size than `rectify` is for pass as they are.

    Perception refuses pictures of a size it was not set up for, so those are told as a fault there.
    """

    def __init__(self, camera: StereoCamera, rectify: Rectify) -> None:
        self._camera = camera
        self._rectify = rectify
        self._last: StereoFrame | None = None

    def latest(self, now: float) -> StereoFrame | None:
        """The newest pair, rectified."""
        frame = self._camera.latest(now)
        if frame is None or (self._last is not None and self._last.seq == frame.seq):
            return self._last
        try:
            left, right = self._rectify(frame.left, frame.right)
        except ValueError:
            left, right = frame.left, frame.right
        self._last = StereoFrame(left, right, frame.captured_at, frame.seq)
        return self._last

    def faults(self, now: float) -> tuple[Fault, ...]:
        """Those of the camera behind it."""
        return self._camera.faults(now)

    def close(self) -> None:
        """Close the camera behind it."""
        self._camera.close()
