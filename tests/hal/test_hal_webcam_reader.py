"""The reader's thread, and the two eyes made of readers."""

from __future__ import annotations

import threading
import time
from queue import Empty, Queue

import numpy as np
import pytest
from webcam_far_end import picture

from robot.clock import SteppedClock
from robot.faults import TABLE
from robot.hal.interfaces import DeviceError, StereoCamera
from robot.hal.webcam.reader import Backoff, Reader
from robot.hal.webcam.source import EndOfPicturesError, TimedImage
from robot.hal.webcam.stereo import SideBySideCamera, WebcamPair

QUICK = Backoff(0.01, 0.02)
DEADLINE = 5.0


class ScriptedSource:
    """Gives what is put into it: pictures, or errors to raise; `absent`: opening fails."""

    def __init__(self, name: str = "scripted") -> None:
        self.name = name
        self.script: Queue[TimedImage | Exception] = Queue()
        self.absent: str = ""
        self.opened = self.closed = 0

    def open(self) -> None:
        if self.absent:
            raise DeviceError(self.absent)
        self.opened += 1

    def grab(self, timeout: float) -> TimedImage | None:
        try:
            item = self.script.get(timeout=timeout)
        except Empty:
            return None
        if isinstance(item, Exception):
            raise item
        return item

    def close(self) -> None:
        self.closed += 1

    def show(self, at: float, value: int = 0, size: tuple[int, int] = (64, 48)) -> None:
        self.script.put(TimedImage(picture(value, size), at))


def until(condition) -> None:  # type: ignore[no-untyped-def]
    end = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        threading.Event().wait(0.002)


@pytest.fixture
def running():  # type: ignore[no-untyped-def]
    readers: list[Reader] = []

    def run(source: ScriptedSource, **settings) -> Reader:  # type: ignore[no-untyped-def]
        reader = Reader(source, backoff=QUICK, **settings)
        readers.append(reader)
        reader.start()
        return reader

    yield run
    for reader in readers:
        reader.close()


# ----------------------------------------------------------------------------------------------- reader


def test_the_newest_pictures_are_kept_and_waited_for(running) -> None:  # type: ignore[no-untyped-def]
    source = ScriptedSource()
    reader = running(source, keep=3)
    assert reader.recent() == ()
    assert not reader.wait_newer(-1.0, 0.01)
    for n in range(6):
        source.show(n / 10)
    assert reader.wait_newer(0.45, DEADLINE)
    assert [p.at for p in reader.recent()] == [0.3, 0.4, 0.5]
    assert not reader.wait_newer(0.5, 0.01)


def test_capture_times_never_go_back(running) -> None:  # type: ignore[no-untyped-def]
    source = ScriptedSource()
    reader = running(source)
    for at in (1.0, 0.9, 1.0, 1.1):
        source.show(at)
    assert reader.wait_newer(1.05, DEADLINE)
    assert [p.at for p in reader.recent()] == [1.0, 1.1]


def test_opening_fails_in_words_and_leaves_nothing_open() -> None:
    source = ScriptedSource()
    source.absent = "it is not there"
    with pytest.raises(DeviceError, match="it is not there"):
        Reader(source).start()
    assert source.closed == 1


def test_a_broken_source_is_told_closed_and_opened_again(running) -> None:  # type: ignore[no-untyped-def]
    source = ScriptedSource()
    dressed: list[int] = []
    reader = running(source, on_open=lambda: dressed.append(source.opened))
    source.show(1.0)
    assert reader.wait_newer(0.0, DEADLINE)
    source.absent = "still unplugged"
    source.script.put(DeviceError("unplugged"))
    until(lambda: reader.state.broken == "still unplugged")
    assert source.closed >= 1
    assert [p.at for p in reader.recent()] == [1.0]
    source.absent = ""
    until(lambda: source.opened == 2)
    assert reader.state.broken  # only a picture proves that it works
    source.show(2.0)
    until(lambda: not reader.state.broken)
    assert reader.wait_newer(1.0, DEADLINE)
    assert dressed == [1, 2]


def test_an_unforeseen_error_does_not_end_the_thread_unseen(running) -> None:  # type: ignore[no-untyped-def]
    source = ScriptedSource()
    reader = running(source)
    source.script.put(KeyError("a mistake"))
    until(lambda: "KeyError" in reader.state.broken)
    source.show(1.0)
    assert reader.wait_newer(0.0, DEADLINE)
    assert reader.state.broken == ""


def test_the_end_is_told_and_wakes_who_waits(running) -> None:  # type: ignore[no-untyped-def]
    source = ScriptedSource()
    reader = running(source)
    source.script.put(EndOfPicturesError("the video is over"))
    begun = time.monotonic()
    assert not reader.wait_newer(0.0, DEADLINE)
    assert time.monotonic() - begun < DEADLINE / 2
    assert reader.state.ended
    assert reader.state.broken == "the video is over"
    assert source.opened == 1


