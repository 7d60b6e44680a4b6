"""Opens the hardware the config names."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Literal, TypeVar, cast

from robot.clock import Clock, MonotonicClock
from robot.config import Base, Cameras, Config, Head, TeleopSettings
from robot.errors import UserError
from robot.hal.folder import FolderCamera, pairs_in
from robot.hal.hardware import Hardware, Reach
from robot.hal.head_limits import HeadLimits
from robot.hal.interfaces import (
    Arm,
    Device,
    DeviceError,
    DriveBase,
    LampDevice,
    NearSensors,
    PanTilt,
    StereoCamera,
    TeleopLink,
)
from robot.hal.kinematics import Limits, Wheels, limited
from robot.hal.mock import MockArm, MockBase, MockCamera, MockHead, MockLamp, MockTeleop
from robot.hal.mock.camera import wall_pair
from robot.hal.nxt.base import NxtBase
from robot.hal.nxt.lcp import Port
from robot.hal.nxt.settings import (
    BLUETOOTH,
    BLUETOOTH_NEAR,
    BLUETOOTH_PAN,
    USB,
    USB_NEAR,
    USB_PAN,
    NxtSettings,
)
from robot.hal.shared_links import SharedLinks
from robot.hal.unplugged import FixedHead, NoBase, NoLamp
from robot.messages import HeadPose, Twist

D = TypeVar("D", bound=Device | None)


def open_hardware(config: Config, clock: Clock | None = None) -> Hardware:
    """Open what the config names. clock: the run's, for drivers with threads of their own.

    Raises UserError in one line (config key, what was looked for, the cure) if a device is not there; those
    opened before are closed again.

    >>> hardware = open_hardware(Config())
    >>> type(hardware.base).__name__, hardware.arm
    ('MockBase', None)
    >>> hardware.close()
    """
    links = SharedLinks(config)
    clock = clock or MonotonicClock()
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
            base=opening("base", lambda: open_base(config.base, links, config.head.driver == "nxt-pan")),
            near=opening("base.bumper_ports and sonar_port", lambda: open_near(config.base, links)),
            head=opening("head", lambda: open_head(config, links)),
            lamp=opening("lamp", lambda: open_lamp(config, links)),
            arm=opening("arm", lambda: open_arm(config, links)),
            teleop=opening("teleop", lambda: open_teleop(config.teleop)),
            camera=opening("cameras", lambda: open_camera(config.cameras, clock)),
        )
        opened.pop_all()
        return hardware


def reach_of(config: Config) -> Reach:
    """What base and head of this config make of commands."""
    figures = nxt_settings(config.base, USB)
    limits = head_limits(config.head)
    rest = math.radians(config.head.rest_tilt_deg)

    def twist(wanted: Twist) -> Twist:
        return limited(wanted, figures.limits, figures.wheels)

    def pan_only(pose: HeadPose) -> HeadPose:
        return replace(limits.applied(pose), tilt=rest)

    stands = config.base.driver == "none"
    fixed = config.head.driver == "none"
    return Reach(
        twist=(lambda wanted: Twist()) if stands else twist,
        pose=(lambda pose: HeadPose(tilt=rest))
        if fixed
        else (pan_only if config.head.driver == "nxt-pan" else limits.applied),
        command_life_s=config.safety.command_life_s,
    )


# ------------------------------------------------------------------------------------------------- eyes


def open_camera(settings: Cameras, clock: Clock) -> StereoCamera:
    """The eyes. Raises DeviceError."""
    size = (settings.width_px, settings.height_px)
    if settings.driver == "mock":
        return MockCamera([wall_pair(*size)], settings.rate_hz)
    if settings.driver == "folder":
        if not settings.left:
            raise DeviceError("cameras.left is empty: name the folder of the left eye's pictures")
        right = Path(settings.right) if settings.right else None
        return FolderCamera(pairs_in(Path(settings.left), right), settings.rate_hz, size)
    if settings.driver not in ("v4l2", "http", "video"):
        raise _unknown("cameras", settings.driver)
    from robot.hal.webcam.opening import open_webcams

    return open_webcams(
        settings.left,
        settings.right,
        cast(Literal["v4l2", "http", "video"], settings.driver),
        width=settings.width_px,
        height=settings.height_px,
        rate_hz=settings.rate_hz,
        pixel_format=settings.pixel_format,
        exposure_100us=settings.exposure_100us,
        white_balance_k=settings.white_balance_k,
        clock=clock,
    )


def head_limits(settings: Head) -> HeadLimits:
    """How far the config lets the head turn."""
    return HeadLimits(
        pan=math.radians(settings.pan_limit_deg),
        tilt_up=math.radians(settings.tilt_up_limit_deg),
        tilt_down=math.radians(settings.tilt_down_limit_deg),
    )


def open_head(config: Config, links: SharedLinks) -> PanTilt:
    """The head; without one the eyes are fixed at the rest tilt. Raises DeviceError."""
    settings = config.head
    rest = HeadPose(tilt=math.radians(settings.rest_tilt_deg))
    if settings.driver == "mock":
        return MockHead(head_limits(settings))
    if settings.driver == "none":
        return FixedHead(rest)
    if settings.driver == "nxt-pan":
        return _pan_motor(config, links)
    if settings.driver != "uvc":
        raise _unknown("head", settings.driver)
    from robot.hal.uvc_head import open_uvc_head

    device = settings.device or config.cameras.left
    return open_uvc_head(device, head_limits(settings), settings.slew_deg_s, rest, settings.zoom or None)


def open_lamp(config: Config, links: SharedLinks) -> LampDevice:
    """The lamp. Raises DeviceError."""
    settings = config.lamp
    if settings.driver == "mock":
        return MockLamp()
    if settings.driver == "none":
        return NoLamp()
    if settings.driver not in ("sysfs", "gpiozero", "modbus"):
        raise _unknown("lamp", settings.driver)
    if not settings.device:
        raise DeviceError("lamp.device is empty: name the LED, the pin or the Modbus address")
    if settings.driver == "sysfs":
        from robot.hal.lamps.sysfs import SysfsLed

        return SysfsLed(settings.device)
    if settings.driver == "gpiozero":
        from robot.hal.lamps.gpio import open_gpio_lamp

        return open_gpio_lamp(settings.device)
    from robot.hal.lamps.modbus_lamp import ModbusLamp

    return ModbusLamp(links.modbus(settings.device), settings.coil, config.arm.unit)


# ------------------------------------------------------------------------------------------------- base


def open_base(settings: Base, links: SharedLinks | None = None, head_on_brick: bool = False) -> DriveBase:
    """The drive base. head_on_brick: the third motor turns the head: a stop of the wheels leaves it alone.

    Raises DeviceError.
    """
    if settings.driver == "mock":
        figures = nxt_settings(settings, USB)
        limits = Limits(figures.speed_limit, figures.turn_limit)
        return MockBase(limits, figures.wheels, settings.pulse_s)
    if settings.driver == "none":
        return NoBase()
    if settings.driver not in ("nxt-usb", "nxt-serial"):
        raise _unknown("base", settings.driver)
    if settings.left_motor == settings.right_motor:
        raise DeviceError(f"left_motor and right_motor are both {settings.left_motor}: name two brick ports")
    links = links or SharedLinks(Config(base=settings))
    brick = links.brick()
    figures = nxt_settings(settings, USB if links.fast else BLUETOOTH)
    if head_on_brick:
        figures = replace(figures, hold_ports=(figures.left_port, figures.right_port))
    return NxtBase(brick, figures)


def open_near(settings: Base, links: SharedLinks) -> NearSensors | None:
    """Bumper and sonar on the base's brick, None if none is named. Raises DeviceError."""
    if not settings.bumper_ports and not settings.sonar_port:
        return None
    from robot.hal.nxt.near import NxtNear

    brick = links.brick()
    figures = USB_NEAR if links.fast else BLUETOOTH_NEAR
    return NxtNear(brick, figures.plugged(settings.bumper_ports, settings.sonar_port))


