"""What no matcher may do with a pair it cannot match: crash, or call something far that is not.

Each pair here ends in a ValueError that says what is wrong, or in a map that measures (next to) nothing. One
suite for all matchers; a matcher is one line of MATCHERS.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rendered_pairs import MOUNT, RIG, TILT

from robot.vision.stereo import AdaptiveWeightMatcher, Disparity, FloorAlignedMatcher

Matches = Callable[[np.ndarray, np.ndarray], Disparity]
SEARCHED = 64
HEIGHT, WIDTH = 144, 352
MOST_WRONG = 0.001
"""Share of the pixels that may come out as measured where nothing can be."""


def _floor_aligned(inner: Matches) -> Matches:
    aligned = FloorAlignedMatcher(inner, RIG, MOUNT)
    return lambda left, right: aligned(left, right, 0.0, TILT)


MATCHERS: dict[str, Callable[[int], Matches]] = {
    "lite": AdaptiveWeightMatcher.lite,
    "normal": AdaptiveWeightMatcher.normal,
    "fine": AdaptiveWeightMatcher.fine,
    "floors": AdaptiveWeightMatcher.floors,
    "floors, floor aligned": lambda searched: _floor_aligned(AdaptiveWeightMatcher.floors(searched)),
}
"""How each matcher is made for a number of disparities (a multiple of 16) that it searches from 0 on."""

ALL = pytest.mark.parametrize("name", MATCHERS)


@cache
def matcher(name: str, searched: int = SEARCHED) -> Matches:
    return MATCHERS[name](searched)


def measured(found: Disparity, left: np.ndarray) -> float:
    """Share of the pixels measured; fails if the map is not a proper one."""
    shape = left.shape[:2]
    assert (found.values.shape, found.valid.shape, found.sigma_px.shape) == (shape, shape, shape)
    assert (found.values.dtype, found.valid.dtype, found.sigma_px.dtype) == (np.float32, np.bool_, np.float32)
    values, sigma = found.values[found.valid], found.sigma_px[found.valid]
    columns = np.broadcast_to(np.arange(shape[1]), shape)[found.valid]
    assert np.isfinite(values).all()
    assert np.isfinite(sigma).all()
    assert (sigma > 0).all()
    assert (values >= 0).all()
    assert (values <= columns).all(), "matched to what lies outside the right picture"
    return float(found.valid.mean())


# --------------------------------------------------------------------------------------------- refused

GOOD = np.random.default_rng(0).integers(0, 256, (40, 100, 3)).astype(np.uint8)
REFUSED = {
    "different width": (GOOD, GOOD[:, 1:], "size"),
    "different height": (GOOD, GOOD[1:], "size"),
    "turned": (GOOD, GOOD.transpose(1, 0, 2), "size"),
    "16 bits": (GOOD.astype(np.uint16), GOOD.astype(np.uint16), "uint16"),
    "floats": (GOOD / np.float32(255), GOOD / np.float32(255), "float32"),
    "one eye in floats": (GOOD, GOOD.astype(np.float64), "float64"),
    "booleans": (GOOD > 9, GOOD > 9, "bool"),
    "with transparency": (GOOD[..., [0, 1, 2, 2]], GOOD[..., [0, 1, 2, 2]], re.escape("(40, 100, 4)")),
    "two channels": (GOOD[..., :2], GOOD[..., :2], re.escape("(40, 100, 2)")),
    "one row of pixels": (GOOD[0, :, 0], GOOD[0, :, 0], "shape|size"),
    "a film": (GOOD[None], GOOD[None], "shape|size"),
    "no pixel": (GOOD[:0, :0], GOOD[:0, :0], "empty"),
    "no row": (GOOD[:0], GOOD[:0], "empty"),
    "no column": (GOOD[:, :0], GOOD[:, :0], "empty"),
}


@ALL
@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_pair_is_refused_in_words(name: str, case: str) -> None:
    left, right, words = REFUSED[case]
    with pytest.raises(ValueError, match=words) as refusal:
        matcher(name)(left, right)
    assert "\n" not in str(refusal.value)


@ALL
@pytest.mark.parametrize("eyes", ["left", "right", "both"])
def test_grey_and_colour_are_the_same_to_it(name: str, eyes: str) -> None:
    left, right = textured(20.0)
    colour_left = np.repeat(left[..., None], 3, axis=2) if eyes in ("left", "both") else left
    colour_right = np.repeat(right[..., None], 3, axis=2) if eyes in ("right", "both") else right
    one, other = matcher(name)(left, right), matcher(name)(colour_left, colour_right)
    assert one.values[one.valid].tobytes() == other.values[other.valid].tobytes()


# ------------------------------------------------------------------------------------- nothing to match


def _flat(level: int, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    noisy = level + noise * np.random.default_rng(seed).standard_normal((HEIGHT, WIDTH, 3))
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


EMPTY_PAIRS = {
    "constant": (_flat(120), _flat(120)),
    "black": (_flat(0), _flat(0)),
    "saturated": (_flat(255), _flat(255)),
    "noise only": (_flat(120, 3.0, 1), _flat(120, 3.0, 2)),
    "saturated with noise": (_flat(250, 6.0, 1), _flat(250, 6.0, 2)),
    "dark with noise": (_flat(4, 3.0, 1), _flat(4, 3.0, 2)),
    "unlike levels": (_flat(60), _flat(180)),
    "rows only": (
        np.tile(np.random.default_rng(5).integers(0, 256, (HEIGHT, 1)).astype(np.uint8), (1, WIDTH)),
    )
    * 2,
}


@ALL
@pytest.mark.parametrize("case", EMPTY_PAIRS)
def test_a_picture_without_texture_measures_nothing(name: str, case: str) -> None:
    left, right = EMPTY_PAIRS[case]
    assert measured(matcher(name)(left, right), left) <= MOST_WRONG


@ALL
@pytest.mark.parametrize("covered", ["left", "right"])
@pytest.mark.parametrize("level", [0, 12, 120, 255])
@pytest.mark.parametrize("noise", [0.0, 3.0])
def test_a_covered_lens_measures_nothing(name: str, covered: str, level: int, noise: float) -> None:
    pair = {"left": textured(20.0)[0], "right": textured(20.0)[1]}
    pair[covered] = cv2.cvtColor(_flat(level, noise), cv2.COLOR_BGR2GRAY)
    assert measured(matcher(name)(pair["left"], pair["right"]), pair["left"]) <= MOST_WRONG


# --------------------------------------------------------------------------------------- sizes, small ones


@ALL
@settings(max_examples=25, deadline=None, derandomize=True)
@given(height=st.integers(1, 70), width=st.integers(1, 150), seed=st.integers(0, 9))
def test_any_size_gives_a_proper_map(name: str, height: int, width: int, seed: int) -> None:
    left, right = (eye[:height, :width] for eye in textured(9.0, seed=seed))
    found = matcher(name, 16)(left, right)
    measured(found, left)
    assert found.valid.sum() < 30 or (np.abs(found.values - 9.0)[found.valid] < 3.0).mean() > 0.9


@ALL
@pytest.mark.parametrize("shape", [(1, 1), (1, 200), (200, 1), (2, 2), (3, 90), (90, 3), (1, 2)])
def test_a_thread_of_pixels_measures_nothing(name: str, shape: tuple[int, int]) -> None:
    left, right = (eye[:90, :200] for eye in textured(9.0))
    left, right = (
        cv2.resize(eye, (shape[1], shape[0]), interpolation=cv2.INTER_AREA) for eye in (left, right)
    )
    assert measured(matcher(name)(left, right), left) == 0.0


@ALL
@pytest.mark.parametrize("shape", [(47, 63), (48, 64), (49, 65), (145, 35), (97, 17)])
def test_odd_sizes_and_ones_smaller_than_the_search_give_proper_maps(
    name: str, shape: tuple[int, int]
) -> None:
    left, right = (eye[: shape[0], : shape[1]] for eye in textured(9.0))
    found = matcher(name)(left, right)
    measured(found, left)
    assert (np.abs(found.values - 9.0)[found.valid] > 2.0).sum() <= 0.02 * left.size


@ALL
def test_views_into_larger_pictures_are_matched_as_copies_are(name: str) -> None:
    left, right = textured(9.0)
    views = left[::2, 5:205], right[::2, 5:205]
    one, other = matcher(name)(*views), matcher(name)(*(np.ascontiguousarray(view) for view in views))
    assert one.values.tobytes() == other.values.tobytes()


@ALL
def test_the_pair_given_is_not_written_to(name: str) -> None:
    left, right = (eye.copy() for eye in textured(9.0))
    left.setflags(write=False)
    right.setflags(write=False)
    assert measured(matcher(name)(left, right), left) > 0.5


# ------------------------------------------------------------------------------- nearer than the search


@cache
def textured(
    disparity: float, *, seed: int = 0, grain_px: float = 1.5, slant: float = 0.0, noise: float = 1.5
) -> tuple[np.ndarray, np.ndarray]:
    """A surface that fills both grey pictures, at `disparity` in the middle; slant: px from column to column.

    Its texture has three octaves, the finest of grain_px: near things look coarser.
    """
    draw = np.random.default_rng(seed)
    rough = draw.standard_normal((HEIGHT, WIDTH + 1400))
    cloud = sum(
        gain * _unit(cv2.GaussianBlur(rough, (0, 0), grain_px * octave))
        for octave, gain in ((1, 1.0), (3, 0.8), (9, 0.6))
    )
    surface = (125 + 36 * cloud).astype(np.float32)
    columns = np.tile(np.arange(WIDTH, dtype=np.float32), (HEIGHT, 1))
    rows = np.repeat(np.arange(HEIGHT, dtype=np.float32)[:, None], WIDTH, axis=1)
    at_left = (columns + disparity - slant * WIDTH / 2) / (1 - slant)
    eyes = (
        cv2.remap(surface, where + 200, rows, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
        + noise * draw.standard_normal((HEIGHT, WIDTH))
        for where in (columns, at_left)
    )
    left, right = (np.clip(np.rint(eye), 0, 255).astype(np.uint8) for eye in eyes)
    return left, right


def _unit(field: np.ndarray) -> np.ndarray:
    return field / field.std()


NEARER = [1.03, 1.11, 1.25, 1.43, 1.67, 2.0, 3.0, 4.0, 5.6, 8.0]
"""Disparity over the search's range; 1.11 to 2.0 is 0.9 to 0.5 of the nearest distance."""


