"""Each driver of a kind with the world behind it, so that one suite can test them all.

A rig has the open `device`, the time `now`, `wait(seconds)` to let time pass, and, where the far end is in
the test's hand, `break_down()` and `mend()`. The driver "none" stands for a device that is not there.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Generic, TypeVar

import cv2
import numpy as np

from robot.config import Base
from robot.hal.factory import nxt_settings, open_base
from robot.hal.folder import FolderCamera, pairs_in
from robot.hal.interfaces import Arm, DriveBase, StereoCamera, TeleopLink
from robot.hal.links import MemoryLink
from robot.hal.mock import MockArm, MockBase, MockCamera, MockHead, MockLamp, MockTeleop
from robot.hal.mock.camera import wall_pair
from robot.hal.nxt.base import NxtBase
from robot.hal.nxt.brick import Brick
from robot.hal.nxt.settings import BLUETOOTH, USB, NxtSettings
from robot.hal.unplugged import FixedHead, NoBase, NoLamp
from robot.messages import Odometry, TeleopInput, Twist
from robot.sim.brick_emulator import BrickEmulator
from robot.sim.motor import FreeMotor

D = TypeVar("D")
TICK_S = 0.04


class Rig(Generic[D]):
    """A driver whose far end is nothing but time."""

    def __init__(self, device: D) -> None:
        self.device = device
        self.now = 0.0

    def wait(self, seconds: float) -> None:
        """Let time pass without a word to the driver."""
        self.now = round(self.now + seconds, 6)

    def break_down(self) -> None:
        """Let the far end fail."""
        raise NotImplementedError

    def mend(self) -> None:
        """Let the far end work again."""
        raise NotImplementedError


class MockRig(Rig[D]):
    """A mock: every method of the kind fails on order."""

    def __init__(self, device: D, methods: tuple[str, ...]) -> None:
        super().__init__(device)
        self._methods = methods

    def break_down(self) -> None:
        """Every call fails."""
        for method in self._methods:
            self.device.fail(method)  # type: ignore[attr-defined]

    def mend(self) -> None:
        """Every call works."""
        self.device.mend()  # type: ignore[attr-defined]


class NxtRig(Rig[DriveBase]):
    """The NXT driver before the emulated brick."""

    def __init__(self, settings: NxtSettings, seed: int = 3) -> None:
        rng = np.random.default_rng(seed)
        motors = [None, FreeMotor(rng, load_inertia=0.0005), FreeMotor(rng, load_inertia=0.0005)]
        self.brick = BrickEmulator(motors, rng)
        self.motors = motors[1:]
        super().__init__(NxtBase(Brick(MemoryLink(self.brick.handle)), settings))

    def wait(self, seconds: float) -> None:
        """The brick lives on while the host is silent."""
        super().wait(seconds)
        self.brick.advance(seconds)

    def break_down(self) -> None:
        """Pull the cable."""
        self.brick.cut_link()

    def mend(self) -> None:
        """Put it back."""
        self.brick.restore_link()


class RealRig(Rig[D]):
    """A device on the table: time passes by itself."""

    def __init__(self, device: D) -> None:
        super().__init__(device)
        self._start = time.monotonic()

    def wait(self, seconds: float) -> None:
        """Wait."""
        time.sleep(seconds)
        self.now = time.monotonic() - self._start


# ------------------------------------------------------------------------------------------ what is there

Make = Callable[[Path], "Rig[object]"]


def _nxt(transport: NxtSettings) -> Make:
    return lambda folder: NxtRig(nxt_settings(Base(), transport))


def _folder_camera(folder: Path) -> Rig[StereoCamera]:
    for index in range(4):
        left, right = wall_pair(64, 48)
        cv2.imwrite(str(folder / f"left_{index}.png"), left + index)
        cv2.imwrite(str(folder / f"right_{index}.png"), right + index)
    return FolderRig(FolderCamera(pairs_in(folder), 25.0), folder)


class FolderRig(Rig[StereoCamera]):
    """Pictures that can be spoilt on disk."""

    def __init__(self, device: StereoCamera, folder: Path) -> None:
        super().__init__(device)
        self._folder = folder

    def break_down(self) -> None:
        """Spoil every picture but the last."""
        for path in self._folder.iterdir():
            if "3" not in path.name:
                path.write_bytes(b"no picture")

    def mend(self) -> None:
        """The last one is good; it comes by itself."""


def _mock_camera(folder: Path) -> Rig[StereoCamera]:
    return MockRig(MockCamera([wall_pair(64, 48)]), ("latest",))


def _mock_arm(folder: Path) -> Rig[Arm]:
    methods = ("enable", "move_joints", "move_linear", "grip", "stop", "read")
    return MockRig(MockArm(), methods)


def _mock_teleop(folder: Path) -> Rig[TeleopLink]:
    script = [TeleopInput(at=0.2 * index, v=0.1 * index) for index in range(5)]
    return MockRig(MockTeleop(script), ("latest", "tell"))


MAKERS: dict[str, dict[str, Make]] = {
    "base": {
        "mock": lambda folder: MockRig(MockBase(), ("send", "stop", "read")),
        "nxt-usb": _nxt(USB),
        "nxt-bluetooth": _nxt(BLUETOOTH),
        "none": lambda folder: Rig(NoBase()),
    },
    "camera": {"mock": _mock_camera, "folder": _folder_camera},
    "head": {
        "mock": lambda folder: MockRig(MockHead(), ("send", "read")),
        "none": lambda folder: Rig(FixedHead()),
    },
    "lamp": {"mock": lambda folder: MockRig(MockLamp(), ("send",)), "none": lambda folder: Rig(NoLamp())},
    "arm": {"mock": _mock_arm},
    "teleop": {"mock": _mock_teleop},
}


def real(kind: str, address: str) -> Make:
    """A rig before a real device. base: usb, usb:SERIAL or a serial port; camera: LEFT,RIGHT folders."""
    if kind == "base" and address.split(":")[0] == "usb":
        config = Base(driver="nxt-usb", brick=address.partition(":")[2])
        return lambda folder: RealRig(open_base(config))
    if kind == "base":
        return lambda folder: RealRig(open_base(Base(driver="nxt-serial", port=address)))
    if kind == "camera":
        left, _, right = address.partition(",")
        return lambda folder: RealRig(FolderCamera(pairs_in(Path(left), Path(right) if right else None)))
    raise ValueError(f"--hardware {kind}={address}: real drivers are there for base and camera")


def drive(rig: Rig[DriveBase], twist: Twist, seconds: float) -> Odometry:
    """The control loop: read and send each tick; returns the odometry at the end."""
    for _ in range(round(seconds / TICK_S)):
        rig.device.read(rig.now)
        rig.device.send(twist, rig.now)
        rig.wait(TICK_S)
    return rig.device.read(rig.now)


def watch(rig: Rig[DriveBase], seconds: float) -> Odometry:
    """Only read."""
    for _ in range(round(seconds / TICK_S)):
        rig.device.read(rig.now)
        rig.wait(TICK_S)
    return rig.device.read(rig.now)