def test_closing_ends_the_thread_and_may_be_done_twice(running) -> None:  # type: ignore[no-untyped-def]
    source = ScriptedSource("x7")
    reader = running(source)
    source.show(1.0)
    assert reader.wait_newer(0.0, DEADLINE)
    reader.close()
    reader.close()
    assert source.closed == 1
    assert len(reader.recent()) == 1
    assert not any(thread.name == "eye x7" for thread in threading.enumerate())


def test_a_reader_in_back_off_closes_at_once() -> None:
    source = ScriptedSource()
    reader = Reader(source, backoff=Backoff(60.0, 60.0))
    reader.start()
    source.script.put(DeviceError("gone"))
    until(lambda: reader.state.broken)
    begun = time.monotonic()
    reader.close()
    assert time.monotonic() - begun < 0.9  # it was woken, not given up


# -------------------------------------------------------------------------------------------- two eyes


class Eyes:
    """A pair over two scripted sources."""

    def __init__(self, running) -> None:  # type: ignore[no-untyped-def]
        self.left, self.right = ScriptedSource("L"), ScriptedSource("R")
        self.readers = running(self.left), running(self.right)
        self.camera = WebcamPair(*self.readers, SteppedClock(), rate_hz=25.0, size=(64, 48))

    def show(self, left: float, right: float, value: int = 0) -> None:
        self.left.show(left, value)
        self.right.show(right, value + 100)
        assert self.readers[0].wait_newer(left - 1e-9, DEADLINE)
        assert self.readers[1].wait_newer(right - 1e-9, DEADLINE)

    def kinds(self, now: float) -> list[str]:
        faults = self.camera.faults(now)
        assert {fault.key for fault in faults} <= TABLE.keys()
        return [fault.kind for fault in faults]


@pytest.fixture
def eyes(running) -> Eyes:  # type: ignore[no-untyped-def]
    return Eyes(running)


def test_two_eyes_are_a_stereo_camera(eyes: Eyes) -> None:
    camera = eyes.camera
    assert isinstance(camera, StereoCamera)
    assert camera.latest(0.1) is None
    assert not camera.wait_newer(0.01)
    eyes.show(1.00, 1.01, value=7)
    assert camera.wait_newer(DEADLINE)
    frame = camera.latest(1.02)
    assert frame is not None
    assert (frame.captured_at, frame.seq) == (1.00, 0)
    assert (int(frame.left[0, 0, 0]), int(frame.right[0, 0, 0])) == (7, 107)
    assert camera.latest(1.03) is frame
    eyes.show(1.04, 1.05)
    again = camera.latest(1.06)
    assert again is not None
    assert (again.captured_at, again.seq) == (1.04, 1)


def test_the_wait_for_a_pair_is_not_ended_by_the_late_eye_of_the_old_one(eyes: Eyes) -> None:
    eyes.show(1.00, 1.0003)
    assert eyes.camera.latest(1.01) is not None
    eyes.left.show(1.04)
    assert eyes.readers[0].wait_newer(1.0, DEADLINE)
    assert not eyes.camera.wait_newer(0.01), "the right picture of the pair shown is not a new one"
    eyes.right.show(1.0403)
    assert eyes.camera.wait_newer(DEADLINE)


def test_a_picture_is_never_shown_in_two_pairs_nor_before_its_time(eyes: Eyes) -> None:
    eyes.show(1.00, 1.00)
    first = eyes.camera.latest(1.0)
    eyes.left.show(1.015)
    assert eyes.readers[0].wait_newer(1.01, DEADLINE)
    assert eyes.camera.latest(1.1) is first
    eyes.show(1.055, 1.06)
    assert eyes.camera.latest(1.058) is first  # the right one is of the future yet
    assert eyes.camera.latest(1.06) is not first


def test_eyes_half_a_period_apart_lose_no_pair(eyes: Eyes) -> None:
    """Capture times waver by a tenth of a millisecond: which picture is nearest changes from side to side."""
    shown = []
    for index in range(12):
        at = 1.0 + 0.04 * index
        eyes.show(at, at + 0.02 + (0.0001 if index % 2 else -0.0001))
        frame = eyes.camera.latest(at + 0.03)
        assert frame is not None
        shown.append(frame.seq)
    assert shown == list(range(12))


