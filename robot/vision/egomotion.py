"""How the base really moved, by the eyes: corners with stereo depth, followed from picture to picture.

`EgoMotionEstimator.update(view)` is called with a picture now and then (5-8 times a second). It follows the
corners of the picture before into this one, starting where wheels and head say they must be, and fits the
rigid motion of the base that explains them (METHODS 5). What comes out stands beside the wheels' word, with
the distance between both in units of their common doubt; `robot.displacement` judges it.

Too little texture, darkness, a head that swung too far or a wrong depth give no statement at all, never a
wrong one. What the wheels cannot know exactly (slip, the moment of reading, the head's encoders while it
turns) is in `Doubts`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.model import HeadMount, StereoRig
from robot.messages import Box, EgoMotion, HeadPose, Pose2, Twist, View, wrap
from robot.vision import corners, rigid_fit
from robot.vision.corners import Grey, Pixels
from robot.vision.rigid_fit import Sight

Array = NDArray[np.float64]

ROW_SKEW_PX = 1.2
"""Rows by which left and right eye may differ for the same point."""
LEAST_DISPARITY_PX = 1.0
FOLLOW_SIGMA_PX, DISPARITY_SIGMA_PX, FOLLOW_SHARE = 0.3, 0.3, 0.01
"""Of a followed corner: where it stands still, of its disparity, and share of the pixels it has moved by."""
LEAST_POINTS, LEAST_CELLS = 16, 4
LEAST_SHARE = 0.5
INLIER_SIGMAS, WHEELS_SIGMAS = 4.0, 3.5
LONGEST_GAP_S = 0.45
LARGEST_SWING = math.radians(40.0)
"""Beyond this turn of the eyes between two pictures too little of the first is left in the second."""
GUESSED_DEPTH_M = 2.5
"""What lies above the horizon is looked for in the right eye as if it stood at this distance."""


@dataclass(frozen=True, slots=True)
class Doubts:
    """Standard deviations of what wheels and head say about one step. Metres, radians, seconds."""

    place: float = 0.003
    height: float = 0.004
    lean: float = math.radians(0.5)
    heading: float = math.radians(0.3)
    slip: float = 0.12
    """Share of the way, and of the turn, the wheels may slip."""
    moment: float = 0.03
    """Seconds between picture and reading of the wheels: counts where they change their speed."""
    head: float = math.radians(0.2)
    head_lag: float = 0.06
    """Share of a head's turn between both pictures that its reading may be wrong by."""


@dataclass(frozen=True, slots=True, eq=False)
class _Landmarks:
    """Corners of one picture: where in it (N, 2), and where before the base (N, 3), robot frame then."""

    view: View
    grey: Grey
    pixels: Pixels
    points: Array


