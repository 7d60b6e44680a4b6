"""Stereo pairs with true disparity: folders of the benches' layout, and pairs that come with packages.

A folder holds left.png, right.png, truth.png (true disparity of the left picture times `scale`, 0 unknown)
and meta.toml (`scale`, `ndisp`). Registry pairs: scikit-image's motorcycle (Middlebury 2014), OpenCV's aloe.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.errors import UserError
from robot.messages import Image

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

OPENCV_DOC = Path("/usr/share/doc/opencv-doc/examples/data")
"""Where Debian's `opencv-doc` puts aloeL.jpg, aloeR.jpg and aloeGT.png."""
COVERED_BY_PX = 1.0
"""A pixel is covered by another that lands on it and is nearer by more than this: what is left of a slanted
surface when its columns fall together is no occlusion."""
ALOE_REDUCTION = 3
"""The original is 1282 x 1110; a third of it is the size Middlebury's own comparisons of 2006 used."""


@dataclass(frozen=True, slots=True, eq=False)
class StereoCase:
    """A rectified pair and its truth.

    left, right: (H, W, 3) uint8 BGR; truth: (H, W) float32 disparity of the left picture in px, NaN unknown;
    disparities: columns to search, 0 .. disparities - 1; non_occluded: (H, W) bool, known pixels that the
    right eye sees too.
    """

    name: str
    left: Image
    right: Image
    truth: Floats
    disparities: int
    non_occluded: Mask

    @property
    def known(self) -> Mask:
        """Pixels whose disparity is known."""
        return np.isfinite(self.truth)


def stereo_case(name: str, left: Image, right: Image, truth: Floats, disparities: int) -> StereoCase:
    """A case with its non-occluded pixels; truth NaN where unknown.

    Raises:
        UserError: pictures of different size, no known pixel, or truth beyond the search.
    """
    if not left.shape[:2] == right.shape[:2] == truth.shape:
        sizes = f"left {left.shape[:2]}, right {right.shape[:2]}, truth {truth.shape}"
        raise UserError(f"stereo pair {name}: the pictures differ in size ({sizes})")
    known = truth[np.isfinite(truth)]
    if not len(known):
        raise UserError(f"stereo pair {name}: its truth knows no pixel")
    if float(known.max()) > disparities:
        found = f"truth reaches {float(known.max()):.1f} px but ndisp is {disparities}"
        raise UserError(f"stereo pair {name}: {found}; raise ndisp or check scale in meta.toml")
    return StereoCase(name, left, right, truth, disparities, non_occluded(truth))


def non_occluded(truth: Floats) -> Mask:
    """Known pixels whose forward warp into the right picture is not covered by a nearer one.

    Pixel (u, v) of the left picture lands at column u - d of the right one, rounded; a z-buffer there keeps
    the largest d. What lands outside the right picture is not seen by it and counts as occluded.

    >>> truth = np.full((1, 8), 1.0, np.float32)
    >>> truth[0, 5:7] = 3.0  # lands on columns 2 and 3, where pixels 3 and 4 land
    >>> non_occluded(truth)[0].astype(int).tolist()
    [0, 1, 1, 0, 0, 1, 1, 1]
    """
    rows, columns = np.nonzero(np.isfinite(truth))
    disparity = truth[rows, columns]
    landing = np.rint(columns - disparity).astype(np.intp)
    inside = (landing >= 0) & (landing < truth.shape[1])
    rows, columns, disparity, landing = rows[inside], columns[inside], disparity[inside], landing[inside]
    nearest = np.full(truth.shape, -np.inf, np.float32)
    np.maximum.at(nearest, (rows, landing), disparity)
    mask = np.zeros(truth.shape, np.bool_)
    mask[rows, columns] = disparity >= nearest[rows, landing] - np.float32(COVERED_BY_PX)
    return mask


def folder_cases(data: Path) -> tuple[StereoCase, ...]:
    """Every pair of `data`/stereo, or of `data` itself if its own children hold pairs; sorted by name.

    Raises:
        UserError: no pair there, or a pair that cannot be read.
    """
    for root in (data / "stereo", data):
        folders = sorted(path.parent for path in root.glob("*/left.png"))
        if folders:
            return tuple(read_case(folder) for folder in folders)
    raise UserError(f"{data}: no stereo pairs; expected stereo/CASE/{{left,right,truth}}.png and meta.toml")


