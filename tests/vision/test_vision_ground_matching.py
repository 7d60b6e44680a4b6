"""Matching along epipolar lines: against a plain search, on pairs that are not rectified, and in doubt."""

import math

import cv2
import numpy as np
import pytest
from ground_scenes import look
from layered_scenes import Layer, cast
from rendered_pairs import RIG, Block, Room

from calib.model import Camera, StereoRig
from robot.vision.ground_corners import harris_corners, spread, upright_edges
from robot.vision.ground_matching import (
    EyePictures,
    _well_placed,
    epipolar_lines,
    fundamental_matrix,
    leads_back,
    match_in_bands,
)
from robot.vision.pair_input import grey_pair


def corners_within(pictures, margin=30):
    corners = harris_corners(pictures.half_left)
    height, width = pictures.left.shape
    inside = (np.abs(corners - (width / 2, height / 2)) < (width / 2 - margin, height / 2 - margin)).all(
        axis=1
    )
    return corners[inside]


def plain_search(left, right, corner, reach):
    """Best whole column by correlating an 11 x 11 patch at every column of the row: slow and obvious."""
    u, v = np.floor(corner).astype(int)
    patch = left[v - 5 : v + 6, u - 5 : u + 6].astype(np.float64)
    scores = []
    for column in range(max(u - reach, 5), u + 1):
        other = right[v - 5 : v + 6, column - 5 : column + 6].astype(np.float64)
        scores.append(np.corrcoef(patch.ravel(), other.ravel())[0, 1])
    return max(u - reach, 5) + int(np.argmax(scores)), max(scores)


def test_it_finds_what_a_plain_search_finds():
    scene = cast(
        (Layer(6.4, (0, 0, 0, 0), 110, 3), Layer(17.7, (70, 40, 150, 110), 150, 4)), 200, 140, seed=2
    )
    pictures = EyePictures.of(scene.left, scene.right)
    corners = corners_within(pictures)
    found = match_in_bands(
        pictures, corners, fundamental_matrix(StereoRig.parallel(200, 140, 200.0, 0.06)),
        corners[:, 0] - 40, corners[:, 0],
    )  # fmt: skip
    sure = np.flatnonzero(found.sure)
    assert len(sure) > 30
    plain = [plain_search(scene.left, scene.right, corners[k], 40) for k in sure]
    column = np.floor(corners[sure, 0]) - [p[0] for p in plain]
    shift = corners[sure, 0] - found.right[sure, 0]
    assert np.mean(np.abs(shift - column) <= 1.0) >= 0.97
    assert np.allclose(found.right[sure, 1], corners[sure, 1], atol=1.0)


@pytest.mark.parametrize("noise", [1.0, 4.0])
def test_fractions_and_their_sigma_are_honest(noise):
    errors, sigmas = [], []
    for k in range(5):
        scene = cast(
            (Layer(7.0 + 0.2 * k, (0, 0, 0, 0), 120, 10 + k, contrast=14.0, down=0.03),), 220, 140, noise, k
        )
        pictures = EyePictures.of(scene.left, scene.right)
        corners = corners_within(pictures)
        rows = fundamental_matrix(StereoRig.parallel(220, 140, 200.0, 0.06))
        found = match_in_bands(pictures, corners, rows, corners[:, 0] - 30, corners[:, 0])
        at = corners[found.sure]
        truth = 7.0 + 0.2 * k + 0.03 * (at[:, 1] + 0.5 - 70.0)
        errors.append(at[:, 0] - found.right[found.sure, 0] - truth)
        sigmas.append(found.sigma_px[found.sure])
    error, sigma = np.concatenate(errors), np.concatenate(sigmas)
    assert len(error) > 200
    assert abs(np.median(error)) < 0.05
    assert np.median(np.abs(error)) < 0.03 + 0.03 * noise
    assert 0.55 <= np.mean(np.abs(error) < sigma) <= 0.95
    assert np.mean(np.abs(error) < 3 * sigma) >= 0.97


def test_more_noise_means_more_sigma():
    medians = []
    for noise in (0.5, 3.0, 6.0):
        scene = cast((Layer(8.3, (0, 0, 0, 0), 120, 31, contrast=12.0),), 200, 120, noise, 1)
        pictures = EyePictures.of(scene.left, scene.right)
        corners = corners_within(pictures)
        rows = fundamental_matrix(StereoRig.parallel(200, 120, 200.0, 0.06))
        found = match_in_bands(pictures, corners, rows, corners[:, 0] - 30, corners[:, 0])
        medians.append(np.median(found.sigma_px[found.sure]))
    assert medians[0] < 0.8 * medians[1] < 0.64 * medians[2]


