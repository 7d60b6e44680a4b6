"""The values that flow between the rooms. All frozen; metres, radians, seconds unless the name says so.

Robot frame: x forward, y left, origin below the middle of the axle. Odometry frame: the robot frame at
the moment the run began. Bearings are positive to the left, tilt is positive downwards.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Points = NDArray[np.float64]
T = TypeVar("T")


# ------------------------------------------------------------------------------------------- geometry


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle in the image: left, top, width, height in pixels (fractions allowed)."""

    x: float
    y: float
    w: float
    h: float

    @property
    def centre(self) -> tuple[float, float]:
        """(u, v) of the middle."""
        return self.x + self.w / 2, self.y + self.h / 2

    @property
    def area(self) -> float:
        """Width times height."""
        return self.w * self.h

    def iou(self, other: Box) -> float:
        """Intersection over union, 0..1.

        >>> Box(0, 0, 2, 2).iou(Box(1, 0, 2, 2))
        0.3333333333333333
        """
        w = min(self.x + self.w, other.x + other.w) - max(self.x, other.x)
        h = min(self.y + self.h, other.y + other.h) - max(self.y, other.y)
        if w <= 0 or h <= 0:
            return 0.0
        return w * h / (self.area + other.area - w * h)

    def clipped(self, width: int, height: int) -> Box:
        """The part inside an image of the given size (may be empty: w or h 0)."""
        x0, y0 = max(self.x, 0.0), max(self.y, 0.0)
        x1, y1 = min(self.x + self.w, width), min(self.y + self.h, height)
        return Box(x0, y0, max(x1 - x0, 0.0), max(y1 - y0, 0.0))


@dataclass(frozen=True, slots=True)
class Pose2:
    """Position and heading on the floor."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def to_world(self, points: Points) -> Points:
        """Points (N, 2) from this pose's frame into the frame the pose is given in."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        p = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        return np.column_stack([self.x + c * p[:, 0] - s * p[:, 1], self.y + s * p[:, 0] + c * p[:, 1]])

    def to_local(self, points: Points) -> Points:
        """Points (N, 2) from the frame this pose is given in into this pose's own frame."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        p = np.asarray(points, dtype=np.float64).reshape(-1, 2) - (self.x, self.y)
        return np.column_stack([c * p[:, 0] + s * p[:, 1], -s * p[:, 0] + c * p[:, 1]])

    def compose(self, step: Pose2) -> Pose2:
        """The pose reached by making `step` (given in this pose's frame) from here."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return Pose2(
            self.x + c * step.x - s * step.y, self.y + s * step.x + c * step.y, wrap(self.yaw + step.yaw)
        )


def wrap(angle: float) -> float:
    """The same angle in (-pi, pi]."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


@dataclass(frozen=True, slots=True)
class Twist:
    """Forward speed v in m/s and turning rate w in rad/s (counter-clockwise)."""

    v: float = 0.0
    w: float = 0.0

    @property
    def is_zero(self) -> bool:
        """True if it asks for no motion at all."""
        return self.v == 0.0 and self.w == 0.0


@dataclass(frozen=True, slots=True)
class HeadPose:
    """Pan (positive left) and tilt (positive down) in radians."""

    pan: float = 0.0
    tilt: float = 0.0


# -------------------------------------------------------------------------------------------- sensors


@dataclass(frozen=True, slots=True, eq=False)
class StereoFrame:
    """What both eyes saw at one moment: two BGR uint8 images (H, W, 3) of equal size."""

    left: Image
    right: Image
    captured_at: float
    seq: int


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A frame together with where the head and the base were when it was taken."""

    frame: StereoFrame
    head: HeadPose
    base: Pose2


@dataclass(frozen=True, slots=True)
class Odometry:
    """Pose in the odometry frame and speed, as the wheels tell them."""

    pose: Pose2 = Pose2()
    twist: Twist = Twist()
    at: float = 0.0


@dataclass(frozen=True, slots=True)
class Near:
    """What the sensors at the bumper say: touched, and the sonar's distance in metres from its face.

    distance: None without an echo or without a sonar.
    """

    at: float
    bumped: bool = False
    distance: float | None = None


