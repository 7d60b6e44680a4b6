"""Bars say what the matcher must hold, neither less nor more."""

import pytest

from bench.stereo_bars import bars, sub_pixel_bars, time_bars

CASES = ("a", "b", "c", "d")
GOOD = {
    "bm": (9.0, 8.0), "sgbm": (5.0, 4.0), "3way_filtered": (4.0, 3.0),
    "lite": (7.0, 6.0), "normal": (3.5, 3.5), "fine": (3.4, 2.5),
}  # fmt: skip


def error_rows(**changes):
    """Rows of four cases; changes: method_case=(all, non-occluded)."""
    return [
        {"case": case, "method": method, "bad2_all": every, "bad2_non_occluded": seen}
        for case in CASES
        for method in GOOD
        for every, seen in [changes.get(f"{method}_{case}", GOOD[method])]
    ]


def failing(rows):
    return [bar.name for bar in bars(rows, [], []) if not bar.holds]


def test_a_good_matcher_keeps_every_bar():
    assert failing(error_rows()) == []


@pytest.mark.parametrize(
    ("changes", "broken"),
    [
        ({"normal_b": (5.0, 3.5)}, 1),  # equal is not below
        ({"normal_b": (4.5, 4.5)}, 0),  # one of four may miss 3way and the non-occluded error
        ({"normal_b": (4.5, 4.5), "normal_c": (3.9, 4.5)}, 1),  # two of four may not
        ({"normal_b": (4.5, 1.0), "normal_c": (4.5, 1.0)}, 1),  # two of four are not most
        ({"fine_a": (3.4, 4.1)}, 1),
        ({"fine_a": (5.1, 2.5)}, 1),
        ({"lite_d": (9.1, 6.0)}, 1),
        ({"lite_d": (7.0, 8.1)}, 1),
        ({"normal_a": (float("nan"), 1.0)}, 1),
    ],
)
def test_each_demand_breaks_its_own_bar(changes, broken):
    assert len(failing(error_rows(**changes))) == broken


def test_every_timed_row_of_ours_has_the_bar_of_its_preset():
    rows = [
        {"case": "x", "method": method, "disparities": count, "ratio": 1.5}
        for method in ("sgbm", "lite", "normal", "fine")
        for count in (64, 176)
    ]
    found = time_bars(rows)
    assert [(bar.bar, bar.holds) for bar in found] == [
        (0.35, False), (0.35, False), (1.0, False), (1.0, False), (1.8, True), (1.8, True),
    ]  # fmt: skip
    assert len({bar.name for bar in found}) == 6


@pytest.mark.parametrize(
    ("error", "share", "holds"),
    [
        (0.12, 0.7, True),
        (0.121, 0.7, False),
        (0.1, 0.59, False),
        (0.1, 0.81, False),
        (float("nan"), 0.7, False),
    ],
)
def test_sub_pixel_bars(error, share, holds):
    row = {"case": "rooms", "method": "normal", "median_error_px": error, "within_1_sigma": share}
    peer = {**row, "method": "semi_global", "median_error_px": 9.0}
    assert all(bar.holds for bar in sub_pixel_bars([row, peer])) is holds
