"""Vision as jobs: what runs when, what a result changes, what a bad picture or a late result must not."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from calib.model import HeadMount, StereoRig
from robot.config import Config
from robot.messages import (
    Box,
    Detection,
    EgoMotion,
    Fault,
    FreeSpace,
    HeadPose,
    Image,
    Pose2,
    StereoFrame,
    Twist,
    View,
    Want,
)
from robot.nav.grid import ObstacleMap
from robot.perception import HANDS_WIDTH, SEED_LIFE, STAGES, Perception
from robot.vision.egomotion import Looks
from robot.vision.pair_check import PairCheck
from robot.vision.textures import texture
from robot.vision_schedule import BATCH_BUDGET, VisionSchedule
from robot.workers import Job, Result, run

TICK = 0.04
CONFIG = Config()
RIG = StereoRig.parallel(352, 288, 305.0, 0.06)
DISPARITY_PX = 12
DEPTH = 305.0 * 0.06 / DISPARITY_PX
BOX = Box(140.0, 100.0, 60.0, 70.0)
WALL = texture((352 + DISPARITY_PX, 288), np.random.default_rng(3))
NONE: frozenset[Want] = frozenset()
SEARCHING = frozenset({Want.RECOGNIZE})
TRACKING = frozenset({Want.TRACK})
REVIEWING = frozenset({Want.TRACK, Want.REVIEW})
BOTH = SEARCHING | TRACKING
CONFIGURED = {name: getattr(CONFIG.vision, name) for name in STAGES}


def view(at: float, *, head: HeadPose | None = None, base: Pose2 | None = None) -> View:
    """The wall as both eyes see it; one pixel differs from frame to frame, as a live sensor's would."""
    seq = round(at / TICK)
    left = WALL[:, :352].copy()
    right = WALL[:, DISPARITY_PX:].copy()
    left[0, 0] = right[0, 0] = seq % 251
    return View(StereoFrame(left, right, at, seq), head or HeadPose(), base or Pose2())


class Recogniser:
    """Sees the target where the test says."""

    def __init__(self) -> None:
        self.places: list[Box] = []
        self.error: Exception | None = None
        self.followed = 0.9

    def predict(self, image: Image, heights_px: Sequence[float] | None = None) -> list[Detection]:
        if self.error is not None:
            raise self.error
        return [self.refine(image, place) for place in self.places]

    def glance(self, image: Image, heights_px: Sequence[float]) -> list[Detection]:
        return self.predict(image)

    def refine(self, image: Image, box: Box) -> Detection:
        return Detection(box, 0.9 if box in self.places else 0.1, "box")

    def score(self, image: Image, box: Box) -> float:
        return self.followed


class HandWorker:
    """Keeps what it is given until the test finishes it."""

    def __init__(self) -> None:
        self.free = True
        self.batches: list[list[Job]] = []
        self.closed = False
        self._done: list[Result] = []

    def idle(self, now: float) -> bool:
        return self.free

    def submit(self, jobs: Sequence[Job], now: float) -> None:
        assert self.free, "a batch was given to a busy worker"
        self.batches.append(list(jobs))

    def collect(self, now: float) -> list[Result]:
        done, self._done = self._done, []
        return done

    def close(self) -> None:
        self.closed = True

    def finish(self, job: Job, value: object = None, *, seconds: float | None = None) -> None:
        """The job gives this value."""
        cost = CONFIGURED[job.stage].cost_s if seconds is None else seconds
        self._done.append(Result(job.stage, job.view, value, cost))

    def run(self, job: Job) -> None:
        """The job really runs."""
        self._done.append(run(job, CONFIGURED[job.stage].cost_s))


