"""Pictures from disk, played as a camera plays them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from robot.hal.folder import FolderCamera, pairs_in
from robot.hal.interfaces import DeviceError


def picture(path: Path, value: int, size: tuple[int, int] = (64, 48)) -> Path:
    path.parent.mkdir(exist_ok=True)
    cv2.imwrite(str(path), np.full((size[1], size[0], 3), value, dtype=np.uint8))
    return path


def two_folders(root: Path, count: int = 3) -> tuple[Path, Path]:
    for index in range(count):
        picture(root / "L" / f"{index:03}.png", 10 + index)
        picture(root / "R" / f"{index:03}.png", 110 + index)
    return root / "L", root / "R"


def test_pairs_of_two_folders_go_by_the_order_of_names(tmp_path: Path) -> None:
    left, right = two_folders(tmp_path)
    (left / "notes.txt").write_text("no picture")
    pairs = pairs_in(left, right)
    assert [(a.parent.name, a.name, b.parent.name, b.name) for a, b in pairs][1] == (
        "L",
        "001.png",
        "R",
        "001.png",
    )
    assert len(pairs) == 3


def test_pairs_of_one_folder_go_by_left_and_right(tmp_path: Path) -> None:
    for index in (0, 1):
        picture(tmp_path / f"left_{index}.png", 10)
        picture(tmp_path / f"right_{index}.png", 20)
    assert [(a.name, b.name) for a, b in pairs_in(tmp_path)] == [
        ("left_0.png", "right_0.png"),
        ("left_1.png", "right_1.png"),
    ]


def test_a_grey_picture_comes_as_colour(tmp_path: Path) -> None:
    paths = tmp_path / "left_0.png", tmp_path / "right_0.png"
    for path in paths:
        cv2.imwrite(str(path), np.full((48, 64), 77, dtype=np.uint8))
    frame = FolderCamera([paths]).latest(0.0)
    assert frame is not None
    assert frame.left.shape == (48, 64, 3)


def test_pictures_are_played_at_the_rate_and_then_grow_old(tmp_path: Path) -> None:
    camera = FolderCamera(pairs_in(*two_folders(tmp_path)), rate_hz=10.0)
    seen = [camera.latest(at) for at in (5.0, 5.05, 5.11, 5.2, 9.0)]
    assert [frame.seq for frame in seen if frame] == [0, 0, 1, 2, 2]
    assert [frame.captured_at for frame in seen if frame] == [5.0, 5.0, 5.1, 5.2, 5.2]
    assert seen[-1] is not None
    assert (int(seen[-1].left[0, 0, 0]), int(seen[-1].right[0, 0, 0])) == (12, 112)


def test_a_slow_reader_skips_pictures(tmp_path: Path) -> None:
    camera = FolderCamera(pairs_in(*two_folders(tmp_path)), rate_hz=10.0)
    camera.latest(0.0)
    frame = camera.latest(0.2)
    assert frame is not None
    assert frame.seq == 2


def test_a_spoilt_or_odd_sized_picture_is_a_fault_and_the_last_pair_stays(tmp_path: Path) -> None:
    left, right = two_folders(tmp_path, count=4)
    camera = FolderCamera(pairs_in(left, right), rate_hz=10.0)
    first = camera.latest(0.0)
    (left / "001.png").write_bytes(b"")
    assert camera.latest(0.1) is first
    assert [fault.key for fault in camera.faults(0.1)] == ["camera.link"]
    assert "001.png" in camera.faults(0.1)[0].evidence
    picture(right / "002.png", 5, size=(32, 48))
    assert camera.latest(0.2) is first
    assert [fault.key for fault in camera.faults(0.2)] == ["camera.size"]
    assert camera.latest(0.3) is not first
    assert camera.faults(0.3) == ()


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda root: (root / "L" / "000.png").write_bytes(b"x"), "000.png is no readable picture"),
        (lambda root: (root / "R" / "002.png").unlink(), "3 pictures, .* 2"),
        (lambda root: picture(root / "R" / "000.png", 1, (32, 48)), "000.png is 32 x 48 pixels, not 64 x 48"),
        (lambda root: [path.unlink() for path in (root / "L").iterdir()], "L holds no pictures"),
    ],
)
def test_bad_folders_are_refused_by_name(tmp_path: Path, spoil, words: str) -> None:  # type: ignore[no-untyped-def]
    folders = two_folders(tmp_path)
    spoil(tmp_path)
    with pytest.raises(DeviceError, match=words):
        FolderCamera(pairs_in(*folders))


def test_missing_folders_and_partners_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="nowhere is not a folder"):
        pairs_in(tmp_path / "nowhere")
    picture(tmp_path / "left_7.png", 1)
    with pytest.raises(DeviceError, match=r"7.png is there for one eye only"):
        pairs_in(tmp_path)
    with pytest.raises(DeviceError, match="no left_"):
        pairs_in(two_folders(tmp_path)[1])


def test_no_pairs_and_no_rate_are_refused() -> None:
    with pytest.raises(DeviceError, match="no pair"):
        FolderCamera([])
    with pytest.raises(ValueError, match="rate_hz"):
        FolderCamera([], rate_hz=0.0)
