"""Motion of blocks in real videos: `python -m bench.diamond --data DIR [--video DIR] [--json] [--full]`.

48 px blocks (see `bench.diamond_video` for which) are looked for within +-7 and +-14 px by the plain and the
improved diamond search, from no motion, as published, and by `find_block`: from no motion, the motion one
frame ago as it found it itself, and the median of the three nearest blocks before it in the same frame. The
shares: how often the vector is the full search's, or one as low within 1e-9; "near": as low within 2 %. Times
are per block, the least of ROUNDS interleaved calls, one thread; "x" is how many times ours the others take:
matchTemplate with minMaxLoc over the same window, SQDIFF being its fastest mode that measures a difference;
CCORR is faster, finds bright places and has no bar. Putting the prediction together ("predict us") is not
part of our time. Exit code 0 if all bars hold.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from bench import diamond_subpixel
from bench.diamond_video import Case, Picture, cases, sources
from bench.report import Bar, arguments, publish
from robot.errors import UserError
from robot.vision.block_motion import confidence, find_block, predictions
from robot.vision.diamond import (
    BlockDistortion,
    Displacement,
    Motion,
    diamond_search,
    full_search,
    improved_diamond_search,
)

Row = dict[str, Any]

WINDOWS = (7, 14)
PAIRS, FULL_PAIRS, ROUNDS, FULL_EVERY = 20, 80, 3, 10
SAME, POINTS, FASTER = 0.97, 25.0, 2.0
BIAS_PX = 0.05
_TIE, _NEAR, _NEIGHBOURS = 1e-9, 1.02, 3


@dataclass(frozen=True, slots=True)
class Answer:
    """What the searches said to one case. seconds: least time of each contender."""

    case: Case
    motions: dict[str, Motion]
    least: float
    confidence: float
    seconds: dict[str, float]

    def same(self, name: str) -> bool:
        """True if the search found the full search's vector or one as low."""
        return self.motions[name].distortion <= self.least + _TIE

    def near(self, name: str) -> bool:
        """True if its distortion is within 2 % of the least."""
        return self.motions[name].distortion <= self.least * _NEAR + _TIE


def answers(found: Sequence[Case], window: int) -> list[Answer]:
    """Every search's answer to every case; blocks of one frame tell their motions to the later ones."""
    told: list[Answer] = []
    beside: list[tuple[Displacement, Displacement]] = []
    at: tuple[int, str] | None = None
    for index, case in enumerate(found):
        if at != (case.frame, case.kind):
            at, beside = (case.frame, case.kind), []
        answer = _answer(case, window, _nearest(beside, case), timed_full=index % FULL_EVERY == 0)
        beside.append(((case.left, case.top), _vector(answer.motions["ours"])))
        told.append(answer)
    return told


def _answer(case: Case, window: int, neighbours: Sequence[Displacement], *, timed_full: bool) -> Answer:
    _, middle, last = case.pictures
    left, top, block = case.left, case.top, case.block
    known = find_block(case.block_before, middle, left, top, window=window)
    moved = _vector(known)
    start = predictions(moved, neighbours)
    distortion = BlockDistortion(block, last, left, top)
    motions = {
        "full": full_search(distortion, window=window),
        "plain": diamond_search(distortion, window=window),
        "improved": improved_diamond_search(distortion, window=window),
        "ours": find_block(block, last, left, top, start, window),
    }
    around = case.window(window)
    contenders: dict[str, Callable[[], object]] = {
        "ours": lambda: find_block(block, last, left, top, start, window),
        "predict": lambda: predictions(moved, neighbours),
        "SQDIFF": lambda: cv2.minMaxLoc(cv2.matchTemplate(around, block, cv2.TM_SQDIFF)),
        "CCORR": lambda: cv2.minMaxLoc(cv2.matchTemplate(around, block, cv2.TM_CCORR)),
        "improved": lambda: improved_diamond_search(BlockDistortion(block, last, left, top), window=window),
    }
    seconds = _least_times(contenders, ROUNDS)
    if timed_full:
        seconds |= _least_times({"full": lambda: full_search(distortion, window=window)}, 1)
    sure = confidence(block, last, left, top, motions["ours"], window)
    return Answer(case, motions, motions["full"].distortion, sure, seconds)


