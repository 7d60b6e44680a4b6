"""What the cameras' contract cannot ask: rate, age, formats, a busy device, one eye gone, one eye silent."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator

import cv2
import pytest
import vivid
from rigs_kernel_camera import KernelCameraRig, open_eyes

from robot.clock import MonotonicClock
from robot.faults import TABLE
from robot.hal.interfaces import DeviceError
from robot.hal.webcam.opening import open_webcams

TICK_S = 0.04
BACK_WITHIN_S = 8.0


@pytest.fixture(autouse=True)
def _cameras_are_well() -> Iterator[None]:
    vivid.plug()
    yield
    vivid.plug()
    for node in vivid.nodes():
        vivid.set_control(node, "percentage_of_dropped_buffers", 0)


@pytest.fixture
def rig(_cameras_are_well: None) -> Iterator[KernelCameraRig]:
    """The open pair, with its first picture."""
    rig = KernelCameraRig()
    _until(rig, lambda: rig.device.latest(rig.now) is not None, 2.0)
    yield rig
    rig.device.close()


def test_opencv_alone_sees_two_cameras() -> None:
    for node in vivid.nodes():
        capture = cv2.VideoCapture(node, cv2.CAP_V4L2)
        good, image = capture.read()
        age = time.monotonic() - capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0
        capture.release()
        assert good
        assert image.std() > 10
        assert -0.03 < age < 0.3


def test_pairs_come_at_the_rate_and_young(rig, record_property) -> None:  # type: ignore[no-untyped-def]
    start, frames, ages = rig.now, {}, []
    while rig.now < start + 4.0:
        frame = rig.device.latest(rig.now)
        frames[frame.seq] = frame
        ages.append(rig.now - frame.captured_at)
        rig.wait(TICK_S / 2)
    rate = (len(frames) - 1) / (rig.now - start)
    shown = f"{rate:.1f}/s {1e3 * statistics.median(ages):.0f} {1e3 * max(ages):.0f}"
    record_property("pairs, median and greatest age, ms", shown)
    # Two free-running cameras half a period apart lose pairs whenever their jitter swaps neighbours.
    assert rate > 0.9 * vivid.RATE_HZ
    assert statistics.median(ages) < 0.08
    assert rig.device.faults(rig.now) == ()


def test_after_a_pause_the_next_picture_is_fresh(rig) -> None:  # type: ignore[no-untyped-def]
    rig.wait(1.5)
    frame = rig.device.latest(rig.now)
    assert rig.now - frame.captured_at < 0.12


def test_the_eyes_are_told_apart(rig) -> None:  # type: ignore[no-untyped-def]
    left, right = vivid.nodes()
    vivid.set_control(left, "test_pattern", _PATTERN_WHITE)
    vivid.set_control(right, "test_pattern", _PATTERN_BLACK)
    try:
        rig.wait(0.4)
        frame = rig.device.latest(rig.now)
        assert frame.left.mean() > 150 > 60 > frame.right.mean()
    finally:
        for node in (left, right):
            vivid.set_control(node, "test_pattern", 0)


def test_both_eyes_keep_one_gain(rig) -> None:  # type: ignore[no-untyped-def]
    assert [vivid.control(node, "gain_automatic") for node in vivid.nodes()] == [0, 0]
    left, right = (vivid.control(node, "gain") for node in vivid.nodes())
    assert left == right


def test_a_second_program_is_refused_and_the_first_goes_on(rig) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(DeviceError, match="another program uses it"):
        open_eyes(MonotonicClock())
    refused_at = rig.now
    rig.wait(0.5)
    assert rig.device.latest(rig.now).captured_at > refused_at + 0.3
    assert rig.device.faults(rig.now) == ()


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"pixel_format": "MJPG"}, "cameras.pixel_format"),
        ({"width": 500, "height": 300}, "cameras.width_px"),
        ({"left": "/dev/video77"}, "/dev/video77: it is not there"),
        ({"left": "/dev/null"}, "no camera"),
    ],
)
def test_what_does_not_fit_is_told_with_the_setting(changed, words) -> None:  # type: ignore[no-untyped-def]
    left, right = vivid.nodes()
    figures = {"width": vivid.WIDTH, "height": vivid.HEIGHT, "rate_hz": vivid.RATE_HZ}
    asked = {"left": left, "right": right, **figures, "pixel_format": vivid.PIXEL_FORMAT} | changed
    with pytest.raises(DeviceError, match=words):
        open_webcams(driver="v4l2", clock=MonotonicClock(), **asked)
    # What was opened is closed again.
    open_eyes(MonotonicClock()).close()


def test_unplugged_cameras_are_told_in_time_and_come_back(rig, record_property) -> None:  # type: ignore[no-untyped-def]
    gone_at = rig.now
    vivid.unplug()
    rig.wait(0.0)
    told = _until(rig, lambda: rig.device.faults(rig.now), 2.0) - gone_at
    # The right eye goes a moment after the left: its last picture may still come.
    rig.wait(0.2)
    last = rig.device.latest(rig.now)
    rig.wait(0.5)
    assert rig.device.latest(rig.now) is last
    assert {fault.device for fault in rig.device.faults(rig.now)} == {"camera"}
    vivid.plug()
    back_at = rig.now
    back = _until(rig, lambda: not rig.device.faults(rig.now), BACK_WITHIN_S) - back_at
    record_property("cameras unplugged: told after, back after, s", f"{told:.2f} {back:.2f}")
    assert told <= TABLE["camera.link"].detection_s
    assert rig.device.latest(rig.now).captured_at > back_at
    assert rig.device.latest(rig.now).seq > last.seq


def test_one_eye_gone_is_named(rig) -> None:  # type: ignore[no-untyped-def]
    right = vivid.nodes()[1]
    gone_at = rig.now
    vivid.set_control(right, "disconnect", 1)
    rig.wait(0.0)
    told = _until(rig, lambda: rig.device.faults(rig.now), 2.0) - gone_at
    assert told <= TABLE["camera.link"].detection_s
    assert "right eye" in rig.device.faults(rig.now)[0].evidence
    assert "left eye" not in rig.device.faults(rig.now)[0].evidence
    # The node is back as soon as its last user has let go.
    _until(rig, lambda: not rig.device.faults(rig.now), BACK_WITHIN_S)


def test_an_eye_that_delivers_nothing_is_told_in_time(rig) -> None:  # type: ignore[no-untyped-def]
    left = vivid.nodes()[0]
    vivid.set_control(left, "percentage_of_dropped_buffers", 100)
    silent_at = rig.now
    told = _until(rig, lambda: rig.device.faults(rig.now), 2.0) - silent_at
    assert told <= TABLE["camera.stale"].detection_s + 3 * TICK_S
    assert "left eye" in rig.device.faults(rig.now)[0].evidence
    vivid.set_control(left, "percentage_of_dropped_buffers", 0)
    _until(rig, lambda: not rig.device.faults(rig.now), BACK_WITHIN_S)


def test_closing_gives_the_devices_back(rig) -> None:  # type: ignore[no-untyped-def]
    rig.device.close()
    eyes = open_eyes(MonotonicClock())
    eyes.close()


def _until(rig: KernelCameraRig, holds: Callable[[], object], within: float) -> float:
    """Let time pass until it holds; returns when that was."""
    end = rig.now + within
    while not holds():
        assert rig.now < end
        rig.wait(TICK_S / 2)
    return rig.now


_PATTERN_BLACK = 5
_PATTERN_WHITE = 6