class Bench:
    """Perception with a worker and a recogniser in the test's hands."""

    def __init__(self) -> None:
        self.worker, self.recogniser = HandWorker(), Recogniser()
        self.perception = Perception(CONFIG, RIG, HeadMount(), self.recogniser, self.worker, ObstacleMap())

    def job(self, stage: str, seen: View, wants: frozenset[Want]) -> Job:
        """That stage's job on that view, submitted as its turn comes (earlier looks at the same moment)."""
        for _ in range(len(STAGES)):
            self.perception.submit(seen, wants, seen.frame.captured_at)
            for job in self.worker.batches[-1] if self.worker.batches else ():
                if job.stage == stage and job.view is seen:
                    return job
        raise AssertionError(f"{stage} never had its turn")

    def do(self, stage: str, seen: View, wants: frozenset[Want]) -> None:
        """Let a stage run on a view, and collect its result."""
        self.worker.run(self.job(stage, seen, wants))
        self.perception.collect(seen.frame.captured_at)

    def drive(
        self, seconds: float, wants: frozenset[Want], costs: Mapping[str, float], begin: float = 0.0
    ) -> Counter[str]:
        """A frame a tick; every batch is finished at once at these costs. Returns each stage's runs."""
        first = len(self.worker.batches)
        for tick in range(1, round(seconds / TICK) + 1):
            now = round(begin + tick * TICK, 9)
            before = len(self.worker.batches)
            self.perception.submit(view(now), wants, now)
            for job in self.worker.batches[before] if len(self.worker.batches) > before else ():
                self.worker.finish(job, seconds=costs[job.stage])
            self.perception.collect(now)
            self.perception.faults(now)
        return Counter(job.stage for batch in self.worker.batches[first:] for job in batch)


COSTS = {name: stage.cost_s for name, stage in CONFIGURED.items()}


# ------------------------------------------------------------------------------------------- schedule


def test_every_wanted_stage_runs_at_its_rate() -> None:
    counts = Bench().drive(10.0, TRACKING, COSTS)
    assert set(counts) == {"track", "free_space", "motion", "health"}
    for name, count in counts.items():
        assert count == pytest.approx(10.0 * CONFIGURED[name].rate_hz, rel=0.15), name


def test_what_is_not_wanted_does_not_run_but_the_guards_needs_always_do() -> None:
    assert set(Bench().drive(2.0, NONE, COSTS)) == {"free_space", "motion", "health"}
    assert "recognize" in Bench().drive(2.0, SEARCHING, COSTS)
    assert "track" not in Bench().drive(2.0, SEARCHING, COSTS)


def test_a_late_health_check_does_not_cost_the_track_a_picture() -> None:
    """Floor, health and track together are longer than a tick: of these, health waits."""
    together = sum(COSTS[name] for name in ("free_space", "health", "track"))
    assert together > BATCH_BUDGET >= COSTS["free_space"] + COSTS["track"], "this is what the test is about"
    plan = VisionSchedule(CONFIGURED, max_load=0.9)
    rates = plan.budget(("track", "free_space", "health")).rates_hz
    plan.begun(["track"], 0.96)
    plan.begun(["free_space"], 0.8)
    assert plan.due(("track", "free_space", "health"), rates, 1.0) == ["track", "health"]
    plan.begun(["track", "health"], 1.0)
    assert plan.due(("track", "free_space", "health"), rates, 1.17) == ["track", "free_space"]


def test_a_batch_fits_into_one_tick_or_is_a_single_stage() -> None:
    bench = Bench()
    counts = bench.drive(6.0, BOTH, COSTS)
    assert counts["recognize"] >= 6.0 * 0.75 * CONFIGURED["recognize"].rate_hz, (
        "longer than a tick, yet it runs"
    )
    for batch in bench.worker.batches:
        assert len(batch) == 1 or sum(COSTS[job.stage] for job in batch) <= BATCH_BUDGET + 1e-9
        assert len({job.stage for job in batch}) == len(batch)


def test_the_most_overdue_stage_comes_first() -> None:
    bench = Bench()
    bench.drive(2.0, NONE, COSTS)
    last = {job.stage: job.view.frame.captured_at for batch in bench.worker.batches for job in batch}
    now = 2.0 + 10 * TICK
    bench.perception.submit(view(now), NONE, now)
    overdue = {name: (now - at) * CONFIGURED[name].rate_hz for name, at in last.items()}
    order = [job.stage for job in bench.worker.batches[-1]]
    assert order[0] == max(overdue, key=lambda name: overdue[name])
    assert [overdue[name] for name in order] == sorted((overdue[n] for n in order), reverse=True)


def test_what_had_no_place_in_a_batch_comes_with_the_next_frame() -> None:
    bench = Bench()
    for tick in (1, 2, 3):
        bench.perception.submit(view(tick * TICK), BOTH, tick * TICK)
    started = [{job.stage for job in batch} for batch in bench.worker.batches]
    assert set.union(*started) == set(STAGES) - {"review"}, "nobody asked for a review"


