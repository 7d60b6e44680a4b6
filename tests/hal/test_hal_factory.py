"""The factory opens what the config names, or says in one line what is missing and how to mend it."""

from __future__ import annotations

import importlib
import math
from pathlib import Path

import cv2
import msgspec
import pytest

from robot.config import ArmSettings, Base, Cameras, Config, Head, LampSettings, TeleopSettings
from robot.errors import UserError
from robot.hal import factory
from robot.hal.factory import Hardware, nxt_settings, open_hardware
from robot.hal.interfaces import Arm, DeviceError, DriveBase, LampDevice, PanTilt, StereoCamera, TeleopLink
from robot.hal.mock import MockBase, MockCamera, MockHead, MockLamp
from robot.hal.mock.camera import wall_pair
from robot.hal.nxt.settings import BLUETOOTH, USB
from robot.messages import HeadPose, Twist


def changed(config: Config, **sections: object) -> Config:
    return msgspec.structs.replace(config, **sections)


def test_the_default_config_opens_without_any_hardware() -> None:
    hardware = open_hardware(Config())
    assert isinstance(hardware.camera, StereoCamera)
    assert isinstance(hardware.head, PanTilt)
    assert isinstance(hardware.lamp, LampDevice)
    assert isinstance(hardware.base, DriveBase)
    assert hardware.arm is None
    assert hardware.teleop is None
    frame = hardware.camera.latest(0.0)
    assert frame is not None
    assert frame.left.shape == (288, 352, 3)
    assert hardware.base.send(Twist(v=9.0), 0.0).v == pytest.approx(0.25)
    hardware.close()
    hardware.close()


def test_none_means_none() -> None:
    config = changed(
        Config(),
        head=Head(driver="none", rest_tilt_deg=10.0),
        lamp=LampSettings(driver="none"),
        base=Base(driver="none"),
        arm=ArmSettings(driver="none"),
    )
    hardware = open_hardware(config)
    assert hardware.head.send(HeadPose(1.0, 1.0), 0.0) == HeadPose(tilt=math.radians(10.0))
    assert hardware.lamp.send(1.0, 0.0) == 0.0
    assert hardware.base.send(Twist(v=0.1), 0.0) == Twist()
    hardware.close()


def test_arm_and_teleop_are_there_when_named() -> None:
    config = changed(Config(), arm=ArmSettings(driver="mock"), teleop=TeleopSettings(driver="mock"))
    hardware = open_hardware(config)
    assert isinstance(hardware.arm, Arm)
    assert isinstance(hardware.teleop, TeleopLink)
    assert len(hardware.devices) == 6
    hardware.close()


def test_the_folder_camera_opens_with_the_configured_size(tmp_path: Path) -> None:
    for eye, image in zip(("left", "right"), wall_pair(64, 48), strict=True):
        cv2.imwrite(str(tmp_path / f"{eye}_0.png"), image)
    cameras = Cameras(driver="folder", left=str(tmp_path), width_px=64, height_px=48)
    hardware = open_hardware(changed(Config(), cameras=cameras))
    assert hardware.camera.latest(0.0) is not None
    hardware.close()
    with pytest.raises(UserError, match=r"config key cameras: .*64 x 48 pixels, not 352 x 288"):
        open_hardware(changed(Config(), cameras=Cameras(driver="folder", left=str(tmp_path))))


