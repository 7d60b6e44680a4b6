"""The real links, before a pseudo-terminal and a device that looks like pyusb's."""

from __future__ import annotations

import errno
import os
import pty
import tty
from contextlib import suppress

import pytest
import usb.core

from robot.hal.interfaces import DeviceError
from robot.hal.nxt.serial import SerialLink, open_serial_port
from robot.hal.nxt.usb import UsbLink, chosen

# --------------------------------------------------------------------------------------------- serial


@pytest.fixture
def wire():  # type: ignore[no-untyped-def]
    """The brick's end of a serial line and the path of ours."""
    brick, ours = pty.openpty()
    tty.setraw(brick)
    tty.setraw(ours)
    yield brick, os.ttyname(ours)
    for end in (brick, ours):
        with suppress(OSError):
            os.close(end)


def link_to(path: str) -> SerialLink:
    return SerialLink(lambda: open_serial_port(path))


def test_serial_telegrams_carry_their_length(wire) -> None:  # type: ignore[no-untyped-def]
    brick, path = wire
    link = link_to(path)
    link.write(bytes.fromhex("000b"))
    assert os.read(brick, 64) == bytes.fromhex("0200 000b")
    os.write(brick, bytes.fromhex("0500 020b00401f 0300 020100"))
    assert link.read(0.2) == bytes.fromhex("020b00401f")
    assert link.read(0.2) == bytes.fromhex("020100")
    assert link.read(0.0) is None
    link.close()
    link.close()


def test_serial_keeps_half_a_telegram_for_the_next_read(wire) -> None:  # type: ignore[no-untyped-def]
    brick, path = wire
    link = link_to(path)
    for part in (b"\x05", b"\x00\x02\x0b"):
        os.write(brick, part)
        assert link.read(0.02) is None
    os.write(brick, b"\x00\x40\x1f")
    assert link.read(0.2) == bytes.fromhex("020b00401f")
    link.close()


@pytest.mark.parametrize("header", ["0000", "4100", "ffff"])
def test_serial_out_of_step_is_an_error_and_starts_afresh(wire, header: str) -> None:  # type: ignore[no-untyped-def]
    brick, path = wire
    link = link_to(path)
    os.write(brick, bytes.fromhex(header) + b"rubbish")
    with pytest.raises(DeviceError, match="out of step"):
        link.read(0.2)
    link.write(b"\x00\x0b")  # opens again
    os.write(brick, bytes.fromhex("0300 020100"))
    assert link.read(0.2) == bytes.fromhex("020100")
    link.close()


def test_serial_hang_up_is_an_error(wire) -> None:  # type: ignore[no-untyped-def]
    brick, path = wire
    link = link_to(path)
    os.close(brick)
    with pytest.raises(DeviceError):
        link.read(0.2)
    with pytest.raises(DeviceError, match="down"):
        link.read(0.2)


def test_serial_port_is_ours_alone(wire) -> None:  # type: ignore[no-untyped-def]
    _, path = wire
    link = link_to(path)
    with pytest.raises(DeviceError, match="lock"):
        link_to(path)
    link.close()


def test_missing_serial_port_names_port_and_cure() -> None:
    with pytest.raises(DeviceError, match=r"/dev/rfcomm-none.*rfcomm bind"):
        open_serial_port("/dev/rfcomm-none")


def test_closed_serial_link_stays_closed(wire) -> None:  # type: ignore[no-untyped-def]
    link = link_to(wire[1])
    link.close()
    with pytest.raises(DeviceError, match="closed"):
        link.write(b"\x00\x0b")


# ------------------------------------------------------------------------------------------------ USB


class Endpoint:
    def __init__(self, address: int) -> None:
        self.bEndpointAddress = address


class FakeBrick:
    """As much of usb.core.Device as the link uses; raises what pyusb raises."""

    def __init__(self, serial: str = "0016530A0B0C", addresses: tuple[int, ...] = (0x01, 0x82)) -> None:
        self.serial_number = serial
        self.addresses = addresses
        self.error: usb.core.USBError | None = None
        self.written: list[tuple[int, bytes, int]] = []
        self.replies: list[bytes] = []
        self.timeouts: list[int] = []
        self._ctx = self  # what usb.util.dispose_resources reaches for
        self.disposed = 0

    def dispose(self, device: object) -> None:
        self.disposed += 1

    def set_configuration(self) -> None:
        self._check()

    def get_active_configuration(self):  # type: ignore[no-untyped-def]
        return {(0, 0): [Endpoint(address) for address in self.addresses]}

    def write(self, endpoint: int, telegram: bytes, timeout: int) -> None:
        self._check()
        self.written.append((endpoint, telegram, timeout))

    def read(self, endpoint: int, size: int, timeout: int) -> bytes:
        self._check()
        self.timeouts.append(timeout)
        assert endpoint & 0x80
        assert size == 64
        if not self.replies:
            raise usb.core.USBTimeoutError("Operation timed out", errno=errno.ETIMEDOUT)
        return self.replies.pop(0)

    def _check(self) -> None:
        if self.error is not None:
            raise self.error