def test_a_busy_worker_is_given_nothing() -> None:
    bench = Bench()
    bench.worker.free = False
    bench.perception.submit(view(TICK), BOTH, TICK)
    assert bench.worker.batches == []
    bench.worker.free = True
    bench.perception.submit(view(2 * TICK), BOTH, 2 * TICK)
    assert bench.worker.batches[0][0].view.frame.seq == 2, "the newest frame, not the missed one"


# ------------------------------------------------------------------------------------------- governor


def test_slow_stages_lower_the_rates_say_so_and_leave_the_guards_needs_alone() -> None:
    bench = Bench()
    bench.drive(2.0, BOTH, COSTS)
    assert bench.perception.faults(2.0) == ()
    slow = {name: 3.0 * cost for name, cost in COSTS.items()}
    counts = bench.drive(8.0, BOTH, slow, begin=2.0)
    (late,) = bench.perception.faults(10.0)
    assert late.key == "vision.late"
    assert 2.0 < late.since < 4.0, "since it began, not since now"
    assert "recognize" in late.evidence
    budget = bench.perception.budget(BOTH)
    assert budget.lowered
    for name in ("free_space", "motion", "health"):
        assert budget.rates_hz[name] == CONFIGURED[name].rate_hz
        # Batches hold less now, so a stage may have to wait a tick for its turn.
        assert counts[name] >= 0.6 * 8.0 * CONFIGURED[name].rate_hz, name
    for name in ("track", "recognize"):
        assert 0.0 < budget.rates_hz[name] < 0.6 * CONFIGURED[name].rate_hz
        assert counts[name] > 0


def test_rates_recover_with_the_costs() -> None:
    bench = Bench()
    bench.drive(6.0, BOTH, {name: 3.0 * cost for name, cost in COSTS.items()})
    assert bench.perception.faults(6.0)
    bench.drive(10.0, BOTH, COSTS, begin=6.0)
    assert bench.perception.faults(16.0) == ()
    rates = bench.perception.budget(BOTH).rates_hz
    assert rates == {name: stage.rate_hz for name, stage in CONFIGURED.items() if name != "review"}


def test_one_slow_run_lowers_nothing_for_good() -> None:
    bench = Bench()
    bench.drive(2.0, TRACKING, COSTS)
    bench.worker.finish(bench.worker.batches[-1][0], seconds=0.1)
    bench.perception.collect(2.0)
    bench.drive(3.0, TRACKING, COSTS, begin=2.0)
    assert bench.perception.faults(5.0) == ()


# --------------------------------------------------------------------------------------------- review


def test_a_better_match_elsewhere_is_told_while_something_is_followed() -> None:
    bench = Bench()
    bench.recogniser.places = [BOX]
    bench.do("recognize", view(0.04), SEARCHING)
    bench.do("track", view(0.08), REVIEWING)
    bench.recogniser.places, bench.recogniser.followed = [Box(260.0, 100.0, 60.0, 70.0)], 0.5
    for at in (1.2, 2.4):
        assert bench.perception.collect(at).better is None, "once is not enough"
        bench.do("track", view(at - 0.08), REVIEWING)
        bench.do("review", view(at), REVIEWING)
    better = bench.perception.collect(2.4).better
    assert better is not None
    assert (better.at, better.value.box.x) == (2.4, 260.0)
    bench.perception.forget_target()
    assert bench.perception.collect(2.5).better is None


def test_nothing_is_reviewed_while_nothing_is_followed() -> None:
    bench = Bench()
    bench.recogniser.places = [BOX]
    bench.do("review", view(0.04), REVIEWING)
    assert bench.perception.collect(0.04).better is None


# ---------------------------------------------------------------------------------------- bad pictures


def spoilt(kind: str, now: float, before: View) -> View:
    good = view(now).frame
    black = np.zeros_like(good.left)
    left, right = {
        "black": (black, black),
        "size": (good.left, good.right[:, :350]),
        "frozen": (before.frame.left, before.frame.right),
    }[kind]
    return View(StereoFrame(left, right, now, good.seq), HeadPose(), Pose2())


