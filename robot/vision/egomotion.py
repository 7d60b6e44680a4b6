"""How the base really moved, by the eyes: corners with stereo depth, followed from picture to picture.

`EgoMotionEstimator.update(view)` is called with a picture now and then (5-8 times a second). It follows the
corners of the picture before into this one, starting where wheels and head say they must be, and fits the
rigid motion of the base that explains them (METHODS 5). What comes out stands beside the wheels' word, with
the distance between both in units of their common doubt; `robot.displacement` judges it.

The same is done with a picture of most of a second ago: slow hands move the base too little from one picture
to the next to stand out from the doubts, but most of these doubts do not grow with time. Corners are followed
over the long step directly, not summed up over the short ones: over one short step what stands still and what
creeps by itself look alike.

Too little texture, darkness, a head that swung too far or a wrong depth give no statement at all, never a
wrong one. What the wheels cannot know exactly (slip, the moment of reading, the head's encoders while it
turns) is in `Doubts`.
"""

from __future__ import annotations

import math
from collections import deque
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
LONG_GAP_S = (0.4, 0.9)
"""Of the long look: the oldest picture of this age is taken. Shorter than `displacement.STILL_S`: what was
over before the base counted as standing still must not be seen again."""
LONG_EVERY_S = 0.2
"""Between two long looks: every second picture is enough for slow hands, at half the cost."""
LARGEST_SWING, LONG_SWING = math.radians(40.0), math.radians(25.0)
"""Beyond this turn of the eyes between two pictures too little of the first is left in the second."""
LONG_WAY_M = 0.15
"""Driven farther, things near the eyes have grown too much to be followed over the long step."""
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
    uneven: float = 0.03
    """Share of the way by which floor and eyes may be out of level: driving on looks like rising a little."""
    head: float = math.radians(0.2)
    head_lag: float = 0.06
    """Share of a head's turn between both pictures that its reading may be wrong by."""


@dataclass(frozen=True, slots=True)
class Looks:
    """What one picture says of the base's motion: since the picture before, and since one well before that.

    None where nothing can be said.
    """

    short: EgoMotion | None = None
    long: EgoMotion | None = None


@dataclass(frozen=True, slots=True)
class _Driven:
    """What the wheels have done up to a picture: way and turn both ways summed up, and their newest speed."""

    way: float = 0.0
    turn: float = 0.0
    speed: Twist = Twist()

    def on(self, step: Pose2, seconds: float) -> _Driven:
        """After one more step; a picture of the same moment adds nothing."""
        if seconds <= 0.0:
            return self
        way = math.hypot(step.x, step.y)
        speed = Twist(way / seconds, step.yaw / seconds)
        return _Driven(self.way + way, self.turn + abs(step.yaw), speed)


@dataclass(frozen=True, slots=True, eq=False)
class _Landmarks:
    """Corners of one picture: where in it (N, 2), and where before the base (N, 3), robot frame then."""

    view: View
    grey: Grey
    pixels: Pixels
    points: Array
    driven: _Driven


