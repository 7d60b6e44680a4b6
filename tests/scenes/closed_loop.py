"""Runs a scene in lockstep and keeps what a test wants to know about it."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robot.messages import Tick
from robot.model_file import Model
from robot.record.events import EventLog
from robot.record.recorder import Recorder
from robot.run_sim import CLAIMING, SimOptions, SimRun
from robot.sim.injected import InjectedFault
from robot.sim.scene import load_scene

ROOM = """
title = "test"
duration_s = {duration}
hold_s = {hold}
{top}
[room]
length_m = 4.2
width_m = 3.8
[robot]
x = 0.8
y = 0.0
heading_deg = {heading}
{rest}
"""


@dataclass(frozen=True)
class Outcome:
    """What came of a run. displaced: metres the robot's true place was ever away from its start."""

    report: dict[str, Any]
    events: bytes
    states: tuple[str, ...]
    claims: int
    displaced: float
    faults: frozenset[str]
    lamp_burned: bool

    @property
    def claimed(self) -> bool:
        """True if it was ever in a state that says 'found'."""
        return self.claims > 0 or any(state in CLAIMING for state in self.states)


def scene_file(
    folder: Path,
    name: str,
    rest: str,
    *,
    top: str = "",
    heading: str = "0.0",
    duration: float = 30.0,
    hold: float = 2.0,
) -> str:
    """Write a small room with `rest` in it; returns its path."""
    path = folder / f"{name}.toml"
    path.write_text(ROOM.format(duration=duration, hold=hold, top=top, heading=heading, rest=rest))
    return str(path)


def drive(
    scene: str,
    seed: int,
    target: Model,
    *,
    seconds: float = math.inf,
    slow: float = 1.0,
    faults: Sequence[InjectedFault] = (),
) -> Outcome:
    """Run until the referee has seen enough, or for `seconds` of robot time."""
    stream = io.BytesIO()
    notes = _Notes()
    run = SimRun(
        load_scene(scene),
        seed,
        target.finder,
        options=SimOptions(slow, tuple(faults)),
        observers=[Recorder(EventLog(stream)), notes],
        height_m=target.height_m,
    )
    try:
        start = run.world.robot_pose
        displaced = 0.0
        while not run.done and run.world.now < seconds - 1e-9:
            run.step()
            here = run.world.robot_pose
            displaced = max(displaced, math.dist((start.x, start.y), (here.x, here.y)))
        report = run.referee.report()
    finally:
        run.close()
    return Outcome(
        report,
        stream.getvalue(),
        tuple(notes.states),
        notes.claims,
        displaced,
        frozenset(notes.faults),
        notes.lamp_burned,
    )


class _Notes:
    """An observer: states in order, faults ever raised, ticks with a claim."""

    def __init__(self) -> None:
        self.states: list[str] = []
        self.faults: set[str] = set()
        self.claims = 0
        self.lamp_burned = False

    def __call__(self, tick: Tick) -> None:
        if not self.states or self.states[-1] != tick.state:
            self.states.append(tick.state)
        self.faults.update(fault.key for fault in tick.faults)
        track = tick.percepts.track
        self.claims += tick.state in CLAIMING and track is not None and not track.value.lost
        self.lamp_burned |= tick.sent.lamp > 0.0
