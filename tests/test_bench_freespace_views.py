"""Random views of the free-space bench: repeatable, and their pictures, depth and truth tell of one world."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from bench.freespace_hand_worlds import HAND_KINDS, draw_hand_world
from bench.freespace_layout import World
from bench.freespace_truth import BASE, HAND, FloorTruth, HandTruth, Truth
from bench.freespace_views import KINDS, FreeSpaceView, draw_view, view, views
from bench.freespace_worlds import BASE_KINDS, draw_world

WORLDS = 60


def worlds(kind: str) -> list[World]:
    draw = draw_hand_world if kind in HAND_KINDS else draw_world
    return [draw(kind, np.random.default_rng([seed, 7])) for seed in range(WORLDS)]


@pytest.fixture(scope="module")
def seen() -> dict[str, FreeSpaceView]:
    """One view of every kind."""
    return {kind: draw_view(kind, 11) for kind in KINDS}


def points(one: FreeSpaceView) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the pixels' surfaces are by true depth and believed pose, (H, W, 3), and depth."""
    rotation, position = one.mount.left_eye(one.pan, one.tilt)
    eye, depth = one.rig.left, one.depth.astype(np.float64)
    u, v = np.meshgrid(np.arange(eye.width), np.arange(eye.height))
    rays = np.stack([(u - eye.cx) / eye.fx, (v - eye.cy) / eye.fy, np.ones(u.shape)], axis=-1)
    return position + depth[..., None] * (rays @ rotation.T), depth


def test_the_same_seed_gives_the_same_bytes_and_another_others(seen: dict[str, FreeSpaceView]) -> None:
    again = draw_view("narrow", 11)
    assert again.left.tobytes() == seen["narrow"].left.tobytes()
    assert again.right.tobytes() == seen["narrow"].right.tobytes()
    assert again.depth.tobytes() == seen["narrow"].depth.tobytes()
    assert again.truth == seen["narrow"].truth
    assert draw_view("narrow", 12).left.tobytes() != again.left.tobytes()


def test_a_kept_view_is_the_drawn_one(tmp_path: Path, seen: dict[str, FreeSpaceView]) -> None:
    first = view("post", 11, tmp_path)
    kept = list(tmp_path.rglob("*.pickle"))
    assert len(kept) == 1
    stamp = kept[0].stat().st_mtime_ns
    second = next(iter(views("post", 1, 11, tmp_path)))
    assert kept[0].stat().st_mtime_ns == stamp
    for one in (first, second):
        assert one.left.tobytes() == seen["post"].left.tobytes()
        assert (one.truth, one.pan, one.tilt, one.rig) == (seen["post"].truth, one.pan, one.tilt, one.rig)


def test_unknown_kinds_are_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"'fog'.*narrow"):
        draw_view("fog", 1)
    with pytest.raises(ValueError, match=r"'fog'.*wall"):
        draw_world("fog", np.random.default_rng(0))
    with pytest.raises(ValueError, match=r"'fog'.*hand_open"):
        draw_hand_world("fog", np.random.default_rng(0))


@pytest.mark.parametrize("kind", KINDS)
def test_the_right_picture_shows_each_point_where_the_depth_says(
    kind: str, seen: dict[str, FreeSpaceView]
) -> None:
    one = seen[kind]
    disparity = (one.rig.left.fx * one.rig.baseline / one.depth).astype(np.float32)
    left, right = (cv2.cvtColor(p, cv2.COLOR_BGR2GRAY).astype(np.float32) for p in (one.left, one.right))
    u, v = np.meshgrid(np.arange(352, dtype=np.float32), np.arange(288, dtype=np.float32))

    def misfit(off: float) -> float:
        warped = cv2.remap(right, u - disparity + off, v, cv2.INTER_LINEAR, borderValue=-1)
        # Brightness differs slowly between the eyes: compare what is left above it.
        fine = [p - cv2.GaussianBlur(p, (0, 0), 4) for p in (left, warped)]
        return float(np.median(np.abs(fine[0] - fine[1])[20:-20, 140:-20]))

    assert misfit(0.0) < min(misfit(-1.5), misfit(1.5))


@pytest.mark.parametrize("kind", BASE_KINDS)
def test_what_is_seen_standing_is_where_the_truth_says(kind: str, seen: dict[str, FreeSpaceView]) -> None:
    one = seen[kind]
    assert isinstance(one.truth, FloorTruth)
    place, _ = points(one)
    away = np.hypot(place[..., 0], place[..., 1])
    standing = (place[..., 2] > 0.08) & (place[..., 2] < 0.3) & (away < 1.6)
    floor = (np.abs(place[..., 2]) < 0.01) & (away < 0.9)
    flat = place[..., :2].reshape(-1, 2)
    off = one.truth.distance_to(flat).reshape(away.shape)
    # The believed pose is off by half a degree: 14 mm at 1.6 m, besides what leans over.
    assert not standing.any() or float(off[standing].max()) < 0.02
    if one.truth.edge is not None:
        before = place[..., 0] * math.cos(one.truth.edge.yaw) + place[..., 1] * math.sin(one.truth.edge.yaw)
        assert float((before[floor] < one.truth.edge.distance + 0.03).mean()) > 0.99
        below = (place[..., 2] < -0.6 * one.truth.edge.drop) & (away < 1.2)
        assert below.any()
        assert float(before[below].min()) > one.truth.edge.distance - 0.03
    else:
        assert float(floor[-40:].mean()) > 0.3 or kind in ("wall", "step_up")