@pytest.mark.parametrize("kind", ["black", "size", "frozen"])
def test_a_bad_picture_never_reaches_a_stage_and_is_told(kind: str) -> None:
    bench = Bench()
    bench.drive(1.0, BOTH, COSTS)
    batches = len(bench.worker.batches)
    before = view(1.0)
    for tick in range(1, 6):
        now = round(1.0 + tick * TICK, 9)
        before = spoilt(kind, now, before)
        bench.perception.submit(before, BOTH, now)
    assert len(bench.worker.batches) == batches
    health = bench.perception.collect(1.2).health
    assert health is not None
    assert (health.value.fault, health.at) == (kind, 1.2)
    bench.perception.submit(view(1.24), BOTH, 1.24)
    assert len(bench.worker.batches) == batches + 1, "a good picture is looked at again"
    health = bench.perception.collect(1.24).health
    assert health is not None
    assert health.value.fault is None
    assert health.value.brightness == pytest.approx(float(WALL.mean()), abs=5.0)


def test_one_dead_eye_is_enough() -> None:
    bench = Bench()
    good = view(TICK).frame
    half = View(StereoFrame(good.left, np.zeros_like(good.right), TICK, 1), HeadPose(), Pose2())
    bench.perception.submit(half, BOTH, TICK)
    assert bench.worker.batches == []


def test_exchanged_eyes_are_found_and_from_then_on_nothing_else_is_looked_at() -> None:
    bench = Bench()
    good = view(TICK).frame
    exchanged = View(StereoFrame(good.right, good.left, TICK, 1), HeadPose(), Pose2())
    bench.do("health", exchanged, NONE)
    batches = len(bench.worker.batches)
    bench.perception.submit(view(2 * TICK), BOTH, 2 * TICK)
    health = bench.perception.collect(2 * TICK).health
    assert health is not None
    assert health.value.fault == "swapped"
    assert len(bench.worker.batches) == batches
    runs = bench.drive(1.0, BOTH, {name: 0.0 for name in STAGES}, begin=3 * TICK)
    assert set(runs) == {"health"}


def test_eyes_put_in_order_again_are_noticed() -> None:
    bench = Bench()
    good = view(TICK).frame
    bench.do("health", View(StereoFrame(good.right, good.left, TICK, 1), HeadPose(), Pose2()), NONE)
    mended = view(1.0)
    bench.do("health", mended, NONE)
    bench.perception.submit(view(1.04), NONE, 1.04)
    health = bench.perception.collect(1.04).health
    assert health is not None
    assert health.value.fault is None


def test_eyes_in_order_are_not_called_exchanged() -> None:
    bench = Bench()
    job = bench.job("health", view(TICK), NONE)
    check = run(job, 0.0).value
    assert isinstance(check, PairCheck)
    assert not check.swapped


def bumped(at: float) -> View:
    """What a right eye sees that was pushed down: everything two pixels higher."""
    frame = view(at).frame
    return View(StereoFrame(frame.left, np.roll(frame.right, -2, axis=0), at, 1), HeadPose(), Pose2())


def looks(bench: Bench, seen: Callable[[float], View], begin: float) -> tuple[list[Fault], list[Fault]]:
    """Eight looks 0.6 s apart; vision's faults after the second and after the last."""
    early: list[Fault] = []
    for k in range(8):
        at = begin + 0.6 * k
        bench.do("health", seen(at), NONE)
        early = list(bench.perception.faults(at)) if k == 1 else early
    return early, list(bench.perception.faults(begin + 5.0))


def test_a_bumped_eye_is_told_once_several_looks_agree_and_taken_back_when_it_stands_right() -> None:
    bench = Bench()
    assert looks(bench, view, 1.0) == ([], [])
    early, late = looks(bench, bumped, 10.0)
    assert early == []
    assert [fault.key for fault in late] == ["camera.misrectified"]
    assert "px too high: was a camera bumped? Calibrate again" in late[0].evidence
    early, late = looks(bench, view, 20.0)
    assert [fault.key for fault in early] == ["camera.misrectified"]
    assert late == []


def test_rows_that_seem_off_while_the_head_turns_accuse_nobody() -> None:
    bench = Bench()

    def turning(at: float) -> View:
        return replace(bumped(at), head=HeadPose(pan=0.2 * at))

    assert looks(bench, turning, 1.0) == ([], [])


