"""Dense disparity of a rectified pair by semi-global matching (OpenCV), behind the call all matchers keep.

Any callable `(left, right) -> Disparity` is a matcher. `SemiGlobalMatcher` is the one in use;
`FloorAlignedMatcher` makes any matcher see the floor at rest, which is where a robot on wheels looks most.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.model import HeadMount, StereoRig
from robot.messages import Image
from robot.vision.pair_input import grey_pair
from robot.vision.stereo_aggregation import Support, aggregate
from robot.vision.stereo_cost import MatchingCost, plain_cost, pooled_cost
from robot.vision.stereo_refinement import Window, enlarge, fill_rows, fit
from robot.vision.stereo_selection import Winners, select
from robot.vision.stereo_voting import Voting, vote

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

SMOOTHING_PX = 1.2
"""Of both pictures before matching: floors show less texture than a webcam's noise, and broader."""
MAX_SIGMA_PX = 0.6
"""A match less certain than this is no measurement."""
SIGMA_FLOOR_PX = 0.16
"""What rounding, pixel locking and slanted surfaces leave where there is texture enough."""
SIGMA_GAIN = 0.004
"""Variance of a match times gradient energy over the picture's noise variance; both measured on rooms."""
NOISE_ENERGY = 0.016
"""Gradient energy that noise of variance 1 itself has after smoothing: it is no texture."""
SIGMA_WINDOW_PX = 9
HIDDEN_SLACK_PX = 1.0
"""Noise makes columns cross by less than this."""
MAX_DISAGREEMENT_PX = 2.0
"""Between the two eyes' searches, the right eye's being half as fine."""
MAX_JUMP_PX = 1.5
"""Between the left and the right neighbour; a surface seen so obliquely is not measured."""
BLOCK_PX = 5
SPECK_PX, SURFACE_STEP_PX = 400, 1.0
"""A surface smaller than this is a false match; neighbours on one surface differ by less than this."""
LAST_LEVELS = 1.5
"""What is matched to the search's very end may well lie beyond it."""
LITE_WINDOW = Window(half_side_px=5, steps=1)
LEAST_DISPARITIES, MOST_DISPARITIES = 8, 512


@dataclass(frozen=True, slots=True, eq=False)
class Disparity:
    """Column of a point in the left picture less its column in the right one, for every left pixel.

    values (H, W) float32 px, 0 where not valid; valid (H, W) bool; sigma_px (H, W) float32: standard
    deviation of a valid value.
    """

    values: Floats
    valid: Mask
    sigma_px: Floats


class Matcher(Protocol):
    """Finds the disparities of a rectified pair of BGR or grey uint8 pictures of equal size."""

    def __call__(self, left: Image, right: Image) -> Disparity:
        """Match left (H, W[, 3]) with right."""