def test_the_robot_stands_tipped_by_half_a_degree_at_most_and_not_upright() -> None:
    slopes = []
    for seed in (11, 12, 13):
        place, _ = points(draw_view("lines", seed))
        x, y, z = place.reshape(-1, 3).T
        floor = (np.abs(z) < 0.03) & (np.hypot(x, y) < 1.2)
        slope, aside, lift = np.linalg.lstsq(
            np.column_stack([x[floor], y[floor], np.ones(int(floor.sum()))]), z[floor], rcond=None
        )[0]
        assert abs(slope) < math.radians(0.51)
        assert abs(aside) < math.radians(0.31)
        assert abs(lift) < 0.001
        slopes.append(abs(slope))
    assert max(slopes) > math.radians(0.1)


@pytest.mark.parametrize("seed", range(3))
def test_an_opening_before_the_hand_is_open_and_as_wide_as_its_truth(seed: int) -> None:
    one = draw_view("hand_narrow", seed)
    gap = one.truth.gap
    assert gap is not None
    place, _ = points(one)
    c, s = math.cos(gap.yaw), math.sin(gap.yaw)
    away = c * (place[..., 0] - gap.centre[0]) + s * (place[..., 1] - gap.centre[1])
    behind = away > 0.05
    # Rays that pass the mouth's plane within the clear circle go on; those clear outside stop there.
    eye = one.mount.left_eye(0.0, 0.0)[1]
    reach = (c * (gap.centre[0] - eye[0]) + s * (gap.centre[1] - eye[1])) / (
        c * (place[..., 0] - eye[0]) + s * (place[..., 1] - eye[1])
    )
    crossing = eye + reach[..., None] * (place - eye) - np.array(gap.centre)
    aside, up = np.abs(c * crossing[..., 1] - s * crossing[..., 0]), np.abs(crossing[..., 2])
    assert float(behind[np.hypot(aside, up) < 0.35 * gap.width].mean()) > 0.95
    outside = (aside > 0.51 * gap.width + gap.slack[0]) | (up > 0.51 * gap.width + gap.slack[1])
    assert outside.any()
    assert not behind[outside].any()


def may_pass(truth: Truth) -> bool:
    return truth.may_pass(BASE) if isinstance(truth, FloorTruth) else truth.may_pass(HAND)


def must_pass(truth: Truth) -> bool:
    return truth.must_pass(BASE) if isinstance(truth, FloorTruth) else truth.must_pass(HAND)


@pytest.mark.parametrize("kind", KINDS)
def test_drawn_worlds_are_what_their_kind_says(kind: str) -> None:
    drawn = worlds(kind)
    may, must = ([passes(w.truth) for w in drawn] for passes in (may_pass, must_pass))
    assert not any(m and not w for m, w in zip(must, may, strict=True))
    if kind in ("step_up", "stair_down", "hand_wall"):
        assert not any(may)
    if kind in ("open", "lines", "hand_open"):
        assert all(may)
    if kind in ("narrow", "hand_narrow", "dark"):
        widths = [w.truth.gap.width / (HAND.diameter if kind in HAND_KINDS else BASE.width)
                  for w in drawn if w.truth.gap is not None]  # fmt: skip
        assert 0.5 <= min(widths) < 0.8
        assert 1.4 < max(widths) <= 1.8
        assert 0.25 * len(drawn) < sum(must) < 0.8 * len(drawn)
    if kind == "stair_down":
        drops = [
            w.truth.edge.drop for w in drawn if isinstance(w.truth, FloorTruth) and w.truth.edge is not None
        ]
        assert len(drops) == WORLDS
        assert 0.03 <= min(drops) < max(drops) <= 0.2
    if kind == "step_up":
        tops = [w.things[0].solid.top for w in drawn]
        assert 0.03 <= min(tops) < max(tops) <= 0.12


def test_a_gap_s_own_centre_is_a_way_through_if_it_must_pass() -> None:
    for world in worlds("narrow"):
        if isinstance(world.truth, FloorTruth) and world.truth.must_pass(BASE):
            assert world.truth.gap is not None
            assert not world.truth.touches(world.truth.gap.centre, BASE)
    for world in worlds("hand_narrow"):
        if isinstance(world.truth, HandTruth) and world.truth.must_pass(HAND):
            assert world.truth.gap is not None
            assert not world.truth.touches(world.truth.gap.centre, HAND)
