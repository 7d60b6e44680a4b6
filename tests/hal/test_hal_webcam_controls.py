"""Camera controls by ioctl and over HTTP, and both eyes under the same exposure."""

from __future__ import annotations

import errno
import json
import logging
import os
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from webcam_far_end import FakeStreamer, control

from robot.hal.interfaces import DeviceError
from robot.hal.webcam.alike import Look, LookKeeper, automatic, lock, settled
from robot.hal.webcam.controls import ControlInfo
from robot.hal.webcam.controls_http import HttpControls, parse_list
from robot.hal.webcam.controls_v4l2 import V4l2Controls

QUERYCTRL, G_CTRL, S_CTRL = 0xC0445624, 0xC008561B, 0xC008561C  # <linux/videodev2.h>
AUTO_WB, AUTOGAIN, GAIN, POWER_LINE, WB = 0x0098090C, 0x00980912, 0x00980913, 0x00980918, 0x0098091A
EXPOSURE_AUTO, EXPOSURE, PRIORITY = 0x009A0901, 0x009A0902, 0x009A0903
FOCUS, FOCUS_AUTO = 0x009A090A, 0x009A090C


class FakeCamera:
    """A UVC camera's controls behind ioctls. What an automatic governs cannot be set, as with the kernel."""

    def __init__(self, without: tuple[int, ...] = (), flags: int = 0) -> None:
        self.controls = {  # id: [value, minimum, maximum, step]
            AUTO_WB: [1, 0, 1, 1],
            GAIN: [20, 0, 255, 1],
            POWER_LINE: [1, 0, 2, 1],
            WB: [4600, 2800, 6500, 10],
            EXPOSURE_AUTO: [3, 0, 3, 1],
            EXPOSURE: [157, 3, 2047, 1],
            PRIORITY: [1, 0, 1, 1],
            FOCUS: [30, 0, 250, 5],
            FOCUS_AUTO: [1, 0, 1, 1],
        }
        for number in without:
            del self.controls[number]
        self.flags = flags
        self.error = 0
        self.set: list[tuple[int, int]] = []
        self.reads = 0
        self.opened = self.closed = 0

    def ioctl(self, request: int, argument: bytearray) -> None:
        if self.error:
            raise OSError(self.error, os.strerror(self.error))
        number = struct.unpack_from("<I", argument)[0]
        if number not in self.controls:
            raise OSError(errno.EINVAL, "Invalid argument")
        value, low, high, step = self.controls[number]
        if request == QUERYCTRL:
            assert len(argument) == 68
            struct.pack_into("<II32s5i", argument, 0, number, 1, b"Name", low, high, step, low, self.flags)
        elif request == G_CTRL:
            assert len(argument) == 8
            self.reads += 1
            struct.pack_into("<Ii", argument, 0, number, value)
        elif request == S_CTRL:
            self._store(number, struct.unpack("<Ii", argument)[1])
        else:
            raise AssertionError(hex(request))

    def wait_for_picture(self, timeout: float) -> bool:
        return False

    def close(self) -> None:
        self.closed += 1

    def open(self) -> V4l2Controls:
        def node(path: str) -> FakeCamera:
            self.opened += 1
            return self

        return V4l2Controls("/dev/video0", node)

    def value(self, number: int) -> int:
        return self.controls[number][0]

    def _store(self, number: int, value: int) -> None:
        entry = self.controls[number]
        if not entry[1] <= value <= entry[2]:
            raise OSError(errno.ERANGE, "out of range")
        governed = {EXPOSURE: (EXPOSURE_AUTO, 3), WB: (AUTO_WB, 1), FOCUS: (FOCUS_AUTO, 1)}
        if number in governed:
            automatic, on = governed[number]
            if automatic in self.controls and self.value(automatic) == on:
                raise OSError(errno.EACCES, "Permission denied")
        if number == EXPOSURE_AUTO and value not in (1, 3):
            raise OSError(errno.EINVAL, "Invalid argument")
        entry[0] = value
        self.set.append((number, value))


# ----------------------------------------------------------------------------------------------- ioctls


def test_controls_are_described_read_and_set() -> None:
    camera = FakeCamera()
    controls = camera.open()
    assert controls.info(WB) == ControlInfo("Name", 2800, 6500, 10, 2800)
    assert controls.info(0x123) is None
    assert controls.read(WB, GAIN) == {WB: 4600, GAIN: 20}
    controls.write(GAIN, -0)
    assert camera.set == [(GAIN, 0)]
    controls.close()
    assert camera.closed == 1


