"""The free-space bench's command line and its contact sheet."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from bench import freespace
from bench.freespace_judge import judge
from bench.freespace_sheet import CAPTION_PX, COLUMNS, sheet, tile
from bench.freespace_truth import FloorTruth, Gap
from bench.freespace_views import BASE_MOUNT, BASE_RIG, FreeSpaceView
from robot.errors import UserError
from robot.messages import FreeSpace, Passage
from robot.sim.solids import Solid

GREEN, RED = (70, 220, 60), (60, 60, 240)


@pytest.fixture
def view() -> FreeSpaceView:
    sides = tuple(Solid("box", 1.05, y, 0.0, 0.05, 0.5, 0.0, 0.6) for y in (-0.65, 0.65))
    blank = np.zeros((288, 352, 3), np.uint8)
    truth = FloorTruth(sides, gap=Gap(0.3, (1.0, 0.0, 0.0)))
    depth = np.ones((288, 352), np.float32)
    return FreeSpaceView("narrow", 5, blank, blank, BASE_RIG, BASE_MOUNT, 0.0, 0.3, depth, truth)


def found(safe: bool) -> FreeSpace:
    bearings = np.radians(np.arange(-20.0, 20.1, 2.0))
    passage = Passage((176.0, 120.0), 40.0, 0.3, (1.0, 0.0, 0.16), safe=safe)
    return FreeSpace(bearings, np.full(21, 0.4), np.full(21, 0.9), np.array([[1.0, 0.4]]), passage)


def inks(picture: np.ndarray) -> set[tuple[int, ...]]:
    return {tuple(int(c) for c in ink) for ink in np.unique(picture.reshape(-1, 3), axis=0)}


def test_a_tile_says_by_colour_whether_the_passage_is_safe(view: FreeSpaceView) -> None:
    for safe, ink, other in ((True, GREEN, RED), (False, RED, GREEN)):
        look = found(safe)
        picture = tile(view, look, judge(view, look))
        assert picture.shape == (288 + CAPTION_PX, 352, 3)
        shown = inks(picture[:288])
        assert ink in shown
        assert other not in shown
    assert not view.left.any()


def test_a_sheet_fills_its_last_row(view: FreeSpaceView) -> None:
    one = (view, found(True), judge(view, found(True)))
    assert sheet([one] * (COLUMNS + 2)).shape == (2 * (288 + CAPTION_PX), COLUMNS * 352, 3)
    assert sheet([one] * 2).shape == (288 + CAPTION_PX, 2 * 352, 3)
    with pytest.raises(ValueError, match="no views"):
        sheet([])


def test_show_writes_the_worst_first_and_says_where_it_cannot(
    view: FreeSpaceView, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(freespace, "looked_at", lambda *_: (view, found(True)))
    judged = [judge(view, found(True))] * 3
    freespace.show(judged, 2, tmp_path / "sheet.png", None)
    written = cv2.imread(str(tmp_path / "sheet.png"))
    assert written is not None
    assert written.shape[1] == 2 * 352
    for bad in (tmp_path / "none" / "sheet.png", tmp_path / "sheet.words"):
        with pytest.raises(UserError, match="cannot write"):
            freespace.show(judged, 1, bad, None)


@pytest.mark.parametrize(
    "words",
    [["--views", "0"], ["--jobs", "0"], ["--kind", "fog"], ["--show", "0", "a.png"], ["--seed", "-1"]],
)
def test_bad_options_are_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        freespace.main(words)
    assert end.value.code == 2
    assert words[0].lstrip("-") in capsys.readouterr().err


def test_rows_of_the_asked_kinds_and_the_bars_decide_the_exit_code(
    view: FreeSpaceView, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for safe, code in ((True, 0), (False, 1)):
        monkeypatch.setattr(freespace, "looked_at", lambda *_, safe=safe: (view, found(safe)))
        assert freespace.main(["--views", "3", "--kind", "narrow", "--jobs", "1", "--json"]) == code
        assert '"views": 3' in capsys.readouterr().out
