"""Vision as jobs: `submit` a view and what is wanted, `collect` the newest percepts. Never waits.

Which stage runs when follows from its rate; the governor lowers rates when there is not time for all.
The obstacle map is kept here because every look at the floor changes it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from calib.model import HeadMount, StereoRig
from robot import displacement
from robot.config import Config
from robot.displacement import Displacement
from robot.looker import Looker, Recognizes
from robot.messages import (
    Clearance,
    Detection,
    EgoMotion,
    Fault,
    FreeSpace,
    Health,
    Percepts,
    Pose2,
    Timed,
    Twist,
    View,
    Want,
    wrap,
)
from robot.nav.grid import ObstacleMap
from robot.reviewer import Reviewer
from robot.target import TargetFollower, TargetSight
from robot.target_range import TargetRanger
from robot.vision import health, misrectified
from robot.vision.egomotion import EgoMotionEstimator, Looks
from robot.vision.free_way import FreeWayFinder
from robot.vision.misrectified import Rectification
from robot.vision.pair_check import PairCheck, check_pair
from robot.vision.section import BoxSection
from robot.vision.stereo import AdaptiveWeightMatcher
from robot.vision_schedule import Budget, VisionSchedule
from robot.workers import Job, Result, Worker

STAGES = ("track", "free_space", "motion", "health", "review", "recognize")
ALWAYS = ("free_space", "motion", "health")
CLEARANCE_RANGE = 1.5  # metres the guard looks ahead: farther than any stopping distance
GRAZE_MARGIN = 0.02  # metres kept beside the body, a map cell's half
FLOOR_MEMORY = 30.0  # seconds for which floor seen free stays known
HANDS_WIDTH = 0.2  # metres about the robot that must be free where it is put down; its eyes cannot see there
FRESH_BOX = 0.3  # seconds for which a track's box still says where the target is
SEED_LIFE = 1.0  # seconds for which a detection may start a track


@dataclass(frozen=True, slots=True)
class Rival:
    """What a review found: something more like the target than what is followed."""

    detection: Detection


class Perception:
    """Owns matcher, recogniser, tracker and map; turns views into percepts."""

    def __init__(
        self,
        config: Config,
        rig: StereoRig,
        mount: HeadMount,
        recognizer: Recognizes,
        worker: Worker,
        obstacle_map: ObstacleMap,
        height_m: float | None = None,
    ) -> None:
        self._config = config
        self._rig = rig
        self._mount = mount
        self._recognizer = recognizer
        self._worker = worker
        self.map = obstacle_map
        self._ways = FreeWayFinder(
            rig,
            mount,
            BoxSection(2.0 * config.base.radius_m, config.base.body_height_m),
            AdaptiveWeightMatcher.floors(config.vision.disparities),
            config.safety.step_height_m,
        )
        ranger = TargetRanger(rig, mount, height_m)
        self._looker = Looker(rig, recognizer, ranger)
        self._follower = TargetFollower(rig, recognizer, ranger)
        self._reviewer = Reviewer(rig, recognizer, ranger)
        self._motion = EgoMotionEstimator(rig, mount)
        self._displacement = Displacement()
        self._long_look: Timed[EgoMotion] | None = None
        self._percepts = Percepts()
        self._seed: tuple[View, Detection] | None = None
        self._previous: View | None = None
        self._swapped = False
        self._rectification = Rectification()
        self._checked: View | None = None
        self._wants: frozenset[Want] = frozenset()
        self._late_since: float | None = None
        stages = {name: getattr(config.vision, name) for name in STAGES}
        self._schedule = VisionSchedule(stages, config.vision.max_load)
        self._errors: dict[str, Fault] = {}

    # ------------------------------------------------------------------------------------ in and out

    def submit(self, view: View, wants: frozenset[Want], now: float) -> None:
        """Check the picture and start the stages that are due on it, if vision is idle."""
        self._wants = wants
        if Want.TRACK not in wants and self._follower.active:
            self._drop_track()
        if self._check_picture(view) is not None or not self._worker.idle(now):
            return
        # With exchanged eyes nothing may be measured; only whether they still are is looked at.
        active = ["health"] if self._swapped else self._active(wants)
        stages = self._schedule.due(active, self.budget(wants).rates_hz, now)
        self._schedule.begun(stages, now)
        if stages:
            self._worker.submit([Job(name, view, self._stage(name)) for name in stages], now)

    def collect(self, now: float) -> Percepts:
        """The newest percepts; each carries the capture time of its frame."""
        for result in self._worker.collect(now):
            self._account(result)
            if result.error is None:
                self._take(result)
        self._judge_displacement(now)
        return self._percepts

    def forget_target(self) -> None:
        """Drop the track: after teleop or a fault it is stale. The place stays, as a hint for the search."""
        self._drop_track()
        self._seed = None
        self._percepts = replace(self._percepts, detections=None, better=None)

    def forget_place(self) -> None:
        """Begin the map anew where the base stands: nobody knows any more how it got there.

        The floor about the body counts as free, as it does where the robot is set down at the start. Track,
        the target's place and the newest free space go as well: they are given in places that are no more.
        """
        self.map.clear()
        if self._previous is not None:
            at = self._previous.frame.captured_at
            self.map.start_disc(self._previous.base, self._config.base.radius_m + HANDS_WIDTH, at)
        self.forget_target()
        self._percepts = replace(self._percepts, place=None, free_space=None)

    def set_down(self) -> None:
        """A person says, by arming, that the base stands on the floor: it is waited for no longer."""
        self._displacement = displacement.set_down(self._displacement)

    def faults(self, now: float) -> tuple[Fault, ...]:
        """Errors inside vision, lateness as long as rates are lowered, a base that was moved."""
        found = [*self._errors.values(), *displacement.faults(self._displacement)]
        found += misrectified.faults(self._rectification)
        budget = self.budget(self._wants)
        if not budget.lowered:
            self._late_since = None
            return tuple(found)
        self._late_since = now if self._late_since is None else self._late_since
        rates = ", ".join(f"{name} {rate:.1f}/s" for name, rate in sorted(budget.rates_hz.items()))
        return (*found, Fault("vision", "late", self._late_since, rates))

    def budget(self, wants: frozenset[Want]) -> Budget:
        """The rates in force for these wants."""
        return self._schedule.budget(self._active(wants))

    def clearance(self, pose: Pose2, twist: Twist, now: float) -> Clearance:
        """How far the way of this twist is free, by the map."""
        return self.map.arc_clearance(
            pose, twist, self._config.base.radius_m + GRAZE_MARGIN, CLEARANCE_RANGE, now, FLOOR_MEMORY
        )

    def may_turn(self, pose: Pose2) -> bool:
        """True if nothing stands within the circle the body turns in."""
        return self.map.disc_free(pose, self._config.base.radius_m)

    def close(self) -> None:
        """Stop the worker."""
        self._worker.close()

    # -------------------------------------------------------------------------------------- schedule

    def _active(self, wants: frozenset[Want]) -> list[str]:
        asked = {want.value for want in wants}
        return [name for name in STAGES if name in asked or name in ALWAYS]

    def _account(self, result: Result) -> None:
        self._schedule.account(result.stage, result.seconds)
        if result.error is not None:
            at = result.view.frame.captured_at
            self._errors[result.stage] = Fault("vision", "error", at, f"{result.stage}: {result.error}")

    # ---------------------------------------------------------------------------------------- stages

    def _stage(self, name: str) -> Callable[[View], object]:
        stages: dict[str, Callable[[View], object]] = {
            "track": self._track,
            "free_space": self._free_space,
            "motion": self._moved,
            "health": self._health,
            "review": self._review,
            "recognize": self._recognize,
        }
        return stages[name]

    def _track(self, view: View) -> TargetSight | None:
        if not self._follower.following and self._seed is not None:
            seed_view, detection = self._seed
            if view.frame.captured_at - seed_view.frame.captured_at <= SEED_LIFE:
                self._follower.start(seed_view, detection)
        self._seed = None
        return self._follower.update(view)

    def _free_space(self, view: View) -> FreeSpace:
        return self._ways(view.frame.left, view.frame.right, view.head.pan, view.head.tilt)

    def _moved(self, view: View) -> Looks:
        track = self._percepts.track  # the target may move by itself: what it shows says nothing of the base
        fresh = track is not None and not track.value.lost and track.age(view.frame.captured_at) <= FRESH_BOX
        return self._motion.update(view, track.value.box if track is not None and fresh else None)

    def _health(self, view: View) -> PairCheck:
        return check_pair(view.frame.left, view.frame.right, self._rig)

    def _review(self, view: View) -> Rival | None:
        if not self._follower.following or self._follower.box is None:
            return None
        better = self._reviewer.review(view, self._follower.box)
        return Rival(better) if better is not None else None

    def _recognize(self, view: View) -> tuple[Detection, ...]:
        return self._looker.look(view)

    # --------------------------------------------------------------------------------------- results

    def _take(self, result: Result) -> None:
        """Put one stage's value into the percepts, and into the map if it is about the floor."""
        at = result.view.frame.captured_at
        match result.value:
            case TargetSight() as sight:
                self._take_sight(sight, result.view)
            case FreeSpace() as free:
                self.map.update(free, result.view.base, at)
                self._percepts = replace(self._percepts, free_space=Timed(free, at))
            case Looks(short=short, long=long):
                if short is not None:
                    self._percepts = replace(self._percepts, motion=Timed(short, at))
                self._long_look = Timed(long, at) if long is not None else self._long_look
            case PairCheck() as check:
                self._take_check(check, result.view)
            case Rival(detection=rival):
                self._percepts = replace(
                    self._percepts, better=Timed(rival, at), detections=Timed((rival,), at)
                )
            case tuple() as detections:
                self._percepts = replace(self._percepts, detections=Timed(detections, at))
                if detections:
                    self._seed = (result.view, detections[0])

    def _take_check(self, check: PairCheck, view: View) -> None:
        """Whether the pair is what stereo takes it for. Eyes that turned meanwhile prove nothing of rows."""
        self._swapped = check.swapped
        at, before, self._checked = view.frame.captured_at, self._checked, view
        if before is None or at <= before.frame.captured_at:
            return
        turned = wrap(view.base.yaw + view.head.pan - before.base.yaw - before.head.pan)
        rate = max(abs(turned), abs(view.head.tilt - before.head.tilt)) / (at - before.frame.captured_at)
        self._rectification = misrectified.updated(self._rectification, check, at, rate)

    def _take_sight(self, sight: TargetSight, view: View) -> None:
        if not self._follower.active:
            return  # the track was dropped while this result was on its way
        at = view.frame.captured_at
        self._percepts = replace(self._percepts, track=Timed(sight.track, at))
        if sight.range is None:
            return
        x, y, _ = sight.range.position
        place = view.base.to_world(np.array([[x, y]]))[0]
        self._percepts = replace(
            self._percepts, target=Timed(sight.range, at), place=Timed((float(place[0]), float(place[1])), at)
        )

    def _judge_displacement(self, now: float) -> None:
        """Hold the eyes against the wheels; once a moved base stands again, its old place is forgotten."""
        before = self._displacement
        self._displacement = displacement.updated(before, self._percepts.motion, now, self._long_look)
        if before.told and not self._displacement.told:
            self.forget_place()

    def _drop_track(self) -> None:
        self._follower.drop()
        self._percepts = replace(self._percepts, track=None, target=None)

    def _check_picture(self, view: View) -> str | None:
        """The cheap checks every picture must pass before any stage sees it; returns what it fails of."""
        previous = self._previous.frame if self._previous is not None else None
        fault = health.picture_fault(view.frame, previous)
        if view.frame.left.shape[:2] != (self._rig.left.height, self._rig.left.width):
            fault = "size"
        self._previous = view
        told = "swapped" if fault is None and self._swapped else fault
        brightness = health.brightness(view.frame.left)
        self._percepts = replace(
            self._percepts, health=Timed(Health(brightness, told), view.frame.captured_at)
        )
        return fault
