"""The model file: what goes in comes out, and anything else is refused with a cure."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.errors import UserError
from robot.messages import Box
from robot.model_file import Model, from_bytes, load, save, to_bytes
from robot.vision.finder_training import fit
from robot.vision.textures import texture
from robot.vision.view_warps import View
from robot.vision.window_training import TrainingPlan

SHORT = TrainingPlan(30.0, places=300, drawn=3, rounds=1)


@pytest.fixture(scope="module")
def model() -> Model:
    side = texture((60, 80), np.random.default_rng(0))
    views = [cv2.convertScaleAbs(side[k:], alpha=1 - 0.05 * k) for k in range(8)]
    looks = [View(view, Box(0, 0, view.shape[1], view.shape[0])) for view in views]
    walls = [texture((240, 200), np.random.default_rng(seed)) for seed in (5, 6, 7)]
    taught = fit(looks, walls, "Tasse ä", seed=0, lesson=SHORT)
    return Model("Tasse ä", taught.finder, 8, 0.14, "8 pictures in cups/", b"\x89PNG preview")


def test_what_was_saved_is_loaded(model: Model, tmp_path: Path) -> None:
    save(tmp_path / "cup.model", model)
    again = load(tmp_path / "cup.model")
    assert (again.name, again.views, again.height_m) == ("Tasse ä", 8, 0.14)
    assert (again.created_from, again.preview_png) == (model.created_from, model.preview_png)
    picture = texture((352, 288), np.random.default_rng(1))
    picture[100:180, 100:160] = texture((60, 80), np.random.default_rng(0))
    assert again.finder.predict(picture) == model.finder.predict(picture)
    assert to_bytes(again) == to_bytes(model)
    assert [path.name for path in tmp_path.iterdir()] == ["cup.model"]


def test_an_unknown_height_stays_unknown(model: Model) -> None:
    assert from_bytes(to_bytes(Model("x", model.finder, 8))).height_m is None


def test_saving_replaces_the_old_file_whole(model: Model, tmp_path: Path) -> None:
    path = tmp_path / "cup.model"
    path.write_bytes(b"old")
    save(path, model)
    assert load(path).views == 8


def test_a_failed_save_leaves_the_old_file_and_no_rubbish(
    model: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "cup.model"
    path.write_bytes(b"old")

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("robot.model_file.os.fsync", full)
    with pytest.raises(UserError, match="No space left on device"):
        save(path, model)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_an_unwritable_place_is_named(model: Model, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="another place"):
        save(tmp_path / "missing" / "cup.model", model)


@given(where=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
@settings(max_examples=60, deadline=None)
def test_any_flipped_bit_is_noticed(model: Model, where: float, bit: int) -> None:
    data = bytearray(to_bytes(model))
    data[int(where * len(data))] ^= 1 << bit
    with pytest.raises(UserError):
        from_bytes(bytes(data))


@pytest.mark.parametrize("offset", range(46))
def test_a_flipped_bit_in_the_head_is_noticed(model: Model, offset: int) -> None:
    data = bytearray(to_bytes(model))
    data[offset] ^= 1
    with pytest.raises(UserError):
        from_bytes(bytes(data))


@given(share=st.floats(0, 1, exclude_max=True))
@settings(max_examples=30, deadline=None)
def test_any_truncation_is_noticed(model: Model, share: float) -> None:
    data = to_bytes(model)
    with pytest.raises(UserError, match=r"cut short|no model"):
        from_bytes(data[: int(share * len(data))])


def test_every_refusal_is_one_line_with_file_and_cure(model: Model, tmp_path: Path) -> None:
    data = to_bytes(model)
    cases = {
        "foreign": (b"PK\x03\x04" + data[4:], "no model of the robot"),
        "version": (data[:8] + b"\x07\x00" + data[10:], "version 7"),
        "cut": (data[:-100], "cut short"),
        "empty": (b"", "cut short"),
    }
    for name, (content, words) in cases.items():
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(UserError, match=words) as caught:
            load(path)
        assert str(path) in str(caught.value)
        assert "robot teach" in str(caught.value)
        assert "\n" not in str(caught.value)
    with pytest.raises(UserError, match="cannot read"):
        load(tmp_path / "none")
    with pytest.raises(UserError, match="cannot read"):
        load(tmp_path)
