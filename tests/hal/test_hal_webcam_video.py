"""Video files as eyes, and the constructor of the whole."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import cv2
import pytest
from webcam_far_end import FakeStreamer, control, jpeg, part, picture

from robot.clock import MonotonicClock, SteppedClock
from robot.hal.interfaces import DeviceError, StereoCamera
from robot.hal.webcam.opening import open_webcams
from robot.hal.webcam.source import EndOfPicturesError, TimedImage
from robot.hal.webcam.video import VideoSource

ASKED = {"width": 64, "height": 48, "rate_hz": 10.0}
EXPOSURE_AUTO, EXPOSURE = 0x009A0901, 0x009A0902


def video(path: Path, values: list[int], rate_hz: float = 10.0, size: tuple[int, int] = (64, 48)) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), rate_hz, size)
    assert writer.isOpened()
    for value in values:
        writer.write(picture(value, size))
    writer.release()
    return path


class Player:
    """A video source on a clock that is stepped by 10 ms; pausing steps it."""

    def __init__(self, path: Path, loop: bool = False, start: float = 1.0) -> None:
        self.clock = SteppedClock(0.01)
        self.to(1.0)
        self.source = VideoSource(path, self.clock, start, loop=loop, pause=self._pause)
        self.source.open()

    def to(self, at: float) -> None:
        while self.clock.now() < at - 1e-9:
            self.clock.step()

    def _pause(self, seconds: float) -> None:
        self.to(self.clock.now() + seconds)

    def next(self) -> tuple[float, int] | None:
        picture: TimedImage | None = self.source.grab(0.02)
        return None if picture is None else (round(picture.at, 6), round(int(picture.image[0, 0, 0]), -1))


def test_a_video_is_played_at_its_own_rate_and_ends_in_words(tmp_path: Path) -> None:
    player = Player(video(tmp_path / "a.avi", [10, 60, 110]))
    assert player.next() == (1.0, 10)
    assert player.next() is None  # 100 ms to the next, it waits 20 ms for it
    assert player.clock.now() == pytest.approx(1.02)
    player.to(1.09)
    assert player.next() == (1.1, 60)
    player.to(1.25)
    assert player.next() == (1.2, 110)
    player.to(1.35)
    with pytest.raises(EndOfPicturesError, match=r"a\.avi is over"):
        player.next()
    player.source.close()
    player.source.close()
    with pytest.raises(DeviceError, match="closed"):
        player.next()


def test_a_late_reader_skips_pictures(tmp_path: Path) -> None:
    player = Player(video(tmp_path / "a.avi", [10, 60, 110, 160]))
    player.to(1.23)
    assert player.next() == (1.2, 110)
    player.to(1.3)
    assert player.next() == (1.3, 160)


def test_a_looped_video_goes_on_in_time(tmp_path: Path) -> None:
    player = Player(video(tmp_path / "a.avi", [10, 60]), loop=True)
    seen = []
    while len(seen) < 5:
        seen += [shown] if (shown := player.next()) else []
    assert seen == [(1.0, 10), (1.1, 60), (1.2, 10), (1.3, 60), (1.4, 10)]


def test_a_looped_video_whose_file_goes_ends_in_words(tmp_path: Path) -> None:
    path = video(tmp_path / "a.avi", [10, 60])
    player = Player(path, loop=True)
    path.unlink()
    for at in (1.0, 1.1, 1.2):
        player.to(at)
        player.next()
    with pytest.raises(DeviceError, match="holds no picture"):
        player.next()


def test_what_is_no_video_is_refused_by_name(tmp_path: Path) -> None:
    for path, words in ((tmp_path / "no.avi", "is not there"), (tmp_path / "bad.avi", "is no video")):
        if "bad" in path.name:
            path.write_bytes(b"no video" * 100)
        with pytest.raises(DeviceError, match=rf"{path.name} {words}"):
            VideoSource(path, SteppedClock(), 0.0).open()


# --------------------------------------------------------------------------------------------- constructor


def wait_for(camera: StereoCamera, clock: MonotonicClock, condition):  # type: ignore[no-untyped-def]
    end = time.monotonic() + 5.0
    while not condition(camera.latest(clock.now())):
        assert time.monotonic() < end, camera.faults(clock.now())
        threading.Event().wait(0.005)
    return camera.latest(clock.now())


def test_two_videos_are_two_eyes_in_step(tmp_path: Path) -> None:
    left = video(tmp_path / "left.avi", [10, 20, 30, 40, 50], rate_hz=20.0)
    right = video(tmp_path / "right.avi", [110, 120, 130, 140, 150], rate_hz=20.0)
    clock = MonotonicClock()
    camera = open_webcams(str(left), str(right), "video", **ASKED | {"rate_hz": 20.0}, clock=clock)
    frame = wait_for(camera, clock, lambda frame: frame is not None and frame.captured_at > 0.1)
    assert round(int(frame.right[0, 0, 0]), -1) == round(int(frame.left[0, 0, 0]), -1) + 100
    wait_for(camera, clock, lambda frame: camera.faults(clock.now()))
    assert [fault.key for fault in camera.faults(clock.now())] == ["camera.missing"]
    camera.close()


def test_one_wide_video_is_two_eyes(tmp_path: Path) -> None:
    clock = MonotonicClock()
    wide = video(tmp_path / "wide.avi", [10] * 20, size=(128, 48))
    camera = open_webcams(str(wide), "", "video", **ASKED, clock=clock)
    frame = wait_for(camera, clock, lambda frame: frame is not None)
    assert frame.left.shape == frame.right.shape == (48, 64, 3)
    assert camera.faults(clock.now()) == ()
    camera.close()


def test_two_network_cameras_with_the_left_ones_exposure() -> None:
    controls = [
        control(EXPOSURE_AUTO, "Auto", 0, 3, value=3),
        control(EXPOSURE, "Exposure", 1, 5000, value=157),
    ]
    other = [control(EXPOSURE_AUTO, "Auto", 0, 3, value=3), control(EXPOSURE, "Exposure", 1, 5000, value=33)]
    eyes = FakeStreamer(controls), FakeStreamer(other)
    clock = MonotonicClock()
    camera = open_webcams(eyes[0].url, eyes[1].url, "http", **ASKED, clock=clock)
    assert [eye.controls[EXPOSURE]["value"] for eye in eyes] == ["157", "157"]
    assert [eye.controls[EXPOSURE_AUTO]["value"] for eye in eyes] == ["1", "1"]
    for eye in eyes:
        eye.connected.acquire(timeout=5)
        eye.push(part(jpeg(50), 7.0))
    frame = wait_for(camera, clock, lambda frame: frame is not None)
    assert frame.captured_at <= clock.now()
    camera.close()
    for eye in eyes:
        eye.down()


def test_an_eye_that_is_not_there_closes_the_other() -> None:
    left = FakeStreamer()
    gone = FakeStreamer()
    gone.down()
    with pytest.raises(DeviceError, match=gone.base):
        open_webcams(left.url, gone.url, "http", **ASKED, clock=MonotonicClock())
    assert not any(thread.name.startswith(f"eye {left.base}") for thread in threading.enumerate())
    left.down()


def test_wrong_names_are_refused_with_the_cure() -> None:
    for left, right, words in (("", "", "cameras.left is empty"), ("a", "a", "are the same")):
        with pytest.raises(DeviceError, match=words):
            open_webcams(left, right, "video", **ASKED, clock=SteppedClock())
    with pytest.raises(DeviceError, match="it is not there"):
        open_webcams("/dev/no-eye", "", "v4l2", **ASKED, clock=SteppedClock())
