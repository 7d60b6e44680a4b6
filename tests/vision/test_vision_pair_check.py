"""One look at a pair: how a bumped camera was turned, whether eyes are exchanged, when nobody can tell."""

import math
from functools import cache

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rendered_pairs import RIG, TILT, Block, Pair, Room, render

from calib.model import StereoRig
from robot.vision.pair_check import PairCheck, SignVotes, check_matches, check_pair, complaint, sign_votes
from robot.vision.pair_matches import PairMatches, pair_matches

ROOMS = {
    "floor": (Room(), 0.349, 0.0),
    "boxes": (Room((Block(1.0, 0.1, 0.3, 0.3, 0.3, yaw=0.5), Block(1.8, -0.4, 0.3, 0.4, 0.5))), 0.1, 0.4),
    "wall": (Room(size=1.0), 0.0, -0.6),
    "dull": (Room((Block(2.0, 0.0, 0.5, 0.5, 0.6),), contrast=0.5), 0.2, 0.0),
}
DEGREE = math.radians(1.0)


@cache
def room(name: str = "boxes", gain: float = 1.0, noise: float = 2.0) -> Pair:
    space, tilt, pan = ROOMS[name]
    return render(space, tilt=tilt, pan=pan, gain=gain, noise=noise, samples=2)


def bumped(
    picture: np.ndarray,
    pitch: float = 0.0,
    roll: float = 0.0,
    stretch: float = 0.0,
    yaw: float = 0.0,
) -> np.ndarray:
    """What the eye sees turned by these angles (the exact homography) and with another focal length."""
    # x to the right, y down: what turns about -x moves down.
    turn = cv2.Rodrigues(np.array([-pitch, yaw, roll]))[0]
    k = RIG.right.matrix
    moved = k @ np.diag([1 + stretch, 1 + stretch, 1.0]) @ turn @ np.linalg.inv(k)
    size = picture.shape[1], picture.shape[0]
    return cv2.warpPerspective(picture, moved, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def check(pair: Pair, **turn: float) -> PairCheck:
    return check_pair(pair.left, bumped(pair.right, **turn) if turn else pair.right, RIG)


# ------------------------------------------------------------------------------------------------ rows


@pytest.mark.parametrize("name", ROOMS)
def test_a_good_pair_is_in_its_rows(name: str) -> None:
    seen = check(room(name))
    assert seen.tells
    assert seen.error_px < 0.15
    assert abs(seen.yaw) < 0.3 * DEGREE
    assert not seen.misrectified
    assert complaint(seen) is None


BUMPS = {
    "low": ({"pitch": 0.35 * DEGREE}, "the right picture lies 1.9 px too low"),
    "high": ({"pitch": -0.5 * DEGREE}, "the right picture lies 2.7 px too high"),
    "much too low": ({"pitch": 3.0 * DEGREE}, "px too low"),
    "rolled": ({"roll": 0.8 * DEGREE}, "is rolled by 0.8 degrees clockwise"),
    "rolled much": ({"roll": -3.0 * DEGREE}, "is rolled by 3.0 degrees counter-clockwise"),
    "another focal length": ({"stretch": 0.015}, "is 1.5 % larger"),
    "turned inwards": ({"yaw": 2.0 * DEGREE}, "degrees to one another"),
    "turned outwards": ({"yaw": -2.0 * DEGREE}, "degrees to one another"),
}


@pytest.mark.parametrize("name", ROOMS)
@pytest.mark.parametrize("bump", BUMPS)
def test_a_bumped_eye_is_found_and_how_it_was_turned(name: str, bump: str) -> None:
    turn, words = BUMPS[bump]
    seen = check(room(name), **turn)
    assert seen.misrectified
    assert not seen.swapped
    line = complaint(seen)
    assert line is not None
    if name == "floor":  # digits, where matches are everywhere
        assert words in line
    assert "Calibrate again" in line
    assert "\n" not in line
    assert seen.pitch == pytest.approx(turn.get("pitch", 0.0), abs=0.05 * DEGREE)
    assert seen.roll == pytest.approx(turn.get("roll", 0.0), abs=0.12 * DEGREE)
    assert seen.stretch == pytest.approx(turn.get("stretch", 0.0), abs=0.002 + turn.get("pitch", 0.0) ** 2)
    assert seen.yaw == pytest.approx(turn.get("yaw", 0.0), abs=0.4 * DEGREE)


@settings(max_examples=10, deadline=None, derandomize=True)
@given(
    pitch=st.floats(-0.02, 0.02),
    roll=st.floats(-0.02, 0.02),
    stretch=st.floats(-0.015, 0.015),
    yaw=st.floats(-0.03, 0.03),
)
def test_any_small_turn_is_measured_within_its_sigma(
    pitch: float, roll: float, stretch: float, yaw: float
) -> None:
    seen = check(room("wall"), pitch=pitch, roll=roll, stretch=stretch, yaw=yaw)
    # Second order: products of two turns are left out of the model.
    slack = 0.02 * max(abs(pitch), abs(roll), abs(yaw)) + 0.0015
    assert seen.pitch == pytest.approx(pitch, abs=slack)
    assert seen.roll == pytest.approx(roll, abs=slack)
    assert seen.stretch == pytest.approx(stretch, abs=slack + 0.001)
    assert abs(seen.yaw - yaw) <= 4 * seen.yaw_sigma + slack
    assert seen.offset_px == pytest.approx(seen.pitch * RIG.right.fx)


def test_the_error_is_the_root_mean_square_over_the_picture() -> None:
    seen = check(room("wall"), roll=1.0 * DEGREE)
    u = np.arange(RIG.right.width) - RIG.right.cx
    assert seen.error_px == pytest.approx(DEGREE * np.sqrt(np.mean(u**2)), rel=0.12)
    assert np.linalg.norm(seen.parts_px) == pytest.approx(seen.error_px, rel=0.05)
    assert max(seen.parts_px, key=abs) == seen.parts_px[1]


def some_matches(
    seed: int = 0,
    count: int = 120,
    sigma_px: float = 0.15,
    chance: float = 0.0,
    yaw: float = 0.0,
    down: float = 0.0,
) -> PairMatches:
    """Matches strewn over the picture, `chance` of them anywhere within 24 rows."""
    draw = np.random.default_rng(seed)
    left = draw.uniform((100, 0), (RIG.left.width, RIG.left.height), (count, 2))
    x, y = ((left - (RIG.left.cx, RIG.left.cy)) / RIG.left.fx).T
    drop = down + RIG.left.fx * yaw * x * y + sigma_px * draw.standard_normal(count)
    drop = np.where(np.arange(count) < chance * count, draw.uniform(-24, 24, count), drop)
    return PairMatches(left, left + np.stack([np.zeros(count), drop], axis=1))


def test_turned_eyes_are_found_before_the_rows_are_off() -> None:
    seen = check_matches(some_matches(yaw=1.2 * DEGREE), RIG)
    assert seen.error_px < 0.7
    assert seen.misrectified
    assert "degrees to one another" in str(complaint(seen))


def test_a_fifth_of_chance_matches_does_no_harm_but_a_half_tells_nothing() -> None:
    seen = check_matches(some_matches(chance=0.2, down=2.0), RIG)
    assert seen.misrectified
    assert seen.offset_px == pytest.approx(2.0, abs=0.25)
    assert not check_matches(some_matches(chance=0.5, down=2.0), RIG).tells


def test_few_or_vague_matches_are_sure_of_nothing() -> None:
    assert not check_matches(some_matches(count=15, down=5.0), RIG).tells
    vague = [check_matches(some_matches(seed, count=20, sigma_px=0.8, down=0.3), RIG) for seed in range(40)]
    assert any(seen.error_px > 0.7 for seen in vague)
    assert sum(seen.misrectified for seen in vague) <= 1, "three standard deviations"
    assert check_matches(some_matches(down=1.1), RIG).error_sigma_px < 0.06


def test_a_half_pixel_is_seen_but_is_no_fault() -> None:
    seen = check(room("wall"), pitch=0.4 / RIG.right.fx)
    assert seen.offset_px == pytest.approx(0.4, abs=0.08)
    assert not seen.misrectified


def test_matches_are_true_to_a_fraction_of_a_pixel() -> None:
    pair = room("wall")
    found = pair_matches(pair.left, bumped(pair.right, pitch=2.25 / RIG.right.fx))
    u, v = np.rint(found.left).astype(int).T
    truth = RIG.left.fx * RIG.baseline / pair.depth[v, u]
    assert len(found) > 40
    along, down = (found.left - found.right).T
    assert np.median(np.abs(along - truth)) < 0.15
    assert np.median(np.abs(-down - 2.25)) < 0.15
    assert (np.abs(along - truth) < 2.0).mean() > 0.9


@pytest.mark.parametrize(("gain", "offset"), [(0.5, 0), (0.8, 30), (1.3, -20)])
def test_eyes_that_expose_differently_are_judged_alike(gain: float, offset: int) -> None:
    pair = room("boxes")
    other = np.clip(gain * pair.right.astype(float) + offset, 0, 255).astype(np.uint8)
    seen = check_pair(pair.left, other, RIG)
    assert seen.tells
    assert seen.error_px < 0.3
    assert check_pair(other, pair.left, RIG).swapped


# ------------------------------------------------------------------------------------- exchanged eyes


@pytest.mark.parametrize("name", ROOMS)
@pytest.mark.parametrize("turn", [{}, {"pitch": 1.0 * DEGREE, "roll": 1.0 * DEGREE}], ids=["", "bumped"])
def test_exchanged_eyes_are_named_before_all_else(name: str, turn: dict[str, float]) -> None:
    pair = room(name)
    right = bumped(pair.right, **turn)
    assert not check_pair(pair.left, right, RIG).swapped
    seen = check_pair(right, pair.left, RIG)
    assert seen.swapped
    line = complaint(seen)
    assert line is not None
    assert "exchanged" in line
    assert "give LEFT first" in line


@pytest.mark.parametrize("name", ROOMS)
def test_a_mirrored_room_is_a_room_too(name: str) -> None:
    left, right = (np.ascontiguousarray(eye[:, ::-1]) for eye in (room(name).right, room(name).left))
    assert not check_pair(left, right, RIG).swapped
    assert check_pair(right, left, RIG).swapped


def test_night_is_judged_as_long_as_it_shows_anything() -> None:
    dusk = room("boxes", gain=0.3, noise=3.0)
    assert check_pair(dusk.right, dusk.left, RIG).swapped
    assert not check_pair(dusk.left, dusk.right, RIG).swapped


@pytest.mark.parametrize("doffs", [-12.0, 12.0])
def test_unlike_principal_points_are_taken_into_account(doffs: float) -> None:
    rig = StereoRig.parallel(352, 288, 305.0, 0.06, doffs=doffs)
    pair = render(ROOMS["floor"][0], rig=rig, tilt=TILT, samples=2)
    assert not check_pair(pair.left, pair.right, rig).swapped
    assert check_pair(pair.right, pair.left, StereoRig.parallel(352, 288, 305.0, 0.06, doffs=-doffs)).swapped


def test_far_things_and_a_slightly_wrong_principal_point_accuse_nobody() -> None:
    noise = np.random.default_rng(4).integers(0, 256, (288, 400)).astype(np.uint8)
    scene = cv2.GaussianBlur(noise, (0, 0), 2.5)
    assert not check_pair(scene[:, 20:372], scene[:, 18:370], RIG).swapped


def test_far_things_seen_by_eyes_turned_to_one_another_accuse_the_calibration_alone() -> None:
    far = render(Room(size=3.5), tilt=0.0, samples=2)
    for yaw in (-2.5 * DEGREE, 2.5 * DEGREE):
        seen = check(far, yaw=yaw)
        assert seen.misrectified
        assert not seen.swapped


def test_a_repeating_pattern_is_matched_nowhere_else() -> None:
    noise = np.random.default_rng(1).integers(0, 256, (120, 56)).astype(np.uint8)
    scene = cv2.GaussianBlur(np.tile(noise, (1, 8)), (0, 0), 1.8)
    found = pair_matches(scene[:, :352], scene[:, 12:364])
    assert len(found) <= 4


def test_a_pattern_of_the_sensors_own_is_no_texture() -> None:
    rough = cv2.GaussianBlur(np.random.default_rng(2).standard_normal((288, 352)), (0, 0), 2.0)
    faint = np.rint(120 + 1.2 * rough / rough.std()).astype(np.uint8)
    assert not check_pair(faint, faint, RIG).tells


def test_votes_are_matches_that_only_one_order_allows() -> None:
    right = np.zeros((5, 2))
    left = np.array([[30.0, 0], [5.0, 0], [0.0, 0], [-5.0, 0], [-30.0, 0]])
    matches = PairMatches(left, right)
    assert sign_votes(matches) == SignVotes(ordered=2, exchanged=2)
    assert sign_votes(matches, doffs=10.0) == SignVotes(ordered=1, exchanged=1)
    assert sign_votes(matches, least_shift_px=10.0) == SignVotes(ordered=1, exchanged=1)
    assert not SignVotes(0, 7).swapped
    assert SignVotes(0, 8).swapped
    assert not SignVotes(2, 16).swapped


# ------------------------------------------------------------------------------------ nothing to tell


@pytest.mark.parametrize("size", [0.16, 0.2, 0.23, 0.28])
@pytest.mark.parametrize("texels", [250.0, 600.0])
def test_a_wall_before_the_nose_accuses_nobody(size: float, texels: float) -> None:
    pair = render(Room(size=size, texels_per_metre=texels), tilt=0.0, samples=1)
    seen = check(pair)
    assert complaint(seen) is None


def test_different_places_and_empty_pictures_tell_nothing() -> None:
    draw = np.random.default_rng(3)
    blank = np.full((288, 352, 3), 90, np.uint8)
    noise = [draw.integers(60, 120, (288, 352, 3)).astype(np.uint8) for _ in range(2)]
    stripes = np.repeat((128 + 90 * np.sin(np.arange(352) * 0.6)).astype(np.uint8)[None], 288, axis=0)
    strangers = room("floor").left, room("boxes").right
    for left, right in (
        (blank, blank), (blank, room("floor").right), noise, (stripes, np.roll(stripes, 7, axis=1)),
        strangers,
    ):  # fmt: skip
        seen = check_pair(left, right, RIG)
        assert not seen.tells
        assert complaint(seen) is None


@settings(max_examples=25, deadline=None, derandomize=True)
@given(height=st.integers(1, 80), width=st.integers(1, 120))
def test_any_size_is_looked_at(height: int, width: int) -> None:
    pair = room("wall")
    rig = StereoRig.parallel(width, height, 305.0, 0.06)
    seen = check_pair(pair.left[100 : 100 + height, :width], pair.right[100 : 100 + height, :width], rig)
    assert math.isfinite(seen.error_px)
    assert not seen.swapped


@pytest.mark.parametrize(
    ("left", "right", "words"),
    [
        (np.zeros((4, 5), np.uint8), np.zeros((4, 6), np.uint8), "different size"),
        (np.zeros((288, 352), np.float32), np.zeros((288, 352), np.float32), "float32"),
        (np.zeros((288, 352, 4), np.uint8), np.zeros((288, 352, 4), np.uint8), "BGR"),
        (np.zeros((288, 352, 3, 1), np.uint8), np.zeros((288, 352, 3, 1), np.uint8), "grey or"),
        (np.zeros((176, 144), np.uint8), np.zeros((176, 144), np.uint8), "144x176, the rig 352x288"),
        (np.zeros((0, 5), np.uint8), np.zeros((0, 5), np.uint8), "empty"),
    ],
)
def test_what_is_no_pair_is_refused(left: np.ndarray, right: np.ndarray, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_pair(left, right, RIG)


def test_same_pair_same_answer() -> None:
    assert check(room("floor")) == check(room("floor"))


def test_a_turn_that_is_only_suspected_already_accuses_nobody_of_exchanged_eyes() -> None:
    """Far things in the middle of the picture, eyes turned by a degree: yaw is vague, all signs wrong."""
    draw = np.random.default_rng(8)
    right = np.array([RIG.right.cx, RIG.right.cy]) + draw.uniform(-82.0, 82.0, (40, 2))
    x, y = ((right - (RIG.right.cx, RIG.right.cy)) / RIG.right.fx).T
    drop = 305.0 * DEGREE * x * y + 0.2 * draw.standard_normal(40)
    left = right - np.column_stack([np.full(40, 305.0 * DEGREE - 1.0), drop])
    seen = check_matches(PairMatches(left, right), RIG)
    assert 2.0 < seen.yaw / seen.yaw_sigma < 3.0
    assert sign_votes(PairMatches(left, right)).swapped
    assert not seen.swapped