def read_case(folder: Path) -> StereoCase:
    """The pair of one folder. See the module.

    Raises:
        UserError: a file is missing or unreadable, or its content does not fit the others.
    """
    left, right = (_picture(folder / name, cv2.IMREAD_COLOR) for name in ("left.png", "right.png"))
    truth = _picture(folder / "truth.png", cv2.IMREAD_UNCHANGED)
    if truth.ndim != 2:
        raise UserError(f"{folder / 'truth.png'}: has colours; save it as one channel of 8 or 16 bits")
    try:
        meta = tomllib.loads((folder / "meta.toml").read_text(encoding="utf-8"))
        scale, disparities = float(meta["scale"]), int(meta["ndisp"])
    except (OSError, ValueError, KeyError, TypeError) as cause:
        raise UserError(f"{folder / 'meta.toml'}: needs the numbers scale and ndisp ({cause})") from cause
    if scale <= 0 or disparities <= 0:
        raise UserError(f"{folder / 'meta.toml'}: scale and ndisp must be above 0")
    values = np.where(truth > 0, truth.astype(np.float32) / np.float32(scale), np.float32(np.nan))
    return stereo_case(folder.name, left, right, values, disparities)


def motorcycle_case() -> StereoCase:
    """Scikit-image's Middlebury 2014 pair as it comes: 741 x 500, float truth up to 59.9 px, 64 disparities.

    At this size the peers come nearest to the figures quoted of them (9.6 for SGBM, 7.2 for post-filtered
    3WAY): 9.9 and 7.2; at half the size they make 9.4 and 7.7.

    Raises:
        ImportError: scikit-image is not installed.
        OSError: it cannot load its pictures.
    """
    left, right, truth = import_module("skimage.data").stereo_motorcycle()
    known = np.where(np.isfinite(truth), truth, np.nan).astype(np.float32)
    return stereo_case("motorcycle", _bgr(left), _bgr(right), known, 64)


def aloe_case(folder: Path = OPENCV_DOC) -> StereoCase:
    """OpenCV's aloe (Middlebury 2006) at a third of its size, 427 x 370, 80 disparities.

    Raises:
        UserError: its files are not in the folder.
    """
    left, right = (_picture(folder / name, cv2.IMREAD_COLOR) for name in ("aloeL.jpg", "aloeR.jpg"))
    truth = _picture(folder / "aloeGT.png", cv2.IMREAD_GRAYSCALE)
    # Of each 3 x 3 block the pictures keep the mean and the truth its centre: both belong to one place.
    centre, step = ALOE_REDUCTION // 2, ALOE_REDUCTION
    height, width = (length // step for length in truth.shape)
    values = truth[centre::step, centre::step][:height, :width].astype(np.float32) / np.float32(step)
    small_left, small_right = (
        cv2.resize(eye[: height * step, : width * step], (width, height), interpolation=cv2.INTER_AREA)
        for eye in (left, right)
    )
    known = np.where(values > 0, values, np.float32(np.nan))
    return stereo_case("aloe", _bytes(small_left), _bytes(small_right), known, 80)


def registry_cases(opencv_doc: Path = OPENCV_DOC) -> tuple[tuple[StereoCase, ...], tuple[str, ...]]:
    """The pairs that come with installed packages, and a sentence for each that is not there."""
    cases: list[StereoCase] = []
    absent: list[str] = []
    try:
        cases.append(motorcycle_case())
    except (ImportError, OSError) as cause:
        absent.append(f"motorcycle: not measured, scikit-image cannot give it ({cause})")
    try:
        cases.append(aloe_case(opencv_doc))
    except UserError as cause:
        absent.append(f"aloe: not measured, it is optional ({cause})")
    return tuple(cases), tuple(absent)


def _picture(path: Path, mode: int) -> Image:
    picture = cv2.imread(str(path), mode) if path.is_file() else None
    if picture is None:
        raise UserError(f"{path}: missing, or not a picture")
    return np.asarray(picture)


def _bgr(rgb: Image) -> Image:
    return _bytes(cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))


def _bytes(picture: cv2.typing.MatLike) -> Image:
    return np.asarray(picture, dtype=np.uint8)