# -------------------------------------------------------------------------------------------- results


def test_an_error_in_a_stage_becomes_a_fault_and_changes_no_percept() -> None:
    bench = Bench()
    bench.recogniser.error = ZeroDivisionError("by zero")
    bench.do("recognize", view(TICK), SEARCHING)
    assert bench.perception.collect(TICK).detections is None
    (fault,) = bench.perception.faults(1.0)
    assert (fault.key, fault.since) == ("vision.error", TICK)
    assert fault.evidence == "recognize: ZeroDivisionError: by zero"


def test_a_percept_carries_its_frames_time_not_the_time_it_was_ready() -> None:
    bench = Bench()
    job = bench.job("recognize", view(TICK), SEARCHING)
    bench.recogniser.places = [BOX]
    bench.worker.run(job)
    detections = bench.perception.collect(0.5).detections
    assert detections is not None
    assert detections.at == TICK
    assert [one.box for one in detections.value] == [BOX]
    bench.recogniser.places = []
    bench.do("recognize", view(1.0), SEARCHING)
    nothing = bench.perception.collect(1.0).detections
    assert nothing is not None
    assert (nothing.value, nothing.at) == ((), 1.0), "that nothing was seen is news too"


@pytest.mark.parametrize(("yaw", "pan", "azimuth"), [(0.3, 0.2, 0.5), (3.0, 0.4, 3.4 - math.tau)])
def test_a_detection_knows_its_direction_on_the_floor(yaw: float, pan: float, azimuth: float) -> None:
    bench = Bench()
    ahead = Box(RIG.left.cx - 20, 100, 40, 50)
    aside = Box(RIG.left.cx + 305.0 * math.tan(0.2) - 20, 100, 40, 50)
    bench.recogniser.places = [ahead, aside]
    bench.do("recognize", view(TICK, head=HeadPose(pan=pan), base=Pose2(yaw=yaw)), SEARCHING)
    detections = bench.perception.collect(TICK).detections
    assert detections is not None
    found = {one.box: one.azimuth for one in detections.value}
    assert found[ahead] == pytest.approx(azimuth, abs=1e-6)
    assert found[aside] == pytest.approx(azimuth - 0.2, abs=1e-6), "further right in the picture"


def tracking_bench(base: Pose2 | None = None) -> Bench:
    """The target was recognised at 0.04 s and tracked at 0.08 s."""
    bench = Bench()
    bench.recogniser.places = [BOX]
    bench.do("recognize", view(TICK, base=base), BOTH)
    bench.do("track", view(2 * TICK, base=base), BOTH)
    return bench


def test_a_detection_starts_a_track_with_range_and_place() -> None:
    bench = tracking_bench(Pose2(1.0, 2.0, math.pi / 2))
    percepts = bench.perception.collect(2 * TICK)
    assert percepts.track is not None
    assert percepts.target is not None
    assert percepts.place is not None
    assert percepts.track.at == percepts.target.at == percepts.place.at == 2 * TICK
    assert percepts.track.value.box.iou(BOX) > 0.9
    assert percepts.target.value.distance == pytest.approx(DEPTH, rel=0.02)
    x, y, _ = percepts.target.value.position
    assert percepts.place.value == pytest.approx((1.0 - y, 2.0 + x)), "turned by a quarter, then moved"


def test_a_detection_that_is_too_old_starts_no_track() -> None:
    for age, starts in ((SEED_LIFE - TICK, True), (SEED_LIFE + TICK, False)):
        bench = Bench()
        bench.recogniser.places = [BOX]
        bench.do("recognize", view(TICK), BOTH)
        bench.do("track", view(round(TICK + age, 9)), BOTH)
        assert (bench.perception.collect(2.0).track is not None) == starts


def test_nothing_is_tracked_before_anything_was_detected() -> None:
    bench = Bench()
    bench.do("track", view(TICK), BOTH)
    percepts = bench.perception.collect(TICK)
    assert percepts.track is None
    assert percepts.target is None


def test_the_track_of_a_target_nobody_wants_any_more_is_dropped_at_once() -> None:
    bench = tracking_bench()
    bench.perception.submit(view(0.2), SEARCHING, 0.2)
    percepts = bench.perception.collect(0.2)
    assert percepts.track is None
    assert percepts.target is None
    assert percepts.place is not None, "where it was is a hint for the search"