def rolled(degrees):
    """A pair whose right eye is rolled and toed in, as no rectified pair is."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    a, b = math.cos(0.02), math.sin(0.02)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[a, 0, b], [0, 1, 0], [-b, 0, a]])
    eye = Camera(352, 288, 305.0, 305.0, 175.5, 143.5)
    return StereoRig(eye, eye, tuple(turn.ravel().tolist()), (-0.06, 0.004, 0.003))


@pytest.mark.parametrize("degrees", [-2.0, 2.0])
def test_a_pair_that_is_not_rectified_is_matched_along_its_lines(degrees):
    rig = rolled(degrees)
    pair = look(Room((Block(0.9, 0.0, 0.2, 0.4, 0.3),)), rig=rig, samples=2)
    pictures = EyePictures.of(*grey_pair(pair.left, pair.right))
    corners = corners_within(pictures, 40)
    lines = epipolar_lines(fundamental_matrix(rig), corners)
    rows = -(lines[:, 0] * corners[:, 0] + lines[:, 2])
    assert np.abs(rows - corners[:, 1]).max() > 4.0
    found = match_in_bands(pictures, corners, fundamental_matrix(rig), corners[:, 0] - 80, corners[:, 0] + 10)
    sure = found.sure
    assert sure.sum() > 60
    at = corners[sure]
    depth = cv2.remap(
        pair.depth.astype(np.float32),
        at[:, :1].astype(np.float32),
        at[:, 1:].astype(np.float32),
        cv2.INTER_NEAREST,
    )
    rays = np.column_stack([at, np.ones(len(at))]) @ np.linalg.inv(rig.left.matrix).T
    truth = (rays * depth @ rig.R.T + rig.translation) @ rig.right.matrix.T
    off = found.right[sure] - truth[:, :2] / truth[:, 2:]
    assert np.median(np.abs(off[:, 0])) < 0.15
    assert np.mean(np.abs(off) < 1.5) > 0.93


def test_points_obey_the_fundamental_matrix():
    rig = rolled(3.0)
    points = np.random.default_rng(1).uniform((-0.5, -0.3, 0.4), (0.5, 0.3, 3.0), (50, 3))
    left, right = points @ rig.left.matrix.T, (points @ rig.R.T + rig.translation) @ rig.right.matrix.T
    left, right = left / left[:, 2:], right / right[:, 2:]
    assert np.abs(np.einsum("ni,ij,nj->n", right, fundamental_matrix(rig), left)).max() < 1e-9


def test_steep_lines_are_refused():
    eye = Camera(352, 288, 305.0, 305.0, 175.5, 143.5)
    above = StereoRig(eye, eye, translation=(0.0, -0.06, 0.0))
    with pytest.raises(ValueError, match="rectify"):
        epipolar_lines(fundamental_matrix(above), np.array([[100.0, 100.0]]))


def test_what_repeats_or_is_plain_is_not_sure():
    rows = fundamental_matrix(RIG)
    v, u = np.mgrid[:288, :352]
    fence = (128 + 60 * np.sin(u * 2 * np.pi / 16) * np.cos(v * 2 * np.pi / 16)).astype(np.uint8)
    at = np.array([[u, v] for u in range(120, 320, 20) for v in range(60, 240, 20)], np.float64)
    for picture in (fence, np.full_like(fence, 90)):
        found = match_in_bands(EyePictures.of(picture, picture), at, rows, at[:, 0] - 80, at[:, 0])
        assert not found.sure.any()


def test_what_one_eye_alone_sees_is_not_sure():
    """Each eye sees its own noise: nothing leads there and back."""
    rng = np.random.default_rng(3)
    left, right = (
        cv2.GaussianBlur(rng.integers(0, 255, (288, 352), np.uint8), (0, 0), 1.5) for _ in range(2)
    )
    pictures = EyePictures.of(left, right)
    corners = corners_within(pictures)
    rows, low, high = fundamental_matrix(RIG), corners[:, 0] - 100, corners[:, 0]
    found = match_in_bands(pictures, corners, rows, low, high)
    back = leads_back(pictures, corners, found.right, rows, low, high)
    assert (found.sure & back).mean() < 0.01


def test_no_points_no_matches():
    grey = np.zeros((20, 30), np.uint8)
    none = np.zeros((0, 2))
    found = match_in_bands(EyePictures.of(grey, grey), none, fundamental_matrix(RIG), none[:, 0], none[:, 0])
    assert found.right.shape == (0, 2)
    assert found.sure.shape == (0,)


def test_corners_are_spread_and_a_plain_post_has_edges():
    picture = np.full((144, 176), 90.0, np.float32)
    picture[:, 80:90] = 140.0
    edges = upright_edges(picture)
    # The step between columns 79 and 80 of the half-size picture: about 160 of the full one, and about 180.
    assert set(np.rint(edges[:, 0] / 4).astype(int)) <= {40, 45}
    assert len(edges) >= 20
    corners = np.random.default_rng(0).uniform(0, 280, (400, 2))
    kept = corners[spread(corners, 100, 2)]
    tiles = (kept // 32).astype(int)
    assert len(kept) == 100
    assert max(np.unique(tiles, axis=0, return_counts=True)[1]) <= 2


@pytest.mark.parametrize(
    ("along", "across", "sigma", "correlation", "sure"),
    [
        (0.0, 0.0, 0.1, 0.95, True),
        (1.9, 1.1, 0.32, 0.86, True),
        (2.1, 0.0, 0.1, 0.95, False),
        (0.0, -1.3, 0.1, 0.95, False),
        (0.0, 0.0, 0.35, 0.95, False),
        (0.0, 0.0, 0.1, 0.84, False),
    ],
)
def test_a_match_must_stay_where_it_was_found_be_alike_and_be_sharp(along, across, sigma, correlation, sure):
    start = np.array([[50.0, 40.0]])
    places = start + np.array([[along, across]])
    assert bool(_well_placed(places, start, np.array([sigma]), np.array([correlation]))[0]) is sure


@pytest.mark.parametrize(("low", "high", "sure"), [(60, 0, True), (60, 15, False), (9, 0, False)])
def test_a_match_at_the_bands_end_may_lie_beyond(low, high, sure):
    """12 px of disparity: patches are still alike two pixels off, where the band ends."""
    noise = np.random.default_rng(1).integers(0, 255, (120, 260), np.uint8)
    scene = cv2.GaussianBlur(noise, (0, 0), 4.0)
    eyes = EyePictures.of(scene[:, :240], scene[:, 12:252])
    at = np.array([[x, y] for x in np.arange(90.5, 220, 12) for y in np.arange(20.5, 100, 12)])
    rows = fundamental_matrix(StereoRig.parallel(240, 120, 200.0, 0.06))
    found = match_in_bands(eyes, at, rows, at[:, 0] - low, at[:, 0] - high)
    assert (found.sure.mean() > 0.5) if sure else not found.sure.any()


def test_true_matches_lead_back_within_their_own_band_and_those_at_the_rim_are_not_sure():
    noise = np.random.default_rng(1).integers(0, 255, (120, 260), np.uint8)
    scene = cv2.GaussianBlur(noise, (0, 0), 2.0)
    eyes = EyePictures.of(scene[:, :240], scene[:, 12:252])
    rows = fundamental_matrix(StereoRig.parallel(240, 120, 200.0, 0.06))
    at = np.array([[x, y] for x in np.arange(60.5, 220, 12) for y in np.arange(20.5, 100, 12)])
    low, high = at[:, 0] - 18.0, at[:, 0] - 6.0
    found = match_in_bands(eyes, at, rows, low, high)
    assert found.sure.mean() > 0.9
    assert leads_back(eyes, at, found.right, rows, low, high)[found.sure].mean() > 0.95
    assert not leads_back(eyes, at, found.right - np.array([5.0, 0.0]), rows, low, high).any()
    rim = np.array([[x, y] for x in (100.5, 150.5) for y in (0.5, 4.5, 118.5)] + [[238.5, 60.5]])
    assert not match_in_bands(eyes, rim, rows, rim[:, 0] - 30, rim[:, 0]).sure.any()


def test_one_tile_gives_no_more_than_its_share_and_every_tile_its_strongest():
    crowded = np.column_stack([np.linspace(1, 30, 50), np.full(50, 10.0)])
    apart = np.array([[40.0, 10.0], [100.0, 200.0]])
    kept = spread(np.vstack([crowded, apart]), 100, 6)
    assert kept.tolist() == [0, 1, 2, 3, 4, 5, 50, 51]
    assert spread(np.vstack([crowded, apart]), 3, 6).tolist() == [0, 50, 51]
    assert spread(crowded[:0], 3, 6).shape == (0,)
