"""The brick on a USB cable: one telegram a bulk transfer."""

from __future__ import annotations

import errno
from collections.abc import Callable
from typing import Any, Final

from robot.hal.interfaces import DeviceError

VENDOR_ID: Final = 0x0694
PRODUCT_ID: Final = 0x0002
_PACKET_BYTES: Final = 64
_WRITE_TIMEOUT_MS: Final = 100


class UsbLink:
    """`Link` over pyusb. `find` returns the device (a usb.core.Device) or raises DeviceError.

    A broken link is let go; the next `write` looks for the brick again: a cable may be pulled and put back.
    """

    def __init__(self, find: Callable[[], Any]) -> None:
        self._find = find
        self._device: Any = None
        self._out: int = 0
        self._in: int = 0
        self._closed = False
        self._open()

    def write(self, telegram: bytes) -> None:
        """Send one telegram. Raises DeviceError if the brick is gone or does not take it within 0.1 s."""
        if self._closed:
            raise DeviceError("the USB link is closed")
        if self._device is None:
            self._open()
        try:
            self._device.write(self._out, telegram, _WRITE_TIMEOUT_MS)
        except OSError as error:
            self._let_go()
            raise DeviceError(f"the brick's USB link broke: {_words(error)}") from error

    def read(self, timeout: float) -> bytes | None:
        """Return the next telegram or None. Raises DeviceError if the brick is gone."""
        if self._device is None:
            raise DeviceError("the brick's USB link is down: check the cable")
        try:
            # libusb takes 0 for 'wait for ever'.
            return bytes(self._device.read(self._in, _PACKET_BYTES, max(1, round(timeout * 1000))))
        except OSError as error:
            if error.errno == errno.ETIMEDOUT:
                return None
            self._let_go()
            raise DeviceError(f"the brick's USB link broke: {_words(error)}") from error

    def close(self) -> None:
        """Release the brick. May be called twice."""
        self._closed = True
        self._let_go()

    def _open(self) -> None:
        device = self._find()
        try:
            device.set_configuration()
            interface = device.get_active_configuration()[(0, 0)]
            self._in, self._out = _endpoints(interface)
        except OSError as error:
            raise DeviceError(f"the brick on USB cannot be opened: {_words(error)}") from error
        self._device = device

    def _let_go(self) -> None:
        device, self._device = self._device, None
        if device is None:
            return
        import usb.util

        usb.util.dispose_resources(device)


def find_brick(serial: str = "") -> Any:
    """Return the usb.core.Device of the brick with this USB serial number, or of the only one.

    Raises DeviceError if there is none, if several are there and none was named, if libusb is missing.
    """
    import usb.core

    try:
        found = list(usb.core.find(find_all=True, idVendor=VENDOR_ID, idProduct=PRODUCT_ID))
    except usb.core.NoBackendError as error:
        raise DeviceError("USB needs the library libusb-1.0: install the package libusb-1.0-0") from error
    return chosen(found, serial)


def chosen(found: list[Any], serial: str) -> Any:
    """Pick the device with the serial number out of those found; the only one if serial is empty."""
    if not found:
        raise DeviceError("no NXT brick (USB 0694:0002) is there: switch it on, check the cable")
    if serial:
        for device in found:
            if _serial_of(device) == serial:
                return device
        there = ", ".join(_serial_of(device) or "(not readable)" for device in found)
        raise DeviceError(f"no brick has the serial number {serial}; there: {there}")
    if len(found) > 1:
        there = ", ".join(_serial_of(device) or "(not readable)" for device in found)
        raise DeviceError(f"{len(found)} bricks are there, name one by its serial number: {there}")
    return found[0]


def _serial_of(device: Any) -> str:
    try:
        return str(device.serial_number or "")
    except (OSError, ValueError):  # pyusb: no permission, no language ids
        return ""


def _endpoints(interface: Any) -> tuple[int, int]:
    """(in, out) addresses, found by direction: their numbers differ between host stacks."""
    addresses = [int(endpoint.bEndpointAddress) for endpoint in interface]
    inward = [a for a in addresses if a & 0x80]
    outward = [a for a in addresses if not a & 0x80]
    if not inward or not outward:
        raise DeviceError("the USB device has no endpoint pair: it is no NXT brick with firmware")
    return inward[0], outward[0]


def _words(error: OSError) -> str:
    if error.errno in (errno.EACCES, errno.EPERM):
        return "no permission: install the udev rule of deploy/ and replug the brick"
    if error.errno == errno.EBUSY:
        return "another program uses the brick: close it"
    if error.errno == errno.ENODEV:
        return "it was unplugged: check the cable"
    return str(error)