def test_a_track_result_that_comes_after_the_drop_is_ignored() -> None:
    bench = tracking_bench()
    late = bench.job("track", view(0.2), BOTH)
    value = run(late, 0.0).value
    bench.perception.submit(view(0.24), SEARCHING, 0.24)
    bench.worker.finish(late, value)
    assert bench.perception.collect(0.28).track is None


def test_forgetting_drops_track_and_detections_but_not_the_place() -> None:
    bench = tracking_bench()
    bench.perception.forget_target()
    percepts = bench.perception.collect(0.2)
    assert percepts.track is None
    assert percepts.target is None
    assert percepts.detections is None
    assert percepts.place is not None
    bench.do("track", view(0.24), TRACKING)
    assert bench.perception.collect(0.24).track is None, "the old detection starts no new track"


# ---------------------------------------------------------------------------------------------- the map


def fan_of_free_floor(reach: float) -> FreeSpace:
    bearings = np.linspace(-1.2, 1.2, 121)
    return FreeSpace(bearings, np.zeros(121), np.full(121, reach), np.zeros((0, 2)))


def test_unseen_floor_is_not_free_and_seen_floor_is() -> None:
    bench = Bench()
    assert bench.perception.clearance(Pose2(), Twist(0.2, 0.0), 0.0).distance == pytest.approx(0.0, abs=0.1)
    free = fan_of_free_floor(2.0)
    bench.worker.finish(bench.job("free_space", view(TICK), NONE), free)
    percepts = bench.perception.collect(0.2)
    assert percepts.free_space is not None
    assert (percepts.free_space.value, percepts.free_space.at) == (free, TICK)
    assert bench.perception.clearance(Pose2(), Twist(0.2, 0.0), 0.2).distance > 1.0


def test_obstacles_enter_the_map_where_the_robot_was_when_they_were_seen() -> None:
    bench = Bench()
    bench.worker.finish(bench.job("free_space", view(TICK), NONE), fan_of_free_floor(3.0))
    bench.perception.collect(TICK)
    free = bench.perception.clearance(Pose2(), Twist(0.2, 0.0), TICK).distance
    # Seen 0.4 m ahead from half a metre further on: it stands at 0.9 m.
    none = np.zeros(0)
    post = FreeSpace(none, none, none, np.array([[0.4, y] for y in (-0.03, 0.0, 0.03)]))
    for at in (0.4, 0.8):
        bench.worker.finish(bench.job("free_space", view(at, base=Pose2(0.5, 0.0, 0.0)), NONE), post)
        bench.perception.collect(at)
    blocked = bench.perception.clearance(Pose2(), Twist(0.2, 0.0), 0.8)
    assert blocked.limited_by == "obstacle"
    front = CONFIG.base.radius_m
    assert blocked.distance == pytest.approx(0.9 - front, abs=0.12)
    assert blocked.distance < free
    assert bench.perception.may_turn(Pose2())
    assert not bench.perception.may_turn(Pose2(0.85, 0.0, 0.0))


def test_free_floor_by_real_stereo_is_looked_for_on_every_view() -> None:
    """The wall stands 1.5 m ahead: the stage runs through, and sees nothing free behind it."""
    bench = Bench()
    bench.do("free_space", view(TICK), NONE)
    free_space = bench.perception.collect(TICK).free_space
    assert free_space is not None
    assert bench.perception.faults(TICK) == ()
    assert float(free_space.value.free.max()) < 2.5


def test_closing_stops_the_worker() -> None:
    bench = Bench()
    bench.perception.close()
    assert bench.worker.closed


# ---------------------------------------------------------------------------------- a base that is moved


def looked(lift: float) -> EgoMotion:
    """What the eyes say of a base that rose this far while its wheels stood."""
    return EgoMotion(
        since=0.0, wheels=Pose2(), eyes=Pose2(), lift=lift, roll=0.0, pitch=0.0, sigma=(0.001, 0.001, 0.001),
        deviation=250.0 * abs(lift), points=80, inliers=79, dissent=0.0,
    )  # fmt: skip