def _pan_motor(config: Config, links: SharedLinks) -> PanTilt:
    from robot.hal.nxt.pan import NxtPan

    base, head = config.base, config.head
    if head.pan_motor in (base.left_motor, base.right_motor):
        raise DeviceError(f"pan_motor {head.pan_motor} drives a wheel already: name the third brick port")
    brick = links.brick()
    figures = replace(
        USB_PAN if links.fast else BLUETOOTH_PAN,
        port=Port[head.pan_motor],
        gear=head.pan_gear,
        pan_limit=math.radians(head.pan_limit_deg),
        tilt=math.radians(head.rest_tilt_deg),
    )
    return NxtPan(brick, figures)


def nxt_settings(settings: Base, transport: NxtSettings) -> NxtSettings:
    """The config's figures on top of those of the link (robot.hal.nxt.settings.USB or BLUETOOTH)."""
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


# ------------------------------------------------------------------------------------------ arm, teleop


def open_arm(config: Config, links: SharedLinks) -> Arm | None:
    """The arm, None if there is none. Raises DeviceError."""
    settings = config.arm
    if settings.driver == "mock":
        return MockArm()
    if settings.driver == "none":
        return None
    if settings.driver != "modbus":
        raise _unknown("arm", settings.driver)
    from robot.hal.arm.modbus_arm import ModbusArm
    from robot.hal.arm.settings import ModbusArmSettings

    figures = ModbusArmSettings(
        unit=settings.unit,
        low_first=settings.word_order == "low-first",
        watchdog_ms=settings.watchdog_ms,
    )
    return ModbusArm(links.modbus(settings.address), figures)


def open_teleop(settings: TeleopSettings) -> TeleopLink | None:
    """The person's link, None if there is none. Raises DeviceError."""
    if settings.driver == "mock":
        return MockTeleop()
    if settings.driver == "none":
        return None
    if settings.driver != "serial":
        raise _unknown("teleop", settings.driver)
    from robot.hal.teleop.port import open_port
    from robot.hal.teleop.serial import SerialTeleop

    if not settings.port:
        raise DeviceError("teleop.port is empty: name the serial port, e.g. /dev/ttyUSB0")
    return SerialTeleop(lambda: open_port(settings.port, settings.baudrate))


def _unknown(key: str, driver: str) -> DeviceError:
    return DeviceError(f"{key}.driver = {driver!r} is no driver: `robot config show` lists those there are")
