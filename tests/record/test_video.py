"""run.mp4: really playable, and silent about a full disk."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from robot.messages import Image
from robot.record.recording import Recording
from robot.record.video import RESERVE_BYTES, VideoWriter

SIZE = (160, 96)


def _frame(number: int) -> Image:
    """A white bar that moves right by 8 px a frame on dark ground."""
    image = np.full((SIZE[1], SIZE[0], 3), 30, dtype=np.uint8)
    image[:, 8 * number : 8 * number + 8] = 230
    return image


def _read(path: Path) -> tuple[list[Image], float]:
    capture = cv2.VideoCapture(str(path))
    images = []
    while True:
        ok, image = capture.read()
        if not ok:
            break
        images.append(np.asarray(image, dtype=np.uint8))
    rate = capture.get(cv2.CAP_PROP_FPS)
    capture.release()
    return images, rate


def test_what_was_written_can_be_played_frame_by_frame(tmp_path: Path) -> None:
    path = tmp_path / "run.mp4"
    video = VideoWriter(path, SIZE, 25.0)
    for number in range(12):
        video.write(_frame(number), number / 25)
    video.close()
    images, rate = _read(path)
    assert rate == 25.0
    assert video.frames == len(images) == 12
    for number, image in enumerate(images):
        assert image.shape == (SIZE[1], SIZE[0], 3)
        assert int(np.argmax(image.mean(axis=(0, 2)))) // 8 == number
    video.close()
    video.write(_frame(0), 1.0)
    assert video.frames == 12


def test_a_disk_that_fills_up_ends_the_video_and_the_part_before_plays(tmp_path: Path) -> None:
    path = tmp_path / "run.mp4"
    free = iter([RESERVE_BYTES, RESERVE_BYTES - 1])
    recording = Recording()
    video = VideoWriter(path, SIZE, 25.0, recording, free=lambda _: next(free))
    for number in range(40):
        video.write(_frame(number % 20), number / 25)
    assert video.frames == 25
    assert recording.stopped is not None
    assert recording.stopped.at == 1.0
    assert "full" in recording.stopped.reason
    assert len(_read(path)[0]) == 25
    video.close()


def test_a_video_that_cannot_be_opened_does_not_stop_the_run(tmp_path: Path) -> None:
    video = VideoWriter(tmp_path / "nowhere" / "run.mp4", SIZE, 25.0, free=lambda _: RESERVE_BYTES)
    video.write(_frame(0), 0.4)
    assert video.recording.stopped is not None
    assert video.recording.stopped.at == 0.4
    video.close()


def test_a_recording_that_is_off_writes_no_video(tmp_path: Path) -> None:
    recording = Recording()
    recording.stop(0.0, "full")
    video = VideoWriter(tmp_path / "run.mp4", SIZE, 25.0, recording)
    video.write(_frame(0), 0.0)
    video.close()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("size", [(161, 96), (160, 95), (0, 96)])
def test_odd_sizes_are_refused(tmp_path: Path, size: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="even width and height"):
        VideoWriter(tmp_path / "run.mp4", size, 25.0)


def test_a_frame_of_another_size_is_refused(tmp_path: Path) -> None:
    video = VideoWriter(tmp_path / "run.mp4", SIZE, 25.0)
    with pytest.raises(ValueError, match="160 x 96"):
        video.write(np.zeros((96, 162, 3), dtype=np.uint8), 0.0)
    with pytest.raises(ValueError, match="0"):
        VideoWriter(tmp_path / "run.mp4", SIZE, 0.0)
