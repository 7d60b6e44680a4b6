"""What the control tick is given: states, chart, perception, body, devices, as it sees them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from robot.guard import GuardLimits
from robot.hal.interfaces import DriveBase, LampDevice, NearSensors, PanTilt, StereoCamera, TeleopLink
from robot.messages import (
    Clearance,
    Command,
    Event,
    Fault,
    Intent,
    Odometry,
    Percepts,
    Pose2,
    Situation,
    Twist,
    View,
    Want,
)


class StateLike(Protocol):
    """A state as the loop sees it."""

    def enter(self, situation: Situation) -> None:
        """Called once when the chart enters the state."""
        ...

    def step(self, situation: Situation) -> tuple[Intent, Event | None]:
        """Called every tick."""
        ...


class ChartLike(Protocol):
    """The chart as the loop sees it."""

    @property
    def leaf(self) -> str:
        """The innermost active state."""
        ...

    def send(self, event: str) -> object:
        """Take the transition of this event."""
        ...


class PerceptionLike(Protocol):
    """Perception as the loop sees it."""

    def submit(self, view: View, wants: frozenset[Want], now: float) -> None:
        """Start what is due on this view."""
        ...

    def collect(self, now: float) -> Percepts:
        """The newest percepts."""
        ...

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong with vision."""
        ...

    def forget_target(self) -> None:
        """Drop the stale track."""
        ...

    def set_down(self) -> None:
        """A person arms the robot: a base that was lifted stands on the floor again."""
        ...

    def clearance(self, pose: Pose2, twist: Twist, now: float) -> Clearance:
        """How far the way of this twist is free."""
        ...

    def may_turn(self, pose: Pose2) -> bool:
        """True if nothing stands within the circle the body turns in."""
        ...


class BodyLike(Protocol):
    """The body as the loop sees it."""

    def command(self, intent: Intent, odometry: Odometry, blocked_by_unknown: bool, now: float) -> Command:
        """Turn an intent into a command."""
        ...


class ArmKeeperLike(Protocol):
    """The arm as the loop sees it."""

    def act(self, situation: Situation, stop: bool) -> None:
        """Stop it, or let it go on at the speed its surroundings allow."""
        ...

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong with it."""
        ...


@dataclass(frozen=True, slots=True)
class Devices:
    """What the loop reads and moves."""

    camera: StereoCamera
    head: PanTilt
    lamp: LampDevice
    base: DriveBase
    teleop: TeleopLink | None = None
    near: NearSensors | None = None
    arm: ArmKeeperLike | None = None


@dataclass(frozen=True, slots=True)
class LoopSettings:
    """Numbers of the control tick. period: seconds from tick to tick."""

    guard: GuardLimits
    period: float = 0.04
    frame_max_age: float = 0.45
    teleop_timeout: float = 0.4
    teleop_max_v: float = 0.25
    teleop_max_w: float = 1.2
    lamp_on_below: float = 45.0
    lamp_off_above: float = 110.0