def test_a_disabled_control_is_none() -> None:
    assert FakeCamera(flags=0x0001).open().info(WB) is None
    assert FakeCamera(flags=0x0010).open().info(WB) is not None  # only governed by an automatic now


@pytest.mark.parametrize(
    ("number", "words"),
    [(errno.ENODEV, "check its cable"), (errno.EACCES, "group video"), (errno.EIO, "error")],
)
def test_errors_are_device_errors_with_the_cure(number: int, words: str) -> None:
    camera = FakeCamera()
    controls = camera.open()
    camera.error = number
    for call in (lambda: controls.info(WB), lambda: controls.read(WB), lambda: controls.write(WB, 1)):
        with pytest.raises(DeviceError, match=words):
            call()


@settings(deadline=None, max_examples=100)
@given(st.floats(-1e9, 1e9), st.integers(-1000, 0), st.integers(0, 1000), st.integers(0, 400))
def test_a_fitted_value_is_one_the_control_takes(value, low, high, step) -> None:  # type: ignore[no-untyped-def]
    fitted = ControlInfo("x", low, high, step).fitted(value)
    assert low <= fitted <= high
    assert (fitted - low) % max(1, step) == 0
    if low <= value <= high - max(1, step):
        assert abs(fitted - value) <= max(1, step) / 2


# ------------------------------------------------------------------------------------------------- http


@pytest.fixture
def server():  # type: ignore[no-untyped-def]
    streamer = FakeStreamer([control(WB, "WB", 2800, 6500, 10, 4600), control(GAIN, "Gain", 0, 255, 1, 20)])
    yield streamer
    streamer.down()


def test_http_controls_speak_as_mjpg_streamer_listens(server: FakeStreamer) -> None:
    controls = HttpControls(server.url, timeout=2.0)
    assert controls.info(WB) == ControlInfo("WB", 2800, 6500, 10, 0)
    assert controls.info(EXPOSURE) is None
    assert server.requests == ["/input_0.json"]
    assert controls.read(WB, GAIN) == {WB: 4600, GAIN: 20}
    assert server.requests == ["/input_0.json"] * 2  # both values out of one list
    controls.write(WB, 5000)
    assert server.requests[-1] == "/?action=command&dest=0&plugin=0&id=9963802&group=1&value=5000"
    assert controls.read(WB) == {WB: 5000}
    with pytest.raises(DeviceError, match="no control"):
        controls.read(EXPOSURE)


def test_http_controls_that_go_away_or_never_were(server: FakeStreamer) -> None:
    controls = HttpControls(server.url, timeout=0.3)
    server.mute = True
    with pytest.raises(DeviceError, match="does not answer"):
        controls.read(WB)
    server.down()
    with pytest.raises(DeviceError, match="cannot be reached"):
        controls.write(WB, 5000)
    phone = FakeStreamer()
    with pytest.raises(DeviceError, match="404"):
        HttpControls(phone.url)
    phone.down()


@pytest.mark.parametrize(
    "document", [b"", b"[]", b"{}", b'{"controls": 5}', b'{"controls": null}', b"\xff", b"[" * 100000]
)
def test_what_is_no_list_of_controls_is_refused(document: bytes) -> None:
    with pytest.raises(DeviceError, match="no list of controls"):
        parse_list(document, "x")


def test_unusable_entries_are_left_out() -> None:
    good = control(GAIN, "Gain", 0, 255)
    spoilt = [
        dict(good, id="x"),
        {},
        5,
        None,
        dict(good, min=None),
        dict(good, value=[1]),
        dict(good, group="a"),
    ]
    document = json.dumps({"controls": [*spoilt, good]}).encode()
    assert list(parse_list(document, "x")) == [GAIN]
    infinite = b'{"controls": [{"id": 1e999, "min": 0, "max": 1, "step": 1, "default": 0, "value": 0}]}'
    assert parse_list(infinite, "x") == {}


# -------------------------------------------------------------------------------------------- both alike


class Time:
    """Time that only passes by pausing."""

    now = 0.0

    def pause(self, seconds: float) -> None:
        self.now += seconds

    def monotonic(self) -> float:
        return self.now


