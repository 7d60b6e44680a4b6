"""Error and time of the robot's dense matcher against OpenCV's, and how true its fractions of a pixel are.

`python -m bench.stereo --data DIR [--json] [--rounds N] [--full]`: error and time on every pair of DIR/stereo
and on the pairs that come with packages; time at 64 and 176 disparities on 352 x 288 pictures; sub-pixel
figures on simulated rooms with exact depth. One thread for everybody, all methods in turn in every round.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from bench import stereo_bars, stereo_figures, stereo_ours, stereo_subpixel
from bench.report import arguments, publish
from bench.stereo_data import OPENCV_DOC, StereoCase, folder_cases, registry_cases
from bench.stereo_peers import Method, peers, side_peers
from bench.stereo_rooms import DISPARITIES, RoomView, room_views
from robot.errors import UserError
from robot.vision.floor_aligned import FloorAlignedMatcher, floor_disparities
from robot.vision.stereo import Matcher

Row = dict[str, Any]

TIMED_DISPARITIES = (64, 176)
ROUNDS, FULL_ROUNDS = 20, 60
ROOMS, FULL_ROOMS = 16, 64
MARGIN_PX = 8.0
"""How much farther than the floor the floor-aligned matcher searches, here as by default."""
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def error_rows(
    case: StereoCase, timed: Sequence[Method], more: Sequence[Method], rounds: int
) -> Iterator[Row]:
    """bad-2.0 and time of every timed method on one pair; error alone of the further ones."""
    seconds = stereo_figures.interleaved_seconds(timed, case.left, case.right, case.disparities, rounds)
    ratios = stereo_figures.ratios(seconds, "sgbm")
    for method in (*timed, *more):
        found = method.run(case.left, case.right, case.disparities)
        row: Row = {
            "case": case.name,
            "method": method.name,
            "disparities": case.disparities,
            "bad2_all": stereo_figures.bad_2(case.truth, found, case.known),
            "bad2_non_occluded": stereo_figures.bad_2(case.truth, found, case.non_occluded),
        }
        if method.name in seconds:
            row["milliseconds"] = 1e3 * float(np.median(seconds[method.name]))
            row["ratio"] = ratios[method.name]
        yield row


def time_rows(case: StereoCase, methods: Sequence[Method], rounds: int) -> Iterator[Row]:
    """Times on the case's pictures at the size of the robot's."""
    left, right = stereo_figures.timed_pair(case)
    for disparities in TIMED_DISPARITIES:
        seconds = stereo_figures.interleaved_seconds(methods, left, right, disparities, rounds)
        for name, ratio in stereo_figures.ratios(seconds, "sgbm").items():
            yield {
                "case": f"{case.name} as 352x288",
                "method": name,
                "disparities": disparities,
                "milliseconds": 1e3 * float(np.median(seconds[name])),
                "ratio": ratio,
            }


def sub_pixel_rows(views: Sequence[RoomView], matchers: dict[str, Matcher]) -> Iterator[Row]:
    """Sub-pixel figures of every matcher over all views, plain and through `FloorAlignedMatcher`."""
    for name, matcher in matchers.items():
        for case, sample in (("rooms plain", plain_samples), ("rooms floor-aligned", aligned_samples)):
            found = stereo_subpixel.joined(sample(view, matcher) for view in views)
            yield {"case": case, "method": name, "samples": len(found.true)} | asdict(
                stereo_subpixel.figures(found)
            )


def plain_samples(view: RoomView, matcher: Matcher) -> stereo_subpixel.Samples:
    """Measured pixels of one view, matched as it is."""
    found, case = matcher(view.case.left, view.case.right), view.case
    return stereo_subpixel.take(case.truth, case.non_occluded, found.values, found.valid, found.sigma_px)


def aligned_samples(view: RoomView, matcher: Matcher) -> stereo_subpixel.Samples:
    """Measured pixels of one view, matched with the floor aligned; the grid of pixels moves along."""
    case = view.case
    aligned = FloorAlignedMatcher(matcher, view.rig, view.mount, MARGIN_PX)
    found = aligned(case.left, case.right, view.pan, view.tilt)
    floor = floor_disparities(view.rig, view.mount, view.pan, view.tilt, len(case.truth))
    grid = np.maximum(floor - MARGIN_PX, 0.0).astype(np.float32)[:, None]
    return stereo_subpixel.take(
        case.truth, case.non_occluded, found.values, found.valid, found.sigma_px, grid
    )


def sub_pixel_matchers() -> dict[str, Matcher]:
    """The three presets."""
    return {preset: stereo_ours.matcher(preset, DISPARITIES) for preset in stereo_ours.PRESETS}


def measure(options: argparse.Namespace) -> tuple[list[Row], list[Row], list[Row]]:
    """Rows of errors, of times and of sub-pixel figures."""
    given = folder_cases(Path(options.data)) if options.data else ()
    registered, absent = registry_cases(Path(options.opencv_doc))
    cases = (*given, *registered)
    if not cases:
        raise UserError("no stereo pairs: give --data DIR or install scikit-image")
    for words in absent:
        print(words, file=sys.stderr)
    ours = stereo_ours.ours()
    views = list(room_views(FULL_ROOMS if options.full else ROOMS))
    errors = [
        row for case in cases for row in error_rows(case, (*peers(), *ours), side_peers(), options.rounds)
    ]
    timed = (*peers(), side_peers()[-1], *ours)
    largest = max(cases, key=lambda case: case.truth.size)
    times = [row for case in (largest, views[0].case) for row in time_rows(case, timed, options.rounds)]
    return errors, times, list(sub_pixel_rows(views, sub_pixel_matchers()))


def main() -> int:
    """Measure and print."""
    parser = arguments(__doc__ or "")
    parser.add_argument(
        "--rounds", type=int, help=f"runs a median is taken of, {ROUNDS} ({FULL_ROUNDS} full)"
    )
    parser.add_argument(
        "--opencv-doc", default=str(OPENCV_DOC), help="folder of Debian's opencv-doc pictures"
    )
    options = parser.parse_args()
    options.data = options.data or os.environ.get("ROBOT_BENCH_DATA")
    options.rounds = options.rounds or (FULL_ROUNDS if options.full else ROUNDS)
    if options.rounds < 1:
        parser.error("--rounds: must be 1 or more")
    cv2.setNumThreads(1)
    try:
        errors, times, sub_pixel = measure(options)
    except UserError as error:
        parser.exit(2, f"{error}\n")
    found = stereo_bars.bars(errors, times, sub_pixel)
    if options.json:
        return publish("stereo", [*errors, *times, *sub_pixel], found, as_json=True)
    publish("stereo: bad-2.0 in percent", errors, [], as_json=False)
    publish("stereo: time", times, [], as_json=False)
    return publish("stereo: sub-pixel", sub_pixel, found, as_json=False)


def start_again_with_one_thread() -> None:
    """Numerical libraries read their number of threads once, when they are loaded: set it and begin anew."""
    if any(os.environ.get(name) != "1" for name in THREADS):
        one = dict.fromkeys(THREADS, "1")
        os.execve(sys.executable, [sys.executable, "-m", "bench.stereo", *sys.argv[1:]], os.environ | one)


if __name__ == "__main__":
    start_again_with_one_thread()
    sys.exit(main())