@dataclass(frozen=True, slots=True)
class TeleopInput:
    """The newest word from whoever holds the stick. Axes -1..1; v forward, w left.

    kind: how the person speaks: 'frames' (a program repeats the sticks, silence is a lost link), 'keys' (a
    bare terminal: each key is a pulse, silence between keys is nothing), 'mavlink' (like frames).
    """

    at: float
    v: float = 0.0
    w: float = 0.0
    take: bool = False
    release: bool = False
    stop: bool = False
    arm: bool = False
    kind: str = "frames"


# ------------------------------------------------------------------------------------------- percepts


@dataclass(frozen=True, slots=True)
class Detection:
    """A place where the target seems to be. score 0..1, higher is surer; label is the model's name.

    azimuth: the direction it was seen in, in the odometry frame; perception adds it, for only there is
    known how head and base stood when the picture was taken.
    """

    box: Box
    score: float
    label: str
    azimuth: float = 0.0


@dataclass(frozen=True, slots=True)
class Range:
    """Distance to the visible surface at the box centre.

    distance and sigma are along the optical axis (depth Z) in metres; position is (x, y, z) in the robot
    frame at the frame's capture; disparity in px from the principal points. method: 'stereo', or 'size'
    where only the target's known height in the picture tells its distance.
    """

    distance: float
    sigma: float
    position: tuple[float, float, float]
    disparity_px: float
    method: str = "stereo"

    @property
    def bearing(self) -> float:
        """Direction of the position on the floor, positive left."""
        return math.atan2(self.position[1], self.position[0])

    @property
    def ground_distance(self) -> float:
        """Distance of the position from the robot's origin along the floor."""
        return math.hypot(self.position[0], self.position[1])


@dataclass(frozen=True, slots=True)
class Track:
    """Where the followed target is in the left image. confidence 0..1; lost means: do not act on the box."""

    box: Box
    velocity_px: tuple[float, float]
    confidence: float
    lost: bool


@dataclass(frozen=True, slots=True)
class Passage:
    """The opening through which there is most room to go, and whether what must pass may.

    For a hand: the largest circle that is open in the plane before it; `diameter` is the circle's. For a
    base: the opening between what stands beside its way, clear over the body's height; `diameter` is the
    clear width of its narrowest place, that of the largest upright cylinder that passes.
    centre: its middle (for a base at half the body's height), pixels of the left picture; radius_px: half the
    diameter as the left eye sees it there; diameter in metres; position of the centre in the robot frame (for
    a hand: as its finder says). sigma_diameter, sigma_position: standard deviations in metres, infinite where
    nobody told them.
    safe: what must pass fits with its margin, and the way to the opening is free. Doubt means not safe.
    """

    centre: tuple[float, float]
    radius_px: float
    diameter: float
    position: tuple[float, float, float]
    sigma_diameter: float = math.inf
    sigma_position: float = math.inf
    safe: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class FreeSpace:
    """What one look at the floor says about where the robot may drive. Robot frame at capture.

    bearings (N,) ascending; near, free (N,): the floor was seen free from `near` to `free` metres along
    each bearing (free <= near: nothing seen free there). obstacles (M, 2): points that stand up from the
    floor (or where it falls away). passage: the widest opening in the same picture, if any.
    """

    bearings: Points
    near: Points
    free: Points
    obstacles: Points
    passage: Passage | None = None


@dataclass(frozen=True, slots=True)
class Clearance:
    """How far the robot's own width is free along a straight corridor, from the obstacle map.

    distance from the robot's front edge in metres; limited_by is 'obstacle', 'unknown' or 'range'.
    """

    distance: float
    limited_by: str


@dataclass(frozen=True, slots=True)
class Timed(Generic[T]):
    """A percept and the capture time of the frame it comes from."""

    value: T
    at: float

    def age(self, now: float) -> float:
        """Seconds since the frame was captured."""
        return now - self.at


@dataclass(frozen=True, slots=True)
class Health:
    """Whether the picture can be trusted: mean brightness 0..255 and the fault it shows, if any."""

    brightness: float
    fault: str | None = None