def test_an_eye_that_runs_ahead_is_not_paired_with_a_picture_shown_before(eyes: Eyes) -> None:
    eyes.show(1.00, 1.01)
    first = eyes.camera.latest(1.02)
    assert first is not None
    eyes.left.show(1.012)
    assert eyes.readers[0].wait_newer(1.011, DEADLINE)
    assert eyes.camera.latest(1.02) is first


def test_pictures_more_than_half_a_period_apart_are_no_pair_and_told(eyes: Eyes) -> None:
    eyes.show(1.0, 1.023)
    assert eyes.camera.latest(1.1) is None
    eyes.show(1.1, 1.119)
    assert eyes.camera.latest(1.2) is not None
    eyes.left.show(5.0)
    eyes.right.show(5.1)
    until(lambda: eyes.readers[0].recent()[-1].at == 5.0 and eyes.readers[1].recent()[-1].at == 5.1)
    assert eyes.kinds(5.2) == ["unpaired"]
    eyes.show(5.2, 5.2)
    assert eyes.kinds(5.25) == []


def test_faults_of_the_eyes_come_and_go(eyes: Eyes) -> None:
    assert eyes.kinds(0.45) == []
    assert eyes.kinds(0.46) == ["missing"]
    eyes.show(1.0, 1.0)
    assert eyes.kinds(1.45) == []
    eyes.left.show(1.6)
    assert eyes.readers[0].wait_newer(1.5, DEADLINE)
    assert eyes.kinds(1.61) == ["stale"]
    assert "right eye" in eyes.camera.faults(1.61)[0].evidence
    assert eyes.camera.faults(1.7)[0].since == 1.61
    eyes.right.absent = "no cable"
    eyes.right.script.put(DeviceError("unplugged"))
    until(lambda: eyes.readers[1].state.broken == "no cable")
    assert eyes.kinds(1.71) == ["link"]
    assert eyes.camera.faults(1.71)[0].evidence == "right eye: no cable"
    eyes.right.absent = ""
    eyes.show(2.0, 2.0)
    until(lambda: not eyes.readers[1].state.broken)
    assert eyes.kinds(2.0) == []
    assert eyes.camera.latest(2.0).captured_at == 2.0  # type: ignore[union-attr]


def test_a_picture_of_another_size_is_a_fault_and_never_shown(eyes: Eyes) -> None:
    eyes.show(1.0, 1.0)
    last = eyes.camera.latest(1.0)
    eyes.left.show(1.04)
    eyes.right.show(1.04, size=(32, 24))
    assert eyes.readers[1].wait_newer(1.0, DEADLINE)
    assert eyes.camera.latest(1.05) is last
    assert eyes.kinds(1.05) == ["size"]
    eyes.show(1.08, 1.08)
    assert eyes.kinds(1.1) == []


def test_a_video_that_is_over_is_missing(eyes: Eyes) -> None:
    eyes.show(1.0, 1.0)
    eyes.left.script.put(EndOfPicturesError("the video a.avi is over"))
    until(lambda: eyes.readers[0].state.ended)
    assert eyes.kinds(1.1) == ["missing"]
    assert "a.avi is over" in eyes.camera.faults(1.1)[0].evidence


def test_closed_eyes_are_quiet(eyes: Eyes) -> None:
    eyes.show(1.0, 1.0)
    last = eyes.camera.latest(1.0)
    eyes.camera.close()
    eyes.camera.close()
    assert eyes.camera.latest(9.0) is last
    assert eyes.camera.faults(9.0) == ()
    assert eyes.left.closed == eyes.right.closed == 1


def test_one_wide_picture_is_split(running) -> None:  # type: ignore[no-untyped-def]
    source = ScriptedSource()
    reader = running(source)
    camera = SideBySideCamera(reader, SteppedClock(), size=(64, 48))
    assert isinstance(camera, StereoCamera)
    wide = np.concatenate([picture(10), picture(20)], axis=1)
    source.script.put(TimedImage(wide, 1.0))
    assert camera.wait_newer(DEADLINE)
    frame = camera.latest(1.1)
    assert frame is not None
    assert frame.left.shape == frame.right.shape == (48, 64, 3)
    assert (int(frame.left.max()), int(frame.right.min())) == (10, 20)
    assert frame.left.flags.c_contiguous
    assert frame.right.flags.c_contiguous
    assert camera.latest(1.2) is frame
    assert camera.faults(1.2) == ()
    assert [fault.kind for fault in camera.faults(1.51)] == ["stale"]
    source.show(1.6, size=(64, 48))
    assert reader.wait_newer(1.0, DEADLINE)
    assert camera.latest(1.7) is frame
    assert [fault.kind for fault in camera.faults(1.7)] == ["size"]
    assert "64 x 48, not 128 x 48" in camera.faults(1.7)[0].evidence
    camera.close()
    assert camera.latest(2.0) is frame
