"""What the stereo bench's rows are held to. Pure: rows in, bars out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bench.report import Bar

Rows = Sequence[Mapping[str, Any]]
Table = Mapping[tuple[str, str], float]

TIME_RATIOS = {"lite": 0.35, "normal": 1.0, "fine": 1.8}
"""Of each preset's time to SGBM's, at most."""
DRIVEN_BY = ("normal", "fine")
MEDIAN_ERROR_PX = 0.12
WITHIN_1_SIGMA = (0.6, 0.8)


def bars(errors: Rows, times: Rows, sub_pixel: Rows) -> list[Bar]:
    """All bars: errors of every preset, times at 352 x 288, sub-pixel error and sigma.

    errors: rows with case, method, bad2_all, bad2_non_occluded; times: case, method, disparities, ratio;
    sub_pixel: case, method, median_error_px, within_1_sigma.
    """
    return [
        *normal_bars(errors),
        *fine_bars(errors),
        *lite_bars(errors),
        *time_bars(times),
        *sub_pixel_bars(sub_pixel),
    ]


def normal_bars(errors: Rows) -> list[Bar]:
    """All pixels: better than SGBM on every pair, than filtered 3WAY on most; non-occluded: on 3 of 4."""
    every, seen = _table(errors, "bad2_all"), _table(errors, "bad2_non_occluded")
    cases = _cases(errors)
    return [
        *_below_on_every(every, cases, "normal", "sgbm", "all pixels"),
        _below_on_many(every, cases, "normal", "3way_filtered", "all pixels", len(cases) // 2 + 1),
        _below_on_many(seen, cases, "normal", "sgbm", "non-occluded", math.ceil(0.75 * len(cases))),
    ]


def fine_bars(errors: Rows) -> list[Bar]:
    """All that `normal` must over all pixels, and non-occluded better than SGBM on every pair."""
    every, seen = _table(errors, "bad2_all"), _table(errors, "bad2_non_occluded")
    cases = _cases(errors)
    return [
        *_below_on_every(every, cases, "fine", "sgbm", "all pixels"),
        _below_on_many(every, cases, "fine", "3way_filtered", "all pixels", len(cases) // 2 + 1),
        *_below_on_every(seen, cases, "fine", "sgbm", "non-occluded"),
    ]


def lite_bars(errors: Rows) -> list[Bar]:
    """Both errors below block matching's on every pair."""
    every, seen = _table(errors, "bad2_all"), _table(errors, "bad2_non_occluded")
    cases = _cases(errors)
    return [
        *_below_on_every(every, cases, "lite", "bm", "all pixels"),
        *_below_on_every(seen, cases, "lite", "bm", "non-occluded"),
    ]


def time_bars(times: Rows) -> list[Bar]:
    """Time of each preset over SGBM's, on each timed pair and number of disparities."""
    return [
        Bar(
            f"time over SGBM's, {row['method']}, {row['disparities']} disparities, {row['case']}",
            row["ratio"],
            TIME_RATIOS[row["method"]],
        )
        for row in times
        if row["method"] in TIME_RATIOS
    ]


def sub_pixel_bars(sub_pixel: Rows) -> list[Bar]:
    """Median error and the share within one sigma of what the robot drives by, plain and floor-aligned.

    `lite` sees two pixels as one: its figures are told, not held to this.
    """
    found: list[Bar] = []
    for row in sub_pixel:
        if row["method"] not in DRIVEN_BY:
            continue
        name, (low, high) = f"{row['method']}, {row['case']}", WITHIN_1_SIGMA
        found += [
            Bar(f"median |disparity error| px, {name}", row["median_error_px"], MEDIAN_ERROR_PX),
            Bar(f"share within one sigma, lower, {name}", row["within_1_sigma"], low, at_most=False),
            Bar(f"share within one sigma, upper, {name}", row["within_1_sigma"], high),
        ]
    return found


def _below_on_every(table: Table, cases: Sequence[str], ours: str, peer: str, pixels: str) -> list[Bar]:
    return [
        Bar(
            f"bad-2.0 {pixels}, {ours} below {peer}, {case}",
            table[case, ours],
            _just_below(table[case, peer]),
        )
        for case in cases
    ]


def _below_on_many(table: Table, cases: Sequence[str], ours: str, peer: str, pixels: str, least: int) -> Bar:
    wins = sum(table[case, ours] < table[case, peer] for case in cases)
    return Bar(f"pairs with bad-2.0 {pixels}, {ours} below {peer}", wins, least, at_most=False)


def _just_below(value: float) -> float:
    return math.nextafter(value, -math.inf)


def _table(rows: Rows, figure: str) -> Table:
    return {(row["case"], row["method"]): row[figure] for row in rows}


def _cases(rows: Rows) -> list[str]:
    return list(dict.fromkeys(row["case"] for row in rows))