@dataclass(frozen=True, slots=True)
class EgoMotion:
    """How the base moved between two pictures as the eyes saw it, beside what its wheels say.

    since: capture time of the earlier picture. wheels, eyes: the step on the floor, in the base's frame at
    that time. lift in metres, roll (left side up) and pitch (front down) in radians: what the eyes saw leave
    the floor. sigma: standard deviations of the eyes' step (x, y, yaw). deviation: how far both are apart in
    standard deviations of both (Mahalanobis distance in all six directions). points: how many were followed;
    inliers: how many of them move as `eyes` says; dissent: share that the wheels explain and `eyes` does not.
    """

    since: float
    wheels: Pose2
    eyes: Pose2
    lift: float
    roll: float
    pitch: float
    sigma: tuple[float, float, float]
    deviation: float
    points: int
    inliers: int
    dissent: float

    @property
    def inlier_share(self) -> float:
        """Share 0..1 of the points that move as the eyes' step says."""
        return self.inliers / max(self.points, 1)


@dataclass(frozen=True, slots=True)
class Percepts:
    """The newest result of every vision job; None where there is none yet.

    place is where the target was last seen, (x, y) in the odometry frame; it outlives a lost track.
    motion stays None, or old, where there is too little to be seen to say anything.
    better is what, while something was followed, looked more like the target than that.
    """

    health: Timed[Health] | None = None
    detections: Timed[tuple[Detection, ...]] | None = None
    track: Timed[Track] | None = None
    target: Timed[Range] | None = None
    place: Timed[tuple[float, float]] | None = None
    free_space: Timed[FreeSpace] | None = None
    motion: Timed[EgoMotion] | None = None
    better: Timed[Detection] | None = None


@dataclass(frozen=True, slots=True)
class Situation:
    """All a state may know when it decides: the time, what was seen, where wheels and head are."""

    now: float
    percepts: Percepts
    odometry: Odometry
    head: HeadPose


# ------------------------------------------------------------------------------- intents and commands


class Want(Enum):
    """Vision a state asks for. Free space and health are always watched and need no asking."""

    RECOGNIZE = "recognize"
    TRACK = "track"
    REVIEW = "review"


class Lamp(Enum):
    """What the lamp shall do."""

    OFF = "off"
    AUTO = "auto"
    ON = "on"


@dataclass(frozen=True, slots=True)
class Hold:
    """Stand still."""


@dataclass(frozen=True, slots=True)
class Turn:
    """Turn on the spot to a heading in the odometry frame."""

    heading: float


@dataclass(frozen=True, slots=True)
class Approach:
    """Keep the target at `stand_off` metres straight ahead; distance and bearing as last known."""

    distance: float
    bearing: float
    stand_off: float


@dataclass(frozen=True, slots=True)
class Follow:
    """Drive along a path, (N, 2) points in the odometry frame, to its end."""

    path: tuple[tuple[float, float], ...]


Motion = Hold | Turn | Approach | Follow


@dataclass(frozen=True, slots=True)
class Intent:
    """What a state wants done, for any body: where to look, how to move, what to see."""

    look: HeadPose = HeadPose()
    motion: Motion = Hold()
    wants: frozenset[Want] = frozenset()
    lamp: Lamp = Lamp.AUTO


@dataclass(frozen=True, slots=True)
class Event:
    """A reason to leave the state: the chart's event name, why in words, and the numbers behind it."""

    name: str
    reason: str
    evidence: Mapping[str, float | int | str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Command:
    """What the body asks of the devices; worthless after `expires_at`."""

    twist: Twist = Twist()
    head: HeadPose | None = None
    lamp: float = 0.0
    expires_at: float = 0.0


@dataclass(frozen=True, slots=True)
class Sent:
    """What was really sent to the devices, and why it differs from the command if it does."""

    twist: Twist
    head: HeadPose | None
    lamp: float
    limited_by: str | None = None


# --------------------------------------------------------------------------------------------- faults


@dataclass(frozen=True, slots=True)
class Fault:
    """Something is wrong with a device: which, since when, and what was seen."""

    device: str
    kind: str
    since: float
    evidence: str = ""

    @property
    def key(self) -> str:
        """'device.kind', the row of the fault table."""
        return f"{self.device}.{self.kind}"


# -------------------------------------------------------------------------------------------- records


@dataclass(frozen=True, slots=True)
class Transition:
    """A change of state: from where to where, on which event."""

    source: str
    target: str
    event: Event


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """Everything one control tick saw and did; what the record, the page and the referee are told."""

    now: float
    state: str
    view: View | None
    percepts: Percepts
    odometry: Odometry
    head: HeadPose
    intent: Intent
    sent: Sent
    faults: tuple[Fault, ...]
    transitions: tuple[Transition, ...]
