"""Rows and bars of the free-space bench. Pure: verdicts in, figures out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from bench.freespace_hand_worlds import HAND_KINDS
from bench.freespace_judge import BASE_AT_M, HAND_AT_M, Verdict
from bench.report import Bar

Row = dict[str, Any]

SAFE_SHARE = 0.98
DIAMETER_SHARE = 0.05
TOLD_KINDS, TOLD_SHARE = ("step_up", "stair_down", "post", "table"), 0.98
"""Things with a texture or an edge must be told; bare painted walls are only kept from being free."""
BASE_CENTRE_SHARE, HAND_CENTRE_M = 0.03, 0.01


def row(kind: str, verdicts: Sequence[Verdict]) -> Row:
    """The figures of one kind: shares 0..1; errors relative, of a hand's centre in metres.

    NaN where no view of the kind says anything. blocked: views where nothing may pass; unsafe: of those,
    called safe; touched: called safe, and the body touches; must, missed, safe: views that must be called
    safe, how many are not, share of those that are; decided: share in which a passage is found; width50,
    width95, centre50, centre95: median and 95th percentile of the errors of `gaps` passages at the stated
    distance; beyond, by_m: views in which floor is called free behind an obstacle, by how much at worst;
    floor_m: free floor seen; told: share of views whose near obstacle is reported; false: views with an
    obstacle where there is none.
    """
    must = [v for v in verdicts if v.must]
    blocked = [v for v in verdicts if not v.may]
    hand = kind in HAND_KINDS
    near, far = HAND_AT_M if hand else BASE_AT_M
    at = [v for v in verdicts if v.diameter_error is not None and near <= v.away <= far]
    diameters = [v.diameter_error for v in at if v.diameter_error is not None]
    centres = [v.centre_error / (1.0 if hand else v.away) for v in at if v.centre_error is not None]
    told = [v.reported for v in verdicts if v.reported is not None]
    return {
        "kind": kind,
        "views": len(verdicts),
        "blocked": len(blocked),
        "unsafe": sum(v.violation for v in verdicts),
        "touched": sum(v.touched for v in verdicts),
        "must": len(must),
        "missed": sum(v.missed for v in must),
        "safe": _share(v.safe for v in must),
        "decided": _share(v.found for v in verdicts),
        "gaps": len(at),
        "width50": _quantile(diameters, 0.5),
        "width95": _quantile(diameters, 0.95),
        "centre50": _quantile(centres, 0.5),
        "centre95": _quantile(centres, 0.95),
        "beyond": sum(v.overreach > 0.0 for v in verdicts),
        "by_m": round(max((v.overreach for v in verdicts), default=0.0), 3),
        "floor_m": math.nan if hand else _quantile([v.floor for v in verdicts], 0.5),
        "told": _share(told),
        "false": sum(v.phantom for v in verdicts),
    }


def rows(verdicts: Iterable[Verdict]) -> list[Row]:
    """A row for every kind, in the order the kinds come."""
    kinds: dict[str, list[Verdict]] = {}
    for verdict in verdicts:
        kinds.setdefault(verdict.kind, []).append(verdict)
    return [row(kind, of_kind) for kind, of_kind in kinds.items()]


def bars(figures: Sequence[Mapping[str, Any]]) -> list[Bar]:
    """What each kind is held to; a figure a kind has no views for has no bar."""
    found: list[Bar] = []
    for figure in figures:
        kind, hand = figure["kind"], figure["kind"] in HAND_KINDS
        found.append(Bar(f"{kind}: safe where nothing fits", figure["unsafe"], 0))
        found.append(Bar(f"{kind}: safe and the body touches", figure["touched"], 0))
        if figure["must"]:
            found.append(Bar(f"{kind}: safe of gaps 15 % wider", figure["safe"], SAFE_SHARE, at_most=False))
        if not hand:
            found.append(Bar(f"{kind}: views with floor free beyond an obstacle", figure["beyond"], 0))
            if kind in TOLD_KINDS and not math.isnan(figure["told"]):
                found.append(Bar(f"{kind}: obstacles reported", figure["told"], TOLD_SHARE, at_most=False))
        if figure["gaps"]:
            centre = HAND_CENTRE_M if hand else BASE_CENTRE_SHARE
            words = "m at 0.25 m" if hand else "of the distance at 1 m"
            found.append(Bar(f"{kind}: width's error, 95 % of gaps", figure["width95"], DIAMETER_SHARE))
            found.append(Bar(f"{kind}: centre's error, {words}, 95 % of gaps", figure["centre95"], centre))
    return found


def worst_first(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Dangerous ones first, then obstacles not told, overreach, missed ones, false obstacles, errors."""
    return sorted(verdicts, key=_goodness)


def _goodness(v: Verdict) -> tuple[bool, bool, float, bool, bool, float]:
    dangerous = v.violation or v.touched
    return (
        not dangerous,
        v.reported is not False,
        -v.overreach,
        not v.missed,
        not v.phantom,
        -(v.diameter_error or 0.0),
    )


def _share(values: Iterable[bool]) -> float:
    told = list(values)
    return round(float(np.mean(told)), 4) if told else math.nan


def _quantile(values: Sequence[float], share: float) -> float:
    return round(float(np.quantile(values, share)), 4) if values else math.nan
