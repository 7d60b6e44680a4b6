"""Opens the hardware the config names."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, TypeVar

from robot.config import ArmSettings, Base, Cameras, Config, Head, LampSettings, TeleopSettings
from robot.errors import UserError
from robot.hal.folder import FolderCamera, pairs_in
from robot.hal.interfaces import (
    Arm,
    Device,
    DeviceError,
    DriveBase,
    LampDevice,
    PanTilt,
    StereoCamera,
    TeleopLink,
)
from robot.hal.kinematics import Limits, Wheels
from robot.hal.links import Link
from robot.hal.mock import MockArm, MockBase, MockCamera, MockHead, MockLamp, MockTeleop
from robot.hal.mock.camera import wall_pair
from robot.hal.mock.head import HeadLimits
from robot.hal.nxt.base import NxtBase
from robot.hal.nxt.brick import Brick
from robot.hal.nxt.lcp import Port
from robot.hal.nxt.settings import BLUETOOTH, USB, NxtSettings
from robot.hal.unplugged import FixedHead, NoBase, NoLamp
from robot.messages import HeadPose

D = TypeVar("D", bound=Device | None)

# A reply over USB takes a few milliseconds, over Bluetooth some 60 and at times twice that.
_USB_REPLY_TIMEOUT_S: Final = 0.05
_BLUETOOTH_REPLY_TIMEOUT_S: Final = 0.15


@dataclass(frozen=True, slots=True)
class Hardware:
    """Every device of the robot, open. arm and teleop are None if the robot has none."""

    camera: StereoCamera
    head: PanTilt
    lamp: LampDevice
    base: DriveBase
    arm: Arm | None = None
    teleop: TeleopLink | None = None

    @property
    def devices(self) -> tuple[Device, ...]:
        """All that are there, what moves first: the order to close them in."""
        every = (self.base, self.arm, self.head, self.lamp, self.camera, self.teleop)
        return tuple(device for device in every if device is not None)

    def close(self) -> None:
        """Leave every device safe, also if one of them fails to close. May be called twice."""
        with ExitStack() as stack:
            for device in reversed(self.devices):
                stack.callback(device.close)


def open_hardware(config: Config) -> Hardware:
    """Open what the config names.

    Raises UserError in one line (config key, what was looked for, the cure) if a device is not there; those
    opened before are closed again.

    >>> hardware = open_hardware(Config())
    >>> type(hardware.base).__name__, hardware.arm
    ('MockBase', None)
    >>> hardware.close()
    """
    with ExitStack() as opened:

        def opening(key: str, open_device: Callable[[], D]) -> D:
            try:
                device = open_device()
            except DeviceError as error:
                raise UserError(f"config key {key}: {error}") from error
            if device is not None:
                opened.callback(device.close)
            return device

        hardware = Hardware(
            camera=opening("cameras", lambda: open_camera(config.cameras)),
            head=opening("head", lambda: open_head(config.head)),
            lamp=opening("lamp", lambda: open_lamp(config.lamp)),
            base=opening("base", lambda: open_base(config.base)),
            arm=opening("arm", lambda: open_arm(config.arm)),
            teleop=opening("teleop", lambda: open_teleop(config.teleop)),
        )
        opened.pop_all()
        return hardware


def open_camera(settings: Cameras) -> StereoCamera:
    """The eyes. Raises DeviceError."""
    size = (settings.width_px, settings.height_px)
    if settings.driver == "mock":
        return MockCamera([wall_pair(*size)], settings.rate_hz)
    if settings.driver == "folder":
        if not settings.left:
            raise DeviceError("cameras.left is empty: name the folder of the left eye's pictures")
        right = Path(settings.right) if settings.right else None
        return FolderCamera(pairs_in(Path(settings.left), right), settings.rate_hz, size)
    raise _unknown("cameras", settings.driver, "mock or folder")


def open_head(settings: Head) -> PanTilt:
    """The head; without one the eyes are fixed at the rest tilt. Raises DeviceError."""
    if settings.driver == "mock":
        return MockHead(
            HeadLimits(
                pan=math.radians(settings.pan_limit_deg),
                tilt_up=math.radians(settings.tilt_up_limit_deg),
                tilt_down=math.radians(settings.tilt_down_limit_deg),
            )
        )
    if settings.driver == "none":
        return FixedHead(HeadPose(tilt=math.radians(settings.rest_tilt_deg)))
    raise _unknown("head", settings.driver, "mock or none")


def open_lamp(settings: LampSettings) -> LampDevice:
    """The lamp. Raises DeviceError."""
    if settings.driver == "mock":
        return MockLamp()
    if settings.driver == "none":
        return NoLamp()
    raise _unknown("lamp", settings.driver, "mock or none")


def open_base(settings: Base) -> DriveBase:
    """The drive base. Raises DeviceError."""
    if settings.driver == "mock":
        figures = nxt_settings(settings, USB)
        limits = Limits(figures.speed_limit, figures.turn_limit)
        return MockBase(limits, figures.wheels, settings.pulse_s)
    if settings.driver == "none":
        return NoBase()
    if settings.left_motor == settings.right_motor:
        raise DeviceError(f"left_motor and right_motor are both {settings.left_motor}: name two brick ports")
    if settings.driver == "nxt-usb":
        brick = Brick(_usb_link(settings.brick), _USB_REPLY_TIMEOUT_S)
        return NxtBase(brick, nxt_settings(settings, USB))
    if settings.driver == "nxt-serial":
        brick = Brick(_serial_link(settings.port), _BLUETOOTH_REPLY_TIMEOUT_S)
        return NxtBase(brick, nxt_settings(settings, BLUETOOTH))
    raise _unknown("base", settings.driver, "mock, nxt-usb, nxt-serial or none")


def nxt_settings(settings: Base, transport: NxtSettings) -> NxtSettings:
    """The config's figures on top of those of the transport (robot.hal.nxt.base.USB or BLUETOOTH)."""
    return replace(
        transport,
        wheels=Wheels(settings.wheel_radius_m, settings.track_width_m),
        wheel=replace(
            transport.wheel, pulse_s=settings.pulse_s, forward=-1 if settings.motors_reversed else 1
        ),
        speed_limit=settings.max_speed_m_s,
        turn_limit=math.radians(settings.max_turn_deg_s),
        left_port=Port[settings.left_motor],
        right_port=Port[settings.right_motor],
    )


def open_arm(settings: ArmSettings) -> Arm | None:
    """The arm, None if there is none. Raises DeviceError."""
    if settings.driver == "mock":
        return MockArm()
    if settings.driver == "none":
        return None
    raise _unknown("arm", settings.driver, "mock or none")


def open_teleop(settings: TeleopSettings) -> TeleopLink | None:
    """The person's link, None if there is none. Raises DeviceError."""
    if settings.driver == "mock":
        return MockTeleop()
    if settings.driver == "none":
        return None
    raise _unknown("teleop", settings.driver, "mock or none")


def _usb_link(serial: str) -> Link:
    from robot.hal.nxt.usb import UsbLink, find_brick

    return UsbLink(lambda: find_brick(serial))


def _serial_link(path: str) -> Link:
    from robot.hal.nxt.serial import SerialLink, open_serial_port

    if not path:
        raise DeviceError("base.port is empty: name the serial port, e.g. /dev/rfcomm0")
    return SerialLink(lambda: open_serial_port(path))


def _unknown(key: str, driver: str, there: str) -> DeviceError:
    return DeviceError(f"{key}.driver = {driver!r} is not there in this version: set it to {there}")
