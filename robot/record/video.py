"""The video of a run: MPEG-4 written frame by frame. A full disk ends the video, never the run."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2

from robot.messages import Image
from robot.record.recording import Recording

RESERVE_BYTES = 16_000_000
"""What must be left on the disk: the encoder hides a full disk, so recording stops just before."""

_CHECK_EVERY_FRAMES = 25


def free_bytes(path: Path) -> int:
    """Free space on the disk that holds `path`."""
    return shutil.disk_usage(path.parent).free


class VideoWriter:
    """Writes BGR uint8 frames of one size to an .mp4 file (fourcc mp4v).

    size is (width, height) in pixels, both even; rate_hz the frames a second it is played with. What goes
    wrong while writing is told by `recording`, not raised; `close` makes the file playable.

    >>> import tempfile
    >>> import numpy as np
    >>> path = Path(tempfile.mkdtemp()) / "run.mp4"
    >>> video = VideoWriter(path, (64, 48), 25.0)
    >>> for level in range(10):
    ...     video.write(np.full((48, 64, 3), 20 * level, dtype=np.uint8), now=level / 25)
    >>> video.close()
    >>> video.frames, path.stat().st_size > 0
    (10, True)
    """

    def __init__(
        self,
        path: Path,
        size: tuple[int, int],
        rate_hz: float,
        recording: Recording | None = None,
        free: Callable[[Path], int] = free_bytes,
    ) -> None:
        if size[0] % 2 or size[1] % 2 or min(size) <= 0:
            raise ValueError(f"a video needs an even width and height, got {size[0]} x {size[1]}")
        if not rate_hz > 0:
            raise ValueError(f"a video needs a positive rate, got {rate_hz}")
        self.recording = recording or Recording()
        self.frames = 0
        """Frames written so far."""
        self._path = path
        self._size = size
        self._rate_hz = rate_hz
        self._free = free
        self._writer: cv2.VideoWriter | None = None
        self._closed = False

    def write(self, image: Image, now: float) -> None:
        """Append a frame (height, width, 3) shown at run time `now`.

        Raises ValueError for an image of another size or type; never for a disk that is full or gone.
        """
        if image.shape != (self._size[1], self._size[0], 3) or image.dtype != "uint8":
            raise ValueError(
                f"expected {self._size[0]} x {self._size[1]} BGR uint8, got {image.shape} {image.dtype}"
            )
        if self._closed or not self.recording.on:
            return
        with self.recording.guarded(now):
            if self.frames % _CHECK_EVERY_FRAMES == 0 and self._free(self._path) < RESERVE_BYTES:
                raise OSError(28, "the disk is full")
            self._opened().write(image)
            self.frames += 1
        if not self.recording.on:
            self._release()

    def close(self) -> None:
        """Finish the file. May be called twice."""
        self._closed = True
        self._release()

    def _opened(self) -> cv2.VideoWriter:
        if self._writer is None:
            fourcc = cv2.VideoWriter.fourcc(*"mp4v")
            writer = cv2.VideoWriter(str(self._path), fourcc, self._rate_hz, self._size)
            if not writer.isOpened():
                raise OSError(5, f"no video can be written to {self._path.name}")
            self._writer = writer
        return self._writer

    def _release(self) -> None:
        if self._writer is not None:
            self._writer.release()
            self._writer = None