def _least_times(contenders: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    least = dict.fromkeys(contenders, float("inf"))
    for _ in range(rounds):
        for name, call in contenders.items():
            start = time.perf_counter()
            call()
            least[name] = min(least[name], time.perf_counter() - start)
    return least


def _nearest(beside: Sequence[tuple[Displacement, Displacement]], case: Case) -> list[Displacement]:
    def far(one: tuple[Displacement, Displacement]) -> int:
        return (one[0][0] - case.left) ** 2 + (one[0][1] - case.top) ** 2

    return [motion for _, motion in sorted(beside, key=far)[:_NEIGHBOURS]]


def _vector(motion: Motion) -> Displacement:
    return motion.dx, motion.dy


def row(sequence: str, window: int, told: Sequence[Answer]) -> Row:
    """The figures of some cases: shares of all searches, points, our time and what others take of it."""
    figures: Row = {"sequence": sequence, "window": window, "blocks": len(told)}
    for name in ("plain", "improved", "ours"):
        figures[name] = round(_mean([answer.same(name) for answer in told]), 4)
    figures["near"] = round(_mean([answer.near("ours") for answer in told]), 4)
    for name in ("plain", "improved", "ours"):
        figures[f"pts {name[:5]}"] = round(_mean([answer.motions[name].points for answer in told]), 1)
    ours = _mean([answer.seconds["ours"] for answer in told])
    figures["us"] = round(1e6 * ours, 1)
    figures["predict us"] = round(1e6 * _mean([answer.seconds["predict"] for answer in told]), 1)
    for name in ("SQDIFF", "CCORR", "improved", "full"):
        times = [answer.seconds[name] for answer in told if name in answer.seconds]
        figures[f"x {name[:6]}"] = round(float(np.mean(times)) / ours, 2) if times else float("nan")
    return figures


def confidence_rows(told: Sequence[Answer], window: int) -> list[Row]:
    """How often the vector is the full search's, in thirds of the blocks by confidence."""
    ranked = sorted(told, key=lambda answer: answer.confidence)
    found = []
    for part in np.array_split(np.arange(len(ranked)), 3):
        third = [ranked[int(index)] for index in part]
        if third:
            name = f"confidence {third[0].confidence:.2f}-{third[-1].confidence:.2f}"
            share = round(_mean([answer.same("ours") for answer in third]), 4)
            found.append({"sequence": name, "window": window, "blocks": len(third), "ours": share})
    return found


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else float("nan")


def bars(rows: Sequence[Row]) -> list[Bar]:
    """What the rows of all textured and box blocks, and the equiangular fit, are held to."""
    found = []
    for total in (one for one in rows if one.get("sequence") == "all"):
        within = f"+-{total['window']}: "
        found += [
            Bar(within + "share with the full search's vector", total["ours"], SAME, at_most=False),
            Bar(within + "points", total["pts ours"], POINTS),
            Bar(within + "x faster than matchTemplate SQDIFF", total["x SQDIFF"], FASTER, at_most=False),
            Bar(within + "x faster than full search", total["x full"], FASTER, at_most=False),
        ]
    for fit in (one for one in rows if one["sequence"].startswith("equiangular")):
        found.append(Bar(f"sub-pixel, {fit['sequence']}: bias in px", abs(fit["bias px"]), BIAS_PX))
    return found


def measure(data: str | None, video: str | None, pairs: int) -> list[Row]:
    """All rows: each sequence, all of them, blocks of any texture, thirds by confidence, sub-pixel."""
    videos = sources(data, video)
    chosen = [case for number, source in enumerate(videos) for case in cases(source, number, pairs)]
    named = list(dict.fromkeys(case.sequence for case in chosen))
    rows: list[Row] = []
    for window in WINDOWS:
        told = answers(chosen, window)
        held = [answer for answer in told if answer.case.kind != "any"]
        rows += [row(n, window, [a for a in held if a.case.sequence == n]) for n in named]
        rows.append(row("all", window, held))
        rows.append(row("of these boxes", window, [a for a in held if a.case.kind == "box"]))
        rows.append(row("any texture", window, [a for a in told if a.case.kind == "any"]))
        rows += confidence_rows(held, window)
    return rows + diamond_subpixel.rows(_samples(chosen))


def _samples(chosen: Sequence[Case]) -> list[Picture]:
    """One large picture of every fifth frame in use."""
    pictures = {(case.sequence, case.frame): case.pictures[2] for case in chosen if case.kind != "box"}
    large = [picture for picture in pictures.values() if min(picture.shape) >= 240]
    return large[::5]


def main(words: Sequence[str] | None = None) -> int:
    """Run the bench; returns the exit code."""
    parser = arguments(__doc__ or "")
    parser.add_argument("--video", help="folder with more video files")
    options = parser.parse_args(words)
    cv2.setNumThreads(1)
    try:
        rows = measure(options.data, options.video, FULL_PAIRS if options.full else PAIRS)
    except UserError as problem:
        print(problem, file=sys.stderr)
        return 2
    return publish("diamond", rows, bars(rows), options.json)


if __name__ == "__main__":
    raise SystemExit(main())
