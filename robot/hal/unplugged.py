"""Stand-ins for devices that a robot does not have (`driver = "none"`): they do nothing and lack nothing."""

from __future__ import annotations

from typing import Final

from robot.messages import Fault, HeadPose, Odometry, Twist

_STRAIGHT: Final = HeadPose()


class _Nothing:
    """A device that is not there cannot break."""

    def faults(self, now: float) -> tuple[Fault, ...]:
        """Nothing is wrong."""
        return ()

    def close(self) -> None:
        """Nothing to release."""


class FixedHead(_Nothing):
    """Eyes that are bolted on: always at `pose`, wherever they are sent."""

    def __init__(self, pose: HeadPose = _STRAIGHT) -> None:
        self._pose = pose

    def send(self, pose: HeadPose, now: float) -> HeadPose:
        """Returns the pose it has."""
        return self._pose

    def read(self, now: float) -> HeadPose:
        """The pose it has."""
        return self._pose


class NoLamp(_Nothing):
    """No light."""

    def send(self, level: float, now: float) -> float:
        """Stays dark: 0."""
        return 0.0


class NoBase(_Nothing):
    """A robot that cannot drive: it stays at the origin."""

    def send(self, twist: Twist, now: float) -> Twist:
        """Does not move: the zero twist."""
        return Twist()

    def stop(self, now: float) -> None:
        """Stands already."""

    def read(self, now: float) -> Odometry:
        """At the origin, standing."""
        return Odometry(at=now)

    def battery_volts(self) -> float | None:
        """No battery."""
        return None
