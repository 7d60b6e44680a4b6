"""trajectory.png: the way cut by state, the picture deterministic and of the right things."""

from __future__ import annotations

import builtins
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.errors import UserError
from robot.record import palette
from robot.record.scenery import Outline, Scenery, place_at, stretches
from robot.record.trajectory import plot_trajectory, render

ROOM = ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0))
WAY = tuple((0.1 * i, 0.5 + 0.03 * i, 1.5) for i in range(101))
SCENERY = Scenery(
    room=ROOM,
    path_true=WAY,
    path_odometry=tuple((t, x, y + 0.05) for t, x, y in WAY),
    target_path=((0.0, 3.7, 2.0), (10.0, 3.7, 1.0)),
    obstacles=(Outline("block", ((2, 2), (2.4, 2), (2.4, 2.4), (2, 2.4))),),
    state_changes=((0.0, "search"), (2.0, "track"), (5.0, "avoid"), (8.0, "track")),
    detours=((5.0, 8.0),),
)


def _image(scenery: Scenery, title: str = "") -> np.ndarray:
    image = cv2.imdecode(np.frombuffer(render(scenery, title), dtype=np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return np.asarray(image)


def _has(image: np.ndarray, colour: palette.Rgb) -> bool:
    return int((np.abs(image.astype(int) - palette.bgr(colour)).max(axis=2) <= 2).sum()) > 60


def test_the_way_is_cut_where_the_state_changes() -> None:
    pieces = stretches(WAY, SCENERY.state_changes)
    assert [p.state for p in pieces] == ["search", "track", "avoid", "track"]
    assert [p.points[0, 0] for p in pieces] == pytest.approx([0.5, 1.1, 2.0, 2.9])
    assert all((a.points[-1] == b.points[0]).all() for a, b in pairwise(pieces))


@given(cuts=st.lists(st.floats(-2, 12), max_size=6), n=st.integers(1, 30))
@settings(deadline=None, max_examples=80)
def test_the_pieces_together_are_the_whole_way(cuts: list[float], n: int) -> None:
    way = [(float(i), float(i) ** 2, -float(i)) for i in range(n)]
    pieces = stretches(way, [(t, f"s{k}") for k, t in enumerate(sorted(cuts))])
    joined = [pieces[0].points] + [p.points[1:] for p in pieces[1:]]
    assert np.array_equal(np.vstack(joined), [(x, y) for _, x, y in way])


def test_an_empty_way_has_no_pieces() -> None:
    assert stretches([], [(0.0, "search")]) == ()


def test_a_place_between_two_stamps_is_on_their_line_and_clamped_outside() -> None:
    way = [(0.0, 0.0, 0.0), (2.0, 4.0, -2.0)]
    assert place_at(way, 0.5) == (1.0, -0.5)
    assert place_at(way, -1.0) == (0.0, 0.0)
    assert place_at(way, 9.0) == (4.0, -2.0)


def test_the_same_scenery_gives_the_same_bytes(tmp_path: Path) -> None:
    plot_trajectory(tmp_path / "a.png", SCENERY, "demo")
    assert (tmp_path / "a.png").read_bytes() == render(SCENERY, "demo")
    assert render(SCENERY, "other") != render(SCENERY, "demo")


def test_every_state_that_occurred_is_in_the_picture_and_no_other() -> None:
    image = _image(SCENERY)
    for state, colour in palette.STATES.items():
        assert _has(image, colour) == (state in ("search", "track", "avoid")), state


def test_each_part_changes_the_picture() -> None:
    whole = render(SCENERY)
    parts: dict[str, Any] = {
        "path_true": (),
        "path_odometry": (),
        "target_path": (),
        "obstacles": (),
        "state_changes": ((0.0, "search"),),
        "detours": (),
    }
    for name, without in parts.items():
        fields = {field: getattr(SCENERY, field) for field in SCENERY.__slots__}
        assert render(Scenery(**{**fields, name: without})) != whole, name


def test_an_empty_room_can_be_drawn_and_a_room_needs_corners() -> None:
    assert min(_image(Scenery(room=ROOM)).shape[:2]) > 400
    with pytest.raises(ValueError, match="3 corners"):
        render(Scenery(room=((0, 0), (1, 1))))


def test_without_matplotlib_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def missing(name: str, *rest: Any) -> Any:
        if name.startswith("matplotlib"):
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(UserError, match=r"robot\[plots\]"):
        render(SCENERY)
