"""What each kind of device is, whatever stands behind it. One contract suite tests every driver of a kind.

Rules all drivers keep:
* Opening may raise `DeviceError` (with the cure in its words). After that no method raises for a broken
  device: it does nothing or returns the last value, and `faults()` says what is wrong until it is over.
* No method waits. Reading returns the newest value there is; writing hands over and returns.
* `close()` leaves the device safe (motors stopped, lamp off) and may be called twice.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from robot.messages import Fault, HeadPose, Near, Odometry, StereoFrame, TeleopInput, Twist


class DeviceError(OSError):
    """A device cannot be opened or its link broke. The message names the device and the cure."""


@runtime_checkable
class Device(Protocol):
    """What every device can do."""

    def faults(self, now: float) -> tuple[Fault, ...]:
        """Everything that is wrong at `now`, empty if nothing is."""
        ...

    def close(self) -> None:
        """Leave the device safe and release it. May be called twice."""
        ...


@runtime_checkable
class StereoCamera(Device, Protocol):
    """Two eyes that look at the same moment."""

    def latest(self, now: float) -> StereoFrame | None:
        """The newest pair, or None before the first. Check its `captured_at`: it may be old."""
        ...


@runtime_checkable
class WaitsForPictures(Protocol):
    """A camera with a thread of its own, that can wake whoever waits for the next pair."""

    def wait_newer(self, timeout: float) -> bool:
        """Wait until there is a pair newer than the one last shown; False after `timeout` seconds."""
        ...


@runtime_checkable
class PanTilt(Device, Protocol):
    """The head. Pan positive left, tilt positive down, radians."""

    def send(self, pose: HeadPose, now: float) -> HeadPose:
        """Go there; returns the pose really asked for after the limits."""
        ...

    def read(self, now: float) -> HeadPose:
        """Where the head is now (measured or modelled)."""
        ...


@runtime_checkable
class DatedHead(Protocol):
    """A head whose reading may be older than the moment it is asked."""

    @property
    def read_at(self) -> float:
        """When the pose that `read` gives was measured."""
        ...


@runtime_checkable
class LampDevice(Device, Protocol):
    """A light whose level can be set."""

    def send(self, level: float, now: float) -> float:
        """Set the level 0..1; returns the level really set."""
        ...


@runtime_checkable
class DriveBase(Device, Protocol):
    """Two driven wheels. A command is a pulse: without renewal the wheels stop by themselves."""

    def send(self, twist: Twist, now: float) -> Twist:
        """Drive like this until renewed or expired; returns the twist really asked for after the limits."""
        ...

    def stop(self, now: float) -> None:
        """Stop at once, whatever else is going on."""
        ...

    def read(self, now: float) -> Odometry:
        """Pose and speed by the wheels' encoders."""
        ...

    def battery_volts(self) -> float | None:
        """Battery voltage, None if unknown."""
        ...


@runtime_checkable
class NearSensors(Device, Protocol):
    """What feels at the body's edge: bumper and sonar, the backup where the eyes fail."""

    def read(self, now: float) -> Near:
        """The newest reading. Check its `at`: it may be old."""
        ...


@dataclass(frozen=True, slots=True)
class ArmState:
    """Joints (radians), flange position (metres), orientation (radians, Rz Ry Rx); the arm's base frame."""

    joints: tuple[float, ...]
    position: tuple[float, float, float]
    orientation: tuple[float, float, float]
    moving: bool
    in_position: bool
    enabled: bool


@runtime_checkable
class Arm(Device, Protocol):
    """A six-axis arm behind its own controller, which plans the motion. Command number 0: not accepted."""

    def enable(self, now: float) -> None:
        """Switch the drives on."""
        ...

    def move_joints(self, joints: tuple[float, ...], speed: float, now: float) -> int:
        """Move to joint angles (radians) at a share 0..1 of full speed; returns the command's number."""
        ...

    def move_linear(
        self,
        position: tuple[float, float, float],
        orientation: tuple[float, float, float],
        speed: float,
        now: float,
    ) -> int:
        """Move the flange in a straight line; returns the command's number."""
        ...

    def limit_speed(self, share: float, now: float) -> None:
        """Let every motion, also the one under way, go at no more than this share 0..1 of its speed."""
        ...

    def grip(self, closed: bool, now: float) -> None:
        """Close or open the gripper."""
        ...

    def stop(self, now: float) -> None:
        """Stop at once."""
        ...

    def read(self, now: float) -> ArmState:
        """The newest state."""
        ...


@runtime_checkable
class TeleopLink(Device, Protocol):
    """A person at the stick."""

    def latest(self, now: float) -> TeleopInput | None:
        """The newest word, or None if nothing was ever heard. Check its `at`: it may be old."""
        ...

    def tell(self, line: str, now: float) -> None:
        """Show one status line to the person."""
        ...