class EgoMotionEstimator:
    """Compares each picture with the one before. Not thread-safe: one stage of vision owns it.

    rig: a parallel (rectified) pair; mount: where the head sits. doubts: how far wheels and head are trusted.
    """

    def __init__(self, rig: StereoRig, mount: HeadMount, doubts: Doubts | None = None) -> None:
        self._rig, self._mount = rig, mount
        self._doubts = doubts or Doubts()
        self._before: _Landmarks | None = None
        self._wheels = Twist()  # mean speed of the wheels between the last two pictures

    def forget(self) -> None:
        """The next picture has none before it."""
        self._before = None

    def update(self, view: View, moving: Box | None = None) -> EgoMotion | None:
        """The step from the picture before to this one; None where nothing can be said.

        moving: where in this picture something stands that may move by itself (the target); no corner is
        taken there.
        """
        grey = corners.grey(view.frame.left)
        before, self._before = self._before, self._survey(view, grey, moving)
        if before is None or not self._comparable(before.view, view):
            return None
        gap = view.frame.captured_at - before.view.frame.captured_at
        wheels = _step(before.view.base, view.base)
        driven = Twist(math.hypot(wheels.x, wheels.y) / gap, wheels.yaw / gap)
        change = Twist(abs(driven.v - self._wheels.v), abs(driven.w - self._wheels.w))
        self._wheels = driven
        return self._compare(before, view, grey, wheels, self._doubt(before.view, view, wheels, change))

    def _comparable(self, before: View, now: View) -> bool:
        gap = now.frame.captured_at - before.frame.captured_at
        swing = wrap(now.base.yaw + now.head.pan - before.base.yaw - before.head.pan)
        nod = now.head.tilt - before.head.tilt
        return 0.0 < gap <= LONGEST_GAP_S and abs(swing) <= LARGEST_SWING and abs(nod) <= LARGEST_SWING

    # ------------------------------------------------------------------------------------- landmarks

    def _survey(self, view: View, grey: Grey, moving: Box | None) -> _Landmarks:
        """Corners of this picture with their places."""
        pixels = corners.corners(grey, moving)
        if not len(pixels):
            return _Landmarks(view, grey, pixels, np.zeros((0, 3)))
        sight = self._sight(view.head)
        guess = pixels - np.column_stack([self._expected_disparity(pixels, sight), np.zeros(len(pixels))])
        right, good = corners.follow(grey, corners.grey(view.frame.right), pixels, guess.astype(np.float32))
        disparity = (pixels[:, 0] - right[:, 0]).astype(np.float64) + self._rig.doffs
        good &= (np.abs(pixels[:, 1] - right[:, 1]) <= ROW_SKEW_PX) & (disparity >= LEAST_DISPARITY_PX)
        points = _placed(pixels[good], self._rig.depth(disparity[good]), sight)
        return _Landmarks(view, grey, pixels[good], points)

    def _expected_disparity(self, pixels: Pixels, sight: Sight) -> Array:
        """Where the search in the right eye begins: the floor's disparity below, a far wall's above."""
        rays = _rays(pixels, sight)
        down = np.minimum(rays @ sight.rotation.T @ np.array([0.0, 0.0, 1.0]), -1e-6)
        depth = np.minimum(-sight.position[2] / down, GUESSED_DEPTH_M)
        return np.asarray(self._rig.left.fx * self._rig.baseline / depth - self._rig.doffs)

    def _sight(self, head: HeadPose) -> Sight:
        rotation, position = self._mount.left_eye(head.pan, head.tilt)
        eye = self._rig.left
        return Sight(eye.fx, eye.fy, eye.cx, eye.cy, rotation, position)

    # ------------------------------------------------------------------------------------ comparison

    def _compare(
        self, before: _Landmarks, view: View, grey: Grey, wheels: Pose2, doubt: Array
    ) -> EgoMotion | None:
        if len(before.points) < LEAST_POINTS:
            return None
        sight = self._sight(view.head)
        predicted = _into(before.points, wheels)
        guess = sight.project(predicted)[0].astype(np.float32)
        seen, good = corners.follow(before.grey, grey, before.pixels, guess)
        good &= corners.inside(seen, grey.shape)
        if int(good.sum()) < LEAST_POINTS:
            return None
        points, pixels = predicted[good], seen[good].astype(np.float64)
        way_px = float(np.median(np.hypot(*(seen[good] - before.pixels[good]).T)))
        sigma_px = self._sigma_px(before.view, view, way_px)
        fitted = rigid_fit.fit(points, pixels, sight, sigma_px)
        inlier = fitted.residuals <= INLIER_SIGMAS * sigma_px
        share = float(inlier.mean())
        if (
            share < LEAST_SHARE
            or inlier.sum() < LEAST_POINTS
            or corners.cells(pixels[inlier], grey.shape) < (LEAST_CELLS)
        ):
            return None
        far = np.linalg.solve(fitted.covariance + doubt, fitted.motion)
        apart = rigid_fit.explained(points, pixels, sight, doubt, sigma_px)
        x, y, z, roll, pitch, yaw = fitted.motion.tolist()
        sigma = np.sqrt(np.diag(fitted.covariance))
        return EgoMotion(
            since=before.view.frame.captured_at,
            wheels=wheels,
            eyes=wheels.compose(Pose2(x, y, yaw)),
            lift=z,
            roll=roll,
            pitch=pitch,
            sigma=(float(sigma[0]), float(sigma[1]), float(sigma[5])),
            deviation=math.sqrt(max(float(fitted.motion @ far), 0.0)),
            points=len(points),
            inliers=int(inlier.sum()),
            dissent=float(((apart <= WHEELS_SIGMAS) & ~inlier).mean()),
        )

    def _sigma_px(self, before: View, now: View, way_px: float) -> float:
        """Of a corner followed over `way_px`: following, and its depth's doubt seen from the new place."""
        _, old = self._mount.left_eye(before.head.pan, before.head.tilt)
        _, new = self._mount.left_eye(now.head.pan, now.head.tilt)
        moved = _into(old[None, :], _step(before.base, now.base))[0] - new
        by_depth = DISPARITY_SIGMA_PX * float(np.linalg.norm(moved)) / self._rig.baseline
        return math.hypot(FOLLOW_SIGMA_PX, by_depth, FOLLOW_SHARE * way_px)

    def _doubt(self, before: View, now: View, wheels: Pose2, change: Twist) -> Array:
        """Covariance (6, 6) of the predicted motion: wheels, body and head, in the base's frame now.

        change: of the wheels' speed since the step before; at constant speed a late reading does no harm.
        """
        doubts = self._doubts
        way, turn = math.hypot(wheels.x, wheels.y), abs(wheels.yaw)
        along = math.hypot(doubts.place, doubts.slip * way, doubts.moment * change.v)
        across = math.hypot(doubts.place, doubts.slip * way)
        heading = math.hypot(doubts.heading, doubts.slip * turn, doubts.moment * change.w)
        sigmas = np.array([along, across, doubts.height, doubts.lean, doubts.lean, heading])
        covariance = np.diag(sigmas**2)
        pan = math.hypot(doubts.head, doubts.head_lag * (now.head.pan - before.head.pan))
        tilt = math.hypot(doubts.head, doubts.head_lag * (now.head.tilt - before.head.tilt))
        axis = np.array([-math.sin(now.head.pan), math.cos(now.head.pan), 0.0])
        for direction, sigma in ((np.array([0.0, 0.0, 1.0]), pan), (axis, tilt)):
            # Turning about the head's axes moves the base's origin against the eyes as well.
            arm = np.array([self._mount.forward, 0.0, self._mount.height])
            line = np.concatenate([-np.cross(direction, arm), direction])
            covariance += sigma**2 * np.outer(line, line)
        return np.asarray(covariance)


# ------------------------------------------------------------------------------------------- geometry


def _rays(pixels: Pixels, sight: Sight) -> Array:
    """Directions (N, 3) in the camera's frame with depth 1."""
    u, v = pixels.astype(np.float64).T
    return np.column_stack([(u - sight.cx) / sight.fx, (v - sight.cy) / sight.fy, np.ones(len(u))])


def _placed(pixels: Pixels, depth: Array, sight: Sight) -> Array:
    return np.asarray((_rays(pixels, sight) * depth[:, None]) @ sight.rotation.T + sight.position)


def _step(before: Pose2, now: Pose2) -> Pose2:
    """The step from one pose to the other, in the frame of the first."""
    place = before.to_local(np.array([[now.x, now.y]]))[0]
    return Pose2(float(place[0]), float(place[1]), wrap(now.yaw - before.yaw))


def _into(points: Array, step: Pose2) -> Array:
    """Points (N, 3) given before a step in the frame after it."""
    return np.column_stack([step.to_local(points[:, :2]), points[:, 2]])
