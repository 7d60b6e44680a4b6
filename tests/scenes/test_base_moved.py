"""Tachos against vision in closed loop: a base that hands move is noticed at once, driving never is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from closed_loop import scene_file

from robot.faults import TABLE
from robot.messages import Tick
from robot.model_file import Model
from robot.run_sim import SimOptions, SimRun
from robot.sim.injected import InjectedFault
from robot.sim.scene import load_scene

REST = '[target]\nobject = "box"\nx = 2.9\ny = 0.3\nheading_deg = 180.0\n'


SLOW_DETECTION_S = 1.0


@dataclass
class Watched:
    """When the fault was told and over, what was sent meanwhile, and how the looks before it were."""

    told: list[float] = field(default_factory=list)
    over: list[float] = field(default_factory=list)
    sent_while_told: int = 0
    known_free: list[int] = field(default_factory=list)
    deviation: float = 0.0
    looks: int = 0


def watch(run: SimRun, begin: float, until: float) -> Watched:
    seen = Watched()
    moved, last = False, -1.0
    try:
        while run.world.now < until - 1e-9:
            tick: Tick = run.step()
            now_moved = any(fault.key == "base.moved" for fault in tick.faults)
            if now_moved != moved:
                (seen.told if now_moved else seen.over).append(tick.now)
                seen.known_free.append(int(run.perception.map.seen_free().sum()))
            moved = now_moved
            seen.sent_while_told += moved and not tick.sent.twist.is_zero
            motion = tick.percepts.motion
            if motion is not None and motion.at != last and motion.at < begin:
                last, seen.looks = motion.at, seen.looks + 1
                seen.deviation = max(seen.deviation, motion.value.deviation)
    finally:
        run.close()
    return seen


@pytest.fixture
def start(tmp_path: Path, box: Model) -> Callable[..., SimRun]:
    def begin(*faults: InjectedFault) -> SimRun:
        scene = load_scene(scene_file(tmp_path, "plain", REST))
        return SimRun(scene, 1, box.finder, options=SimOptions(faults=faults), height_m=box.height_m)

    return begin


@pytest.mark.parametrize(
    ("kind", "begin", "lasts"),
    [("lifted", 3.6, 0.9), pytest.param("pushed", 1.6, None, marks=pytest.mark.slow)],
)
def test_a_base_that_hands_move_is_told_in_time_stops_and_begins_its_map_anew(
    start: Callable[..., SimRun], kind: str, begin: float, lasts: float | None
) -> None:
    seen = watch(start(InjectedFault("base", kind, begin, lasts)), begin, begin + 3.0)
    assert len(seen.told) == 1
    assert begin < seen.told[0] <= begin + TABLE["base.moved"].detection_s
    assert seen.sent_while_told == 0
    assert len(seen.over) == 1
    assert seen.over[0] >= begin + (lasts or 0.7) + 0.9, "not before it stood still for a second"
    disc_cells = 213
    before, after = seen.known_free
    assert before > 3 * disc_cells
    assert after < 1.3 * disc_cells, "only the place where it was set down"
    assert seen.looks > 0.7 * 8.0 * begin
    assert seen.deviation < 4.0, "as long as nobody touches it, searching, panning and driving are consistent"


@pytest.mark.parametrize(
    "kind",
    [
        "lifted_slowly",
        *(pytest.param(f"{way}_slowly", marks=pytest.mark.slow) for way in ("tipped", "pushed")),
    ],
)
def test_slow_hands_on_a_base_that_stands_are_noticed_within_a_second(
    start: Callable[..., SimRun], kind: str
) -> None:
    """5 cm or 10 degrees a second, while it looks at the target and does not drive yet."""
    begin = 0.9
    seen = watch(start(InjectedFault("base", kind, begin)), begin, begin + 1.1)
    assert len(seen.told) == 1
    assert begin < seen.told[0] <= begin + SLOW_DETECTION_S
    assert seen.sent_while_told == 0
    assert not seen.over