class SemiGlobalMatcher:
    """Semi-global block matching over `disparities` columns, 0 .. disparities - 1.

    A match counts if the right eye finds it too (left-right check). That second search runs at half the
    resolution and reaches twice as far, so what lies nearer than the search comes out invalid, never far.
    The standard deviation of a value follows from the picture's noise and the texture about the pixel (as of
    least-squares matching); where it exceeds `MAX_SIGMA_PX`, as on blank walls and in the dark, the value is
    invalid.

    Args:
        disparities: a multiple of 16.

    Raises:
        ValueError: disparities not a positive multiple of 16, or eyes of different size.

    >>> noise = np.random.default_rng(1).integers(0, 255, (64, 160), np.uint8)
    >>> scene = cv2.GaussianBlur(noise, (0, 0), 1.5)
    >>> found = SemiGlobalMatcher(32)(scene[:, :120], scene[:, 8:128])
    >>> round(float(np.median(found.values[found.valid])))
    8
    """

    def __init__(self, disparities: int = 64) -> None:
        if disparities <= 0 or disparities % 16:
            raise ValueError(f"disparities must be a positive multiple of 16, got {disparities}")
        self.disparities = disparities
        self._fine, self._coarse = _sgbm(disparities), _sgbm(disparities)

    def __call__(self, left: Image, right: Image) -> Disparity:
        """Match a pair. See the class."""
        if left.shape[:2] != right.shape[:2]:
            raise ValueError(f"eyes of different size: left {left.shape[:2]}, right {right.shape[:2]}")
        grey_left, grey_right = _grey(left), _grey(right)
        smooth_left, smooth_right = _smooth(grey_left), _smooth(grey_right)
        values = self._match(self._fine, smooth_left, smooth_right)
        sigma = match_sigma(smooth_left, _noise(grey_left))
        columns = np.arange(left.shape[1], dtype=np.float32)
        valid = (values > 0.0) & (values <= columns) & (sigma <= MAX_SIGMA_PX)
        valid &= self._confirmed(smooth_left, smooth_right, values) & ~_torn(values)
        valid &= ~_hidden(columns - values, valid)
        return Disparity(np.where(valid, values, np.float32(0.0)), valid, sigma)

    def _match(self, matcher: cv2.StereoSGBM, left: Image, right: Image) -> Floats:
        # OpenCV leaves the first `disparities` columns empty: give it margin and cut that off.
        margin = self.disparities
        wide_left, wide_right = (
            cv2.copyMakeBorder(g, 0, 0, margin, 0, cv2.BORDER_REPLICATE) for g in (left, right)
        )
        return matcher.compute(wide_left, wide_right)[:, margin:].astype(np.float32) * np.float32(1 / 16)

    def _confirmed(self, left: Image, right: Image, values: Floats) -> Mask:
        """Pixels whose match the right eye finds too, searching twice as far at half the resolution."""
        half_left, half_right = _flipped_half(left), _flipped_half(right)
        # Flipped, the right eye's search is a left eye's.
        seen_back = 2.0 * self._match(self._coarse, half_right, half_left)[:, ::-1]
        height, width = values.shape
        columns = np.arange(width, dtype=np.float32) - values
        rows = np.repeat(np.arange(height, dtype=np.float32)[:, None], width, axis=1)
        # Pixel k of the half-size picture covers pixels 2k and 2k + 1.
        back = cv2.remap(
            np.ascontiguousarray(seen_back), 0.5 * columns - 0.25, 0.5 * rows - 0.25, cv2.INTER_NEAREST,
            borderMode=cv2.BORDER_CONSTANT, borderValue=-100.0,
        )  # fmt: skip
        confirmed: Mask = np.abs(back - values) <= MAX_DISAGREEMENT_PX
        return confirmed


