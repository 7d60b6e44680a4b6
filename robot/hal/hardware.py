"""Every device of the robot together: as opened, and behind its workers for a real-time run."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass

from robot.clock import Clock
from robot.hal.device_thread import DeviceThread
from robot.hal.interfaces import (
    Arm,
    Device,
    DriveBase,
    LampDevice,
    NearSensors,
    PanTilt,
    StereoCamera,
    TeleopLink,
)
from robot.hal.threaded import ThreadedBase, ThreadedHead, ThreadedLamp, ThreadedNear, ThreadedTeleop
from robot.hal.threaded_arm import ThreadedArm
from robot.messages import HeadPose, Twist

# Seconds from exchange to exchange, where nothing wakes the worker earlier. The drivers keep their own,
# slower rates where the link asks for it.
BASE_PERIOD_S = 0.01
HEAD_PERIOD_S = 0.02
LAMP_PERIOD_S = 0.5
NEAR_PERIOD_S = 0.02
ARM_PERIOD_S = 0.05
TELEOP_PERIOD_S = 0.01
# A lamp or a head that is slow holds up nobody; a base or a stick that hangs is dangerous at once.
PATIENT_S, IMPATIENT_S = 0.45, 0.25
_CLOSED_WITHIN_S = 0.5


@dataclass(frozen=True, slots=True)
class Hardware:
    """Every device of the robot, open. near, arm and teleop are None if the robot has none."""

    camera: StereoCamera
    head: PanTilt
    lamp: LampDevice
    base: DriveBase
    near: NearSensors | None = None
    arm: Arm | None = None
    teleop: TeleopLink | None = None

    @property
    def devices(self) -> tuple[Device, ...]:
        """All that are there, what moves first: the order to close them in."""
        every = (self.base, self.arm, self.head, self.lamp, self.near, self.camera, self.teleop)
        return tuple(device for device in every if device is not None)

    def close(self) -> None:
        """Leave every device safe, also if one of them fails to close. May be called twice."""
        with ExitStack() as stack:
            for device in reversed(self.devices):
                stack.callback(device.close)


@dataclass(frozen=True, slots=True)
class Reach:
    """What base and head make of a command, known without asking them."""

    twist: Callable[[Twist], Twist]
    pose: Callable[[HeadPose], HeadPose]
    command_life_s: float = 0.2


class WorkingHardware(Hardware):
    """Hardware behind workers; all are ended at once, so that one that hangs holds up no other."""

    def close(self) -> None:
        """Leave every device safe, what moves first; half a second at most for all together."""
        closing = [threading.Thread(target=device.close, daemon=True) for device in self.devices]
        for thread in closing:
            thread.start()
        for thread in closing:
            thread.join(_CLOSED_WITHIN_S)


def behind_workers(hardware: Hardware, reach: Reach, clock: Clock) -> Hardware:
    """The same devices, each with a worker in a thread of its own. The camera has its own already."""

    def worker(name: str, period_s: float, deadline_s: float) -> DeviceThread:
        return DeviceThread(name, clock, period_s, deadline_s)

    near, arm, teleop = hardware.near, hardware.arm, hardware.teleop
    base = ThreadedBase(
        hardware.base, worker("base", BASE_PERIOD_S, IMPATIENT_S), reach.twist, reach.command_life_s
    )
    return WorkingHardware(
        camera=hardware.camera,
        base=base,
        head=ThreadedHead(hardware.head, worker("head", HEAD_PERIOD_S, PATIENT_S), reach.pose),
        lamp=ThreadedLamp(hardware.lamp, worker("lamp", LAMP_PERIOD_S, PATIENT_S)),
        near=None if near is None else ThreadedNear(near, worker("near", NEAR_PERIOD_S, PATIENT_S)),
        arm=None if arm is None else ThreadedArm(arm, worker("arm", ARM_PERIOD_S, PATIENT_S)),
        teleop=None
        if teleop is None
        else ThreadedTeleop(teleop, worker("teleop", TELEOP_PERIOD_S, IMPATIENT_S), base.stop),
    )
