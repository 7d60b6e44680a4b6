"""Half of a target: told by what shows, whatever hides the rest."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from robot.messages import Box, Image
from robot.vision.half_views import NOWHERE, HalfViews, best_half, commonness, halves
from robot.vision.recognizer import Recognizer
from robot.vision.recognizer_training import unjudged
from robot.vision.textures import texture
from robot.vision.view_matching import Picture

PLACE = Box(140, 90, 60, 80)


def printed(seed: int) -> Image:
    fields = np.random.default_rng(seed).integers(0, 256, (6, 5, 3), np.uint8)
    return cv2.resize(fields, (60, 80), interpolation=cv2.INTER_NEAREST)


@pytest.fixture(scope="module")
def taught() -> Recognizer:
    views = [cv2.convertScaleAbs(printed(k), alpha=gain) for k in range(3) for gain in (0.6, 0.8, 1.0)]
    return unjudged(views, "box", seed=0)


def shapes(taught: Recognizer) -> list[HalfViews]:
    """The halves, all equally rare."""
    return [HalfViews(group, np.full((len(group.layouts), 4), 0.5, np.float32)) for group in taught.groups]


def scene(hidden: str, other: Image | None = None) -> Image:
    """The first print in a room, one half of it behind a textured board."""
    image = texture((352, 288), np.random.default_rng(40))
    image[90:170, 140:200] = printed(0) if other is None else other
    board = texture((352, 288), np.random.default_rng(41))
    rows = {"upper": (90, 130), "lower": (130, 170)}.get(hidden, (90, 170))
    columns = {"left": (140, 170), "right": (170, 200)}.get(hidden, (140, 200))
    if hidden:
        image[slice(*rows), slice(*columns)] = board[slice(*rows), slice(*columns)]
    return image


@pytest.mark.parametrize("hidden", ["upper", "lower", "left", "right"])
def test_the_half_that_shows_tells_the_whole_place(taught: Recognizer, hidden: str) -> None:
    rough = Box(146, 84, 66, 88)
    told = best_half(Picture.of(scene(hidden)), rough, shapes(taught))
    assert told.box.iou(PLACE) > 0.75
    assert min(told.correlation, told.colour) > 0.85
    whole = taught.locate(Picture.of(scene(hidden)), PLACE).evidence
    assert whole.correlation < 0.8, "a whole view does not fit there"


def test_the_light_on_the_half_does_not_matter(taught: Recognizer) -> None:
    bright = best_half(Picture.of(scene("left")), PLACE, shapes(taught))
    dim = best_half(Picture.of(cv2.convertScaleAbs(scene("left"), alpha=0.5)), PLACE, shapes(taught))
    assert dim.correlation == pytest.approx(bright.correlation, abs=0.03)
    assert dim.box.iou(bright.box) > 0.8


def test_another_print_has_no_such_half(taught: Recognizer) -> None:
    told = best_half(Picture.of(scene("left", other=printed(77))), PLACE, shapes(taught))
    assert told.merit < best_half(Picture.of(scene("left")), PLACE, shapes(taught)).merit - 0.4


def test_a_plain_wall_tells_nothing(taught: Recognizer) -> None:
    plain = np.full((288, 352, 3), 120, np.uint8)
    assert best_half(Picture.of(plain), PLACE, shapes(taught)) == NOWHERE


def test_what_is_met_everywhere_is_common(taught: Recognizer) -> None:
    (group,) = taught.groups
    elsewhere = [(Picture.of(texture((352, 288), np.random.default_rng(k))), PLACE) for k in range(12)]
    rare = commonness(elsewhere, group)
    assert rare.shape == (len(group.layouts), 4)
    met = commonness([*elsewhere, *[(Picture.of(scene("left")), PLACE)] * 6], group)
    right = 3
    assert met[:3, right].min() > rare[:3, right].max() + 0.3, "the first print's right half"
    told = [best_half(Picture.of(scene("left")), PLACE, [HalfViews(group, one)]).merit for one in (rare, met)]
    assert told[1] < told[0], "what is common proves less"


def test_halves_of_an_odd_grid_leave_out_its_middle() -> None:
    upper, lower, left, right = halves(5, 3).reshape(4, 3, 5)
    assert upper.sum() == lower.sum() == 5
    assert left.sum() == right.sum() == 6
    assert not (upper & lower).any()
    assert not (left & right).any()
