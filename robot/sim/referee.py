"""The referee: knows the truth, hears what the robot claims, scores the mission. Not for robot code."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.messages import Box, Pose2
from robot.sim.builder import ROBOT_PARTS
from robot.sim.clearance import Clearances
from robot.sim.truth import Truth
from robot.sim.ways import length
from robot.sim.world import TICK_S, World

RIGHT_IOU = 0.3
"""Overlap from which a claimed box is the target."""
AT_DISTANCE = 0.2
"""Share by which the distance may differ from the stand-off."""
IN_VIEW_SHARE = 0.3
"""Share of the target that must be seen for it to count as in view."""
ASTRAY_S = 1.0
"""A claim that stays off the target this long is a false detection too."""
DETOUR_M = 0.1
"""A path that leaves the straight line by this is a detour."""
STANDING_M = 0.02
"""Who needs to drive no farther than this drives the shortest way."""
APART_S = 0.5
"""Touches of one thing nearer in time than this are one collision."""

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Claim:
    """What the robot says at one tick: it has (or has not) found the target, there, at that range.

    box in pixels of the left picture of frame `frame_seq`; range_m along the optical axis; gave_up: the
    search is over without success.
    """

    now: float
    state: str
    found: bool
    box: Box | None = None
    range_m: float | None = None
    frame_seq: int | None = None
    gave_up: bool = False


@dataclass(frozen=True, slots=True)
class Outline:
    """A thing seen from above: corners in the room frame, and what it is (a shape's name, 'distractor')."""

    kind: str
    corners: tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class Scenery:
    """What a top view of a run needs, room frame, metres: `start` turns odometry into room positions."""

    room: tuple[Point, ...]
    things: tuple[Outline, ...]
    start: Pose2
    robot_path: tuple[Point, ...]
    target_path: tuple[Point, ...]


class Referee:
    """Scores one run. Call `observe` once a tick, after `world.step()`."""

    def __init__(self, world: World) -> None:
        self._world, self._scene = world, world.scene
        self._truth = Truth(world)
        self._clearances = Clearances(world)
        self._now = 0.0
        self._path: list[Point] = []
        self._target_path: list[Point] = []
        self._path_length = 0.0
        self._found_at: float | None = None
        self._reached: tuple[float, Point] | None = None
        self._reached_length = 0.0
        self._ticks_since_found = self._ticks_in_view = self._ticks_at_distance = 0
        self._held = 0.0
        self._gave_up = False
        self._claiming = False
        self._episode_right: bool | None = None
        self._astray_since: float | None = None
        self._false_detections = 0
        self._range_errors: list[float] = []
        self._judged_seq = -1
        self._collisions: list[str] = []
        self._touched_at: dict[str, float] = {}
        self._blocked = self._straight_way_blocked()
        self._walk()

    def observe(self, claim: Claim) -> None:
        """Take note of one tick: where everything is, and what the robot says."""
        self._now = self._world.now
        self._walk()
        self._note_touches()
        self._clearances.note()
        self._gave_up = self._gave_up or claim.gave_up
        self._judge(claim)
        if self._found_at is not None:
            self._note_following()

    @property
    def done(self) -> bool:
        """True once the mission is fulfilled or its time is over."""
        return self._fulfilled or self._now >= self._scene.duration_s - 1e-9

    def report(self) -> dict[str, float | int | str | bool | None]:
        """The score so far; metres, seconds, shares 0..1; None where there is nothing to tell."""
        success, reason = self._verdict()
        errors = self._range_errors
        since = self._ticks_since_found
        clearance = self._clearances.smallest
        return {
            "success": success,
            "reason": reason,
            "scene": self._scene.name,
            "seed": self._world.seed,
            "expect": self._scene.expect,
            "duration_s": round(self._now, 2),
            "found_s": None if self._found_at is None else round(self._found_at, 2),
            "reached_s": None if self._reached is None else round(self._reached[0], 2),
            "held_s": round(self._held, 2),
            "gave_up": self._gave_up,
            "range_error_median": round(float(np.median(errors)), 4) if errors else None,
            "range_samples": len(errors),
            "in_view": round(self._ticks_in_view / since, 4) if since else None,
            "at_distance": round(self._ticks_at_distance / since, 4) if since else None,
            "path_length": round(self._path_length, 3),
            "shortest_length": self._shortest(),
            "spl": self._spl(success),
            "collisions": len(self._collisions),
            "collided_with": ", ".join(dict.fromkeys(self._collisions)),
            "clearance_min": None if math.isinf(clearance) else round(clearance, 4),
            "false_detections": self._false_detections,
            "detour_needed": self._blocked,
            "detour_taken": self._detour_taken(),
        }

    def scenery(self) -> Scenery:
        """The room, everything in it, and both paths so far."""
        layout = self._world.layout
        half = layout.width / 2
        things = [Outline(b.shape, s.outline) for b in layout.bodies for s in b.solids]
        things += [Outline("distractor", s.outline) for s in layout.solids[len(things) :]]
        return Scenery(
            room=((0.0, -half), (layout.length, -half), (layout.length, half), (0.0, half)),
            things=tuple(things),
            start=layout.start,
            robot_path=tuple(self._path),
            target_path=tuple(self._target_path),
        )

    def true_range(self, frame_seq: int, box: Box) -> float | None:
        """Depth (camera z, metres) of the surface at the box's centre when that frame was captured.

        None if nothing is there or the frame is longer ago than the world remembers.
        """
        moment = self._world.moment_of(frame_seq)
        if moment is None:
            return None
        hit = self._truth.range_at(moment, *box.centre)
        return None if hit is None else hit[0]

    def true_box(self, frame_seq: int) -> Box | None:
        """The box around what was visible of the target in that frame's left picture, if anything was."""
        moment = self._world.moment_of(frame_seq)
        return None if moment is None else self._truth.visible(moment)[0]

    # -------------------------------------------------------------------------------------- one tick's notes

    def _walk(self) -> None:
        robot, target = self._world.robot_pose, self._world.target_pose
        here = (robot.x, robot.y)
        if self._path:
            self._path_length += math.dist(self._path[-1], here)
        self._path.append(here)
        if target is not None:
            self._target_path.append((target.x, target.y))

    def _note_touches(self) -> None:
        for name in sorted(self._world.touched):
            thing = name.split("_")[0] if name not in ROBOT_PARTS else name
            if self._now - self._touched_at.get(thing, -math.inf) > APART_S:
                self._collisions.append(thing)
            self._touched_at[thing] = self._now

    def _judge(self, claim: Claim) -> None:
        if not claim.found or claim.box is None:
            self._claiming, self._episode_right, self._astray_since = False, None, None
            return
        seq = self._world.moment.seq if claim.frame_seq is None else claim.frame_seq
        moment = self._world.moment_of(seq)
        if moment is None or (self._claiming and seq == self._judged_seq):
            return
        self._judged_seq, self._claiming = seq, True
        visible, _ = self._truth.visible(moment)
        full = self._truth.full_box(moment)
        right = visible is not None and visible.iou(claim.box) >= RIGHT_IOU
        touches = any(box is not None and box.iou(claim.box) > 0.0 for box in (visible, full))
        self._count_false(touches, self._now)
        if right:
            self._found_at = self._now if self._found_at is None else self._found_at
            self._note_range(seq, claim)

    def _count_false(self, touches: bool, now: float) -> None:
        """An episode is false if its first box misses the target, or if it goes astray for good."""
        if touches:
            self._episode_right, self._astray_since = True, None
        elif self._episode_right is None:
            self._episode_right = False
            self._false_detections += 1
        elif self._episode_right:
            self._astray_since = now if self._astray_since is None else self._astray_since
            if now - self._astray_since >= ASTRAY_S:
                self._episode_right = False
                self._false_detections += 1

    def _note_range(self, seq: int, claim: Claim) -> None:
        if claim.range_m is None or claim.box is None:
            return
        truth = self.true_range(seq, claim.box)
        if truth is not None:
            self._range_errors.append(abs(claim.range_m - truth) / truth)

    def _note_following(self) -> None:
        moment = self._world.moment
        box, share = self._truth.visible(moment)
        in_view = box is not None and share >= IN_VIEW_SHARE
        self._ticks_since_found += 1
        self._ticks_in_view += in_view
        if box is None or not in_view:
            return
        hit = self._truth.range_at(moment, *box.centre)
        stand_off = self._scene.stand_off_m
        if hit is None or abs(hit[0] - stand_off) > AT_DISTANCE * stand_off:
            return
        self._ticks_at_distance += 1
        target = moment.target
        if self._reached is None and target is not None:
            self._reached = (self._now, (target.x, target.y))
            self._reached_length = self._path_length
        if self._world.target_at_rest or not self._scene.hold_after_motion:
            self._held += TICK_S

    # ----------------------------------------------------------------------------------------- the verdict

    @property
    def _fulfilled(self) -> bool:
        if self._scene.expect == "not found":
            return self._gave_up
        return (
            self._found_at is not None
            and self._reached is not None
            and self._held >= self._scene.hold_s - 1e-9
        )

    def _verdict(self) -> tuple[bool, str]:
        """Success, and a plain sentence that says why or why not."""
        if self._collisions:
            return False, f"the robot touched {self._collisions[0]}"
        if self._scene.expect == "not found":
            return self._verdict_empty()
        if self._found_at is None:
            return False, "the target was not found"
        if self._reached is None:
            return False, f"found after {self._found_at:.1f} s, but the set distance was never reached"
        if not self._fulfilled:
            return False, f"followed at the set distance for {self._held:.1f} s of {self._scene.hold_s:.1f} s"
        return (
            True,
            f"found after {self._found_at:.1f} s and followed at the set distance for {self._held:.1f} s",
        )

    def _verdict_empty(self) -> tuple[bool, str]:
        if self._false_detections or self._found_at is not None:
            return False, "something was taken for the target, which is not there"
        if not self._gave_up:
            return False, "the robot did not report that the target is not there"
        return True, "reported 'not found', and rightly so"

    def _straight_way_blocked(self) -> bool:
        layout = self._world.layout
        if layout.target is None:
            return False
        start, target = layout.start, layout.target.pose
        return layout.ways.corridor_blocked((start.x, start.y), (target.x, target.y), self._scene.stand_off_m)

    def _shortest(self) -> float | None:
        if self._reached is None:
            return None
        start = self._world.layout.start
        way = self._world.layout.ways.shortest_way(
            (start.x, start.y), self._reached[1], self._scene.stand_off_m
        )
        return None if way is None else round(length(way), 3)

    def _spl(self, success: bool) -> float:
        """Success weighted by path length (Anderson et al. 2018): shortest / max(driven, shortest)."""
        shortest = self._shortest()
        if self._scene.expect == "not found":
            return float(success)
        if not success or shortest is None:
            return 0.0
        longest = max(self._reached_length, shortest)
        return round(shortest / longest, 4) if longest > STANDING_M else 1.0

    def _detour_taken(self) -> bool:
        """True if the straight way was blocked, and the robot got there by leaving the straight line."""
        if not self._blocked or self._reached is None or self._collisions:
            return False
        start, (x, y) = self._path[0], self._reached[1]
        reach = math.dist(start, (x, y))
        if reach < 1e-6:
            return False
        path = np.array(self._path) - start
        off = np.abs(path[:, 0] * (y - start[1]) - path[:, 1] * (x - start[0])) / reach
        return bool(off.max() >= DETOUR_M)
