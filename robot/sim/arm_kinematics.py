"""A six-axis arm of the 850 mm class: where the flange is for given joints, and the joints for a flange.

The figures are those of a DENSO VS-6577G as its data sheet draws them (lengths from memory, held against the
sheet's 854 mm of reach: 75 + 365 + hypot(405, 90) = 855 mm; joint speeds are of that class).
All joints zero: the arm points straight up, flange up. Joints 2, 3 and 5 lean it forward.

| joint | theta | d (m) | a (m) | alpha | range (deg) | speed (deg/s) |
|---|---|---|---|---|---|---|
| 1 | q1 | 0.335 | 0.075 | -90 | -170 .. 170 | 250 |
| 2 | q2 - 90 | 0 | 0.365 | 0 | -100 .. 135 | 187.5 |
| 3 | q3 + 90 | 0 | -0.090 | 90 | -119 .. 166 | 250 |
| 4 | q4 | 0.405 | 0 | -90 | -190 .. 190 | 300 |
| 5 | q5 | 0 | 0 | 90 | -120 .. 120 | 300 |
| 6 | q6 | 0.080 | 0 | 0 | -360 .. 360 | 480 |

The axes of joints 4, 5 and 6 meet in one point, so the inverse is in closed form (Pieper 1968; e.g. Siciliano
et al., Robotics, 2009, section 2.12): three joints by trigonometry for that point, three as ZYZ angles.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
Joints = tuple[float, ...]
Triple = tuple[float, float, float]

SHOULDER_HEIGHT: Final = 0.335
SHOULDER_FORWARD: Final = 0.075
UPPER_ARM: Final = 0.365
FOREARM: Final = 0.405
FOREARM_BACK: Final = 0.090
FLANGE: Final = 0.080

_DH: Final = (
    (0.0, SHOULDER_HEIGHT, SHOULDER_FORWARD, -math.pi / 2),
    (-math.pi / 2, 0.0, UPPER_ARM, 0.0),
    (math.pi / 2, 0.0, -FOREARM_BACK, math.pi / 2),
    (0.0, FOREARM, 0.0, -math.pi / 2),
    (0.0, 0.0, 0.0, math.pi / 2),
    (0.0, FLANGE, 0.0, 0.0),
)
LIMITS: Final = tuple(
    (math.radians(low), math.radians(high))
    for low, high in ((-170, 170), (-100, 135), (-119, 166), (-190, 190), (-120, 120), (-360, 360))
)
SPEEDS: Final = tuple(math.radians(speed) for speed in (250.0, 187.5, 250.0, 300.0, 300.0, 480.0))

# Elbow to wrist as the crow flies, and how far that leans back from the forearm's own direction.
_ELBOW_TO_WRIST: Final = math.hypot(FOREARM, FOREARM_BACK)
_LEAN: Final = math.atan2(FOREARM_BACK, FOREARM)
_SINGULAR: Final = 1e-9
_ROUNDING: Final = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """The flange in the base frame: position (3,) in metres, rotation (3, 3)."""

    position: Matrix
    rotation: Matrix

    @property
    def angles(self) -> Triple:
        """(rx, ry, rz) in radians with rotation = Rz(rz) Ry(ry) Rx(rx); rz 0 where only a sum is defined."""
        r = self.rotation
        ry = math.atan2(-r[2, 0], math.hypot(r[0, 0], r[1, 0]))
        if math.hypot(r[0, 0], r[1, 0]) < _SINGULAR:
            return math.atan2(-r[1, 2], r[1, 1]), ry, 0.0
        return math.atan2(r[2, 1], r[2, 2]), ry, math.atan2(r[1, 0], r[0, 0])


def pose_of(position: Triple, angles: Triple) -> Pose:
    """A pose from metres and (rx, ry, rz) in radians.

    >>> [round(angle, 9) for angle in pose_of((0.4, 0.0, 0.3), (0.1, -0.2, 0.3)).angles]
    [0.1, -0.2, 0.3]
    """
    (sx, sy, sz), (cx, cy, cz) = np.sin(angles), np.cos(angles)
    rotation = np.array(
        [
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ]
    )
    return Pose(np.array(position, dtype=np.float64), rotation)


def forward(joints: Joints) -> Pose:
    """The flange for six joint angles.

    >>> forward((0.0,) * 6).position.round(3).tolist()[0::2]
    [-0.015, 1.185]
    """
    frame = np.eye(4)
    for angle, (offset, d, a, alpha) in zip(joints, _DH, strict=True):
        frame = frame @ _link(angle + offset, d, a, alpha)
    return Pose(frame[:3, 3], frame[:3, :3])


def within_limits(joints: Joints) -> bool:
    """True if every joint is in its range."""
    return all(
        low - _ROUNDING <= q <= high + _ROUNDING for q, (low, high) in zip(joints, LIMITS, strict=True)
    )


def inverse(pose: Pose, near: Joints) -> Joints | None:
    """The joints within limits that reach the pose with the least turn of any joint from `near`.

    None if there are none: too far, too near, or beyond a joint's range.
    """
    best, least = None, math.inf
    for joints in _solutions(pose, near):
        turn = max(abs(a - b) for a, b in zip(joints, near, strict=True))
        if turn < least and within_limits(joints):
            best, least = joints, turn
    return best


def _solutions(pose: Pose, near: Joints) -> Iterator[Joints]:
    wrist = pose.position - FLANGE * pose.rotation[:, 2]
    across = math.hypot(wrist[0], wrist[1])
    bearing = math.atan2(wrist[1], wrist[0]) if across > _SINGULAR else near[0]
    for q1, out in ((bearing, across), (bearing + math.pi, -across)):
        for q2, q3 in _elbows(out - SHOULDER_FORWARD, float(wrist[2]) - SHOULDER_HEIGHT):
            turned = _first_three(q1, q2, q3).T @ pose.rotation
            for q4, q5, q6 in _wrists(turned, near):
                yield tuple(_nearest(q, i, near[i]) for i, q in enumerate((q1, q2, q3, q4, q5, q6)))


def _elbows(out: float, up: float) -> Iterator[tuple[float, float]]:
    """Joints 2 and 3 that bring the wrist `out` and `up` from the shoulder: elbow on either side."""
    cosine = (out**2 + up**2 - UPPER_ARM**2 - _ELBOW_TO_WRIST**2) / (2 * UPPER_ARM * _ELBOW_TO_WRIST)
    if abs(cosine) > 1.0 + _ROUNDING:
        return
    bend = math.acos(max(-1.0, min(1.0, cosine)))
    for gamma in (bend, -bend):
        lift = math.atan2(out, up) - math.atan2(
            _ELBOW_TO_WRIST * math.sin(gamma), UPPER_ARM + _ELBOW_TO_WRIST * math.cos(gamma)
        )
        yield lift, gamma + _LEAN


def _wrists(turned: Matrix, near: Joints) -> Iterator[tuple[float, float, float]]:
    """Joints 4, 5, 6 with Rz(q4) Ry(q5) Rz(q6) = turned; where 4 and 6 turn alike, 4 stays."""
    sine = math.hypot(turned[0, 2], turned[1, 2])
    if sine < _SINGULAR:
        q5 = 0.0 if turned[2, 2] > 0 else math.pi
        both = math.atan2(turned[1, 0], turned[1, 1])
        yield near[3], q5, both - near[3] if q5 == 0.0 else both + near[3]
        return
    q4 = math.atan2(turned[1, 2], turned[0, 2])
    q6 = math.atan2(turned[2, 1], -turned[2, 0])
    q5 = math.atan2(sine, turned[2, 2])
    yield q4, q5, q6
    yield q4 + math.pi, -q5, q6 + math.pi


def _nearest(angle: float, joint: int, near: float) -> float:
    """The angle, or it and whole turns, within the joint's range and next to `near`."""
    angle = near + math.remainder(angle - near, math.tau)
    low, high = LIMITS[joint]
    if angle > high + _ROUNDING and angle - math.tau >= low - _ROUNDING:
        return angle - math.tau
    if angle < low - _ROUNDING and angle + math.tau <= high + _ROUNDING:
        return angle + math.tau
    return angle


def _first_three(q1: float, q2: float, q3: float) -> Matrix:
    """Rotation of the third link: about the vertical, then forward by both arms' lean."""
    s1, c1, s, c = math.sin(q1), math.cos(q1), math.sin(q2 + q3), math.cos(q2 + q3)
    return np.array([[c1 * c, -s1, c1 * s], [s1 * c, c1, s1 * s], [-s, 0.0, c]])


def _link(theta: float, d: float, a: float, alpha: float) -> Matrix:
    st, ct, sa, ca = math.sin(theta), math.cos(theta), math.sin(alpha), math.cos(alpha)
    return np.array(
        [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0.0, sa, ca, d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