class EgoMotionEstimator:
    """Compares each picture with the one before. Not thread-safe: one stage of vision owns it.

    rig: a parallel (rectified) pair; mount: where the head sits. doubts: how far wheels and head are trusted.
    """

    def __init__(self, rig: StereoRig, mount: HeadMount, doubts: Doubts | None = None) -> None:
        self._rig, self._mount = rig, mount
        self._doubts = doubts or Doubts()
        self._past: deque[_Landmarks] = deque()  # oldest first, none older than the long look reaches
        self._long_at = -math.inf

    def forget(self) -> None:
        """The next picture has none before it."""
        self._past.clear()

    def update(self, view: View, moving: Box | None = None) -> Looks:
        """The steps to this picture from the one before and from one of most of a second ago.

        moving: where in this picture something stands that may move by itself (the target); no corner is
        taken there.
        """
        now = self._survey(view, corners.grey(view.frame.left), moving)
        while self._past and _gap(self._past[0].view, view) > LONG_GAP_S[1]:
            self._past.popleft()
        looks = Looks(self._short(now), self._long(now))
        self._past.append(now)
        return looks

    def _short(self, now: _Landmarks) -> EgoMotion | None:
        before = self._past[-1] if self._past else None
        return self._compare(before, now) if before and _comparable(before.view, now.view) else None

    def _long(self, now: _Landmarks) -> EgoMotion | None:
        at = now.view.frame.captured_at
        earlier = next((past for past in self._past if _comparable_over_long(past.view, now.view)), None)
        if earlier is None or abs(at - self._long_at) < LONG_EVERY_S:
            return None
        self._long_at = at
        return self._compare(earlier, now)

    # ------------------------------------------------------------------------------------- landmarks

    def _survey(self, view: View, grey: Grey, moving: Box | None) -> _Landmarks:
        """Corners of this picture with their places."""
        driven = _Driven()
        if self._past:
            before = self._past[-1]
            driven = before.driven.on(_step(before.view.base, view.base), _gap(before.view, view))
        pixels = corners.corners(grey, moving)
        if not len(pixels):
            return _Landmarks(view, grey, pixels, np.zeros((0, 3)), driven)
        sight = self._sight(view.head)
        guess = pixels - np.column_stack([self._expected_disparity(pixels, sight), np.zeros(len(pixels))])
        right, good = corners.follow(grey, corners.grey(view.frame.right), pixels, guess.astype(np.float32))
        disparity = (pixels[:, 0] - right[:, 0]).astype(np.float64) + self._rig.doffs
        good &= (np.abs(pixels[:, 1] - right[:, 1]) <= ROW_SKEW_PX) & (disparity >= LEAST_DISPARITY_PX)
        points = _placed(pixels[good], self._rig.depth(disparity[good]), sight)
        return _Landmarks(view, grey, pixels[good], points, driven)

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

    def _compare(self, before: _Landmarks, now: _Landmarks) -> EgoMotion | None:
        if len(before.points) < LEAST_POINTS:
            return None
        view, grey = now.view, now.grey
        wheels = _step(before.view.base, view.base)
        doubt = self._doubt(before, now)
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
            or corners.cells(pixels[inlier], grey.shape) < LEAST_CELLS
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

    def _doubt(self, before: _Landmarks, now: _Landmarks) -> Array:
        """Covariance (6, 6) of the predicted motion: wheels, body and head, in the base's frame now."""
        doubts = self._doubts
        # At constant speed a late reading of the wheels does no harm.
        change_v = abs(now.driven.speed.v - before.driven.speed.v)
        change_w = abs(now.driven.speed.w - before.driven.speed.w)
        way, turn = now.driven.way - before.driven.way, now.driven.turn - before.driven.turn
        along = math.hypot(doubts.place, doubts.slip * way, doubts.moment * change_v)
        across = math.hypot(doubts.place, doubts.slip * way)
        height = math.hypot(doubts.height, doubts.uneven * way)
        heading = math.hypot(doubts.heading, doubts.slip * turn, doubts.moment * change_w)
        sigmas = np.array([along, across, height, doubts.lean, doubts.lean, heading])
        covariance = np.diag(sigmas**2)
        head, old = now.view.head, before.view.head
        pan = math.hypot(doubts.head, doubts.head_lag * (head.pan - old.pan))
        tilt = math.hypot(doubts.head, doubts.head_lag * (head.tilt - old.tilt))
        axis = np.array([-math.sin(head.pan), math.cos(head.pan), 0.0])
        for direction, sigma in ((np.array([0.0, 0.0, 1.0]), pan), (axis, tilt)):
            # Turning about the head's axes moves the base's origin against the eyes as well.
            arm = np.array([self._mount.forward, 0.0, self._mount.height])
            line = np.concatenate([-np.cross(direction, arm), direction])
            covariance += sigma**2 * np.outer(line, line)
        return np.asarray(covariance)


# ------------------------------------------------------------------------------------------- geometry


def _gap(before: View, now: View) -> float:
    return now.frame.captured_at - before.frame.captured_at


def _comparable(before: View, now: View) -> bool:
    return 0.0 < _gap(before, now) <= LONGEST_GAP_S and _swings_within(LARGEST_SWING, before, now)


def _comparable_over_long(before: View, now: View) -> bool:
    shortest, longest = LONG_GAP_S
    way = math.hypot(now.base.x - before.base.x, now.base.y - before.base.y)
    in_time = shortest <= _gap(before, now) <= longest
    return in_time and way <= LONG_WAY_M and _swings_within(LONG_SWING, before, now)


def _swings_within(most: float, before: View, now: View) -> bool:
    swing = wrap(now.base.yaw + now.head.pan - before.base.yaw - before.head.pan)
    return abs(swing) <= most and abs(now.head.tilt - before.head.tilt) <= most


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