class AdaptiveWeightMatcher:
    """[T]'s local matcher with adaptive weights (METHODS 7), made for the robot's own processor.

    Three stages, each in its own file: matching cost (`stereo_cost`), aggregation with K clustered
    intensities (`stereo_aggregation`), selection with left-right check (`stereo_selection`). Then gaps are
    filled, neighbours may vote (`stereo_voting`, the second disparity-space volume), and every disparity is
    fitted to the grey values (`stereo_refinement`). `values` are filled everywhere; `valid` marks what was
    measured. Calls do not influence each other.

    Args:
        disparities: columns searched, 0 .. disparities - 1; even, 8 to 512.
        cost: limits of the comparison of two pixels.
        support: whose costs count for a pixel.
        voting: how neighbours vote where the eyes disagree; None: the row's farther neighbour fills.

    Raises:
        ValueError: disparities out of range; pictures that are no pair (see `grey_pair`).

    >>> noise = np.random.default_rng(1).integers(0, 255, (64, 160), np.uint8)
    >>> scene = cv2.GaussianBlur(noise, (0, 0), 1.5)
    >>> found = AdaptiveWeightMatcher.normal(32)(scene[:, :120], scene[:, 8:128])
    >>> round(float(np.median(found.values[found.valid])), 1)
    8.0
    """

    def __init__(
        self,
        disparities: int = 64,
        *,
        cost: MatchingCost = MatchingCost(),
        support: Support = Support(),
        voting: Voting | None = None,
    ) -> None:
        self.disparities = checked(disparities)
        self.cost, self.support, self.voting = cost, support, voting
        cell = support.cell if voting is None else math.lcm(support.cell, voting.support.cell)
        self._multiple = 2 * cell

    @staticmethod
    def lite(disparities: int = 64) -> HalvedMatcher:
        """The quickest: a third of the time of OpenCV's semi-global matching, for the smallest boards."""
        return HalvedMatcher(disparities)

    @classmethod
    def normal(cls, disparities: int = 64) -> AdaptiveWeightMatcher:
        """What the robot uses: no slower than semi-global matching and more accurate."""
        return cls(disparities)

    @classmethod
    def fine(cls, disparities: int = 64) -> AdaptiveWeightMatcher:
        """Finer intensities, and the second disparity-space volume fills what only one eye saw."""
        return cls(disparities, support=Support(clusters=16), voting=Voting())

    def __call__(self, left: Image, right: Image) -> Disparity:
        """Match left (H, W[, 3]) with right. See the class."""
        eyes = grey_pair(left, right)
        height, width = eyes[0].shape
        wide_left, wide_right = (padded(eye, self._multiple) for eye in eyes)
        guide = halved(wide_left)
        costs = pooled_cost(wide_left, wide_right, self.disparities, self.cost)
        levels, stable = self._chosen(select(aggregate(costs, guide, self.support)), guide)
        # Level k holds disparities 2k and 2k + 1.
        index = enlarge(levels, guide, wide_left)[:height, :width]
        stable &= levels < self.disparities // 2 - LAST_LEVELS
        return measured(*eyes, np.take(2.0 * levels + np.float32(0.5), index), np.take(stable, index))

    def _chosen(self, winners: Winners, guide: Image) -> tuple[Floats, Mask]:
        """Levels (h, w) with gaps filled, and which of them are the winners' own, agreed on by both eyes."""
        levels = cv2.medianBlur(fill_rows(winners.level, winners.stable), 3)
        if self.voting is not None:
            voted = vote(levels, winners.stable, guide, self.disparities // 2, self.voting)
            levels = cv2.medianBlur(np.where(winners.stable, levels, voted), 3)
        return levels, own(winners, levels)


class HalvedMatcher:
    """The same three stages on the pictures at half their size: a quarter of the pixels and disparities.

    What is finer than two pixels is lost, and values and sigma are half as good. Arguments, result and errors
    as of `AdaptiveWeightMatcher`.
    """

    def __init__(
        self,
        disparities: int = 64,
        *,
        cost: MatchingCost = MatchingCost(),
        support: Support = Support(clusters=4, cell=4),
    ) -> None:
        self.disparities = checked(disparities)
        self.cost, self.support = cost, support

    def __call__(self, left: Image, right: Image) -> Disparity:
        """Match left (H, W[, 3]) with right. See the class."""
        eyes = grey_pair(left, right)
        height, width = eyes[0].shape
        half_left, half_right = (halved(padded(eye, 2 * self.support.cell)) for eye in eyes)
        costs = plain_cost(half_left, half_right, self.disparities // 2, self.cost)
        winners = select(aggregate(costs, half_left, self.support))
        levels = cv2.medianBlur(fill_rows(winners.level, winners.stable), 3)
        stable = own(winners, levels) & (levels < self.disparities // 2 - LAST_LEVELS)
        half = measured(half_left, half_right, levels, stable, LITE_WINDOW)
        return Disparity(
            np.ascontiguousarray(doubled(2.0 * half.values)[:height, :width]),
            doubled(half.valid.view(np.uint8)).view(np.bool_)[:height, :width],
            doubled(2.0 * half.sigma_px)[:height, :width],
        )


def checked(disparities: int) -> int:
    """The number of disparities. Raises ValueError if it is odd or out of range."""
    if disparities % 2 or not LEAST_DISPARITIES <= disparities <= MOST_DISPARITIES:
        raise ValueError(
            f"disparities must be even, {LEAST_DISPARITIES} to {MOST_DISPARITIES}, got {disparities}"
        )
    return disparities


def own(winners: Winners, levels: Floats) -> Mask:
    """Pixels whose final level is the one both eyes found themselves."""
    unchanged: Mask = np.abs(levels - winners.level) <= 1.0
    return unchanged & winners.stable


def measured(left: Image, right: Image, coarse: Floats, stable: Mask, window: Window = Window()) -> Disparity:
    """The map's last step: stable values fitted to the grey values (H, W), told how sure they are."""
    found = fit(left, right, coarse, window)
    valid = stable & found.good
    values = np.maximum(np.where(valid, found.values, coarse), np.float32(0.0))
    columns = np.arange(left.shape[1], dtype=np.float32)
    valid &= (values > 0.0) & (values <= columns) & (found.sigma_px <= MAX_SIGMA_PX) & ~_torn(values)
    coarse_valid = _on_surfaces(values[::2, ::2], valid[::2, ::2])
    coarse_valid &= ~_hidden(columns[::2] - values[::2, ::2], coarse_valid)
    valid &= doubled(coarse_valid.view(np.uint8)).view(np.bool_)[: left.shape[0], : left.shape[1]]
    return Disparity(values, valid, found.sigma_px)


def _on_surfaces(values: Floats, valid: Mask) -> Mask:
    """What lies on a surface of at least `SPECK_PX` (at half the size): false matches have few neighbours."""
    sixteenths = np.where(valid, 16.0 * values + 16.0, 0.0).astype(np.int16)
    surfaces, _ = cv2.filterSpeckles(sixteenths, 0, SPECK_PX // 4, round(16 * SURFACE_STEP_PX))
    kept: Mask = np.asarray(surfaces) > 0
    return kept


def padded(grey: Image, multiple: int) -> Image:
    """The picture with rims repeated so that height and width are multiples."""
    height, width = grey.shape
    bottom, right = -height % multiple, -width % multiple
    return cv2.copyMakeBorder(grey, 0, bottom, 0, right, cv2.BORDER_REPLICATE).astype(np.uint8, copy=False)


def halved(grey: Image) -> Image:
    """Half the size, each pixel the mean of four."""
    return cv2.resize(grey, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)


def doubled(plane: NDArray[Any]) -> NDArray[Any]:
    """Twice the size, each pixel four times."""
    return cv2.resize(plane, None, fx=2.0, fy=2.0, interpolation=cv2.INTER_NEAREST)


class FloorAlignedMatcher:
    """Matches with the right picture sheared so that the floor lies at one disparity everywhere.

    A floor seen from low above changes its disparity from row to row; blocks and smoothness terms expect it
    not to, and answer with steps and a bias of a third of a pixel. Sheared, the floor is their easiest case,
    and the search begins `margin_px` below the floor's own disparity in every row: it reaches nearer where
    floor is near.

    Args:
        matcher: what matches the sheared pair; its search must start at 0.
        rig: parallel pair.
        mount: where the head sits; the head does not roll.
        margin_px: how much farther than the floor is still searched.
    """

    def __init__(self, matcher: Matcher, rig: StereoRig, mount: HeadMount, margin_px: float = 8.0) -> None:
        self._matcher = matcher
        self._rig, self._mount = rig, mount
        self._margin = margin_px

    def __call__(self, left: Image, right: Image, pan: float, tilt: float) -> Disparity:
        """Match a pair taken with the head at pan, tilt (radians); disparities are the given pair's.

        Raises:
            ValueError: pictures that are no pair.
        """
        left, right = grey_pair(left, right)
        height, width = left.shape
        floor = floor_disparities(self._rig, self._mount, pan, tilt, height)
        shift = np.maximum(floor - self._margin, 0.0).astype(np.float32)[:, None]
        columns = np.arange(width, dtype=np.float32)
        rows = np.repeat(np.arange(height, dtype=np.float32)[:, None], width, axis=1)
        sheared = cv2.remap(right, columns - shift, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        found = self._matcher(left, sheared.astype(np.uint8, copy=False))
        values = found.values + shift
        valid = found.valid & (values <= columns)
        return Disparity(np.where(valid, values, np.float32(0.0)), valid, found.sigma_px)


def floor_disparities(rig: StereoRig, mount: HeadMount, pan: float, tilt: float, height: int) -> Floats:
    """Disparity u_l - u_r of the floor in each row, (height,) float32; below -doffs above the horizon.

    d = f B k / h - doffs, k the drop of the row's ray for each metre of depth, h the lens height: METHODS 4's
    plane-induced homography for a parallel pair and a head that does not roll.
    """
    rotation, eye = mount.left_eye(pan, tilt)
    ray = (np.arange(height) - rig.left.cy) / rig.left.fy
    drop = -(rotation[2, 1] * ray + rotation[2, 2])
    return np.asarray(rig.left.fx * rig.baseline * drop / eye[2] - rig.doffs, np.float32)


def match_sigma(smooth: Image, noise: float) -> Floats:
    """Standard deviation of a block match at each pixel, px: noise over gradient, and what matching adds.

    smooth: (H, W) uint8, the smoothed picture; noise: grey levels, of the picture before smoothing.
    """
    gradient = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8)
    energy = cv2.blur(cv2.multiply(gradient, gradient), (SIGMA_WINDOW_PX, SIGMA_WINDOW_PX))
    texture = np.maximum(energy - np.float32(NOISE_ENERGY * noise * noise), np.float32(1e-3))
    variance = np.float32(SIGMA_FLOOR_PX**2) + np.float32(SIGMA_GAIN * noise * noise) / texture
    return np.asarray(np.sqrt(variance), np.float32)


def _torn(values: Floats) -> Mask:
    """Pixels at a jump of the disparity: blocks that see two surfaces measure neither."""
    torn: Mask = np.zeros(values.shape, np.bool_)
    torn[:, 1:-1] = np.abs(values[:, 2:] - values[:, :-2]) > MAX_JUMP_PX
    return torn


def _hidden(right_columns: Floats, valid: Mask) -> Mask:
    """Pixels that something to their right hides from the right eye: no measurement, whatever was filled in.

    right_columns: where each left pixel lies in the right picture; it must rise from left to right.
    """
    bound = np.where(valid, right_columns, np.float32(np.inf))
    least = np.minimum.accumulate(bound[:, ::-1], axis=1)[:, ::-1]
    hidden: Mask = right_columns > least + np.float32(HIDDEN_SLACK_PX)
    return hidden


def _flipped_half(grey: Image) -> Image:
    half = cv2.resize(grey, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(half[:, ::-1], np.uint8)


def _noise(grey: Image) -> float:
    """Standard deviation of the picture's noise, grey levels: the median of Immerkaer's mask."""
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    rough = np.abs(cv2.filter2D(grey[::6], cv2.CV_32F, mask)[:, ::2])
    return max(float(np.median(rough)) / (6 * 0.6745), 0.3)


def _grey(image: Image) -> Image:
    return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.uint8, copy=False)


def _smooth(grey: Image) -> Image:
    return cv2.GaussianBlur(grey, (7, 7), SMOOTHING_PX).astype(np.uint8, copy=False)


def _sgbm(disparities: int) -> cv2.StereoSGBM:
    return cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=disparities,
        blockSize=BLOCK_PX,
        P1=8 * BLOCK_PX**2,
        P2=32 * BLOCK_PX**2,
        disp12MaxDiff=1,
        preFilterCap=31,
        uniquenessRatio=10,
        speckleWindowSize=60,
        speckleRange=2,
        mode=cv2.StereoSGBM_MODE_SGBM_3WAY,
    )
