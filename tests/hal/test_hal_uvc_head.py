"""The head inside a camera: signs, limits, read-back, faults."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from webcam_far_end import PAN, TILT, ZOOM, FakeStreamer, control

from robot.hal.interfaces import DeviceError, PanTilt
from robot.hal.mock.head import HeadLimits
from robot.hal.uvc_head import UvcHead, open_uvc_head
from robot.hal.webcam.controls import ControlInfo
from robot.messages import HeadPose

SLEW = math.radians(200.0)
TICK = 0.04


class FakeHead:
    """Pan and tilt controls in memory; `moves` says what the read-back is while the head turns.

    echo: the value last set, as most cameras answer; otherwise where the head is, turning `rate` units/s.
    """

    def __init__(self, step: int = 1, echo: bool = True, rate: float = 360_000.0) -> None:
        self.infos = {
            PAN: ControlInfo("Pan", -522000, 522000, step),
            TILT: ControlInfo("Tilt", -324000, 324000, step),
            ZOOM: ControlInfo("Zoom", 100, 500),
        }
        self.goal = {PAN: 0, TILT: 0, ZOOM: 300}
        self.at = dict(self.goal)
        self.echo, self.rate = echo, rate
        self.writes: list[tuple[int, int]] = []
        self.reads = 0
        self.broken = False
        self.closed = 0

    def info(self, number: int) -> ControlInfo | None:
        self._check()
        return self.infos.get(number)

    def read(self, *numbers: int) -> dict[int, int]:
        self._check()
        self.reads += 1
        return {number: (self.goal if self.echo else self.at)[number] for number in numbers}

    def write(self, number: int, value: int) -> None:
        self._check()
        info = self.infos[number]
        assert info.minimum <= value <= info.maximum
        assert (value - info.minimum) % info.step == 0
        self.goal[number] = value
        self.writes.append((number, value))

    def close(self) -> None:
        self.closed += 1

    def turn(self, seconds: float) -> None:
        for number in (PAN, TILT):
            way = self.goal[number] - self.at[number]
            step = round(self.rate * seconds)
            self.at[number] += way if abs(way) <= step else (step if way > 0 else -step)

    def _check(self) -> None:
        if self.broken:
            raise DeviceError("no answer")


class Bench:
    """A head over the fake, ticked like the control loop."""

    def __init__(self, far_end: FakeHead | None = None, **settings) -> None:  # type: ignore[no-untyped-def]
        self.far_end = far_end or FakeHead()
        self.reopened = 0
        self.now = 5.0
        self.head = UvcHead(self.far_end, HeadLimits(), SLEW, self._reopen, **settings)

    def _reopen(self) -> FakeHead:
        self.far_end._check()
        self.reopened += 1
        return self.far_end

    def tick(self, pose: HeadPose, ticks: int = 1) -> HeadPose:
        for _ in range(ticks):
            at = self.head.read(self.now)
            self.head.send(pose, self.now)
            self.now = round(self.now + TICK, 6)
            self.far_end.turn(TICK)
        return at

    @property
    def kinds(self) -> list[str]:
        return [fault.kind for fault in self.head.faults(self.now)]


def test_the_camera_counts_right_and_up_the_robot_left_and_down() -> None:
    bench = Bench()
    assert isinstance(bench.head, PanTilt)
    pose = HeadPose(math.radians(10.0), math.radians(5.0))
    assert bench.head.send(pose, bench.now) == pose
    assert bench.far_end.goal[PAN] == -36000
    assert bench.far_end.goal[TILT] == -18000


def test_only_what_changed_is_written() -> None:
    bench = Bench()
    bench.far_end.writes.clear()
    bench.tick(HeadPose(0.3, 0.1), 5)
    assert [number for number, _ in bench.far_end.writes] == [PAN, TILT]
    bench.tick(HeadPose(0.3, 0.2), 5)
    assert [number for number, _ in bench.far_end.writes] == [PAN, TILT, TILT]
    before = bench.far_end.reads
    bench.head.read(bench.now)
    bench.head.read(bench.now)
    assert bench.far_end.reads == before + 1


@settings(deadline=None, max_examples=60)
@given(st.floats(), st.floats(), st.sampled_from([1, 900, 3600, 7200]))
def test_any_pose_ends_within_the_limits_and_the_range(pan, tilt, step) -> None:  # type: ignore[no-untyped-def]
    far_end = FakeHead(step)
    far_end.infos[PAN] = ControlInfo("Pan", -100 * 720, 50 * 720, step)  # 20 degrees right, 10 left, about
    bench = Bench(far_end)
    sent = bench.head.send(HeadPose(pan, tilt), bench.now)
    assert math.radians(-10.001) <= sent.pan <= math.radians(20.001)
    assert math.radians(-20.001) <= sent.tilt <= math.radians(50.001)
    assert bench.far_end.goal[PAN] == pytest.approx(-math.degrees(sent.pan) * 3600, abs=step)
    assert bench.far_end.goal[TILT] == pytest.approx(-math.degrees(sent.tilt) * 3600, abs=step)


def test_a_camera_that_repeats_what_was_set_is_modelled_to_turn() -> None:
    bench = Bench()
    bench.tick(HeadPose(), 3)
    bench.tick(HeadPose(pan=1.0))
    for n in range(1, 5):
        assert bench.tick(HeadPose(pan=1.0)).pan == pytest.approx(n * TICK * SLEW)
    assert bench.tick(HeadPose(pan=1.0), 10).pan == pytest.approx(1.0)
    assert bench.kinds == []


def test_a_coarse_camera_is_read_where_it_is() -> None:
    bench = Bench(FakeHead(step=36000))
    at = bench.tick(HeadPose(pan=math.radians(13.0)), 30)
    assert bench.far_end.goal[PAN] == -54000
    assert at.pan == pytest.approx(math.radians(15.0))
    assert bench.kinds == []


def test_a_camera_that_tells_where_it_is_is_believed() -> None:
    bench = Bench(FakeHead(echo=False, rate=180_000.0))  # 50 degrees a second, the model thinks 200
    bench.tick(HeadPose(), 3)
    bench.tick(HeadPose(pan=1.0))
    for n in range(1, 5):
        assert bench.tick(HeadPose(pan=1.0)).pan == pytest.approx(math.radians(50.0 * TICK * n), abs=1e-3)
    assert bench.kinds == []
    assert bench.tick(HeadPose(pan=1.0), 40).pan == pytest.approx(1.0, abs=1e-4)
    assert bench.kinds == []


@pytest.mark.parametrize("axis", ["pan", "tilt"])
def test_a_head_that_does_not_come_nearer_is_stuck(axis: str) -> None:
    bench = Bench(FakeHead(echo=False))
    bench.tick(HeadPose(), 3)
    bench.far_end.rate = 0.0
    pose = HeadPose(**{axis: 0.3})
    ticks = 0
    while not bench.kinds:
        bench.tick(pose)
        ticks += 1
    assert 0.6 < ticks * TICK <= 0.75
    assert bench.kinds == ["stuck"]
    assert f"{axis} stays at" in bench.head.faults(bench.now)[0].evidence
    assert "17.2 degrees" in bench.head.faults(bench.now)[0].evidence
    bench.far_end.rate = 360_000.0
    bench.tick(pose, 10)
    assert bench.kinds == []


def test_a_stuck_head_is_found_also_while_its_goal_changes() -> None:
    bench = Bench(FakeHead(echo=False))
    bench.tick(HeadPose(), 3)
    bench.far_end.rate = 0.0
    for n in range(20):
        bench.tick(HeadPose(pan=0.3 + 0.01 * n))
    assert bench.kinds == ["stuck"]


def test_a_slow_head_and_one_that_was_not_read_for_long_are_not_stuck() -> None:
    bench = Bench(FakeHead(echo=False, rate=18_000.0))  # 5 degrees a second
    bench.tick(HeadPose(pan=1.0), 100)
    assert bench.kinds == []
    bench = Bench(FakeHead(echo=False))
    bench.tick(HeadPose(), 3)
    bench.now += 10.0
    bench.tick(HeadPose(pan=1.0), 3)
    assert bench.kinds == []
    bench = Bench(FakeHead(echo=False))
    bench.tick(HeadPose(), 3)
    bench.now += 10.0
    bench.head.send(HeadPose(pan=1.0), bench.now)
    bench.head.read(bench.now + TICK)  # it has not begun to turn
    assert bench.kinds == []


def test_one_lost_exchange_is_borne_a_broken_link_told_and_tried_again() -> None:
    bench = Bench()
    bench.tick(HeadPose(pan=0.3), 20)
    bench.far_end.broken = True
    before = bench.head.read(bench.now)
    assert bench.head.send(HeadPose(pan=-0.5), bench.now).pan == 0.3
    bench.far_end.broken = False
    bench.tick(HeadPose(pan=0.3), 5)
    assert bench.kinds == []
    bench.far_end.broken = True
    since = bench.now
    while not bench.kinds:
        before = bench.tick(HeadPose(pan=-0.5))
    assert bench.kinds == ["link"]
    assert bench.now - since <= 0.5
    assert bench.head.faults(bench.now)[0].evidence == "no answer"
    assert bench.far_end.closed == 1
    assert bench.tick(HeadPose(pan=-0.5), 5) == before
    bench.far_end.broken = False
    bench.far_end.goal = {PAN: 0, TILT: 7200, ZOOM: 111}  # it lost everything
    bench.tick(HeadPose(pan=-0.5), 30)
    assert bench.reopened == 1
    assert bench.far_end.goal[TILT] == 0
    assert bench.kinds == []
    assert bench.head.read(bench.now).pan == pytest.approx(-0.5, abs=1e-4)


def test_attempts_to_reach_a_dead_camera_grow_rare() -> None:
    bench = Bench()
    attempts: list[float] = []

    def reopen() -> FakeHead:
        attempts.append(bench.now)
        raise DeviceError("still gone")

    bench.head._reopen = reopen
    bench.far_end.broken = True
    bench.tick(HeadPose(pan=0.1), 600)
    gaps = [b - a for a, b in itertools.pairwise(attempts)]
    assert gaps[:5] == pytest.approx([1.0, 2.0, 4.0, 5.0, 5.0], abs=0.05)
    assert bench.head.faults(bench.now)[0].evidence == "still gone"


def test_zoom_is_set_at_opening_and_after_a_replug_or_never() -> None:
    bench = Bench(zoom=120)
    assert bench.far_end.goal[ZOOM] == 120
    bench.far_end.broken = True
    bench.tick(HeadPose(), 10)
    bench.far_end.broken, bench.far_end.goal[ZOOM] = False, 111
    bench.tick(HeadPose(), 30)
    assert bench.far_end.goal[ZOOM] == 120
    assert Bench().far_end.goal[ZOOM] == 300


def test_the_head_starts_at_rest_and_a_missing_axis_is_there_for_good() -> None:
    rest = HeadPose(pan=0.1, tilt=0.35)
    far_end = FakeHead()
    del far_end.infos[TILT]
    bench = Bench(far_end, rest=rest)
    assert far_end.goal[PAN] == round(-math.degrees(0.1) * 3600)
    assert bench.head.send(HeadPose(pan=0.4, tilt=0.0), bench.now) == HeadPose(pan=0.4, tilt=0.35)
    assert bench.tick(HeadPose(pan=0.4), 20) == HeadPose(pan=pytest.approx(0.4, abs=1e-5), tilt=0.35)
    del far_end.infos[PAN]
    with pytest.raises(DeviceError, match="neither pan nor tilt"):
        Bench(far_end)
    assert far_end.closed == 1


def test_a_head_that_never_answers_is_refused_and_closed_once_a_slew_that_is_none() -> None:
    far_end = FakeHead()
    far_end.broken = True
    with pytest.raises(DeviceError, match="no answer"):
        Bench(far_end)
    assert far_end.closed == 1
    limits, reopen = HeadLimits(), FakeHead
    slews: list[Callable[[], UvcHead]] = [
        lambda slew=slew: UvcHead(FakeHead(), limits, slew, reopen) for slew in (0.0, -1.0, math.nan)
    ]
    for make in slews:
        with pytest.raises(ValueError, match="slew"):
            make()


def test_a_closed_head_neither_moves_nor_asks() -> None:
    bench = Bench()
    bench.tick(HeadPose(pan=0.3), 20)
    bench.head.close()
    bench.head.close()
    writes, reads = len(bench.far_end.writes), bench.far_end.reads
    at = bench.tick(HeadPose(pan=-0.5), 20)
    assert at.pan == pytest.approx(0.3, abs=1e-4)
    assert (len(bench.far_end.writes), bench.far_end.reads) == (writes, reads)
    assert bench.far_end.closed == 1


def test_over_http_from_the_stream_address_and_back() -> None:
    server = FakeStreamer(
        [control(PAN, "Pan", -522000, 522000, 3600), control(TILT, "Tilt", -324000, 324000, 3600)]
    )
    head = open_uvc_head(server.url, HeadLimits(), 200.0, HeadPose(tilt=math.radians(20.0)))
    assert server.controls[TILT]["value"] == "-72000"
    head.read(1.0)
    head.send(HeadPose(pan=math.radians(10.0)), 1.0)
    assert server.controls[PAN]["value"] == "-36000"
    assert head.read(2.0) == HeadPose(pytest.approx(math.radians(10.0)), 0.0)
    server.down()
    head.read(2.1)
    head.read(2.5)
    assert [fault.key for fault in head.faults(2.5)] == ["head.link"]
    head.close()
    with pytest.raises(DeviceError, match="cannot be reached"):
        open_uvc_head(server.base, HeadLimits(), 200.0, HeadPose())
    with pytest.raises(DeviceError, match="is not there"):
        open_uvc_head("/dev/no-head", HeadLimits(), 200.0, HeadPose())