def valid_far(found: Disparity, left: np.ndarray, truth: np.ndarray | float) -> float:
    """Share of the picture measured farther than it is by over 2 px."""
    measured(found, left)
    return float((found.valid & (truth - found.values > 2.0)).mean())


@ALL
@pytest.mark.parametrize("times", NEARER)
@pytest.mark.parametrize("grain_px", [1.0, 2.0, 5.0])
def test_a_surface_nearer_than_the_search_is_never_far(name: str, times: float, grain_px: float) -> None:
    disparity = times * SEARCHED
    for seed in range(2):
        left, right = textured(disparity, seed=seed, grain_px=grain_px)
        assert valid_far(matcher(name)(left, right), left, disparity) <= MOST_WRONG


@ALL
@pytest.mark.parametrize("slant", [-0.3, 0.3])
@pytest.mark.parametrize("times", [1.6, 2.5, 4.0])
def test_a_slanted_surface_nearer_than_the_search_is_never_far(name: str, times: float, slant: float) -> None:
    disparity = times * SEARCHED
    left, right = textured(disparity, slant=slant, grain_px=2.0)
    truth = disparity + slant * (np.arange(WIDTH) - WIDTH / 2)
    assert valid_far(matcher(name)(left, right), left, truth) <= MOST_WRONG


