"""Pictures that must not be trusted are named; honest ones never are."""

from dataclasses import replace

import numpy as np
import pytest
from rendered_pairs import Block, Pair, Room, render

from calib.model import StereoRig
from robot.messages import StereoFrame
from robot.vision import health

RIG = StereoRig.parallel(352, 128, 305.0, 0.06)
"""The middle rows of the usual pictures: quicker to cast."""


@pytest.fixture(scope="module")
def pair() -> Pair:
    return render(Room((Block(1.2, 0.2, 0.3, 0.3, 0.3, yaw=0.4, seed=2),)), rig=RIG, samples=2)


@pytest.fixture
def frame(pair: Pair) -> StereoFrame:
    return StereoFrame(pair.left, pair.right, 1.0, 25)


def test_a_good_pair_has_no_fault(frame: StereoFrame) -> None:
    before = StereoFrame(frame.left ^ 1, frame.right ^ 1, 0.96, 24)
    assert health.picture_fault(frame, None) is None
    assert health.picture_fault(frame, before) is None


def test_the_same_bytes_again_are_frozen(frame: StereoFrame) -> None:
    later = replace(frame, captured_at=1.04, seq=26)
    assert health.picture_fault(later, frame) == "frozen"


def test_one_frozen_eye_is_enough(frame: StereoFrame) -> None:
    later = StereoFrame(frame.left, frame.right ^ 1, 1.04, 26)
    assert health.picture_fault(later, frame) == "frozen"
    later = StereoFrame(frame.left ^ 1, frame.right, 1.04, 26)
    assert health.picture_fault(later, frame) == "frozen"


def test_a_change_between_the_sampled_pixels_is_a_live_picture(frame: StereoFrame) -> None:
    left, right = frame.left.copy(), frame.right.copy()
    left[3, 3], right[5, 5] = left[3, 3] ^ 1, right[5, 5] ^ 1
    assert health.picture_fault(StereoFrame(left, right, 1.04, 26), frame) is None


def test_the_same_pair_looked_at_twice_is_not_frozen(frame: StereoFrame) -> None:
    assert health.picture_fault(frame, frame) is None


@pytest.mark.parametrize("eyes", ["both", "left", "right"])
def test_a_black_eye_is_named_even_with_noise_and_hot_pixels(frame: StereoFrame, eyes: str) -> None:
    black = np.random.default_rng(0).integers(0, 6, frame.left.shape).astype(np.uint8)
    black[8, 16] = 255
    left = black if eyes in ("both", "left") else frame.left
    right = black if eyes in ("both", "right") else frame.right
    assert health.picture_fault(StereoFrame(left, right, 1.0, 25), None) == "black"


def test_night_is_dark_but_not_black(frame: StereoFrame) -> None:
    night = StereoFrame(frame.left // 8, frame.right // 8, 1.0, 25)
    assert health.picture_fault(night, None) is None
    assert health.brightness(night.left) < 20


def test_eyes_of_different_or_no_size_are_named(frame: StereoFrame) -> None:
    assert health.picture_fault(replace(frame, right=frame.right[:, 1:]), None) == "size"
    none = np.zeros((0, 0, 3), np.uint8)
    assert health.picture_fault(StereoFrame(none, none, 1.0, 25), None) == "size"


def test_another_size_than_before_is_not_frozen(frame: StereoFrame) -> None:
    before = StereoFrame(frame.left[:100], frame.right[:100], 0.96, 24)
    assert health.picture_fault(frame, before) is None


def test_brightness_is_the_mean_grey_level() -> None:
    ramp = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 64, axis=0).repeat(3, axis=2)
    assert health.brightness(ramp) == pytest.approx(127.5, abs=4)
