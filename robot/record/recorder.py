"""Turns ticks into the record of a run: events, pictures, the way driven. Told everything, asks nobody."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robot.messages import Fault, Pose2, Tick, Transition
from robot.record.events import EventLog

QUIET = ("acceleration", "speed limit")  # limitations that are part of every start and not worth a line
STATUS_EVERY = 1.0


class FrameSink(Protocol):
    """Takes the pictures of a run."""

    def __call__(self, tick: Tick) -> None:
        """Show this tick."""
        ...


@dataclass(frozen=True, slots=True)
class WayPoint:
    """Where the robot was, and in which state, by its own odometry."""

    now: float
    pose: Pose2
    state: str


class Way:
    """An observer that keeps the whole way driven, one point a tick: for runs that end."""

    def __init__(self) -> None:
        self.points: list[WayPoint] = []

    def __call__(self, tick: Tick) -> None:
        """Note where the robot is."""
        self.points.append(WayPoint(tick.now, tick.odometry.pose, tick.state))


def tick_ms(seconds: Sequence[float]) -> dict[str, float]:
    """Median and 99th percentile in milliseconds of ticks' times in seconds; zeros if there are none."""
    if not seconds:
        return {"median": 0.0, "p99": 0.0}
    median, p99 = 1e3 * np.percentile(seconds, [50, 99])
    return {"median": round(float(median), 2), "p99": round(float(p99), 2)}


class Recorder:
    """An observer of the loop: writes events as they happen and a status line a second; hands pictures on."""

    def __init__(self, log: EventLog, pictures: FrameSink | None = None, label: str = "target") -> None:
        self._log = log
        self._pictures = pictures
        self._label = label
        self._tick = 0
        self._faults: dict[str, Fault] = {}
        self._limited: tuple[str, float] | None = None
        self._rates = ""
        self._status_at = 0.0

    def __call__(self, tick: Tick) -> None:
        """Record one tick."""
        self._tick += 1
        for transition in tick.transitions:
            self._note_transition(tick, transition)
        self._note_faults(tick)
        self._note_limitation(tick)
        if tick.now - self._status_at >= STATUS_EVERY - 1e-9:
            self._status_at = tick.now
            self._note_status(tick)
        if self._pictures is not None:
            self._pictures(tick)

    def _note_transition(self, tick: Tick, transition: Transition) -> None:
        self._log.transition(tick.now, self._tick, transition.source, transition.target, transition.event)
        percepts = tick.percepts
        if transition.event.name == "target_confirmed" and percepts.detections and percepts.detections.value:
            best = percepts.detections.value[0]
            self._log.target_found(tick.now, self._label, best.box, best.score, None)
        if transition.event.name == "target_lost":
            seen = percepts.place.age(tick.now) if percepts.place is not None else tick.now
            self._log.target_lost(tick.now, transition.event.reason, seen)
        if transition.event.name == "given_up":
            self._log.mission_ended(tick.now, "not found", transition.event.reason)

    def _note_faults(self, tick: Tick) -> None:
        active = {fault.key: fault for fault in tick.faults}
        for key, fault in active.items():
            if key not in self._faults:
                self._log.fault_raised(tick.now, fault)
        for key, fault in self._faults.items():
            if key not in active:
                self._log.fault_cleared(tick.now, fault)
        late = active.get("vision.late")
        rates = late.evidence if late is not None else ""
        if rates != self._rates:
            self._log.write("governor", tick.now, rates=rates or "all as wanted")
            self._rates = rates
        self._faults = active

    def _note_limitation(self, tick: Tick) -> None:
        why = tick.sent.limited_by
        kind = why.split(" in ")[0] if why is not None and why not in QUIET else None
        if self._limited is not None and self._limited[0] != kind:
            self._log.limitation_ended(tick.now, self._limited[0], tick.now - self._limited[1])
            self._limited = None
        if kind is not None and self._limited is None:
            self._log.limitation_began(tick.now, kind)
            self._limited = (kind, tick.now)

    def _note_status(self, tick: Tick) -> None:
        pose, target = tick.odometry.pose, tick.percepts.target
        self._log.write(
            "status",
            tick.now,
            state=tick.state,
            x=pose.x,
            y=pose.y,
            yaw=pose.yaw,
            v=tick.sent.twist.v,
            w=tick.sent.twist.w,
            pan=tick.head.pan,
            tilt=tick.head.tilt,
            distance=target.value.distance if target is not None else None,
        )
