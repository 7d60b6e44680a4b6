"""What passes between the world's process and those who hold a channel to it. All frozen, all picklable.

Times called `at` are `time.monotonic()`, which all processes of one machine share.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeAlias

from robot.messages import HeadPose, Pose2
from robot.sim.injected import InjectedFault
from robot.sim.referee import Claim, Scenery
from robot.sim.scene import Scene

Channel: TypeAlias = "Connection[Any, Any]"
"""One end of a pipe to the world's process."""


@dataclass(frozen=True, slots=True)
class WorldSpec:
    """The world to make. folder: for its serial ports; it removes it at its end. linger_s: how long it goes
    on once nobody holds a channel any more.
    """

    scene: Scene
    seed: int
    folder: Path
    faults: tuple[InjectedFault, ...] = ()
    linger_s: float = 2.0


@dataclass(frozen=True, slots=True)
class Addresses:
    """Where the drivers' far ends are: serial ports as paths, eyes as URLs, box (lamp, arm) as HOST:PORT."""

    brick: str
    teleop: str
    left_eye: str
    right_eye: str
    box: str


# ---------------------------------------------------------------------------------- to the world's process


@dataclass(frozen=True, slots=True)
class Begin:
    """Let time pass. Until then the room stands still and every device answers."""


@dataclass(frozen=True, slots=True)
class Claimed:
    """What the robot says at one tick. seen_at: when the picture it speaks of was taken, None without one."""

    claim: Claim
    seen_at: float | None


@dataclass(frozen=True, slots=True)
class Inject:
    """Break a device `fault.at` seconds from now on."""

    fault: InjectedFault


@dataclass(frozen=True, slots=True)
class Type:
    """Bytes for the person's end of the teleop port. Answered by `Typed`."""

    data: bytes


@dataclass(frozen=True, slots=True)
class AskTruth:
    """Answered by `Truth`."""


@dataclass(frozen=True, slots=True)
class AskTrace:
    """Answered by `Trace`."""


@dataclass(frozen=True, slots=True)
class AskOutcome:
    """Answered by `Outcome`."""


@dataclass(frozen=True, slots=True)
class End:
    """End the world."""


Request = Begin | Claimed | Inject | Type | AskTruth | AskTrace | AskOutcome | End


# -------------------------------------------------------------------------------- from the world's process


@dataclass(frozen=True, slots=True)
class Ready:
    """The world stands and serves."""

    addresses: Addresses


@dataclass(frozen=True, slots=True)
class Failed:
    """The world cannot be made or broke: words for a person."""

    words: str


@dataclass(frozen=True, slots=True)
class Done:
    """The referee has seen enough."""


@dataclass(frozen=True, slots=True)
class Typed:
    """The bytes were written to the teleop port at `at`."""

    at: float


@dataclass(frozen=True, slots=True)
class Truth:
    """How things truly are. wheels: left, right in rad/s; lamp: share of full light; heard: what the robot
    last wrote to the person."""

    at: float
    now: float
    robot: Pose2
    wheels: tuple[float, float]
    head: HeadPose
    lamp: float
    heard: bytes


@dataclass(frozen=True, slots=True)
class MotorTelegram:
    """One SETOUTPUTSTATE as it arrived at the brick: port 0-2 or 255 for all, power in percent."""

    at: float
    port: int
    power: int
    limit: int

    @property
    def stops(self) -> bool:
        """True if it tells all motors to stand."""
        return self.port == 255 and self.power == 0


@dataclass(frozen=True, slots=True)
class WheelSpeeds:
    """Left and right wheel in rad/s; now: the world's own time, which lags on a busy machine."""

    at: float
    now: float
    left: float
    right: float


@dataclass(frozen=True, slots=True)
class Trace:
    """What is remembered, oldest first: motor commands, wheels (the last seconds), times of pictures."""

    telegrams: tuple[MotorTelegram, ...]
    wheels: tuple[WheelSpeeds, ...]
    moments: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Pace:
    """How the world kept time: ticks passed, those more than half a tick late, the worst lateness, seconds by
    which its time was put back because it could not follow, and pictures not drawn in time."""

    ticks: int = 0
    late: int = 0
    worst_s: float = 0.0
    slipped_s: float = 0.0
    pictures_missed: int = 0


@dataclass(frozen=True, slots=True)
class Outcome:
    """The referee's report, the room with both paths (one place a world tick), and how the world kept time.

    unmatched: claims about a picture that never was.
    """

    report: dict[str, float | int | str | bool | None] = field(default_factory=dict)
    scenery: Scenery | None = None
    pace: Pace = Pace()
    unmatched: int = 0
