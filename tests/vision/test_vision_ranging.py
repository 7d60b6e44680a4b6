"""Ranges against ray-cast depth: true, honest about their doubt, and none rather than a wrong one."""

from functools import cache

import cv2
import numpy as np
import pytest
from rendered_pairs import MOUNT, RIG, Block, Pair, Room, render

from calib.model import Camera, StereoRig
from robot.messages import Box
from robot.vision import patch_match
from robot.vision.ranging import range_box

DISTANCES = (0.6, 0.85, 1.1, 1.5, 1.9, 2.2, 2.5, 2.8)
LOW_RIG = StereoRig.parallel(352, 96, 305.0, 0.06)
"""The middle rows of the usual pictures: quicker to cast."""


@cache
def shot(distance: float) -> Pair:
    """A block 40 cm high, its middle `distance` metres before the eyes, turned a little; no noise."""
    block = Block(distance + 0.2, 0.0, 0.25, 0.25, 0.4, yaw=0.35, seed=round(100 * distance))
    room = Room((block,), texels_per_metre=400.0)
    return render(room, rig=LOW_RIG, tilt=0.0, noise=0.0, samples=2)


def exposed(image: np.ndarray, noise: float, gain: float, seed: int) -> np.ndarray:
    noisy = gain * image + noise * np.random.default_rng(seed).standard_normal(image.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def measured(noise: float, gain: float) -> np.ndarray:
    """Rows of (true, measured, sigma): every distance, three draws of noise and of a tracker's shaky box."""
    rows = []
    for distance in DISTANCES:
        pair = shot(distance)
        for seed in range(3):
            eyes = exposed(pair.left, noise, gain, seed), exposed(pair.right, noise, gain, 99 - seed)
            size = min(305 * 0.22 / distance, 88.0)
            u, v = (175.5, 47.5) + np.random.default_rng(seed).uniform(-0.08, 0.08, 2) * size
            found = range_box(*eyes, Box(u - size / 2, v - size / 2, size, size), LOW_RIG, MOUNT, 0.0, 0.0)
            if found is not None:
                rows.append((pair.depth[round(v), round(u)], found.distance, found.sigma))
    return np.array(rows)


@pytest.mark.parametrize(("noise", "gain", "most"), [(2.0, 1.0, 0.01), (3.0, 0.3, 0.02)])
def test_median_error_stays_small_in_light_and_in_the_dark(noise: float, gain: float, most: float) -> None:
    rows = measured(noise, gain)
    assert len(rows) >= 0.9 * 3 * len(DISTANCES)
    error = np.abs(rows[:, 1] - rows[:, 0]) / rows[:, 0]
    for low, high in ((0.5, 1.0), (1.0, 2.0), (2.0, 3.3)):
        band = error[(rows[:, 0] >= low) & (rows[:, 0] < high)]
        assert len(band) >= 4
        assert np.median(band) <= most


def test_sigma_is_honest() -> None:
    rows = np.vstack([measured(2.0, 1.0), measured(3.0, 0.3)])
    off = np.abs(rows[:, 1] - rows[:, 0]) / rows[:, 2]
    assert 0.5 <= np.mean(off <= 1.0) <= 0.97
    assert np.mean(off <= 2.0) >= 0.85


@pytest.mark.parametrize("distance", [0.8, 1.2, 1.6])
def test_an_upright_edge_in_the_middle_is_not_read_too_far(distance: float) -> None:
    half_diagonal = 0.25 / 2**0.5
    block = Block(distance + 0.08 + half_diagonal, 0.03, 0.25, 0.25, 0.4, yaw=np.pi / 4, seed=5)
    pair = render(Room((block,), texels_per_metre=400.0), rig=LOW_RIG, tilt=0.0, noise=1.0, samples=2)
    size = 305 * 0.3 / distance
    box = Box(175.5 - size / 2, 47.5 - size / 2, size, size)
    found = range_box(pair.left, pair.right, box, LOW_RIG, MOUNT, 0.0, 0.0)
    true = float(pair.depth[47, 173:179].min())
    assert true == pytest.approx(distance, abs=0.01)
    assert found is not None
    assert found.distance == pytest.approx(true, rel=0.012)


def test_doubt_grows_in_the_dark() -> None:
    bright, dark = measured(2.0, 1.0), measured(3.0, 0.3)
    assert np.median(dark[:, 2] / dark[:, 0]) > 1.3 * np.median(bright[:, 2] / bright[:, 0])


def cloud(seed: int, width: int = 352) -> np.ndarray:
    noise = np.random.default_rng(seed).integers(0, 256, (120, width)).astype(np.uint8)
    return cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 1.6), None, 20, 235, cv2.NORM_MINMAX)


def shifted(image: np.ndarray, disparity: float, lower: float = 0.0) -> np.ndarray:
    """The right picture of a wall: everything `disparity` px farther left, by Fourier (exact)."""
    fy, fx = np.fft.fftfreq(image.shape[0])[:, None], np.fft.fftfreq(image.shape[1])[None, :]
    turn = np.exp(2j * np.pi * (fx * disparity - fy * lower))
    return np.clip(np.rint(np.fft.ifft2(np.fft.fft2(image.astype(float)) * turn).real), 0, 255).astype(
        np.uint8
    )