def test_usb_writes_out_and_reads_in_whatever_the_endpoints_are_called() -> None:
    brick = FakeBrick(addresses=(0x85, 0x03))
    link = UsbLink(lambda: brick)
    link.write(b"\x00\x0b")
    assert brick.written[0][:2] == (0x03, b"\x00\x0b")
    brick.replies.append(b"\x02\x0b\x00\x40\x1f")
    assert link.read(0.1) == b"\x02\x0b\x00\x40\x1f"
    assert link.read(0.05) is None
    assert brick.timeouts == [100, 50]


def test_usb_never_waits_for_ever() -> None:
    brick = FakeBrick()
    link = UsbLink(lambda: brick)
    assert link.read(0.0) is None
    assert brick.timeouts == [1]  # 0 would be for ever
    link.write(b"\x00\x0b")
    assert 0 < brick.written[0][2] <= 100


def test_usb_finds_the_brick_again_after_the_cable_was_pulled() -> None:
    bricks = [FakeBrick(), FakeBrick()]
    waiting = list(bricks)
    link = UsbLink(lambda: waiting.pop(0))
    bricks[0].error = usb.core.USBError("No such device", errno=errno.ENODEV)
    with pytest.raises(DeviceError, match="unplugged"):
        link.write(b"\x00\x0b")
    assert bricks[0].disposed == 1
    with pytest.raises(DeviceError, match="down"):
        link.read(0.1)
    link.write(b"\x00\x0b")
    assert len(bricks[1].written) == 1
    link.close()
    link.close()
    assert bricks[1].disposed == 1
    with pytest.raises(DeviceError, match="closed"):
        link.write(b"\x00\x0b")


@pytest.mark.parametrize(("number", "cure"), [(errno.EACCES, "udev rule"), (errno.EBUSY, "another program")])
def test_usb_errors_at_opening_name_the_cure(number: int, cure: str) -> None:
    brick = FakeBrick()
    brick.error = usb.core.USBError("no", errno=number)
    with pytest.raises(DeviceError, match=cure):
        UsbLink(lambda: brick)


def test_a_device_without_endpoints_is_no_brick() -> None:
    with pytest.raises(DeviceError, match="no endpoint pair"):
        UsbLink(lambda: FakeBrick(addresses=(0x82,)))


def test_which_brick_is_chosen() -> None:
    one, two = FakeBrick("AA"), FakeBrick("BB")
    assert chosen([one], "") is one
    assert chosen([one, two], "BB") is two
    with pytest.raises(DeviceError, match="no NXT brick"):
        chosen([], "")
    with pytest.raises(DeviceError, match=r"2 bricks.*AA, BB"):
        chosen([one, two], "")
    with pytest.raises(DeviceError, match="CC; there: AA, BB"):
        chosen([one, two], "CC")


class Bus:
    """A USB bus: what is plugged in, found as `find_brick` finds it; a device that left raises ENODEV."""

    def __init__(self, *bricks: FakeBrick) -> None:
        self.there = list(bricks)

    def find(self, serial: str) -> FakeBrick:
        return chosen(self.there, serial)

    def unplug(self, brick: FakeBrick) -> None:
        self.there.remove(brick)
        brick.error = usb.core.USBError("No such device (it may have been disconnected)", errno=errno.ENODEV)


def test_a_brick_that_returns_at_another_address_is_found_by_its_serial_number() -> None:
    ours, other = FakeBrick("AA"), FakeBrick("BB")
    bus = Bus(ours, other)
    link = UsbLink(lambda: bus.find("AA"))
    bus.unplug(ours)
    for _ in range(3):  # gone: told each time, never the other brick
        with pytest.raises(DeviceError):
            link.write(b"\x00\x0b")
    back = FakeBrick("AA", addresses=(0x02, 0x81))  # another device on another address of the bus
    bus.there.append(back)
    link.write(b"\x00\x0b")
    back.replies.append(b"\x02\x0b\x00\x40\x1f")
    assert link.read(0.1) == b"\x02\x0b\x00\x40\x1f"
    assert back.written[0][:2] == (0x02, b"\x00\x0b")
    assert other.written == []
    assert ours.disposed == 1


def test_a_brick_unplugged_between_question_and_answer_is_told_and_found_again() -> None:
    ours = FakeBrick("AA")
    bus = Bus(ours)
    link = UsbLink(lambda: bus.find(""))
    link.write(b"\x00\x0b")
    bus.unplug(ours)
    with pytest.raises(DeviceError, match="unplugged"):
        link.read(0.1)
    bus.there.append(FakeBrick("AA"))
    link.write(b"\x00\x0b")
    assert bus.there[0].written


def test_serial_half_a_telegram_from_before_is_thrown_away_at_opening(wire) -> None:  # type: ignore[no-untyped-def]
    brick, path = wire
    os.write(brick, b"\x05\x00\x02\x0b")
    link = link_to(path)
    os.write(brick, bytes.fromhex("0300 020100"))
    assert link.read(0.2) == bytes.fromhex("020100")
    link.close()
