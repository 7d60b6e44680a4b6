"""Links that several drivers share: one brick for base, sensors and pan; one controller for arm and lamp."""

from __future__ import annotations

import time
from typing import Final

from robot.config import Base, Config
from robot.hal.interfaces import DeviceError
from robot.hal.links import Link
from robot.hal.modbus import ModbusLink, open_modbus_link
from robot.hal.nxt.brick import Brick

# A reply over USB takes a few milliseconds, over Bluetooth some 60 and at times twice that.
_USB_REPLY_TIMEOUT_S: Final = 0.05
_SERIAL_REPLY_TIMEOUT_S: Final = 0.15
_FAST_LINK_S: Final = 0.015
_PROBES: Final = 5


class SharedLinks:
    """Opens each link once, however many drivers ask for it."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._brick: Brick | None = None
        self._fast = True
        self._modbus: dict[str, ModbusLink] = {}

    def brick(self) -> Brick:
        """The brick of `base`. Raises DeviceError."""
        if self._brick is None:
            brick = open_brick(self._config.base)
            self._fast = self._config.base.driver == "nxt-usb" or is_fast(brick)
            self._brick = brick
        return self._brick

    @property
    def fast(self) -> bool:
        """Whether the brick's link keeps a cable's rates; known once `brick` was called."""
        return self._fast

    def modbus(self, address: str) -> ModbusLink:
        """The link to a Modbus address. Raises DeviceError."""
        link = self._modbus.get(address)
        if link is not None and not link.closed:
            return link.share()
        self._modbus[address] = open_modbus_link(address, self._config.arm.baudrate)
        return self._modbus[address]


def open_brick(settings: Base) -> Brick:
    """The brick behind `base.driver`. Raises DeviceError with the cure."""
    if settings.driver == "nxt-usb":
        return Brick(_usb_link(settings.brick), _USB_REPLY_TIMEOUT_S, time.monotonic)
    if settings.driver == "nxt-serial":
        return Brick(_serial_link(settings.port), _SERIAL_REPLY_TIMEOUT_S, time.monotonic)
    raise DeviceError(f"it needs a brick, but base.driver is {settings.driver!r}: use nxt-usb or nxt-serial")


def is_fast(brick: Brick) -> bool:
    """Whether the link keeps the rates of a USB cable, measured by a few exchanges.

    Raises DeviceError, the link closed, if the brick does not answer.
    """
    try:
        for _ in range(_PROBES):
            brick.battery_mv()
    except OSError as error:
        brick.close()
        raise DeviceError(f"the brick does not answer: {error}") from error
    median_s = brick.times.median_s
    return median_s is not None and median_s < _FAST_LINK_S


def _usb_link(serial: str) -> Link:
    from robot.hal.nxt.usb import UsbLink, find_brick

    return UsbLink(lambda: find_brick(serial))


def _serial_link(path: str) -> Link:
    from robot.hal.nxt.serial import SerialLink, open_serial_port

    if not path:
        raise DeviceError("base.port is empty: name the serial port, e.g. /dev/rfcomm0")
    return SerialLink(lambda: open_serial_port(path))
