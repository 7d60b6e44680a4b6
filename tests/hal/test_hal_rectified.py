"""Rectified pairs: once per pair, faults and closing passed on, odd sizes left for perception to refuse."""

import numpy as np

from robot.hal.mock import MockCamera
from robot.hal.rectified import RectifiedCamera

PICTURE = np.full((8, 8, 3), 90, np.uint8)


def test_every_pair_is_rectified_once():
    calls = []

    def rectify(left, right):
        calls.append(1)
        return left + 1, right + 2

    camera = RectifiedCamera(MockCamera([(PICTURE, PICTURE)]), rectify)
    first = camera.latest(0.0)
    assert (first.left[0, 0, 0], first.right[0, 0, 0], first.seq) == (91, 92, 0)
    assert camera.latest(0.0) is first
    assert len(calls) == 1
    assert camera.latest(0.04).seq == 1


def test_a_pair_of_another_size_passes_as_it_is():
    def refuse(left, right):
        raise ValueError("another size")

    assert RectifiedCamera(MockCamera([(PICTURE, PICTURE)]), refuse).latest(0.0).left is PICTURE


def test_faults_and_closing_are_passed_on():
    behind = MockCamera([(PICTURE, PICTURE)])
    camera = RectifiedCamera(behind, lambda left, right: (left, right))
    behind.fail("latest")
    camera.latest(0.0)
    assert [fault.key for fault in camera.faults(0.0)] == ["camera.link"]
    camera.close()
    assert behind.closed == 1