def test_settling_waits_until_the_values_stand_still_but_not_for_ever() -> None:
    camera, time = FakeCamera(), Time()

    def drift(seconds: float) -> None:
        time.pause(seconds)
        if time.now < 0.5:
            camera.controls[EXPOSURE][0] += 10

    look = settled(camera.open(), still=0.4, most=2.0, pause=drift, monotonic=time.monotonic)
    assert look == Look(camera.value(EXPOSURE), 4600, 20, 1, 30)
    assert 0.8 <= time.now <= 1.0

    def never(seconds: float) -> None:
        time.pause(seconds)
        camera.controls[EXPOSURE][0] += 1

    time.now = 0.0
    settled(camera.open(), still=0.4, most=2.0, pause=never, monotonic=time.monotonic)
    assert 2.0 <= time.now <= 2.2


def test_automatic_is_on_at_a_steady_rate() -> None:
    camera = FakeCamera()
    camera.controls[EXPOSURE_AUTO][0], camera.controls[AUTO_WB][0] = 1, 0
    automatic(camera.open())
    assert [camera.value(c) for c in (EXPOSURE_AUTO, AUTO_WB, PRIORITY)] == [3, 1, 0]


def test_locking_sets_every_value_after_its_automatic_is_off() -> None:
    camera = FakeCamera()
    assert lock(camera.open(), Look(333, 5003, 40, 2, 62)) == ()
    values = {c: camera.value(c) for c in camera.controls}
    assert values == {
        AUTO_WB: 0,
        GAIN: 40,
        POWER_LINE: 2,
        WB: 5000,
        EXPOSURE_AUTO: 1,
        EXPOSURE: 333,
        PRIORITY: 0,
        FOCUS: 60,
        FOCUS_AUTO: 0,
    }


def test_what_is_not_wanted_is_left_alone() -> None:
    camera = FakeCamera()
    lock(camera.open(), Look(exposure_100us=100))
    assert [camera.value(c) for c in (AUTO_WB, WB, GAIN, POWER_LINE)] == [1, 4600, 20, 1]
    assert camera.value(EXPOSURE) == 100


def test_both_eyes_get_what_the_left_one_settled_on_also_after_a_replug() -> None:
    left, right = FakeCamera(), FakeCamera()
    left.controls[EXPOSURE][0], left.controls[WB][0], left.controls[GAIN][0] = 250, 5200, 33
    keeper = LookKeeper(Look(), settle=lambda controls: settled(controls, still=0.0))
    keeper.apply("right", right.open)  # before the look is found nothing is set
    assert right.set == []
    keeper.find(("left", left.open), [("right", right.open)])
    for camera in (left, right):
        assert [camera.value(c) for c in (EXPOSURE_AUTO, EXPOSURE, AUTO_WB, WB, GAIN)] == [
            1,
            250,
            0,
            5200,
            33,
        ]
        assert camera.opened == camera.closed
    fresh = FakeCamera()
    keeper.apply("right", fresh.open)
    assert [fresh.value(c) for c in (EXPOSURE, WB, GAIN)] == [250, 5200, 33]


def test_configured_values_win_and_nobody_waits_for_them() -> None:
    left, right = FakeCamera(), FakeCamera()

    def no_settling(controls):  # type: ignore[no-untyped-def]
        raise AssertionError("there is nothing to wait for")

    LookKeeper(Look(120, 4000), settle=no_settling).find(("left", left.open), [("right", right.open)])
    assert [camera.value(c) for camera in (left, right) for c in (EXPOSURE, WB)] == [120, 4000] * 2
    LookKeeper(Look(exposure_100us=90), settle=lambda c: settled(c, still=0.0)).find(("left", left.open), [])
    assert [left.value(c) for c in (EXPOSURE, WB)] == [90, 4000]


def test_what_a_camera_lacks_is_told_once(caplog: pytest.LogCaptureFixture) -> None:
    poor = FakeCamera(without=(EXPOSURE, EXPOSURE_AUTO, FOCUS, FOCUS_AUTO))

    def unreachable() -> V4l2Controls:
        raise DeviceError("no controls here")

    keeper = LookKeeper(Look(120, 4000))
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            keeper.find(("left", poor.open), [("right", unreachable)])
    assert [record.message for record in caplog.records] == [
        "camera left does not take: exposure",
        "the picture of right stays automatic: no controls here",
    ]
    assert poor.value(WB) == 4000


def test_a_camera_that_breaks_while_it_is_set_up_stops_nobody(caplog: pytest.LogCaptureFixture) -> None:
    camera = FakeCamera()
    camera.error = errno.EIO
    with caplog.at_level(logging.WARNING):
        LookKeeper(Look()).find(("left", camera.open), [])
    assert "could not be" in caplog.text
    assert camera.opened == camera.closed
