"""Ferns that learn the target while it is followed: what they hold, propose and refuse."""

import cv2
import numpy as np
import pytest

from robot.messages import Box
from robot.vision.target_memory import TargetMemory
from robot.vision.textures import texture

WALL = texture((352, 288), np.random.default_rng(1))
PRINT = cv2.resize(texture((120, 160), np.random.default_rng(2)), (45, 60))
PLACE = Box(150, 110, 45, 60)


def shown(x: int, y: int) -> np.ndarray:
    picture = WALL.copy()
    picture[y : y + 60, x : x + 45] = PRINT
    return picture


@pytest.fixture(scope="module")
def memory() -> TargetMemory:
    return TargetMemory.learnt(shown(150, 110), PLACE, seed=0)


def test_the_target_stands_above_its_rivals_from_the_first_frame_on(memory):
    assert memory.own > memory.rivals + 0.2


def test_it_holds_the_target_and_not_the_wall_in_its_place(memory):
    assert memory.holds(shown(153, 108), Box(153, 108, 45, 60))
    assert not memory.holds(WALL, PLACE)
    assert not memory.holds(WALL, Box(400, 300, 45, 60))


def test_it_proposes_the_target_anywhere_best_first(memory):
    place, known = memory.proposals(shown(260, 40), PLACE)[0]
    assert place.iou(Box(260, 40, 45, 60)) > 0.6
    assert known > 0.5
    assert all(known < 0.5 for _, known in memory.proposals(WALL, PLACE))


def test_what_it_meets_it_knows_better(memory):
    turned = shown(150, 110)
    turned[110:170, 150:195] = cv2.flip(PRINT, 1)
    before = dict(memory.proposals(turned, PLACE)[:1])
    learnt = memory
    for frame in range(3):
        learnt = learnt.and_met(turned, PLACE, seed=frame)
    place, known = learnt.proposals(turned, PLACE)[0]
    assert place.iou(PLACE) > 0.6
    assert known > max(before.values(), default=0.0)


def test_the_same_seed_gives_the_same_memory():
    one, other = (TargetMemory.learnt(shown(150, 110), PLACE, seed=3) for _ in range(2))
    assert (one.own, one.rivals) == (other.own, other.rivals)