@pytest.mark.parametrize("part", [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875])
def test_parts_of_a_pixel_are_measured_without_locking_to_whole_ones(part: float) -> None:
    left = cloud(1)
    for whole in (7, 21):
        right = shifted(left, whole + part)
        found = range_box(left, right, Box(150, 40, 40, 40), RIG, MOUNT, 0.0, 0.0)
        assert found is not None
        assert found.disparity_px == pytest.approx(whole + part, abs=0.02)
        assert found.distance == pytest.approx(305 * 0.06 / (whole + part), rel=0.004)


@pytest.mark.parametrize("lower", [-0.8, -0.4, 0.5, 1.0])
def test_a_skew_of_rows_between_the_eyes_does_not_spoil_the_range(lower: float) -> None:
    left = cloud(2)
    found = range_box(left, shifted(left, 12.3, lower), Box(150, 40, 40, 40), RIG, MOUNT, 0.0, 0.0)
    assert found is not None
    assert found.disparity_px == pytest.approx(12.3, abs=0.05)


def test_another_exposure_of_the_right_eye_does_not_spoil_the_range() -> None:
    left = cloud(3)
    right = np.clip(0.7 * shifted(left, 9.6).astype(float) + 25, 0, 255).astype(np.uint8)
    found = range_box(left, right, Box(150, 40, 40, 40), RIG, MOUNT, 0.0, 0.0)
    assert found is not None
    assert found.disparity_px == pytest.approx(9.6, abs=0.05)


def test_principal_points_that_differ_are_taken_into_account() -> None:
    rig = StereoRig.parallel(352, 120, 305.0, 0.06, doffs=6.0)
    left = cloud(4)
    found = range_box(left, shifted(left, 4.0), Box(150, 40, 40, 40), rig, MOUNT, 0.0, 0.0)
    assert found is not None
    assert found.disparity_px == pytest.approx(10.0, abs=0.03)
    assert found.distance == pytest.approx(1.83, rel=0.005)


def test_far_things_left_of_each_other_by_doffs_are_found() -> None:
    rig = StereoRig.parallel(352, 120, 305.0, 0.06, doffs=10.0)
    left = cloud(5)
    found = range_box(left, shifted(left, -4.0), Box(150, 40, 40, 40), rig, MOUNT, 0.0, 0.0)
    assert found is not None
    assert found.disparity_px == pytest.approx(6.0, abs=0.03)


@pytest.mark.parametrize(("pan", "tilt"), [(0.0, 0.0), (0.7, 0.2), (-1.2, 0.5)])
def test_position_is_where_the_head_looks(pan: float, tilt: float) -> None:
    left = cloud(6)
    camera = Camera(352, 120, 305.0, 305.0, 170.0, 60.0)
    rig = StereoRig(camera, camera)
    found = range_box(left, shifted(left, 10.0), Box(150, 40, 40, 40), rig, MOUNT, pan, tilt)
    assert found is not None
    rotation, eye = MOUNT.left_eye(pan, tilt)
    assert np.allclose(found.position, eye + found.distance * rotation[:, 2], atol=1e-9)


def test_colour_and_grey_give_the_same() -> None:
    left, right = cloud(7), shifted(cloud(7), 8.4)
    grey = range_box(left, right, Box(150, 40, 40, 40), RIG, MOUNT, 0.0, 0.0)
    colour = range_box(
        *(cv2.merge([i, i, i]) for i in (left, right)), Box(150, 40, 40, 40), RIG, MOUNT, 0.0, 0.0
    )
    assert grey == colour
    assert grey is not None


def test_what_calibration_leaves_adds_to_the_doubt() -> None:
    pair = cloud(8), shifted(cloud(8), 10.0)
    plain, doubted = (
        range_box(*pair, Box(150, 40, 40, 40), RIG, MOUNT, 0.0, 0.0, calibration_sigma_px=s)
        for s in (0.0, 0.2)
    )
    assert plain is not None
    assert doubted is not None
    assert doubted.sigma**2 - plain.sigma**2 == pytest.approx(
        (plain.distance * 0.2 / plain.disparity_px) ** 2
    )


# ------------------------------------------------------------------------- none rather than a wrong one


def test_nearer_than_searched_is_none_and_never_far() -> None:
    left = cloud(9)
    for disparity in (80.0, 95.0, 120.0):
        assert range_box(left, shifted(left, disparity), Box(180, 40, 40, 40), RIG, MOUNT, 0.0, 0.0) is None


def test_exchanged_eyes_have_no_range() -> None:
    left = cloud(10)
    assert range_box(shifted(left, 12.0), left, Box(150, 40, 40, 40), RIG, MOUNT, 0.0, 0.0) is None