@pytest.mark.parametrize(
    ("sections", "words"),
    [
        ({"cameras": Cameras(driver="folder")}, r"cameras\.left is empty"),
        ({"cameras": Cameras(driver="folder", left="/no/such")}, "cameras: /no/such is not a folder"),
        ({"cameras": Cameras(driver="v4l2")}, r"cameras\.left is empty: name the left eye"),
        ({"cameras": Cameras(driver="v4l2", left="/dev/video-none")}, "cameras: .*/dev/video-none"),
        ({"cameras": Cameras(driver="video", left="/no/such.avi")}, r"cameras: .*/no/such\.avi"),
        ({"cameras": Cameras(driver="x")}, r"cameras\.driver = 'x' is no driver"),
        ({"head": Head(driver="nxt-pan")}, "head: .*pan_motor C drives a wheel"),
        ({"head": Head(driver="nxt-pan", pan_motor="A")}, "head: .*base.driver is 'mock'"),
        ({"head": Head(driver="uvc", device="/dev/video-none")}, "head: .*/dev/video-none"),
        ({"base": Base(bumper_ports="1")}, "base.bumper_ports.*base.driver is 'mock'"),
        ({"lamp": LampSettings(driver="sysfs")}, r"lamp\.device is empty"),
        ({"lamp": LampSettings(driver="sysfs", device="no-such-led")}, "lamp: .*no-such-led"),
        ({"lamp": LampSettings(driver="modbus", device="127.0.0.1:1")}, "lamp: .*127.0.0.1:1"),
        ({"arm": ArmSettings(driver="modbus")}, "arm: .*no address"),
        ({"arm": ArmSettings(driver="modbus", address="127.0.0.1:1")}, "arm: .*127.0.0.1:1"),
        ({"teleop": TeleopSettings(driver="serial")}, r"teleop\.port is empty"),
        ({"teleop": TeleopSettings(driver="serial", port="/dev/tty-none")}, "teleop: .*/dev/tty-none"),
        ({"base": Base(driver="nxt-serial")}, r"base\.port is empty"),
        ({"base": Base(driver="nxt-serial", port="/dev/rfcomm-none")}, "base: .*/dev/rfcomm-none"),
        ({"base": Base(driver="nxt-usb", left_motor="C")}, "both C"),
        ({"head": Head(driver="x")}, r"head\.driver"),
        ({"lamp": LampSettings(driver="x")}, r"lamp\.driver"),
        ({"base": Base(driver="x")}, r"base\.driver"),
        ({"arm": ArmSettings(driver="x")}, r"arm\.driver"),
        ({"teleop": TeleopSettings(driver="x")}, r"teleop\.driver"),
    ],
)
def test_what_is_not_there_is_told_in_one_line(sections: dict[str, object], words: str) -> None:
    with pytest.raises(UserError, match=words) as caught:
        open_hardware(changed(Config(), **sections))
    assert "\n" not in str(caught.value)
    assert "config key" in str(caught.value)


def test_a_brick_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    usb = importlib.import_module("robot.hal.nxt.usb")
    monkeypatch.setattr(usb, "find_brick", lambda serial: usb.chosen([], serial))
    with pytest.raises(UserError, match=r"config key base: no NXT brick .*switch it on"):
        open_hardware(changed(Config(), base=Base(driver="nxt-usb")))


def test_what_was_opened_is_closed_when_a_later_device_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[MockBase | MockHead | MockLamp] = []

    def keeping(open_one):  # type: ignore[no-untyped-def]
        def keep(*args):  # type: ignore[no-untyped-def]
            opened.append(open_one(*args))
            return opened[-1]

        return keep

    for name in ("open_base", "open_head", "open_lamp"):
        monkeypatch.setattr(factory, name, keeping(getattr(factory, name)))
    with pytest.raises(UserError):
        open_hardware(changed(Config(), cameras=Cameras(driver="folder")))
    assert [device.closed for device in opened] == [1, 1, 1]


def test_one_that_does_not_close_does_not_keep_the_others_open() -> None:
    class Stuck(MockBase):
        def close(self) -> None:
            raise DeviceError("stuck")

    hardware = Hardware(
        camera=MockCamera([wall_pair(64, 48)]), head=MockHead(), lamp=MockLamp(), base=Stuck()
    )
    with pytest.raises(DeviceError, match="stuck"):
        hardware.close()
    others = (hardware.camera, hardware.head, hardware.lamp)
    assert [device.closed for device in others] == [1, 1, 1]  # type: ignore[attr-defined]


def test_the_figures_of_the_config_reach_the_driver() -> None:
    figures = nxt_settings(
        Base(
            wheel_radius_m=0.03,
            track_width_m=0.2,
            max_speed_m_s=0.1,
            max_turn_deg_s=90.0,
            pulse_s=0.2,
            left_motor="A",
            right_motor="B",
        ),
        BLUETOOTH,
    )
    assert (figures.wheels.radius, figures.wheels.track_width) == (0.03, 0.2)
    assert (figures.speed_limit, figures.turn_limit) == (0.1, pytest.approx(math.pi / 2))
    assert figures.wheel.pulse_s == 0.2
    assert (figures.left_port, figures.right_port) == (0, 1)
    assert figures.pace == BLUETOOTH.pace != USB.pace
