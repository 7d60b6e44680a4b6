"""The online tracker: motion, size, light, loss and return, drift, cover, bad pictures."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from robot.messages import Box
from robot.vision.textures import texture
from robot.vision.tracker import OnlineTracker

WALL = texture((352, 288), np.random.default_rng(1))
PRINT = texture((120, 160), np.random.default_rng(2))


def frame(u: float, v: float, height: float, gain: float = 1.0, noise_seed: int | None = None) -> np.ndarray:
    """The print, `height` px tall with its centre at (u, v), before a wall."""
    s = height / PRINT.shape[0]
    k = max(1, round(1 / s))
    small = cv2.resize(PRINT, None, fx=1 / k, fy=1 / k, interpolation=cv2.INTER_AREA)
    s *= k
    matrix = np.float32([[s, 0, u - s * small.shape[1] / 2], [0, s, v - s * small.shape[0] / 2]])
    picture = cv2.warpAffine(small, matrix, (352, 288), WALL.copy(), borderMode=cv2.BORDER_TRANSPARENT)
    light = gain * picture.astype(float)
    if noise_seed is not None:
        light += np.random.default_rng(noise_seed).normal(0, 4, light.shape)
    return np.clip(light, 0, 255).astype(np.uint8)


def box(u: float, v: float, height: float) -> Box:
    width = height * PRINT.shape[1] / PRINT.shape[0]
    return Box(u - width / 2, v - height / 2, width, height)


def test_a_moving_growing_target_in_changing_light_is_followed() -> None:
    tracker = OnlineTracker()
    tracker.start(frame(100, 140, 50), box(100, 140, 50))
    for k in range(1, 60):
        u, v, height = 100 + 2.5 * k, 140 + 30 * np.sin(k / 8), 50 * 1.01**k
        track = tracker.update(frame(u, v, height, gain=1 - 0.008 * k, noise_seed=k), scale=1.01)
        assert not track.lost
        assert track.box.iou(box(u, v, height)) > 0.75
    assert track.velocity_px[0] == pytest.approx(2.5, abs=1.5)


def test_growth_that_nobody_announced_is_noticed() -> None:
    tracker = OnlineTracker()
    tracker.start(frame(170, 140, 60), box(170, 140, 60))
    for k in range(1, 41):
        track = tracker.update(frame(170, 140, 60 * 1.01**k))
    assert track.box.iou(box(170, 140, 60 * 1.01**40)) > 0.75


@pytest.mark.parametrize("jump", [(25, 0), (-25, 6), (12, -22)])
def test_a_jump_of_25_px_is_caught_without_any_hint(jump: tuple[int, int]) -> None:
    tracker = OnlineTracker()
    tracker.start(frame(170, 140, 60), box(170, 140, 60))
    track = tracker.update(frame(170 + jump[0], 140 + jump[1], 60))
    assert not track.lost
    assert track.box.iou(box(170 + jump[0], 140 + jump[1], 60)) > 0.85


def test_the_heads_own_motion_is_no_motion_of_the_target() -> None:
    tracker = OnlineTracker()
    tracker.start(frame(100, 140, 60), box(100, 140, 60))
    track = tracker.update(frame(175, 150, 60), shift=(75.0, 10.0))
    assert not track.lost
    assert track.box.iou(box(175, 150, 60)) > 0.9
    assert np.hypot(*track.velocity_px) < 1.0


def test_a_vanished_target_is_lost_and_found_again_where_it_returns() -> None:
    tracker = OnlineTracker()
    tracker.start(frame(170, 140, 60), box(170, 140, 60))
    for _ in range(5):
        gone = tracker.update(WALL)
        assert gone.lost
        assert gone.velocity_px == (0.0, 0.0)
    back = tracker.update(frame(180, 140, 60))
    assert not back.lost
    assert back.box.iou(box(180, 140, 60)) > 0.8


def test_a_still_target_does_not_drift_through_noise() -> None:
    tracker = OnlineTracker()
    tracker.start(frame(170.4, 139.7, 55), box(170.4, 139.7, 55))
    for k in range(100):
        track = tracker.update(frame(170.4, 139.7, 55, noise_seed=k))
    (u, v), (true_u, true_v) = track.box.centre, (170.4, 139.7)
    assert np.hypot(u - true_u, v - true_v) < 1.5
    assert abs(track.box.h / 55 - 1) < 0.1


def test_a_look_that_changes_slowly_is_learnt() -> None:
    other = texture((352, 288), np.random.default_rng(5))
    tracker = OnlineTracker()
    tracker.start(frame(170, 140, 80), box(170, 140, 80))
    patch = np.s_[100:180, 140:200]
    for k in range(60):
        picture = frame(170, 140, 80)
        share = k / 59
        picture[patch] = ((1 - share) * picture[patch] + share * other[patch]).astype(np.uint8)
        track = tracker.update(picture)
    assert not track.lost
    assert track.box.iou(box(170, 140, 80)) > 0.7


def test_a_new_start_forgets_the_old_place() -> None:
    tracker = OnlineTracker()
    tracker.start(frame(100, 140, 60), box(100, 140, 60))
    picture = frame(250, 120, 40)
    tracker.start(picture, box(250, 120, 40))
    track = tracker.update(picture)
    assert not track.lost
    assert track.box.iou(box(250, 120, 40)) > 0.9


def test_a_target_leaving_the_picture_is_followed_and_then_lost() -> None:
    tracker = OnlineTracker()
    tracker.start(frame(290, 140, 60), box(290, 140, 60))
    lost = []
    for k in range(1, 30):
        lost.append(tracker.update(frame(290 + 4 * k, 140, 60)).lost)
    assert not any(lost[:10])
    assert lost[-1]


def test_the_same_frames_give_the_same_track() -> None:
    def run() -> list:
        tracker = OnlineTracker()
        tracker.start(frame(100, 140, 60), box(100, 140, 60))
        return [tracker.update(frame(100 + 3 * k, 140, 60, noise_seed=k)) for k in range(8)]

    assert run() == run()


def test_the_support_is_told_while_the_target_is_held() -> None:
    tracker = OnlineTracker()
    assert tracker.support is None
    tracker.start(frame(170, 140, 60), box(170, 140, 60))
    tracker.update(frame(173, 140, 60))
    support = tracker.support
    assert support is not None
    rows, columns = np.nonzero(support)
    assert Box(columns.min(), rows.min(), np.ptp(columns), np.ptp(rows)).iou(box(173, 140, 60)) > 0.6
    tracker.update(np.zeros_like(WALL))
    assert tracker.support is None


def test_misuse_is_refused() -> None:
    tracker = OnlineTracker()
    with pytest.raises(RuntimeError, match="start"):
        tracker.update(WALL)
    with pytest.raises(ValueError, match="6 px"):
        tracker.start(WALL, Box(100, 100, 3, 3))
    with pytest.raises(ValueError, match="6 px"):
        tracker.start(WALL, Box(400, 100, 30, 30))


def test_a_jump_beyond_its_window_is_caught_by_the_block_s_motion() -> None:
    tracker = OnlineTracker()
    tracker.start(frame(100, 140, 60), box(100, 140, 60))
    track = tracker.update(frame(138, 160, 60))
    assert not track.lost
    assert track.box.iou(box(138, 160, 60)) > 0.85


def test_a_target_half_covered_for_30_frames_is_still_the_target_afterwards() -> None:
    tracker = OnlineTracker()
    other = texture((352, 288), np.random.default_rng(9))
    for k in range(90):
        u = 90 + 2 * k
        picture = frame(u, 140, 60)
        if 30 <= k < 60:
            picture[110:170, u - 23 : u] = other[110:170, u - 23 : u]
        if k == 0:
            tracker.start(picture, box(u, 140, 60))
            continue
        track = tracker.update(picture)
        if k >= 65:
            assert not track.lost
            assert track.box.iou(box(u, 140, 60)) > 0.65


@pytest.mark.parametrize("side", ["left", "right", "top", "bottom"])
def test_lost_behind_a_cover_it_is_found_again_beside_its_place_while_still_half_covered(side: str) -> None:
    other = texture((352, 288), np.random.default_rng(9))
    half = {"left": np.s_[110:170, 147:170], "right": np.s_[110:170, 170:194],
            "top": np.s_[110:140, 147:194], "bottom": np.s_[140:170, 147:194]}[side]  # fmt: skip
    tracker = OnlineTracker()
    tracker.start(frame(170, 140, 60), box(170, 140, 60))
    for k in range(25):
        tracker.update(frame(170, 140, 60, noise_seed=k))
    for _ in range(5):
        assert tracker.update(other).lost
    picture = frame(170, 140, 60, noise_seed=25)
    picture[half] = other[half]
    track = tracker.update(picture)
    assert not track.lost
    assert track.box.iou(box(170, 140, 60)) > 0.65


def test_out_of_view_for_100_frames_it_locks_onto_nothing_and_comes_back_elsewhere() -> None:
    tracker = OnlineTracker()
    tracker.start(frame(100, 140, 60), box(100, 140, 60))
    for k in range(30):
        tracker.update(frame(100 + 2 * k, 140, 60, noise_seed=k))
    for k in range(100):
        noisy = np.clip(WALL + np.random.default_rng(k).normal(0, 4, WALL.shape), 0, 255).astype(np.uint8)
        assert tracker.update(noisy).lost
    found = [tracker.update(frame(270, 100, 60, noise_seed=k)) for k in range(10)]
    assert not found[-1].lost
    assert found[-1].box.iou(box(270, 100, 60)) > 0.7


def test_black_frames_and_another_size_are_lost_not_followed() -> None:
    tracker = OnlineTracker()
    tracker.start(frame(170, 140, 60), box(170, 140, 60))
    for k in range(25):
        tracker.update(frame(170, 140, 60, noise_seed=k))
    assert tracker.update(np.zeros_like(WALL)).lost
    assert not tracker.update(frame(170, 140, 60)).lost
    smaller = cv2.resize(WALL, (176, 144), interpolation=cv2.INTER_AREA)
    assert tracker.update(smaller).lost
    assert tracker.update(np.zeros((2000, 3000), np.uint8)).lost


def test_grey_pictures_are_followed_as_colour_ones() -> None:
    tracker = OnlineTracker()
    tracker.start(_grey(frame(150, 140, 60)), box(150, 140, 60))
    for k in range(1, 10):
        track = tracker.update(_grey(frame(150 + 3 * k, 140, 60)))
    assert track.box.iou(box(177, 140, 60)) > 0.85


@pytest.mark.parametrize(
    ("picture", "words"),
    [
        (np.zeros((288, 352, 3), np.uint16), "uint8"),
        (np.zeros((288, 352, 4), np.uint8), "BGR"),
        (np.zeros((4, 4, 3), np.uint8), "at least 8 px"),
    ],
    ids=["16 bit", "alpha", "tiny"],
)
def test_a_picture_it_cannot_read_is_refused_in_words(picture: np.ndarray, words: str) -> None:
    tracker = OnlineTracker()
    with pytest.raises(ValueError, match=words):
        tracker.start(picture, box(100, 140, 60))
    tracker.start(frame(170, 140, 60), box(170, 140, 60))
    with pytest.raises(ValueError, match=words):
        tracker.update(picture)


def _grey(picture: np.ndarray) -> np.ndarray:
    return picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
