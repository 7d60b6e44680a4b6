"""A V4L2 camera before a fake device: formats, capture times, errors with their cures."""

from __future__ import annotations

import errno
import os
import struct

import cv2
import numpy as np
import pytest
from webcam_far_end import picture

from robot.clock import SteppedClock
from robot.hal.interfaces import DeviceError
from robot.hal.webcam.node import DeviceNode, check_capture
from robot.hal.webcam.v4l2 import Format, V4l2Source, check_format, fourcc_text

QUERYCAP, REQBUFS = 0x80685600, 0xC0145608  # <linux/videodev2.h>
CAPTURE, META_CAPTURE, HAS_DEVICE_CAPS = 0x1, 0x00800000, 0x80000000
ASKED = Format(64, 48, 25.0, "MJPG")


class FakeNode:
    """A device node in memory: capabilities, errors by request, and whether a picture waits."""

    def __init__(self, capabilities: int = HAS_DEVICE_CAPS | CAPTURE, device_caps: int = CAPTURE) -> None:
        self.capabilities, self.device_caps = capabilities, device_caps
        self.errors: dict[int, int] = {}
        self.waiting: list[bool | int] = []
        self.timeouts: list[float] = []
        self.closed = 0

    def ioctl(self, request: int, argument: bytearray) -> None:
        if request in self.errors:
            raise OSError(self.errors[request], os.strerror(self.errors[request]))
        assert len(argument) == (request >> 16) & 0x3FFF  # the kernel would write past its end
        if request == QUERYCAP:
            struct.pack_into("<II", argument, 84, self.capabilities, self.device_caps)
        elif request == REQBUFS:
            assert struct.unpack("<5I", argument) == (0, 1, 1, 0, 0)
        else:
            raise OSError(errno.ENOTTY, "unknown")

    def wait_for_picture(self, timeout: float) -> bool:
        self.timeouts.append(timeout)
        answer = self.waiting.pop(0) if self.waiting else True
        if answer is not True and answer is not False:
            raise OSError(answer, os.strerror(answer))
        return answer

    def close(self) -> None:
        self.closed += 1


class FakeCapture:
    """cv2.VideoCapture as V4L2 shows it: it may give another format than it was asked for."""

    def __init__(self, given: Format | None = None) -> None:
        self.given = given
        self.opened = True
        self.asked: list[tuple[int, float]] = []
        self.pictures: list[object] = []
        self.stamp = 0.0
        self.grabs: list[bool] = []
        self.released = 0
        self.grabbed = 0

    def isOpened(self) -> bool:
        return self.opened

    def set(self, propId: int, value: float) -> bool:
        self.asked.append((propId, value))
        return True

    def get(self, propId: int) -> float:
        if propId == cv2.CAP_PROP_POS_MSEC:
            return self.stamp * 1000
        given = self.given or ASKED
        return {
            cv2.CAP_PROP_FRAME_WIDTH: given.width,
            cv2.CAP_PROP_FRAME_HEIGHT: given.height,
            cv2.CAP_PROP_FPS: given.rate_hz,
            cv2.CAP_PROP_FOURCC: float(sum(ord(c) << 8 * i for i, c in enumerate(given.pixel_format))),
        }[propId]

    def grab(self) -> bool:
        self.grabbed += 1
        return self.grabs.pop(0) if self.grabs else True

    def retrieve(self) -> tuple[bool, object]:
        image = self.pictures.pop(0) if self.pictures else picture(9)
        if isinstance(image, Exception):
            raise image
        return image is not None, image

    def release(self) -> None:
        self.released += 1


class Bench:
    """A source with everything about it in hand; the run's clock stands at 10 s, the machine's at 500 s."""

    def __init__(self, path: str = "/dev/null", given: Format | None = None) -> None:
        self.node, self.capture = FakeNode(), FakeCapture(given)
        self.monotonic = 500.0
        self.capture.stamp = 499.97
        clock = SteppedClock(10.0)
        clock.step()
        self.source = V4l2Source(
            path,
            ASKED,
            clock,
            open_capture=lambda path: self.capture,
            open_node=lambda path: self.node,
            monotonic=lambda: self.monotonic,
        )