def test_a_repeated_pattern_has_no_range() -> None:
    stripes = np.tile((128 + 90 * np.sin(np.arange(352) * 2 * np.pi / 11)).astype(np.uint8), (120, 1))
    assert range_box(stripes, shifted(stripes, 15.0), Box(150, 40, 40, 40), RIG, MOUNT, 0.0, 0.0) is None


@pytest.mark.parametrize("level", [0, 120, 255])
def test_a_blank_surface_has_no_range(level: int) -> None:
    blank = np.full((120, 352), level, np.uint8)
    assert range_box(blank, blank, Box(150, 40, 40, 40), RIG, MOUNT, 0.0, 0.0) is None


def test_noise_alone_has_no_range() -> None:
    draw = np.random.default_rng(11)
    for _ in range(20):
        left, right = (draw.normal(120, 4, (120, 352)).astype(np.uint8) for _ in range(2))
        assert range_box(left, right, Box(150, 40, 40, 40), RIG, MOUNT, 0.0, 0.0) is None


def test_what_only_one_eye_sees_has_no_range() -> None:
    left, right = cloud(12), cloud(13)
    assert range_box(left, right, Box(150, 40, 40, 40), RIG, MOUNT, 0.0, 0.0) is None


@pytest.mark.parametrize(
    "box", [Box(-60, 40, 40, 40), Box(400, 40, 40, 40), Box(150, 200, 30, 30), Box(345, 40, 8, 40)]
)
def test_a_box_outside_or_at_the_rim_has_no_range(box: Box) -> None:
    left = cloud(14)
    assert range_box(left, shifted(left, 10.0), box, RIG, MOUNT, 0.0, 0.0) is None


def test_a_tiny_box_has_no_range() -> None:
    left = cloud(15)
    assert range_box(left, shifted(left, 10.0), Box(150, 40, 6, 6), RIG, MOUNT, 0.0, 0.0) is None


def test_a_patch_keeps_its_middle_when_the_border_shrinks_it() -> None:
    patch = patch_match.patch_at(6.3, 50.0, 12.0, 12.0, 352, 120)
    assert patch is not None
    assert (patch.u, patch.half_u, patch.half_v) == (6, 6, 12)
    assert patch.u_true == 6.3


def pasted(image: np.ndarray, source: np.ndarray, u_to: int, u_from: int) -> np.ndarray:
    """The image with source's columns about u_from, 25 px to both sides, put about u_to."""
    copy = image.copy()
    copy[:, u_to - 25 : u_to + 26] = source[:, u_from - 25 : u_from + 26]
    return copy


def grey(image: np.ndarray) -> np.ndarray:
    return image.astype(np.float32)


def test_two_places_that_look_alike_are_no_match() -> None:
    left = cloud(16)
    right = shifted(left, 10.0)
    patch = patch_match.patch_at(220.0, 60.0, 12.0, 12.0, 352, 120)
    assert patch is not None
    assert patch_match.find(grey(left), grey(right), patch, (-2, 76)) is not None
    double = pasted(right, left, 160, 220)
    assert patch_match.find(grey(left), grey(double), patch, (-2, 76)) is None


def test_a_match_that_does_not_lead_back_is_none() -> None:
    left = cloud(17)
    right = pasted(shifted(left, 10.0), cloud(18), 180, 180)  # what was at 190 is hidden from the right eye
    noise = np.random.default_rng(0).normal(0, 12, left.shape)
    alike = np.clip(pasted(left, left, 190, 130) + noise * (np.abs(np.arange(352) - 190) < 26), 0, 255)
    patch = patch_match.patch_at(190.0, 60.0, 12.0, 12.0, 352, 120)
    assert patch is not None
    there = patch_match._best_along_row(grey(alike), grey(right), patch, (-76, 2))
    assert there is not None
    assert there[0] == -70, "it looks like the thing 60 px beside it"
    assert patch_match.find(grey(alike), grey(right), patch, (-2, 76)) is None


def test_a_match_at_the_rim_of_the_search_is_none() -> None:
    left = cloud(19)
    patch = patch_match.patch_at(220.0, 60.0, 12.0, 12.0, 352, 120)
    assert patch is not None
    for disparity, found in ((19.0, True), (20.0, False), (21.0, False)):
        place = patch_match.find(grey(left), grey(shifted(left, disparity)), patch, (-2, 20))
        assert (place is not None) is found


def test_a_skew_of_rows_does_not_turn_into_disparity_on_slanted_texture() -> None:
    noise = np.random.default_rng(20).integers(0, 256, (120, 352)).astype(np.uint8)
    lines = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 1.5, sigmaY=4.0), None, 20, 235, cv2.NORM_MINMAX)
    left = np.stack([np.roll(row, v) for v, row in enumerate(lines)])
    found = range_box(left, shifted(left, 12.0, 0.4), Box(150, 40, 40, 40), RIG, MOUNT, 0.0, 0.0)
    assert found is not None
    assert found.disparity_px == pytest.approx(12.0, abs=0.12)
