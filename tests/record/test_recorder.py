"""The recorder: what happened is written once, when it happens, and nothing else is."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.messages import (
    Box,
    Detection,
    Event,
    Fault,
    HeadPose,
    Intent,
    Odometry,
    Percepts,
    Pose2,
    Range,
    Sent,
    Tick,
    Timed,
    Transition,
    Twist,
)
from robot.record.events import EventLog
from robot.record.recorder import Recorder, Way, WayPoint, tick_ms

PERIOD = 0.04
SENT = Sent(Twist(0.2, 0.1), HeadPose(), 0.0)


def tick(number: int, **changes: Any) -> Tick:
    """The tick of this number of an uneventful drive."""
    now = round(number * PERIOD, 9)
    plain = Tick(
        now, "search", None, Percepts(), Odometry(Pose2(0.1 * number, 0.0, 0.5), Twist(), now),
        HeadPose(0.3, 0.4), Intent(), SENT, (), (),
    )  # fmt: skip
    return replace(plain, **changes)


class Book:
    """A recorder with its lines at hand."""

    def __init__(self, **options: Any) -> None:
        self._stream = io.BytesIO()
        self.recorder = Recorder(EventLog(self._stream), **options)

    def told(self, *ticks: Tick) -> list[dict[str, Any]]:
        """All lines but the status ones after these ticks."""
        for one in ticks:
            self.recorder(one)
        return [line for line in self.lines() if line["kind"] != "status"]

    def lines(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self._stream.getvalue().splitlines()]


def change(event: str, reason: str = "why", **evidence: float) -> tuple[Transition, ...]:
    return (Transition("recognize", "range", Event(event, reason, evidence)),)


def test_an_uneventful_drive_is_one_status_line_a_second() -> None:
    book = Book()
    assert book.told(*(tick(n) for n in range(1, 76))) == []
    lines = book.lines()
    assert [line["t"] for line in lines] == [1.0, 2.0, 3.0]
    assert lines[0] == {
        "t": 1.0, "kind": "status", "state": "search", "x": 2.5, "y": 0.0, "yaw": 0.5, "v": 0.2, "w": 0.1,
        "pan": 0.3, "tilt": 0.4, "distance": None,
    }  # fmt: skip


def test_the_status_line_tells_the_distance() -> None:
    book = Book()
    measured = Percepts(target=Timed(Range(1.25, 0.02, (1.3, 0.1, 0.2), 14.6), 0.9))
    book.told(tick(25, percepts=measured))
    assert book.lines()[0]["distance"] == 1.25


def test_a_transition_is_written_with_its_tick_reason_and_evidence() -> None:
    (line,) = Book().told(tick(1), tick(2, transitions=change("way_blocked", "a wall", distance_m=0.5)))[:1]
    assert line == {
        "t": 0.08, "kind": "transition", "tick": 2, "from": "recognize", "to": "range",
        "event": "way_blocked", "reason": "a wall", "evidence": {"distance_m": 0.5},
    }  # fmt: skip


def test_a_confirmed_target_is_written_with_its_name_box_and_score() -> None:
    detections = Timed(
        (Detection(Box(10, 20, 30, 40), 0.91, "cup"), Detection(Box(0, 0, 5, 5), 0.6, "cup")), 0.0
    )
    seen = tick(1, transitions=change("target_confirmed"), percepts=Percepts(detections=detections))
    found = [line for line in Book(label="cup").told(seen) if line["kind"] == "target found"]
    assert found == [
        {"t": 0.04, "kind": "target found", "label": "cup", "score": 0.91, "box": [10.0, 20.0, 30.0, 40.0]}
    ]


def test_a_lost_target_is_written_with_the_time_it_was_not_seen() -> None:
    for place, unseen in ((Timed((1.0, 2.0), 1.5), 0.5), (None, 2.0)):
        lost = tick(50, transitions=change("target_lost", "gone"), percepts=Percepts(place=place))
        (line,) = [line for line in Book().told(lost) if line["kind"] == "target lost"]
        assert line == {"t": 2.0, "kind": "target lost", "reason": "gone", "unseen_s": unseen}


def test_giving_up_ends_the_mission() -> None:
    (line,) = Book().told(tick(1, transitions=change("given_up", "nothing here")))[1:]
    assert (line["kind"], line["outcome"], line["reason"]) == ("mission ended", "not found", "nothing here")


BLACK = Fault("camera", "black", 0.04, "mean 0.1")
STALL = Fault("base", "stall", 0.08)


def test_a_fault_is_written_when_it_comes_and_when_it_goes() -> None:
    lines = Book().told(
        tick(1, faults=(BLACK,)), tick(2, faults=(BLACK, STALL)), tick(3, faults=(STALL,)), tick(4), tick(5)
    )  # fmt: skip
    assert [(line["t"], line["kind"], line["fault"]) for line in lines] == [
        (0.04, "fault raised", "camera.black"),
        (0.08, "fault raised", "base.stall"),
        (0.12, "fault cleared", "camera.black"),
        (0.16, "fault cleared", "base.stall"),
    ]
    assert lines[0]["evidence"] == "mean 0.1"


@settings(deadline=None, max_examples=40)
@given(present=st.lists(st.booleans(), min_size=1, max_size=30))
def test_raised_and_cleared_alternate_whatever_comes(present: list[bool]) -> None:
    lines = Book().told(*(tick(n, faults=(BLACK,) if there else ()) for n, there in enumerate(present, 1)))
    kinds = [line["kind"] for line in lines]
    assert all(kind == ("fault raised", "fault cleared")[k % 2] for k, kind in enumerate(kinds))
    assert len(kinds) % 2 == present[-1], "an open fault is one raised once more than cleared"


def test_the_governor_is_written_when_rates_change() -> None:
    slow, slower = (Fault("vision", "late", 0.04, words) for words in ("track 12.0/s", "track 8.0/s"))
    lines = Book().told(
        tick(1), tick(2, faults=(slow,)), tick(3, faults=(slow,)), tick(4, faults=(slower,)), tick(5), tick(6)
    )  # fmt: skip
    governor = [(line["t"], line["rates"]) for line in lines if line["kind"] == "governor"]
    assert governor == [(0.08, "track 12.0/s"), (0.16, "track 8.0/s"), (0.2, "all as wanted")]


def limited(number: int, why: str | None) -> Tick:
    return tick(number, sent=replace(SENT, limited_by=why))


def test_a_limitation_is_written_once_with_how_long_it_lasted() -> None:
    lines = Book().told(
        limited(1, None), limited(2, "obstacle in 0.50 m"), limited(3, "obstacle in 0.31 m"),
        limited(4, "unknown in 0.20 m"), limited(5, None), limited(6, None),
    )  # fmt: skip
    assert [(line["t"], line["kind"], line["limited_by"]) for line in lines] == [
        (0.08, "limitation began", "obstacle"),
        (0.16, "limitation ended", "obstacle"),
        (0.16, "limitation began", "unknown"),
        (0.2, "limitation ended", "unknown"),
    ]
    assert [line.get("lasted_s") for line in lines] == [None, 0.08, None, 0.04]


@pytest.mark.parametrize("why", ["acceleration", "speed limit"])
def test_what_limits_every_start_is_not_worth_a_line(why: str) -> None:
    assert Book().told(limited(1, why), limited(2, None)) == []


def test_every_tick_is_handed_to_the_pictures() -> None:
    shown: list[Tick] = []
    ticks = [tick(n) for n in (1, 2, 3)]
    Book(pictures=shown.append).told(*ticks)
    assert shown == ticks


def test_the_same_ticks_give_the_same_bytes() -> None:
    ticks = [tick(n, faults=(BLACK,) if n % 7 == 0 else ()) for n in range(1, 60)]
    assert Book().told(*ticks) == Book().told(*ticks)


def test_a_full_disk_does_not_stop_the_recorder() -> None:
    class Full(io.BytesIO):
        def write(self, data: object, /) -> int:
            raise OSError(28, "No space left on device")

    log = EventLog(Full())
    recorder = Recorder(log)
    for number in range(1, 60):
        recorder(tick(number))
    assert log.recording.stopped is not None
    assert (log.recording.stopped.at, log.recording.stopped.reason) == (1.0, "No space left on device")


def test_the_way_is_kept_tick_by_tick() -> None:
    way = Way()
    for number in (1, 2):
        way(tick(number, state="track"))
    assert way.points == [
        WayPoint(0.04, Pose2(0.1, 0.0, 0.5), "track"),
        WayPoint(0.08, Pose2(0.2, 0.0, 0.5), "track"),
    ]


def test_tick_times_in_milliseconds() -> None:
    assert tick_ms([0.001] * 99 + [0.101]) == {"median": 1.0, "p99": 2.0}
    assert tick_ms([]) == {"median": 0.0, "p99": 0.0}
