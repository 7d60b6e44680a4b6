"""Taught targets on disk: found if they are there, made if not, never half-written."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

from robot import model_file, taught
from robot.errors import UserError
from robot.messages import Box
from robot.model_file import Model
from robot.teach import Lesson
from robot.vision.finder_training import Validation

QUIET = Console(quiet=True)


def lesson_of(model: Model) -> Lesson:
    """A lesson of which this model came."""
    sheet = np.zeros((72, 72, 3), np.uint8)
    return Lesson(model, model.views, {}, (), sheet, Validation(0.9, 0.4, 0.0, 30, 60))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_taught_target_is_loaded_and_not_taught_again(
    folder: Path, box_model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def forbidden(*_: object) -> Lesson:
        raise AssertionError("it is taught already")

    monkeypatch.setattr(taught, "from_studio", forbidden)
    (folder / "models").mkdir()
    shutil.copy(box_model, folder / "models" / "box.model")
    target = taught.target_for("box", QUIET)
    assert (target.name, target.views > 20) == ("box", True)
    assert target.height_m == pytest.approx(0.22, rel=0.1)


def test_a_target_nobody_taught_is_taught_in_its_studio(
    folder: Path, box: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[str, str, int]] = []

    def studio(name: str, scene: str, seed: int, console: Console) -> Lesson:
        asked.append((name, scene, seed))
        return lesson_of(box)

    monkeypatch.setattr(taught, "from_studio", studio)
    path = taught.model_for("cup", QUIET)
    assert path == Path("models/cup.model")
    assert model_file.load(path).views == box.views
    assert taught.model_for("cup", QUIET) == path
    assert asked == [("cup", "teach-cup", taught.STUDIO_SEED)], "once"


def test_a_model_of_an_older_format_is_taught_anew(
    folder: Path, box: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(taught, "from_studio", lambda *_: lesson_of(box))
    (folder / "models").mkdir()
    data = bytearray(model_file.to_bytes(box))
    data[8:10] = (1).to_bytes(2, "little")
    (folder / "models" / "box.model").write_bytes(data)
    assert model_file.load(taught.model_for("box", QUIET)).views == box.views


def test_a_lesson_that_fails_leaves_no_model(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> Lesson:
        raise UserError("no views")

    monkeypatch.setattr(taught, "from_studio", fails)
    with pytest.raises(UserError, match="no views"):
        taught.model_for("box", QUIET)
    assert list((folder / "models").iterdir()) == []


def test_a_folder_that_cannot_be_made_is_named_before_the_work(folder: Path) -> None:
    (folder / "models").write_text("in the way")
    with pytest.raises(UserError, match=r"models.*folder you may write to"):
        taught.model_for("box", QUIET)


@settings(deadline=None, max_examples=40)
@given(numbers=st.tuples(*[st.integers(-500, 500)] * 2, *[st.integers(1, 500)] * 2))
def test_a_box_reads_back_as_it_was_typed(numbers: tuple[int, int, int, int]) -> None:
    assert taught.parse_box(",".join(map(str, numbers))) == Box(*numbers)
    assert taught.parse_box(" , ".join(f"{n}.0" for n in numbers)) == Box(*numbers)


@pytest.mark.parametrize(
    "text", ["", "1,2,3", "1,2,3,4,5", "a,b,c,d", "1;2;3;4", "1,2,nan,4", "1,2,inf,4", "1,2,0,4", "1,2,3,-4"]
)
def test_what_is_no_box_is_refused_with_an_example_or_the_reason(text: str) -> None:
    with pytest.raises(UserError, match=r"--box .*(e\.g\. 120,80,60,90|must be positive)") as caught:
        taught.parse_box(text)
    assert "\n" not in str(caught.value)