def look_on(bench: Bench, lifts: Sequence[float], begin: float, base: Pose2 | None = None) -> float:
    """One look of the motion stage every 0.12 s, each of this lift; returns the time after them."""
    at = begin
    for lift in lifts:
        at = round(at + 3 * TICK, 9)
        job = bench.job("motion", view(at, base=base), NONE)
        bench.worker.finish(job, Looks(short=replace(looked(lift), since=at - 3 * TICK)))
        bench.perception.collect(at)
    return at


def test_pictures_of_a_standing_base_say_that_it_stands() -> None:
    bench = Bench()
    for at in (0.12, 0.24):
        bench.do("motion", view(at), NONE)
    motion = bench.perception.collect(0.24).motion
    assert motion is not None
    assert motion.at == 0.24
    assert motion.value.since == 0.12
    assert motion.value.eyes.x == pytest.approx(0.0, abs=0.002)
    assert bench.perception.faults(0.24) == ()


def test_a_lifted_base_is_told_and_told_no_more_once_it_stands_again() -> None:
    bench = Bench()
    up = look_on(bench, [0.0, 0.04, 0.04], 1.0)
    (fault,) = bench.perception.faults(up)
    assert fault.key == "base.moved"
    assert fault.since == up
    down = look_on(bench, [-0.04, -0.04], up)
    assert [fault.key for fault in bench.perception.faults(down)] == ["base.moved"]
    still = look_on(bench, [0.0] * 9, down)
    assert bench.perception.faults(still) == ()


def test_two_long_looks_tell_a_base_that_slow_hands_lift() -> None:
    bench = Bench()
    for at in (1.0, 1.24):
        assert bench.perception.faults(at) == ()
        job = bench.job("motion", view(at), NONE)
        long = replace(looked(0.04), since=at - 0.84)
        bench.worker.finish(job, Looks(short=replace(looked(0.006), since=at - 0.12), long=long))
        percepts = bench.perception.collect(at)
        assert percepts.motion is not None
        assert percepts.motion.value.lift == 0.006, "percepts show the look from picture to picture"
    assert [fault.key for fault in bench.perception.faults(1.24)] == ["base.moved"]


def test_a_lifted_base_is_waited_for_until_a_person_says_that_it_stands() -> None:
    bench = Bench()
    up = look_on(bench, [0.04, 0.04], 1.0)
    held = look_on(bench, [0.0] * 100, up)
    assert [fault.key for fault in bench.perception.faults(held)] == ["base.moved"]
    bench.perception.set_down()
    still = look_on(bench, [0.0], held)
    assert bench.perception.faults(still) == ()


def test_where_a_moved_base_stands_again_its_map_is_begun_anew() -> None:
    bench = tracking_bench()
    here = Pose2(1.0, 0.5, 1.0)
    up = look_on(bench, [0.04, 0.04], 1.0, here)
    for _ in range(2):  # one look at a wall so far away is not yet believed
        up += 0.2
        bench.do("free_space", view(up, base=here), NONE)
    held = bench.perception.collect(up)
    assert held.place is not None
    assert held.free_space is not None
    assert len(bench.perception.map.occupied_points()) > 0, "the wall"
    still = look_on(bench, [-0.04, -0.04, *[0.0] * 9], up, here)
    percepts = bench.perception.collect(still)
    assert (percepts.place, percepts.track, percepts.target, percepts.free_space) == (None,) * 4
    assert percepts.detections is None
    floor = bench.perception.map
    assert len(floor.occupied_points()) == 0
    free = floor.centres(np.argwhere(floor.seen_free(still)))
    reach = CONFIG.base.radius_m + HANDS_WIDTH
    distances = np.hypot(free[:, 0] - here.x, free[:, 1] - here.y)
    assert distances.max() <= reach, "only where it was set down"
    assert len(free) == pytest.approx(math.pi * (reach / floor.settings.cell) ** 2, rel=0.1)


def test_what_the_target_shows_says_nothing_of_the_base() -> None:
    """The eyes are told where the target is as long as its track is fresh."""
    bench = tracking_bench()
    told: list[Box | None] = []

    class Told:
        def update(self, seen: View, moving: Box | None) -> None:
            told.append(moving)

    bench.perception._motion = Told()  # type: ignore[assignment]
    bench.do("motion", view(0.2), BOTH)
    bench.do("motion", view(0.6), BOTH)
    assert told[0] is not None
    assert told[0].iou(BOX) > 0.9
    assert told[1] is None