def test_format_is_asked_for_first_and_pictures_have_the_drivers_time() -> None:
    bench = Bench()
    bench.source.open()
    assert bench.capture.asked == [
        (cv2.CAP_PROP_FOURCC, float(0x47504A4D)),
        (cv2.CAP_PROP_FRAME_WIDTH, 64),
        (cv2.CAP_PROP_FRAME_HEIGHT, 48),
        (cv2.CAP_PROP_FPS, 25.0),
    ]
    first = bench.source.grab(0.1)
    assert first is not None
    assert first.at == pytest.approx(9.97)
    assert first.image.shape == (48, 64, 3)
    bench.capture.stamp = 499.99
    second = bench.source.grab(0.1)
    assert second is not None
    assert second.at == pytest.approx(9.99)
    assert bench.node.timeouts == [0.1]
    assert bench.capture.grabbed == 2


@pytest.mark.parametrize("stamp", [0.0, -1.0, 1.7e9, 400.0, 500.2])
def test_a_stamp_of_another_clock_is_not_believed(stamp: float) -> None:
    bench = Bench()
    bench.capture.stamp = stamp
    bench.source.open()
    first = bench.source.grab(0.1)
    assert first is not None
    assert first.at == pytest.approx(10.0)


def test_it_never_grabs_without_a_picture_waiting() -> None:
    bench = Bench()
    bench.source.open()
    bench.source.grab(0.1)
    bench.node.waiting = [False]
    assert bench.source.grab(0.1) is None
    assert bench.capture.grabbed == 1
    bench.monotonic += 2.1
    bench.node.waiting = [False]
    with pytest.raises(DeviceError, match="delivers nothing for 2 s"):
        bench.source.grab(0.1)


@pytest.mark.parametrize(
    ("path", "words"), [("/nowhere/video0", "was unplugged"), ("/dev/null", "stopped delivering")]
)
@pytest.mark.parametrize("how", ["poll", "grab", "retrieve"])
def test_a_camera_that_goes_is_told(path: str, words: str, how: str) -> None:
    bench = Bench(path)
    bench.source.open()
    bench.source.grab(0.1)
    if how == "poll":
        bench.node.waiting = [errno.ENODEV]
    elif how == "grab":
        bench.capture.grabs = [False]
    else:
        bench.capture.pictures = [cv2.error("mistake")]
    with pytest.raises(DeviceError, match=words):
        bench.source.grab(0.1)
    bench.source.close()
    bench.source.close()
    assert bench.capture.released == bench.node.closed == 1
    with pytest.raises(DeviceError, match="is closed"):
        bench.source.grab(0.1)


def test_a_broken_picture_is_passed_over_ten_in_a_row_are_a_broken_camera() -> None:
    bench = Bench()
    bench.source.open()
    bench.source.grab(0.1)
    bench.capture.pictures = [None] * 9 + [picture(1)] + [None] * 10
    assert [bench.source.grab(0.1) is None for _ in range(19)] == [True] * 9 + [False] + [True] * 9
    with pytest.raises(DeviceError, match="10 broken pictures in a row"):
        bench.source.grab(0.1)


def test_a_full_usb_bus_is_told_with_its_cure_and_everything_released() -> None:
    bench = Bench()
    bench.capture.grabs = [False]
    with pytest.raises(DeviceError, match=r"starts no stream: the USB bus has no room .*'MJPG'"):
        bench.source.open()
    assert bench.capture.released == bench.node.closed == 1


def test_a_camera_whose_first_pictures_are_broken_gets_time() -> None:
    bench = Bench()
    bench.capture.pictures = [None, None, picture(3)]
    bench.source.open()
    first = bench.source.grab(0.1)
    assert first is not None
    assert int(first.image[0, 0, 0]) == 3
    bench.capture.pictures = [None]
    bench.node.waiting = [False]
    with pytest.raises(DeviceError, match="gives no picture"):
        bench.source.open()