@cache
def hand_before_a_wall(disparity: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A wall at 12 px with a textured thing at `disparity` before it, columns 180-290 of the left picture."""
    wall_left, wall_right = textured(12.0, seed=seed)
    thing = textured(1.0, seed=seed + 50, grain_px=3.0)[0]
    rows, columns = slice(20, 130), np.arange(180, 290)
    left, right = wall_left.copy(), wall_right.copy()
    left[rows, columns] = thing[rows, :110]
    landing = columns - int(disparity)
    right[rows, landing[landing >= 0]] = thing[rows, :110][:, landing >= 0]
    truth = np.full(left.shape, 12.0)
    truth[rows, columns] = disparity
    return left, right, truth


@ALL
@pytest.mark.parametrize("disparity", [70, 90, 120, 160, 230, 300])
def test_a_thing_nearer_than_the_search_is_never_the_wall_behind_it(name: str, disparity: int) -> None:
    left, right, truth = hand_before_a_wall(float(disparity))
    found = matcher(name)(left, right)
    inner = cv2.erode((truth > 60).astype(np.uint8), np.ones((15, 15), np.uint8)) > 0
    assert (found.valid & inner & (truth - found.values > 2.0)).sum() <= MOST_WRONG * left.size
    wall = np.broadcast_to(np.arange(left.shape[1]) >= 12, left.shape) & (truth == 12.0)
    covered = np.zeros(left.shape, bool)
    covered[:, : 290 - disparity + 12] = (truth == disparity).any(axis=1)[:, None]
    covered[:, : max(180 - disparity + 12, 0)] = False
    # (Aligned to the floor, the search leaves out what lies below the floor: this wall in the lower rows.)
    wall[left.shape[0] // 3 :] &= not name.endswith("floor aligned")
    assert found.valid[wall & ~covered].mean() > 0.7, "what both eyes see of the wall is still measured"


# ---------------------------------------------------------------------------------------- exchanged eyes


@ALL
@pytest.mark.parametrize("disparity", [4.0, 12.0, 30.0, 60.0, 100.0])
def test_exchanged_eyes_are_not_measured(name: str, disparity: float) -> None:
    left, right = textured(disparity, grain_px=2.0)
    assert measured(matcher(name)(right, left), left) <= MOST_WRONG
