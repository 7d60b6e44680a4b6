"""The judge of the free-space bench on percepts made by hand, and what its rows and bars make of verdicts."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bench.freespace_bars import bars, row, rows, worst_first
from bench.freespace_judge import CELL_M, Verdict, judge
from bench.freespace_truth import FloorTruth, Gap, HandTruth
from bench.freespace_views import BASE_MOUNT, BASE_RIG, HAND_MOUNT, HAND_RIG, FreeSpaceView
from robot.messages import FreeSpace, Passage
from robot.sim.solids import Solid

BEARINGS = np.radians(np.arange(-24.0, 24.1, 1.5))


def gate(width: float, away: float = 1.0) -> FloorTruth:
    sides = tuple(
        Solid("box", away + 0.05, side * (0.5 * width + 0.75), 0.0, 0.05, 0.75, 0.0, 0.6) for side in (-1, 1)
    )
    return FloorTruth(sides, gap=Gap(width, (away, 0.0, 0.0)))


def base_view(truth: FloorTruth) -> FreeSpaceView:
    blank = np.zeros((288, 352, 3), np.uint8)
    depth = np.ones((288, 352), np.float32)
    return FreeSpaceView("narrow", 5, blank, blank, BASE_RIG, BASE_MOUNT, 0.0, 0.3, depth, truth)


def hand_view(truth: HandTruth) -> FreeSpaceView:
    blank = np.zeros((288, 352, 3), np.uint8)
    depth = np.ones((288, 352), np.float32)
    return FreeSpaceView("hand_narrow", 5, blank, blank, HAND_RIG, HAND_MOUNT, 0.0, 0.0, depth, truth)


def passage(diameter: float, position: tuple[float, float, float], safe: bool) -> Passage:
    return Passage((176.0, 144.0), 40.0, diameter, position, safe=safe)


def look(found: Passage | None, free: float = 0.9, obstacles: object = ((1.0, 0.4),)) -> FreeSpace:
    near, end = np.full(len(BEARINGS), 0.35), np.full(len(BEARINGS), free)
    return FreeSpace(BEARINGS, near, end, np.array(obstacles, np.float64).reshape(-1, 2), found)


def test_a_small_gap_called_safe_is_a_violation_and_the_body_touches() -> None:
    verdict = judge(base_view(gate(0.24)), look(passage(0.27, (1.0, 0.0, 0.16), True)))
    assert (verdict.may, verdict.safe, verdict.violation, verdict.touched) == (False, True, True, True)
    careful = judge(base_view(gate(0.24)), look(passage(0.24, (1.0, 0.0, 0.16), False)))
    assert (careful.found, careful.violation, careful.touched, careful.missed) == (True, False, False, False)


def test_a_wide_gap_must_be_safe_and_aimed_at() -> None:
    view = base_view(gate(0.32))
    good = judge(view, look(passage(0.32, (1.0, 0.0, 0.16), True)))
    assert (good.must, good.missed, good.touched, good.violation) == (True, False, False, False)
    assert judge(view, look(passage(0.32, (1.0, 0.0, 0.16), False))).missed
    assert judge(view, look(None)).missed
    beside = judge(view, look(passage(0.32, (1.0, 0.05, 0.16), True)))
    assert (beside.touched, beside.violation) == (True, False)


def test_a_gap_between_may_be_either() -> None:
    view = base_view(gate(0.28))
    for safe in (True, False):
        verdict = judge(view, look(passage(0.28, (1.0, 0.0, 0.16), safe)))
        assert (verdict.violation, verdict.missed, verdict.touched) == (False, False, False)


def test_errors_of_width_and_centre_are_told_in_the_gap_and_not_elsewhere() -> None:
    view = base_view(gate(0.32))
    verdict = judge(view, look(passage(0.336, (1.03, 0.04, 0.3), False)))
    assert verdict.diameter_error == pytest.approx(0.05)
    assert verdict.centre_error == pytest.approx(0.05)
    assert verdict.away == pytest.approx(1.0)
    assert judge(view, look(passage(0.3, (1.0, 0.5, 0.1), False))).diameter_error is None


def test_a_hand_s_centre_may_lie_anywhere_along_a_slot() -> None:
    slot = Gap(0.05, (0.25, 0.0, 0.0), 0.05, slack=(0.02, 0.0))
    view = hand_view(HandTruth((), gap=slot))
    assert judge(view, look(passage(0.05, (0.25, 0.018, 0.0), True))).centre_error == pytest.approx(0.0)
    assert judge(view, look(passage(0.05, (0.25, 0.024, 0.003), True))).centre_error == pytest.approx(0.005)
    turned = hand_view(HandTruth((), gap=replace(slot, yaw=0.2)))
    assert judge(turned, look(passage(0.05, (0.25, 0.0, 0.0), True))).centre_error is None


def test_a_hand_that_would_touch_is_told() -> None:
    board = Solid("box", 0.3, 0.06, 0.0, 0.01, 0.03, -0.3, 0.3)
    view = hand_view(HandTruth((board,), gap=Gap(0.06, (0.29, 0.0, 0.0))))
    assert judge(view, look(passage(0.06, (0.29, 0.02, 0.0), True))).touched
    assert not judge(view, look(passage(0.06, (0.29, -0.01, 0.0), True))).touched


@pytest.mark.parametrize(("free", "beyond"), [(0.95, 0.0), (1.0 + CELL_M, 0.0), (1.15, 0.06), (1.3, 0.2)])
def test_free_floor_may_end_one_cell_late(free: float, beyond: float) -> None:
    wall = FloorTruth((Solid("box", 1.05, 0.0, 0.0, 0.05, 2.0, 0.0, 1.0),))
    verdict = judge(base_view(wall), look(None, free))
    # At its foot straight ahead the wall is one metre away, aside a little more.
    assert verdict.overreach == pytest.approx(max(free - 1.0 - CELL_M, 0.0), abs=0.012)
    assert (verdict.overreach > 0.0) is (beyond > 0.0)


def test_floor_that_was_not_seen_free_reaches_nowhere() -> None:
    wall = FloorTruth((Solid("box", 0.3, 0.0, 0.0, 0.05, 2.0, 0.0, 1.0),))
    nothing = FreeSpace(BEARINGS, np.full(33, 0.9), np.full(33, 0.9), np.zeros((0, 2)))
    assert judge(base_view(wall), nothing).overreach == 0.0
    # One bearing is seen free before the wall, the others nowhere: theirs say nothing.
    some = replace(nothing, near=np.where(BEARINGS > 0.4, 0.2, 0.9), free=np.where(BEARINGS > 0.4, 0.3, 0.9))
    assert judge(base_view(wall), some).overreach == 0.0
    empty = FreeSpace(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 2)))
    assert judge(base_view(wall), empty).overreach == 0.0


def test_a_post_must_be_told_and_nothing_else() -> None:
    post = FloorTruth((Solid("cylinder", 0.8, 0.1, 0.0, 0.02, 0.02, 0.0, 1.0),))
    told = judge(base_view(post), look(None, 0.7, ((0.79, 0.1),)))
    assert (told.reported, told.phantom) == (True, False)
    silent = judge(base_view(post), look(None, 0.7, ()))
    assert (silent.reported, silent.phantom) == (False, False)
    ghost = judge(base_view(post), look(None, 0.7, ((0.79, 0.1), (0.8, -0.3))))
    assert (ghost.reported, ghost.phantom) == (True, True)
    far = judge(base_view(FloorTruth(())), look(None, 2.0, ((2.0, 0.0),)))
    assert (far.reported, far.phantom) == (None, False)


def verdict(**told: Any) -> Verdict:
    plain = Verdict("narrow", 1, True, True, True, True, False, False, False, 0.01, 0.01, 1.0)
    return replace(plain, **told)


def holds(verdicts: list[Verdict]) -> dict[str, bool]:
    return {bar.name: bar.holds for bar in bars(rows(verdicts))}


def test_good_verdicts_hold_every_bar_and_each_fault_breaks_its_own() -> None:
    good = [verdict(seed=k) for k in range(50)]
    assert all(holds(good).values())
    assert len(holds(good)) == 6
    cases = {
        "safe where nothing fits": verdict(violation=True, may=False, must=False),
        "the body touches": verdict(touched=True),
        "free beyond an obstacle": verdict(overreach=0.01),
    }
    for words, fault in cases.items():
        broken = [name for name, kept in holds([*good, fault]).items() if not kept]
        assert len(broken) == 1
        assert words in broken[0]


def test_two_of_a_hundred_may_be_missed_three_may_not() -> None:
    for missed, kept in ((2, True), (3, False)):
        many = [verdict(missed=k < missed, safe=k >= missed) for k in range(100)]
        assert row("narrow", many)["safe"] == pytest.approx(1 - missed / 100)
        assert all(holds(many).values()) is kept


def test_accuracy_is_judged_at_its_distance_alone() -> None:
    near = [verdict(away=away, diameter_error=0.3, centre_error=0.2) for away in (0.7, 0.84, 1.16, 1.4)]
    figures = row("narrow", near)
    assert figures["gaps"] == 0
    assert math.isnan(figures["width95"])
    assert all(holds(near).values())
    at = [verdict(diameter_error=0.06, centre_error=0.032) for _ in range(20)]
    assert sorted(name for name, kept in holds(at).items() if not kept) == [
        "narrow: centre's error, of the distance at 1 m, 95 % of gaps",
        "narrow: width's error, 95 % of gaps",
    ]
    hand = [verdict(kind="hand_narrow", away=0.25, centre_error=0.011, diameter_error=0.01)]
    assert [name for name, kept in holds(hand).items() if not kept] == [
        "hand_narrow: centre's error, m at 0.25 m, 95 % of gaps"
    ]


def test_a_post_not_told_breaks_the_bar() -> None:
    told = [verdict(kind="post", must=False, reported=k > 1) for k in range(50)]
    assert any("reported" in name and not kept for name, kept in holds(told).items())


def test_rows_keep_the_order_of_kinds_and_the_worst_come_first() -> None:
    mixed = [verdict(kind="wall"), verdict(kind="open", missed=True), verdict(kind="wall", touched=True)]
    assert [r["kind"] for r in rows(mixed)] == ["wall", "open"]
    assert [(v.kind, v.touched) for v in worst_first(mixed)] == [
        ("wall", True),
        ("open", False),
        ("wall", False),
    ]
