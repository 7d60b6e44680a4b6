"""Real time over the wire: from picture to motor command, from stop to standing, ticks missed, memory.

The robot follows a target that walks round a room for most of the time; pictures are blacked out now and then
(a stop fault). Then a person takes the stick, drives and stops again and again. World and robot are two
processes that need a core each: measure on a machine that does nothing else.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import structs

from bench.report import Bar, arguments, publish
from robot.config import Config
from robot.messages import Tick
from robot.record.recorder import Recorder
from robot.record.run_folder import RunFolder
from robot.run_sim import armed
from robot.run_wire import WireRobot, wired
from robot.sim.injected import InjectedFault
from robot.sim.scene import Scene, parse_scene
from robot.sim.wire.launch import WorldChannel, start_world
from robot.sim.wire.messages import Outcome, Trace
from robot.taught import target_for
from robot.wire_figures import (
    Decision,
    capture_to_telegram,
    fault_stops,
    in_ms,
    missed_ticks,
    order_to_telegram,
    request_to_stop,
)
from robot.wire_witness import Memory

WARM_UP_S = 60.0
STOPS_SHARE = 0.15
"""Of the whole time a person drives and stops."""
BLACK_EVERY_S, BLACK_S = 12.0, 0.5
SEED = 1
_MEGABYTE = 1e6
_LONGEST_MIN = 9.5  # a scene lasts ten minutes at most


@dataclass(slots=True)
class Measured:
    """What came out of the run. asked: when stop bytes were typed."""

    decisions: list[Decision]
    trace: Trace
    outcome: Outcome
    memory: list[Memory]
    asked: list[float] = field(default_factory=list)
    followed_until: float = 0.0


def walk(minutes: float) -> Scene:
    """A room in which the target walks round and round."""
    corners = ((3.4, -0.7), (3.6, 0.6), (2.4, 0.8), (2.3, -0.6))
    return parse_scene(
        {
            "mirror": False,
            "duration_s": min(60.0 * minutes + 30.0, 600.0),
            "hold_after_motion": True,
            "hold_s": 60.0,
            "room": {"length_m": 5.4, "width_m": 4.6},
            "robot": {"x": 0.9, "y": 0.0, "heading_deg": 0.0},
            "target": {
                "object": "box", "x": 2.6, "y": 0.0, "motion": "path", "speed_m_s": 0.08, "starts_s": 8.0,
                "waypoints": [{"x": x, "y": y, "pause_s": 1.0} for _ in range(40) for x, y in corners],
            },
        },
        "walk",
    )  # fmt: skip


def measure(minutes: float, say: Callable[[str], None]) -> Measured:
    """One run of so many minutes."""
    target, scene = target_for("box"), walk(minutes)
    with (
        tempfile.TemporaryDirectory() as records,
        start_world(scene, SEED, blackouts(60.0 * minutes), spare_channels=1) as world,
    ):
        config = wired(patient(armed(Config(), scene, SEED)), world.addresses)
        robot = WireRobot(config, target, world)
        folder = RunFolder.create(Path(records), datetime.now())
        person = Person(WorldChannel(world.spare[0]), 60.0 * minutes, say)
        try:
            world.begin()
            person.start()
            observers: list[Callable[[Tick], None]] = [Recorder(folder.open_events()), person.watch]
            robot.run(person.over, observers, [folder.recording.faults])
        finally:
            person.over.set()
            robot.close()
            folder.close()
        return Measured(
            robot.decisions,
            world.trace(),
            world.outcome(),
            robot.witness.memory,
            person.asked,
            person.took_at,
        )


def patient(config: Config) -> Config:
    """A robot that never gives the search up: one that went idle would have nothing more to measure."""
    mission = structs.replace(config.mission, search_timeout_s=3600.0)
    return structs.replace(config, mission=mission)


def blackouts(seconds: float) -> tuple[InjectedFault, ...]:
    """Pictures go black for a moment, again and again, as long as the robot follows."""
    until = seconds * (1 - STOPS_SHARE) - BLACK_EVERY_S
    return tuple(
        InjectedFault("camera", "black", float(at), BLACK_S)
        for at in np.arange(BLACK_EVERY_S, until, BLACK_EVERY_S)
    )


class Person:
    """Waits for their turn, then takes the stick, drives a little, stops, and so on, at random moments."""

    def __init__(self, world: WorldChannel, seconds: float, say: Callable[[str], None]) -> None:
        self._world, self._seconds, self._say = world, seconds, say
        self._state = ""
        self._driving = False
        self._chance = random.Random(SEED)
        self.asked: list[float] = []
        self.took_at = 0.0
        self.over = threading.Event()
        """Set at the end, and to end it."""

    def start(self) -> None:
        """Begin, in a thread of its own."""
        threading.Thread(target=self._act, name="person", daemon=True).start()

    def watch(self, tick: Tick) -> None:
        """An observer: what the robot does now."""
        self._state = tick.state
        self._driving = not tick.sent.twist.is_zero

    def _act(self) -> None:
        begun = time.monotonic()
        self._say(f"following for {self._seconds * (1 - STOPS_SHARE):.0f} s")
        self.over.wait(self._seconds * (1 - STOPS_SHARE))
        self.took_at = time.monotonic()
        self._say("driving and stopping by hand")
        while not self.over.is_set() and time.monotonic() - begun < self._seconds:
            self._drive_and_stop()
        self.over.set()

    def _drive_and_stop(self) -> None:
        if self._state != "teleop":
            self._world.type_keys(b"t")
            self.over.wait(0.2)
            return
        self._world.type_keys(self._chance.choice((b"j", b"l", b"u", b".")))
        self.over.wait(self._chance.uniform(0.15, 0.3))
        if self._driving:
            self.asked.append(self._world.type_keys(b" "))
        self.over.wait(self._chance.uniform(0.2, 0.3))


def rows_of(measured: Measured) -> list[dict[str, Any]]:
    """All figures."""
    m, telegrams, moments = measured, measured.trace.telegrams, measured.trace.moments
    stops = [figure for figure in request_to_stop(m.asked, telegrams) if figure is not None]
    faults = [figure for figure in request_to_stop(fault_stops(m.decisions), telegrams) if figure is not None]
    latencies = {
        ("picture to motor command", "track"): capture_to_telegram(
            m.decisions, telegrams, moments, lambda decision: decision.track_at
        ),
        ("picture to motor command", "free space"): capture_to_telegram(
            m.decisions, telegrams, moments, lambda decision: decision.floor_at
        ),
        ("order to motor command", "base"): order_to_telegram(m.decisions, telegrams),
        ("stop byte to stop command", "teleop"): stops,
        ("stop fault seen to stop command", "camera.black"): faults,
    }
    rows: list[dict[str, Any]] = []
    for (case, method), seconds in latencies.items():
        figures = in_ms(seconds)
        rows.append(
            {"case": case, "method": method, "n": figures.pop("n")}
            | {f"{k}_ms": v for k, v in figures.items()}
        )
    missed = missed_ticks([decision.at for decision in m.decisions])
    first, last = memory_levels(m.memory, m.followed_until)
    pace = m.outcome.pace
    rows += [
        {
            "case": "control ticks", "method": "loop", "n": len(m.decisions), "missed": missed,
            "missed_share": missed / max(len(m.decisions) + missed, 1),
        },
        {
            "case": "control ticks", "method": "in track, share",
            "share": sum(d.state == "track" for d in m.decisions) / max(len(m.decisions), 1),
        },
        {
            "case": "world ticks", "method": "world", "n": pace.ticks, "late": pace.late,
            "slipped_s": pace.slipped_s, "pictures_missed": pace.pictures_missed,
        },
        {
            "case": "stop bytes without a stop command", "method": "teleop", "n": len(m.asked) - len(stops),
        },
        {
            "case": "memory of the robot", "method": "resident", "first_MB": first / _MEGABYTE,
            "last_MB": last / _MEGABYTE, "growth_MB": (last - first) / _MEGABYTE,
        },
    ]  # fmt: skip
    return rows


def memory_levels(memory: list[Memory], until: float) -> tuple[float, float]:
    """Resident bytes after the warm-up and before `until`: medians of a minute, of a fifth if it is short."""
    samples = [sample for sample in memory if sample.at <= until]
    if len(samples) < 10:
        return float("nan"), float("nan")
    minute = min(60, len(samples) // 5)
    begin = min(round(WARM_UP_S), len(samples) // 3)
    first, last = samples[begin : begin + minute], samples[-minute:]
    return (
        float(np.median([sample.rss for sample in first])),
        float(np.median([sample.rss for sample in last])),
    )


def bars_of(rows: list[dict[str, Any]]) -> list[Bar]:
    """What the figures are held to."""
    found = {(row["case"], row["method"]): row for row in rows}

    def p99(case: str, method: str) -> float:
        value = found[case, method]["p99_ms"]
        return float("nan") if value is None else float(value)

    return [
        Bar("picture to motor command p99, ms", p99("picture to motor command", "track"), 100.0),
        Bar("stop byte to stop command p99, ms", p99("stop byte to stop command", "teleop"), 50.0),
        Bar(
            "stop fault seen to stop command p99, ms",
            p99("stop fault seen to stop command", "camera.black"),
            50.0,
        ),
        Bar(
            "stop bytes without a stop command",
            found["stop bytes without a stop command", "teleop"]["n"],
            0.0,
        ),
        Bar("share of time in track", found["control ticks", "in track, share"]["share"], 0.4, at_most=False),
        Bar("missed control ticks, share", found["control ticks", "loop"]["missed_share"], 0.01),
        Bar("memory growth, MB", found["memory of the robot", "resident"]["growth_MB"], 1.0),
    ]


def main() -> int:
    """Measure and print."""
    parser = arguments(__doc__ or "")
    parser.add_argument("--minutes", type=_minutes, default=_LONGEST_MIN, help="how long, 1 to 9.5")
    options = parser.parse_args()
    measured = measure(options.minutes, lambda words: print(words, file=sys.stderr, flush=True))
    rows = rows_of(measured)
    return publish("wire", rows, bars_of(rows), options.json)


def _minutes(text: str) -> float:
    minutes = float(text)
    if not 0.5 <= minutes <= _LONGEST_MIN:
        raise argparse.ArgumentTypeError(f"{text} is not within 0.5..{_LONGEST_MIN}")
    return minutes


if __name__ == "__main__":
    sys.exit(main())
