"""Where teaching views come from: a folder of pictures, or a video with the target's first box."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from robot.errors import UserError
from robot.messages import Box, Image
from robot.teach_views import TeachingView
from robot.vision.tracker import OnlineTracker

PICTURES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".webp", ".tif", ".tiff"})
BOXES_FILE = "boxes.csv"
_COLUMNS = ("file", "x", "y", "w", "h")
# Frames between two views of a video: neighbouring frames show the same side.
_FRAMES_BETWEEN = 5
_CERTAIN = 0.7


def views_from_folder(folder: Path | str) -> Iterator[TeachingView]:
    """Views of all pictures of a folder, in order of their names.

    With a file `boxes.csv` (header `file,x,y,w,h`, pixels) the pictures named there are used, each with
    its box; without it every picture is taken to show the target and nothing else.

    Raises UserError for a folder without pictures, an unreadable picture, a box outside its picture.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise UserError(f"{folder} is no folder: give a folder of pictures, a video or a teaching scene")
    boxes = folder / BOXES_FILE
    return _boxed_views(folder, boxes) if boxes.is_file() else _whole_views(folder)


def _whole_views(folder: Path) -> Iterator[TeachingView]:
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in PICTURES)
    if not files:
        raise UserError(f"{folder} holds no pictures ({', '.join(sorted(PICTURES))}): give another folder")
    for path in files:
        image = _picture(path)
        yield TeachingView(image, Box(0.0, 0.0, float(image.shape[1]), float(image.shape[0])))


def _boxed_views(folder: Path, table: Path) -> Iterator[TeachingView]:
    with table.open(newline="", encoding="utf-8-sig") as file:
        rows = csv.DictReader(file)
        if rows.fieldnames is None or not set(_COLUMNS) <= set(rows.fieldnames):
            raise UserError(f"{table}: the first line must be {','.join(_COLUMNS)}")
        for row in rows:
            image = _picture(folder / str(row["file"]))
            yield TeachingView(image, _box(row, image, f"{table}, line {rows.line_num}"))


def _box(row: dict[str, str], image: Image, place: str) -> Box:
    try:
        box = Box(*(float(row[edge]) for edge in _COLUMNS[1:]))
    except (TypeError, ValueError) as error:
        raise UserError(f"{place}: x, y, w, h must be numbers") from error
    _check_inside(box, image, place)
    return box


def _check_inside(box: Box, image: Image, place: str) -> None:
    height, width = image.shape[:2]
    if not (box.w > 0 and box.h > 0 and box.clipped(width, height).area > 0):
        raise UserError(f"{place}: the box must lie inside the picture of {width} x {height} px")


def _picture(path: Path) -> Image:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror}; mend or remove its entry") from error
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR) if data else None
    if image is None:
        raise UserError(f"{path} is no readable picture: remove or convert it")
    return np.asarray(image, np.uint8)


def views_from_video(path: Path | str, box: Box) -> Iterator[TeachingView]:
    """Views of a target that is followed through a video from its box in the first frame.

    Every fifth frame in which the target is surely tracked gives a view; the rest is skipped in silence.
    Raises UserError for a video that cannot be read and a box outside it.
    """
    capture = cv2.VideoCapture(str(path)) if Path(path).is_file() else None
    if capture is None or not capture.isOpened():
        raise UserError(
            f"{path} is no readable video: give a folder of pictures, a video or a teaching scene"
        )
    try:
        yield from _tracked(capture, Path(path), box)
    finally:
        capture.release()


def _tracked(capture: cv2.VideoCapture, path: Path, box: Box) -> Iterator[TeachingView]:
    there, first = capture.read()
    if not there:
        raise UserError(f"{path} holds no frames: record it again")
    image = np.asarray(first, np.uint8)
    _check_inside(box, image, "--box")
    tracker = OnlineTracker()
    try:
        tracker.start(image, box)
    except ValueError as error:
        raise UserError(f"--box: {error}") from error
    yield TeachingView(image, box)
    frame = 0
    while True:
        there, picture = capture.read()
        if not there:
            return
        image, frame = np.asarray(picture, np.uint8), frame + 1
        track = tracker.update(image)
        if frame % _FRAMES_BETWEEN == 0 and not track.lost and track.confidence >= _CERTAIN:
            yield TeachingView(image, track.box, mask=tracker.support)
