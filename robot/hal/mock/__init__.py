"""Light drivers for tests and dry runs: scripted, recording what they were told, able to fail on any call."""

from robot.hal.mock.arm import MockArm
from robot.hal.mock.base import MockBase
from robot.hal.mock.camera import MockCamera
from robot.hal.mock.head import MockHead
from robot.hal.mock.lamp import MockLamp
from robot.hal.mock.script import Call
from robot.hal.mock.teleop import MockTeleop

__all__ = ["Call", "MockArm", "MockBase", "MockCamera", "MockHead", "MockLamp", "MockTeleop"]
