"""Rigs of the mocks, and of devices that are not there."""

from __future__ import annotations

from pathlib import Path

from rig import MockRig, Rig

from robot.hal.interfaces import Arm, StereoCamera, TeleopLink
from robot.hal.mock import MockArm, MockCamera, MockHead, MockLamp, MockTeleop
from robot.hal.mock.camera import wall_pair
from robot.hal.unplugged import FixedHead, NoLamp
from robot.messages import TeleopInput


def _mock_camera(folder: Path) -> Rig[StereoCamera]:
    return MockRig(MockCamera([wall_pair(64, 48)]), ("latest",))


def _mock_arm(folder: Path) -> Rig[Arm]:
    methods = ("enable", "move_joints", "move_linear", "grip", "stop", "read")
    return MockRig(MockArm(), methods)


def _mock_teleop(folder: Path) -> Rig[TeleopLink]:
    script = [TeleopInput(at=0.2 * index, v=0.1 * index) for index in range(5)]
    return MockRig(MockTeleop(script), ("latest", "tell"))


MAKERS = {
    "camera": {"mock": _mock_camera},
    "head": {
        "mock": lambda folder: MockRig(MockHead(), ("send", "read")),
        "none": lambda folder: Rig(FixedHead()),
    },
    "lamp": {"mock": lambda folder: MockRig(MockLamp(), ("send",)), "none": lambda folder: Rig(NoLamp())},
    "arm": {"mock": _mock_arm},
    "teleop": {"mock": _mock_teleop},
}
