"""A taught target found whole or half hidden, nothing found elsewhere, and the same again from its arrays."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from robot.messages import Box, Detection, Image
from robot.vision.finder_training import Taught, fit, half_hidden
from robot.vision.target_finder import TargetFinder
from robot.vision.textures import texture
from robot.vision.view_warps import View
from robot.vision.window_training import TrainingPlan

SPOILT = r"do not fit|does not fit|impossible|more offsets|channel|not enough values|at least"
SHORT = TrainingPlan(30.0, places=1500, drawn=6)
WIDE = Box(120, 70, 75, 100)


def printed(seed: int) -> Image:
    fields = np.random.default_rng(seed).integers(0, 256, (6, 5, 3), np.uint8)
    return cv2.resize(fields, (75, 100), interpolation=cv2.INTER_NEAREST)


def room(seed: int) -> Image:
    return texture((352, 288), np.random.default_rng(seed))


def put(image: Image, view: Image, box: Box) -> Image:
    shown = image.copy()
    small = cv2.resize(view, (int(box.w), int(box.h)), interpolation=cv2.INTER_AREA)
    shown[int(box.y) : int(box.y + box.h), int(box.x) : int(box.x + box.w)] = small
    return shown


def views() -> list[View]:
    lit = (
        cv2.convertScaleAbs(put(room(100 + k), printed(k % 2), WIDE), alpha=0.6 + 0.02 * k) for k in range(18)
    )
    return [View(image, WIDE) for image in lit]


@pytest.fixture(scope="module")
def taught(once) -> Taught:
    return once.value(
        "finder", lambda: fit(views(), [room(seed) for seed in range(200, 220)], "box", seed=0, lesson=SHORT)
    )


@pytest.fixture(scope="module")
def finder(taught: Taught) -> TargetFinder:
    return taught.finder


@pytest.mark.parametrize("height", [24, 40, 70, 130])
def test_it_is_found_at_every_size(finder: TargetFinder, height: int) -> None:
    place = Box(90, 60, round(0.75 * height), height)
    (best, *_) = finder.predict(put(room(1), printed(1), place))
    assert best.label == "box"
    assert best.box.iou(place) > 0.6


def test_it_is_found_with_any_half_hidden_most_times(finder: TargetFinder) -> None:
    rng = np.random.default_rng(3)
    place = Box(150, 90, 60, 80)
    pictures = [half_hidden(put(room(2), printed(k % 2), place), place, [room(9)], rng) for k in range(12)]
    found = [any(one.box.iou(place) > 0.5 for one in finder.predict(picture)) for picture in pictures]
    alone = [
        any(one.box.iou(place) > 0.5 for one in finder.recognizer.predict(picture)) for picture in pictures
    ]
    assert sum(found) >= 8
    assert sum(alone) < sum(found), "NMF alone judges whole views"


@pytest.mark.parametrize("seed", range(400, 406))
def test_nothing_is_found_where_it_is_not(finder: TargetFinder, seed: int) -> None:
    assert finder.predict(room(seed)) == []
    assert finder.predict(put(room(seed), printed(55), Box(100, 100, 60, 80))) == [], "another print"


def test_a_single_place_is_judged_half_hidden_too(finder: TargetFinder) -> None:
    place = Box(150, 90, 60, 80)
    picture = put(room(2), printed(0), place)
    picture[130:170, 150:210] = room(8)[130:170, 150:210]
    assert finder.score(picture, place) >= 0.5
    assert finder.refine(picture, Box(154, 94, 60, 80)).box.iou(place) > 0.6
    assert finder.score(room(2), place) < 0.5
    assert finder.votes(picture, place) > 2 * finder.votes(room(2), place)


def test_places_at_the_border_and_beyond_are_judged_without_fuss(finder: TargetFinder) -> None:
    for place in (Box(-50, -60, 60, 80), Box(340, 280, 60, 80), Box(-1000, 0, 30, 40)):
        assert finder.score(room(2), place) < 0.5
        assert finder.votes(room(2), place) == 0.0 or place.clipped(352, 288).area > 0


@pytest.mark.parametrize("value", [0, 128, 255])
def test_plain_pictures_hold_nothing(finder: TargetFinder, value: int) -> None:
    assert finder.predict(np.full((288, 352, 3), value, np.uint8)) == []


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.zeros((288, 352, 3), np.uint16), "uint8"),
        (np.zeros((288, 352, 3)), "uint8"),
        (np.zeros((288, 352, 4), np.uint8), "BGR"),
        (np.zeros((0, 352, 3), np.uint8), "with pixels"),
    ],
    ids=["16 bit", "float", "alpha", "empty"],
)
def test_what_is_no_picture_is_refused_in_words(finder: TargetFinder, image: np.ndarray, words: str) -> None:
    for who in (finder, finder.recognizer, finder.ferns):
        with pytest.raises(ValueError, match=words):
            who.predict(image)
    with pytest.raises(ValueError, match=words):
        finder.refine(image, WIDE)


def test_grey_tiny_and_huge_pictures_are_looked_at(finder: TargetFinder) -> None:
    place = Box(90, 60, 75, 100)
    grey = cv2.cvtColor(put(room(1), printed(1), place), cv2.COLOR_BGR2GRAY)
    assert finder.predict(grey)[0].box.iou(place) > 0.5
    assert finder.predict(grey) == finder.predict(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR))
    assert finder.predict(np.zeros((3, 4, 3), np.uint8)) == []
    huge = cv2.resize(room(1), (1760, 1440))
    huge[700:800, 900:975] = printed(1)
    assert finder.predict(huge)[0].box.iou(Box(900, 700, 75, 100)) > 0.5


def test_half_of_a_small_target_is_not_asked_for(
    finder: TargetFinder, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[float] = []

    def half_of(self: TargetFinder, image: Image, picture: object, box: Box) -> Detection:
        asked.append(box.h)
        return Detection(box, 0.0, "box")

    monkeypatch.setattr(TargetFinder, "_by_half", half_of)
    for seed in range(400, 404):
        finder.predict(room(seed))
        for height in (20, 31, 40, 90):
            finder.refine(room(seed), Box(100, 80, 0.75 * height, height))
    assert {40, 90} <= set(asked)
    assert min(asked) >= 32.0


@pytest.mark.parametrize("out", [0, 30, 60])
def test_what_the_rim_cuts_off_is_not_told(finder: TargetFinder, out: int) -> None:
    picture = room(1)
    picture[100:200, : 75 - out] = printed(1)[:, out:]
    boxes = [one.box for one in finder.predict(picture)]
    assert all(box.clipped(352, 288).area >= 0.85 * box.area for box in boxes)
    assert bool(boxes) == (out == 0)


def test_cross_validation_tells_what_is_found(taught: Taught) -> None:
    told = taught.validation
    assert told.recall > 0.85
    assert told.recall >= told.half_recall > 0.25
    assert told.false_alarms < 0.1


def test_the_arrays_give_the_same_finder(finder: TargetFinder) -> None:
    again = TargetFinder.from_arrays("box", finder.arrays())
    picture = put(room(1), printed(1), Box(90, 60, 60, 80))
    assert again.predict(picture) == finder.predict(picture)
    assert all(
        np.array_equal(array, other)
        for array, other in zip(again.arrays().values(), finder.arrays().values(), strict=True)
    )


@pytest.mark.parametrize(
    ("key", "spoil"),
    [
        ("ferns.0.extent", lambda a: a * 1e6),
        ("ferns.0.offsets", lambda a: a + 1.0),
        ("ferns.0.met", lambda a: a[:, :-1]),
        ("ferns.background", lambda a: a * np.nan),
        ("ferns.tests.channel", lambda a: a + 7),
        ("ferns.tests.first", lambda a: a + 100),
        ("ferns.settings", lambda a: a * 0),
        ("half_judge", lambda a: a[:2]),
        ("common.0", lambda a: a[:, :3]),
        ("nmf.aspects", lambda a: a[:0]),
        ("windows.shape", lambda a: a + 0.5),
        ("windows.shape", lambda a: a * [1, 1, 1e9, 1]),
        ("windows.shape", lambda a: a * np.nan),
        ("windows.net.first", lambda a: a[:-1]),
    ],
)
def test_arrays_that_do_not_fit_are_refused(finder: TargetFinder, key: str, spoil) -> None:
    arrays = dict(finder.arrays())
    arrays[key] = spoil(arrays[key])
    with pytest.raises(ValueError, match=SPOILT):
        TargetFinder.from_arrays("box", arrays)


def test_pictures_without_the_target_are_needed() -> None:
    with pytest.raises(ValueError, match="without the target"):
        fit([View(printed(0), Box(0, 0, 75, 100))] * 4, [np.zeros((10, 10, 3), np.uint8)], "box", 0)
