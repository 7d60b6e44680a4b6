"""How well taught objects are found: `python -m bench.detector --data DIR [--json] [--full]`.

UIUC cars (80 + 80 training crops, both test sets by the set's own rule) and ETH-80 cups put into real
pictures, clean, half hidden, dark, all at once: windows as the robot proposes with them, and which pixels
the ferns give a found cup; ferns alone, SIFT with a homography and matchTemplate beside them. DIR is laid
out as the shared data: detection/uiuc_cars, detection/eth80_cups, stereo, tracking. Exit code 0 if all bars
hold.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.detector_composites import (
    CONDITIONS,
    Condition,
    Shown,
    backgrounds,
    box_of,
    cup_views,
    cut,
    darkened,
    put,
)
from bench.detector_peers import SiftHomography, TemplateScales
from bench.detector_sheet import sheet
from bench.detector_uiuc import CROP, Found, crops, equal_error_rate, grey, truths
from bench.report import Bar, arguments, publish
from robot.errors import UserError
from robot.messages import Image
from robot.vision.ferns import FernDetector, Sample
from robot.vision.view_warps import View as TaughtView
from robot.vision.window_detector import WindowDetector

Row = dict[str, Any]
Mask = NDArray[np.bool_]
View = tuple[Image, Mask]

CROPS = 80
CAR_SCALES = {
    "single": [2.0 * 2 ** (step / 4) for step in (-1, 0, 1)],
    "multi": [2.0 ** (step / 4) for step in range(2, 10)],
}
"""Of the ferns, sizes over 48 px: cars of 100 px, of 89 to 212 px."""
CUP_SCALES = [2.0 ** (step / 4) for step in range(9)]
CAR_WINDOWS = {
    "single": [1.75 * 2 ** (step / 4) for step in (-1, 0, 1)],
    "multi": [1.5 * 2 ** (step / 4) for step in range(7)],
}
"""Of the windows, edges of squares as large as the car over theirs."""
CUP_WINDOWS = [1.2 * 2 ** (step / 4) for step in range(8)]
EER, CAR_MS, LEAST, LEAST_WINDOW = 0.94, 40.0, 0.1, 0.01
FALSE_PER_IMAGE = 0.1
RECALL = {"clean": 0.95, "half hidden": 0.9, "dark": 0.9, "all at once": 0.85}
SUPPORT_IOU, LEAST_IOU = 0.6, 0.5
PICTURES, FULL = 40, 200


def cars(folder: Path, seeds: Sequence[int]) -> list[Row]:
    """A row for each set and choice of training crops."""
    rows = []
    for seed in seeds:
        views, without = crops(folder, CROPS, seed)
        start = time.perf_counter()
        windows = WindowDetector.fit([TaughtView(view, CROP) for view in views], without, seed=seed)
        taught = time.perf_counter() - start
        ferns = FernDetector.fit([Sample(view, CROP, "car") for view in views], without, seed=seed)
        for kind in CAR_SCALES:
            true = truths(folder, kind)
            found: dict[str, list[Found]] = {"windows": [], "ferns": []}
            times = []
            for name in true:
                picture = grey(folder / kind / name)
                start = time.perf_counter()
                told = windows.predict(picture, CAR_WINDOWS[kind], least_score=LEAST_WINDOW)
                times.append((time.perf_counter() - start) * 352 * 288 / picture.size)
                found["windows"] += [Found(name, one.box, one.score) for one in told]
                voted = ferns.predict(picture, CAR_SCALES[kind], least_score=LEAST)
                found["ferns"] += [Found(name, one.box, one.score) for one in voted]
            rates = {who: equal_error_rate(told, true, scales=kind == "multi") for who, told in found.items()}
            rows.append(
                {"set": f"cars, {kind}", "seed": seed, "images": len(true),
                 "eer": round(rates["windows"][0], 4), "recall": round(rates["windows"][1], 4),
                 "ferns": round(rates["ferns"][0], 4),
                 "ms": round(1000 * float(np.median(times)), 1), "fit s": round(taught, 1)}
            )  # fmt: skip
    return rows


def recall_at(hits: Sequence[float], false: Sequence[float], images: int) -> float:
    """Share of hits that score above all but a tenth false alarm for each image.

    >>> recall_at([0.9, 0.4], [0.5, 0.45, 0.3], images=10)
    0.5
    """
    ranked = sorted(false, reverse=True)
    allowed = int(FALSE_PER_IMAGE * images)
    threshold = ranked[allowed] if allowed < len(ranked) else -np.inf
    return float(np.mean([score > threshold for score in hits]))


class _Tally:
    """What one detector answered to the pictures of one condition."""

    def __init__(self) -> None:
        self.hits: list[float] = []
        self.false: list[float] = []
        self.images = 0

    def add(self, found: Sequence[Found], shown: Shown | None) -> None:
        """Count the detections of one picture; shown: what is in it, None: nothing."""
        self.images += 1
        hit = -np.inf
        for one in found:
            if shown is not None and one.box.iou(shown.box) >= LEAST_IOU:
                hit = max(hit, one.score)
            else:
                self.false.append(one.score)
        if shown is not None:
            self.hits.append(hit)

    def recall(self) -> float:
        return recall_at(self.hits, self.false, self.images)


def cups(data: Path, count: int) -> list[Row]:
    """A row for each cup and condition; `count` pictures with it and as many without."""
    pictures = backgrounds(data)
    rows = []
    for number, folder in enumerate(sorted((data / "detection" / "eth80_cups").iterdir())):
        rng = np.random.default_rng([number, 80])
        order = rng.permutation(len(pictures))
        known, fresh = ([pictures[int(i)] for i in part] for part in np.array_split(order, 2))
        views = cup_views(folder)
        finders = _taught(folder.name, views[::2], [cut(image, rng) for image in known * 2], number)
        for how in CONDITIONS:
            shown = [_pictures(views[1::2][i % len(views[1::2])], fresh, how, rng) for i in range(count)]
            rows.append(
                {"set": f"{folder.name}, {how.name}", "images": 2 * count, **_figures(finders, shown)}
            )
    return rows


@dataclass(frozen=True, slots=True)
class _Finders:
    windows: WindowDetector
    ferns: FernDetector
    peers: tuple[SiftHomography, TemplateScales]


def _taught(label: str, views: Sequence[View], without: Sequence[Image], seed: int) -> _Finders:
    samples = [Sample(view, box_of(mask), label, mask) for view, mask in views]
    trimmed = [_trimmed(view, mask) for view, mask in views]
    ferns = FernDetector.fit(samples, without, seed=seed)
    windows = WindowDetector.fit(
        [TaughtView(one.image, one.box, one.mask) for one in samples], without, seed=seed
    )
    return _Finders(windows, ferns, (SiftHomography(trimmed), TemplateScales(trimmed)))


def _trimmed(view: Image, mask: Mask) -> Image:
    box = box_of(mask)
    return view[int(box.y) : int(box.y + box.h), int(box.x) : int(box.x + box.w)]


def _pictures(
    view: View, fresh: Sequence[Image], how: Condition, rng: np.random.Generator
) -> tuple[Shown, Image]:
    """A picture with the view and one without."""
    ground, hider, empty = (cut(fresh[int(rng.integers(len(fresh)))], rng) for _ in range(3))
    return put(*view, ground, hider, how, rng), darkened(empty, rng) if how.dark else empty


def _figures(finders: _Finders, pictures: Sequence[tuple[Shown, Image]]) -> Row:
    """Recall of all finders at the allowed false alarms, overlap of supports, time of the windows."""
    tallies = {name: _Tally() for name in ("windows", "ferns", *(peer.name for peer in finders.peers))}
    label = next(iter(finders.ferns.classes))
    overlaps, times = [], []
    for shown, empty in pictures:
        for image, truth in ((shown.image, shown), (empty, None)):
            start = time.perf_counter()
            told = finders.windows.predict(image, CUP_WINDOWS, least_score=LEAST_WINDOW)
            times.append(time.perf_counter() - start)
            tallies["windows"].add([Found("", one.box, one.score) for one in told], truth)
            voted = finders.ferns.predict(image, CUP_SCALES, least_score=LEAST)
            tallies["ferns"].add([Found("", one.box, one.score) for one in voted], truth)
            for peer in finders.peers:
                tallies[peer.name].add(peer.find("", image), truth)
            if truth is not None and told and told[0].box.iou(truth.box) >= LEAST_IOU:
                seen, mine = truth.visible, finders.ferns.support(image, label, told[0].box)
                overlaps.append(float((mine & seen).sum() / (mine | seen).sum()))
    recalls = {name: round(tally.recall(), 3) for name, tally in tallies.items()}
    overlap = round(float(np.mean(overlaps)), 3) if overlaps else 0.0
    return {**recalls, "support": overlap, "ms": round(1000 * float(np.median(times)), 1)}


def bars(rows: Sequence[Row]) -> list[Bar]:
    """What the rows are held to; of several seeds and cups the mean."""
    found = []
    multi = [row for row in rows if row["set"] == "cars, multi"]
    if multi:
        found.append(Bar("cars, multi-scale: equal-error rate", _mean(multi, "eer"), EER, at_most=False))
        found.append(Bar("cars, multi-scale: ms for 352 x 288", _mean(multi, "ms"), CAR_MS))
    for name, recall in RECALL.items():
        of = [row for row in rows if row["set"].endswith(f", {name}")]
        if of:
            found.append(Bar(f"cups, {name}: recall", _mean(of, "windows"), recall, at_most=False))
            if name == "clean":
                found.append(Bar("cups, clean: support", _mean(of, "support"), SUPPORT_IOU, at_most=False))
    return found


def _drawn(data: Path, out: Path) -> int:
    """Votes, support and detections of one cup under every condition, as a picture."""
    folder = sorted((data / "detection" / "eth80_cups").iterdir())[0]
    rng = np.random.default_rng(8)
    known, fresh = (backgrounds(data)[part::2] for part in (0, 1))
    views = cup_views(folder)
    finder = _taught(folder.name, views[::2], [cut(image, rng) for image in known * 2], 0).ferns
    shown = [(how.name, _pictures(views[1::2][6], fresh, how, rng)[0]) for how in CONDITIONS]
    if not cv2.imwrite(str(out), sheet(finder, folder.name, shown, CUP_SCALES)):
        raise UserError(f"{out}: cannot be written; name a .png in a folder that exists")
    return 0


def _mean(rows: Sequence[Row], key: str) -> float:
    return round(float(np.mean([row[key] for row in rows])), 4)


def main(words: Sequence[str] | None = None) -> int:
    """Run the bench; returns the exit code."""
    parser = arguments(__doc__ or "")
    parser.add_argument("--sheet", help="write a picture of votes, support and detections on the cups here")
    options = parser.parse_args(words)
    cv2.setNumThreads(1)
    try:
        if not options.data:
            raise UserError("give the folder of real images with --data DIR")
        data = Path(options.data)
        if options.sheet:
            return _drawn(data, Path(options.sheet))
        rows = cars(data / "detection" / "uiuc_cars", range(5 if options.full else 3))
        rows += cups(data, FULL if options.full else PICTURES)
    except UserError as problem:
        print(problem, file=sys.stderr)
        return 2
    return publish("detector", rows, bars(rows), options.json)


if __name__ == "__main__":
    raise SystemExit(main())
