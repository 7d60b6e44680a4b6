"""The drawn pair: things appear where the geometry says, and nothing is drawn that is not there."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from calib.model import HeadMount, StereoRig
from robot.messages import (
    Box,
    Detection,
    Fault,
    FreeSpace,
    HeadPose,
    Image,
    Intent,
    Odometry,
    Passage,
    Percepts,
    Pose2,
    Range,
    Sent,
    StereoFrame,
    Tick,
    Timed,
    Track,
    Twist,
    View,
)
from robot.record import palette
from robot.record.annotate import (
    CAPTION_HEIGHT,
    TRACK_MAX_AGE_S,
    Overlay,
    annotate,
    annotate_tick,
    annotated_size,
    overlay_of,
)
from robot.record.canvas import text_width
from robot.record.projection import eyes

RIG = StereoRig.parallel(352, 288, 305.0, 0.06)
MOUNT = HeadMount()
HEAD = HeadPose(pan=0.1, tilt=0.35)
GREY = 90
RANGE = Range(0.7, 0.012, (0.8, 0.1, 0.1), 305.0 * 0.06 / 0.7)
BEARINGS = np.radians(np.arange(-20.0, 21.0, 2.0))


def _frame(at: float = 1.0) -> StereoFrame:
    plain = np.full((288, 352, 3), GREY, dtype=np.uint8)
    return StereoFrame(plain, plain.copy(), at, 7)


def _space(
    obstacles: list[tuple[float, float]], free: float = 1.0, passage: Passage | None = None
) -> FreeSpace:
    n = len(BEARINGS)
    return FreeSpace(
        BEARINGS, np.full(n, 0.4), np.full(n, free), np.array(obstacles, dtype=float).reshape(-1, 2), passage
    )


def _draw(**overlay: Any) -> Image:
    return annotate(_frame(), Overlay("track", 1.0, HEAD, **overlay), RIG, MOUNT)


def _halves(picture: Image) -> tuple[Image, Image]:
    return picture[:288, :351], picture[:288, 353:]


def _painted(picture: Image) -> np.ndarray:
    return np.argwhere((picture != GREY).any(axis=2))[:, ::-1]  # (u, v)


def test_size_and_input_left_alone() -> None:
    frame = _frame()
    picture = annotate(frame, Overlay("search", 0.0, HEAD, box=Box(10, 10, 50, 50)), RIG, MOUNT)
    assert picture.dtype == np.uint8
    assert annotated_size(RIG) == (picture.shape[1], picture.shape[0]) == (704, 288 + CAPTION_HEIGHT)
    assert (frame.left == GREY).all()


def test_nothing_to_draw_leaves_both_pictures_as_they_were() -> None:
    for half in _halves(_draw()):
        assert len(_painted(half)) == 0


@pytest.mark.parametrize("state", sorted(palette.STATES))
def test_the_caption_shows_the_state_in_its_colour(state: str) -> None:
    picture = annotate(_frame(), Overlay(state, 1.0, HEAD), RIG, MOUNT)
    corner = picture[-1, 2].tolist()
    assert tuple(corner) == palette.bgr(palette.state_colour(state))


def test_states_are_told_apart_by_colour() -> None:
    colours = list(palette.STATES.values())
    distances = [math.dist(a, b) for i, a in enumerate(colours) for b in colours[:i]]
    assert min(distances) > 50


def test_an_obstacle_point_is_drawn_where_the_cameras_see_it() -> None:
    point = np.array([[0.9, 0.15]])
    left, right = _halves(_draw(free_space=_space([(0.9, 0.15)], free=0.0)))
    left_eye, right_eye = eyes(RIG, MOUNT, HEAD)
    for half, eye, offset in ((left, left_eye, 0), (right, right_eye, 1)):
        expected = eye.project(point)
        assert expected is not None
        assert np.abs(_painted(half).mean(axis=0) - (expected[0] - (offset, 0))).max() < 1.0


def test_projection_agrees_with_the_cameras_own_equations() -> None:
    rotation, position = MOUNT.left_eye(HEAD.pan, HEAD.tilt)
    seen = rotation.T @ (np.array([1.2, -0.2, 0.1]) - position)
    u = RIG.left.cx + RIG.left.fx * seen[0] / seen[2]
    v = RIG.left.cy + RIG.left.fy * seen[1] / seen[2]
    left, right = eyes(RIG, MOUNT, HEAD)
    drawn_left = left.project(np.array([[1.2, -0.2]]), height=0.1)
    drawn_right = right.project(np.array([[1.2, -0.2]]), height=0.1)
    assert drawn_left is not None
    assert drawn_right is not None
    assert drawn_left[0] == pytest.approx((u, v))
    assert drawn_right[0] == pytest.approx((u - 305.0 * 0.06 / seen[2], v))


def test_what_lies_behind_the_eyes_is_not_drawn() -> None:
    assert eyes(RIG, MOUNT, HEAD)[0].project(np.array([[-1.0, 0.0]])) is None
    left, right = _halves(_draw(free_space=_space([(-1.0, 0.0)], free=0.0)))
    assert len(_painted(left)) == len(_painted(right)) == 0


def test_free_floor_is_tinted_between_near_and_free_only() -> None:
    left, _ = _halves(_draw(free_space=_space([], free=1.0)))
    eye = eyes(RIG, MOUNT, HEAD)[0]
    pixels = eye.project(np.array([[0.7, 0.0], [1.3, 0.0]]))
    assert pixels is not None
    (u_free, v_free), (u_unknown, v_unknown) = pixels.round().astype(int)
    tinted = left[v_free, u_free].astype(int)
    assert tinted[1] > GREY + 10  # greener
    assert tinted[1] > tinted[2]
    assert (left[v_unknown, u_unknown] == GREY).all()


def test_the_floor_moves_with_the_robot() -> None:
    """0.2 m driven since the floor was seen: obstacle and edge of the free floor are drawn 0.2 m nearer."""
    moved, _ = _halves(_draw(free_space=_space([(0.9, 0.0)], free=0.0), moved=Pose2(0.2, 0.0, 0.0)))
    near, _ = _halves(_draw(free_space=_space([(0.7, 0.0)], free=0.0)))
    assert (moved == near).all()
    tinted, _ = _halves(_draw(free_space=_space([], free=1.0), moved=Pose2(0.2, 0.0, 0.0)))
    edge = eyes(RIG, MOUNT, HEAD)[0].project(np.array([[0.8, 0.0]]))
    assert edge is not None
    assert _painted(tinted)[:, 1].min() == pytest.approx(edge[0, 1], abs=2.0)


def test_the_box_is_drawn_in_both_eyes_a_disparity_apart() -> None:
    left, right = _halves(_draw(box=Box(150, 100, 60, 80), target=RANGE, label=""))
    yellow = np.array(palette.bgr(palette.TARGET))
    places = [np.argwhere((half == yellow).all(axis=2))[:, ::-1] for half in (left, right)]
    lower = [p[p[:, 1] > 120].mean(axis=0) for p in places]
    assert lower[0][0] == pytest.approx(180, abs=1.5)
    assert lower[0][0] - (lower[1][0] + 1) == pytest.approx(RANGE.disparity_px, abs=1.5)


def test_a_box_without_range_is_drawn_in_the_left_eye_only() -> None:
    left, right = _halves(_draw(box=Box(150, 100, 60, 80)))
    assert len(_painted(left)) > 50
    assert len(_painted(right)) == 0


@pytest.mark.parametrize(
    "box", [Box(-500, -500, 50, 50), Box(340, 280, 400, 400), Box(0, 0, 1, 1), Box(100, 0, 60, 288)]
)
def test_boxes_at_and_beyond_the_edge_do_no_harm(box: Box) -> None:
    assert _draw(box=box, target=RANGE).shape == (336, 704, 3)
    assert _draw(candidates=(Detection(box, 0.5, "cup"),)).shape == (336, 704, 3)


def _ink(picture: Image, colour: palette.Rgb) -> np.ndarray:
    return np.argwhere((picture == palette.bgr(colour)).all(axis=2))[:, ::-1]  # (u, v)


def test_a_passage_is_a_gate_of_its_width_that_stands_on_the_floor() -> None:
    passage = Passage((180.0, 120.0), 40.0, 0.44, (1.5, 0.0, 0.2), safe=True)
    left, right = _halves(_draw(free_space=_space([], free=0.0, passage=passage)))
    gate = _ink(left, palette.PASSAGE)
    assert gate[:, 0].min() == pytest.approx(140, abs=2)
    assert gate[:, 0].max() == pytest.approx(220, abs=2)
    assert gate[:, 1].max() == pytest.approx(120 + 40 * 0.2 / 0.22, abs=2)
    seen = _ink(right, palette.PASSAGE)
    shift = RIG.left.fx * RIG.baseline / eyes(RIG, MOUNT, HEAD)[0].left_depth(np.array([1.5, 0.0, 0.2]))
    assert seen[:, 0].min() + 1 == pytest.approx(140 - shift, abs=2)


def test_a_passage_not_safe_is_dashed_in_another_colour_and_says_so() -> None:
    feet, labels = {}, {}
    for safe in (True, False):
        passage = Passage((180.0, 120.0), 40.0, 0.44, (1.5, 0.0, 0.2), safe=safe)
        left, _ = _halves(_draw(free_space=_space([], free=0.0, passage=passage)))
        ink, other = (palette.PASSAGE, palette.WARNING)[:: 1 if safe else -1]
        assert not len(_ink(left, other))
        drawn = _ink(left, ink)
        feet[safe] = np.count_nonzero(drawn[:, 1] == drawn[:, 1].max())
        label = drawn[drawn[:, 1] < 120 - 40]
        labels[safe] = np.ptp(label[:, 0]) + 1
    assert feet[False] < 0.75 * feet[True]
    assert labels[True] == pytest.approx(text_width("0.44 m wide", size=0.36, bold=True) + 9, abs=1)
    assert labels[False] > labels[True] + text_width(", not safe", size=0.36, bold=True) - 3


@pytest.mark.parametrize("safe", [True, False])
def test_passages_at_and_beyond_the_edge_do_no_harm(safe: bool) -> None:
    for centre, radius, width in (
        ((-900.0, 60.0), 30.0, 0.3), ((1e7, -1e7), 1e12, 0.3), ((9.0, 9.0), 0.0, 0.0),
    ):  # fmt: skip
        for z in (0.16, -0.1):
            passage = Passage(centre, radius, width, (0.0, 0.0, z), safe=safe)
            assert _draw(free_space=_space([], passage=passage)).shape == (336, 704, 3)


def test_lamp_limit_and_faults_change_the_caption() -> None:
    plain = _draw()[288:]
    dark = Sent(Twist(), None, 0.0)
    for changed in (
        _draw(sent=Sent(Twist(), None, 1.0)),
        _draw(sent=Sent(Twist(), None, 0.0, "obstacle")),
        _draw(sent=dark, faults=("camera.black",)),
        _draw(confidence=0.5),
    ):
        assert (changed[288:] != plain).any()
        assert (changed[:288] == _draw()[:288]).all()


# ---------------------------------------------------------------------------------------------- from a tick


def _tick(percepts: Percepts, at: float = 1.0, twist: Twist | None = None, view: bool = True) -> Tick:
    odometry = Odometry(Pose2(), twist or Twist(), at)
    return Tick(
        now=at + 0.02,
        state="track",
        view=View(_frame(at), HEAD, Pose2()) if view else None,
        percepts=percepts,
        odometry=odometry,
        head=HEAD,
        intent=Intent(),
        sent=Sent(Twist(0.1, 0.0), None, 0.0),
        faults=(Fault("camera", "black", 0.0),),
        transitions=(),
    )


def _percepts(at: float, lost: bool = False) -> Percepts:
    return Percepts(
        detections=Timed(
            (Detection(Box(1, 2, 3, 4), 0.8, "cup"), Detection(Box(1, 2, 3, 4), 0.9, "cup")), at
        ),
        track=Timed(Track(Box(10, 20, 30, 40), (0.0, 0.0), 0.7, lost), at),
        target=Timed(RANGE, at),
        free_space=Timed(_space([]), at),
    )


def test_a_tick_becomes_an_overlay() -> None:
    overlay = overlay_of(_tick(_percepts(0.9), twist=Twist(0.2, 0.5)))
    assert overlay.box == Box(10, 20, 30, 40)
    assert (overlay.label, overlay.score, overlay.confidence) == ("cup", 0.9, 0.7)
    assert overlay.target == RANGE
    assert overlay.faults == ("camera.black",)
    assert (overlay.moved.x, overlay.moved.yaw) == pytest.approx((0.02, 0.05))


def test_a_lost_track_is_not_drawn_but_the_candidates_are() -> None:
    overlay = overlay_of(_tick(_percepts(0.9, lost=True)))
    assert overlay.box is None
    assert overlay.target is None
    assert len(overlay.candidates) == 2


def test_stale_percepts_are_not_drawn() -> None:
    overlay = overlay_of(_tick(_percepts(1.0 - TRACK_MAX_AGE_S - 0.01)))
    assert (overlay.box, overlay.target, overlay.free_space, overlay.candidates) == (None, None, None, ())


def test_a_tick_without_a_new_frame_has_no_picture() -> None:
    assert annotate_tick(_tick(_percepts(1.0), view=False), RIG, MOUNT) is None
    picture = annotate_tick(_tick(_percepts(1.0)), RIG, MOUNT)
    assert picture is not None
    assert picture.shape == (336, 704, 3)