def test_not_opened_and_wrongly_set_up_cameras_are_refused() -> None:
    bench = Bench()
    bench.capture.opened = False
    with pytest.raises(DeviceError, match="cannot be opened"):
        bench.source.open()
    bench = Bench(given=Format(32, 48, 25.0, "MJPG"))
    with pytest.raises(DeviceError, match="32 x 48"):
        bench.source.open()
    assert bench.capture.released == bench.node.closed == 1
    assert bench.capture.grabbed == 0


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (Format(64, 48, 25.0, "YUYV"), r"gives YUYV, not MJPG: set cameras.pixel_format"),
        (Format(32, 24, 25.0), r"32 x 24 pixels, not 64 x 48: mend cameras.width_px and cameras.height_px"),
        (Format(64, 48, 15.0), r"15.0 pictures a second, not 25: lower cameras.rate_hz"),
    ],
)
def test_another_format_is_refused_with_the_setting_that_fits(given: Format, words: str) -> None:
    with pytest.raises(DeviceError, match=words):
        check_format(given, ASKED, "/dev/video0")


def test_unknown_figures_and_a_quicker_camera_pass() -> None:
    check_format(Format(-1, -1, -1.0, ""), ASKED, "x")
    check_format(Format(0, 0, 0.0, ""), ASKED, "x")
    check_format(Format(64, 48, 30.0), ASKED, "x")
    check_format(Format(64, 48, 20.0), ASKED, "x")
    assert [fourcc_text(code) for code in (-1.0, 0.0, float("nan"), 1.0, 0x56595559)] == [
        "",
        "",
        "",
        "",
        "YUYV",
    ]


# ------------------------------------------------------------------------------------------------- node


def test_what_is_no_camera_or_taken_is_refused() -> None:
    check_capture(FakeNode(), "x")
    check_capture(FakeNode(capabilities=CAPTURE, device_caps=0), "x")
    with pytest.raises(DeviceError, match=r"delivers no pictures: .* index0"):
        check_capture(FakeNode(capabilities=HAS_DEVICE_CAPS | CAPTURE, device_caps=META_CAPTURE), "x")
    for request, number, words in (
        (QUERYCAP, errno.ENOTTY, "is no camera"),
        (QUERYCAP, errno.ENODEV, "check its cable"),
        (REQBUFS, errno.EBUSY, "another program uses it"),
    ):
        node = FakeNode()
        node.errors = {request: number}
        with pytest.raises(DeviceError, match=words):
            check_capture(node, "x")
    odd = FakeNode()
    odd.errors = {REQBUFS: errno.EINVAL}  # a camera of another buffer kind: OpenCV shall try
    check_capture(odd, "x")


def test_a_real_file_that_is_no_camera_and_one_that_is_not_there() -> None:
    node = DeviceNode("/dev/null")
    with pytest.raises(DeviceError, match="/dev/null is no camera"):
        check_capture(node, "/dev/null")
    node.close()
    node.close()
    with pytest.raises(OSError, match="Bad file"):
        node.ioctl(QUERYCAP, bytearray(104))
    with pytest.raises(DeviceError, match="it is not there: check its cable"):
        DeviceNode("/dev/no-such-camera")


def test_waiting_is_bounded_and_a_hang_up_is_an_error(tmp_path) -> None:  # type: ignore[no-untyped-def]
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    node = DeviceNode(str(pipe))  # a fifo opened both ways: nobody else is needed
    assert not node.wait_for_picture(0.01)
    writer = os.open(pipe, os.O_WRONLY)
    os.write(writer, b"x")
    assert node.wait_for_picture(5.0)
    os.close(writer)
    node.close()
    master, slave = os.openpty()
    gone = DeviceNode(os.ttyname(slave))
    os.close(slave)
    os.close(master)
    with pytest.raises(OSError, match="No such device"):
        gone.wait_for_picture(1.0)
    gone.close()


def test_images_are_bytes() -> None:
    bench = Bench()
    bench.source.open()
    first = bench.source.grab(0.1)
    assert first is not None
    assert first.image.dtype == np.uint8
    assert first.size == (64, 48)
