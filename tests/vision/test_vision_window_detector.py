"""A net finds a taught object whole, half hidden and in the dark, at its place and size, nothing else."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from robot.messages import Box, Image
from robot.vision.textures import texture
from robot.vision.view_warps import Mask, View, ViewWarps, grey_bytes
from robot.vision.window_detector import WindowDetection, WindowDetector
from robot.vision.window_training import TrainingPlan, WindowShape, darkened

SIZE = 240, 200
OBJECT = 60, 80
PLAN = TrainingPlan(30.0, places=1500, drawn=6, rounds=2)


def room(seed: int) -> Image:
    return texture(SIZE, np.random.default_rng([seed, 4]))


def poster() -> Image:
    fields = np.random.default_rng(6).integers(0, 256, (8, 6, 3), np.uint8)
    return cv2.resize(fields, OBJECT, interpolation=cv2.INTER_LINEAR)


def shown(seed: int, place: tuple[int, int], size: float = 1.0) -> tuple[Image, Box]:
    picture, (x, y) = room(seed), place
    view = cv2.resize(poster(), None, fx=size, fy=size, interpolation=cv2.INTER_AREA)
    picture[y : y + view.shape[0], x : x + view.shape[1]] = view
    return picture, Box(x, y, view.shape[1], view.shape[0])


@pytest.fixture(scope="module")
def detector() -> WindowDetector:
    views = [View(poster(), Box(0, 0, *OBJECT))]
    return WindowDetector.fit(views, [room(seed) for seed in range(40, 52)], seed=0, plan=PLAN)


@pytest.mark.parametrize("size", [0.6, 0.75, 1.0, 1.4, 2.0])
def test_it_is_found_at_its_place_and_size(detector: WindowDetector, size: float) -> None:
    picture, true = shown(1, (70, 25), size)
    best = detector.predict(picture)[0]
    assert best.score > 0.9
    assert best.box.iou(true) > 0.75


def test_a_net_tells_sizes_between_those_looked_at(detector: WindowDetector) -> None:
    heights = []
    for size in (1.0, 1.1, 1.2):
        picture, true = shown(2, (80, 40), size)
        best = detector.predict(picture, [2.3])[0]
        assert best.box.iou(true) > 0.7
        heights.append(best.box.h)
    assert heights == sorted(heights)


@pytest.mark.parametrize("side", ["upper", "lower", "left", "right"])
def test_half_of_it_is_enough_and_its_box_is_still_the_whole(detector: WindowDetector, side: str) -> None:
    right = 0
    for seed in range(5):
        picture, true = shown(seed, (90, 60))
        hidden = np.zeros(picture.shape[:2], np.bool_)
        x, y = 90, 60
        rows = {"upper": (y, y + 40), "lower": (y + 40, y + 80)}.get(side, (y, y + 80))
        columns = {"left": (x, x + 30), "right": (x + 30, x + 60)}.get(side, (x, x + 60))
        hidden[slice(*rows), slice(*columns)] = True
        picture[hidden] = room(seed + 70)[hidden]
        right += any(one.box.iou(true) > 0.6 for one in detector.predict(picture, most=2))
    assert right >= 4


def test_the_dark_hides_little(detector: WindowDetector) -> None:
    picture, true = shown(3, (120, 90))
    noise = np.random.default_rng(1).normal(0.0, 2.0, SIZE[::-1])
    dark = np.clip(0.25 * grey_bytes(picture) + noise, 0, 255).astype(np.uint8)
    assert detector.predict(dark)[0].box.iou(true) > 0.7


@pytest.mark.parametrize("seed", range(10, 16))
def test_rooms_without_it_score_less(detector: WindowDetector, seed: int) -> None:
    with_it = detector.predict(shown(seed, (90, 60))[0])[0].score
    without = max((one.score for one in detector.predict(room(seed))), default=0.0)
    assert without < with_it


def test_the_same_seed_gives_the_same_detector_another_seed_another(detector: WindowDetector) -> None:
    small = TrainingPlan(30.0, places=60, drawn=1, rounds=2)
    views = [View(poster(), Box(0, 0, *OBJECT))]
    one, same, other = (WindowDetector.fit(views, [room(1)], seed=s, plan=small).arrays() for s in (3, 3, 4))
    assert all(np.array_equal(one[key], same[key]) for key in one)
    assert not np.array_equal(one["net.first"], other["net.first"])


def test_arrays_hold_everything(detector: WindowDetector) -> None:
    again = WindowDetector.from_arrays(detector.arrays())
    picture = shown(5, (60, 50))[0]
    assert again.predict(picture) == detector.predict(picture)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("shape", np.array([8, 6, 26.0, 34.0])),
        ("shape", np.array([9, 7, -1.0, 34.0])),
        ("net.first", np.zeros((3, 64), np.float32)),
        ("net.first_bias", np.zeros((2, 2), np.float32)),
        ("net.second", np.zeros((64, 4), np.float32)),
        ("net.second_bias", np.full(5, np.nan, np.float32)),
    ],
)
def test_arrays_that_do_not_fit_are_refused(detector: WindowDetector, key: str, value: Image) -> None:
    with pytest.raises(ValueError, match=r"window|unpack"):
        WindowDetector.from_arrays(detector.arrays() | {key: value})


@pytest.mark.parametrize(
    "image", [np.zeros((40, 50, 4), np.uint8), np.zeros((40, 50), np.uint16), np.zeros((40,), np.uint8)]
)
def test_pictures_of_another_kind_are_refused(detector: WindowDetector, image: Image) -> None:
    with pytest.raises(ValueError, match="picture"):
        detector.predict(image)


@pytest.mark.parametrize("shape", [(8, 8), (8, 300), (300, 9), (20, 24, 3)])
def test_black_and_tiny_pictures_show_nothing_or_little(
    detector: WindowDetector, shape: tuple[int, ...]
) -> None:
    found = detector.predict(np.zeros(shape, np.uint8))
    assert all(isinstance(one, WindowDetection) and np.isfinite(one.score) for one in found)
    assert not [one for one in found if one.score > 0.5]


@pytest.mark.parametrize("box", [Box(300, 10, 20, 20), Box(10, 10, 3, 20), Box(10, 10, 0, 0)])
def test_boxes_outside_the_picture_are_refused(box: Box) -> None:
    with pytest.raises(ValueError, match=r"4 px|shape"):
        WindowDetector.fit([View(room(1), box)], [room(2)], seed=0, plan=PLAN)


def test_no_view_is_refused() -> None:
    with pytest.raises(ValueError, match="a view"):
        WindowDetector.fit([], [room(2)], seed=0)


def test_a_window_has_the_boxes_mean_shape() -> None:
    shape = WindowShape.of([Box(0, 0, 100, 40), Box(0, 0, 50, 20)], 30.0)
    assert shape.extent == pytest.approx((30 * 2.5**0.5, 30 / 2.5**0.5))
    assert (shape.rows, shape.columns) == (5, 12)


def test_a_place_tells_where_the_object_truly_is() -> None:
    view = np.full((60, 80), 200, np.uint8)
    mask: Mask = np.zeros((60, 80), np.bool_)
    mask[20:44, 30:60] = True
    warps = ViewWarps(View(view, Box(30, 20, 30, 24), mask), 1.2, (64, 56))
    rng = np.random.default_rng(0)
    for warp in (warps.straight(), warps.drawn(rng), warps.drawn(rng)):
        place = warps.place(warp, [np.zeros((90, 90), np.uint8)], rng)
        rows, columns = np.nonzero(place.mask)
        middle = (columns.min() + columns.max()) / 2, (rows.min() + rows.max()) / 2
        assert middle == pytest.approx(place.middle, abs=0.8)
        turned = abs(np.sin(warp.turn))
        wide = place.extent[0] + turned * place.extent[1]
        assert np.ptp(columns) + 1 == pytest.approx(wide, abs=2.0)
        assert (place.image[place.mask] > 90).all(), "the view is in front of the black background"


def test_darkened_pictures_keep_what_they_show() -> None:
    picture = grey_bytes(room(8))
    rng = np.random.default_rng(2)
    for _ in range(5):
        dark = darkened(picture, rng)
        assert dark.mean() <= picture.mean() + 1.0
        assert np.corrcoef(dark.ravel(), picture.ravel())[0, 1] > 0.85
