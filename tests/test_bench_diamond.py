"""The bench of block motion: which blocks it takes, what it counts, what it exits with."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from bench import diamond, diamond_subpixel
from bench.diamond_video import EDGE, LEAST_TEXTURE, MARGIN, cases, sources, texture


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sequences of a texture that moves 3 px right and 1 px down a frame, with true boxes."""
    folder = tmp_path_factory.mktemp("data")
    noise = np.random.default_rng(0).random((300, 400), np.float32)
    soft = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 2), None, 0, 255, cv2.NORM_MINMAX)
    for name in ("one", "two"):
        frames = folder / "tracking" / name / "frames"
        frames.mkdir(parents=True)
        for number in range(5):
            part = soft[20 - number : 260 - number, 30 - 3 * number : 350 - 3 * number]
            cv2.imwrite(str(frames / f"{number:05}.jpg"), part, [cv2.IMWRITE_JPEG_QUALITY, 98])
        rows = [f"{number},{100 + 3 * number},{80 + number},60,60" for number in range(4)]
        (folder / "tracking" / name / "truth.csv").write_text("frame,x,y,w,h\n" + "\n".join([*rows, "4,,,,"]))
    return folder


def test_the_draw_is_seeded_and_keeps_its_rule(data: Path) -> None:
    source = sources(str(data), None)[0]
    first, again, other = (cases(source, number, 2) for number in (0, 0, 1))
    places = [(case.kind, case.frame, case.left, case.top) for case in first]
    assert places == [(case.kind, case.frame, case.left, case.top) for case in again]
    assert places != [(case.kind, case.frame, case.left, case.top) for case in other]
    assert {case.frame for case in first} == {2, 4}
    assert [case.kind for case in first].count("box") == 2
    for case in first:
        assert case.block.shape == case.block_before.shape == (EDGE, EDGE)
        assert case.window(MARGIN).shape == (EDGE + 2 * MARGIN,) * 2
        assert case.kind != "textured" or texture(case.block) >= LEAST_TEXTURE


def test_a_box_is_brought_to_the_blocks_size(data: Path) -> None:
    box = next(case for case in cases(sources(str(data), None)[0], 0, 2) if case.kind == "box")
    assert box.frame == 2
    # The box of the middle frame is (103, 81, 60, 60): its centre times 48 / 60, less half a block.
    assert (box.left, box.top) == (round(133 * 0.8) - 24, round(111 * 0.8) - 24)
    assert box.pictures[1].shape == (192, 256)


def test_bare_pictures_give_no_textured_blocks() -> None:
    assert texture(np.full((48, 48), 90, np.uint8)) == 0.0
    edge = np.zeros((48, 48), np.uint8)
    edge[:, 24:] = 200
    assert texture(edge) == 0.0  # an edge has texture in one direction only
    edge[24:] = 90
    assert texture(edge) > LEAST_TEXTURE


def test_the_rows_tell_the_motion_found(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert diamond.main(["--data", str(data), "--json"]) in (0, 1)  # the times are the machine's
    told = json.loads(capsys.readouterr().out)
    rows = {(row["sequence"], row.get("window")): row for row in told["rows"]}
    for window in (7, 14):
        total = rows["all", window]
        assert total["ours"] == total["near"] == 1.0
        assert total["blocks"] == rows["one", window]["blocks"] + rows["two", window]["blocks"]
        assert 6 <= total["pts ours"] <= 25
        assert total["x full"] > 2
    assert rows["equiangular, noise 0", None]["median px"] < rows["parabola, noise 0", None]["median px"]
    names = [bar["name"] for bar in told["bars"]]
    assert len(names) == len(set(names)) == 11


def test_a_bar_that_does_not_hold_is_told() -> None:
    row = {"sequence": "all", "window": 7, "ours": 0.96, "pts ours": 26.0, "x SQDIFF": 1.9, "x full": 1.5}
    assert [bar.holds for bar in diamond.bars([row])] == [False] * 4
    good = {"sequence": "all", "window": 7, "ours": 0.97, "pts ours": 25.0, "x SQDIFF": 2.0, "x full": 2.0}
    assert all(bar.holds for bar in diamond.bars([good]))
    fit = {"sequence": "equiangular, noise 2", "bias px": -0.06}
    assert [bar.holds for bar in diamond.bars([fit])] == [False]


def test_sub_pixel_rows_measure_the_known_bias_of_the_parabola() -> None:
    noise = np.random.default_rng(1).random((280, 360), np.float32)
    soft = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 6), None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    rows = {row["sequence"]: row for row in diamond_subpixel.rows([soft])}
    assert rows["parabola, noise 0"]["bias px"] > 0.05 > abs(rows["equiangular, noise 0"]["bias px"])
    assert diamond_subpixel.rows([soft[:100, :100]]) == []


def test_without_videos_it_says_what_to_give(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert diamond.main([]) == 2
    assert "--data" in capsys.readouterr().err
    (tmp_path / "short").mkdir()
    assert diamond.main(["--video", str(tmp_path)]) == 2
