"""The contact sheet of a lesson: what was learnt, in one picture."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from robot.messages import Image
from robot.vision.windows import resize

THUMBNAIL = 72
_COLUMNS = 10
_CAPTION_PX = 22
_DARK, _LIGHT = 32, (230, 230, 230)


def contact_sheet(crops: Sequence[Image], captions: Sequence[str] = ()) -> Image:
    """All views side by side, ten a row, each fitted into 72 x 72 px, under lines of words; BGR uint8."""
    tiles = [thumbnail(crop, THUMBNAIL) for crop in crops]
    blank = np.full_like(tiles[0], _DARK)
    tiles += [blank] * (-len(tiles) % _COLUMNS)
    rows = [np.hstack(tiles[i : i + _COLUMNS]) for i in range(0, len(tiles), _COLUMNS)]
    lines = [_caption(words, rows[0].shape[1]) for words in captions]
    return np.asarray(np.vstack([*lines, *rows]), np.uint8)


def _caption(words: str, width: int) -> Image:
    line = np.full((_CAPTION_PX, width, 3), _DARK, np.uint8)
    plain = words.encode("ascii", "replace").decode()
    cv2.putText(line, plain, (6, 15), cv2.FONT_HERSHEY_SIMPLEX, 0.42, _LIGHT, 1, cv2.LINE_AA)
    return line


def thumbnail(image: Image, edge: int) -> Image:
    """The picture fitted into a dark square of `edge` pixels."""
    factor = (edge - 4) / max(image.shape[:2])
    size = max(1, round(image.shape[1] * factor)), max(1, round(image.shape[0] * factor))
    tile = np.full((edge, edge, 3), 32, np.uint8)
    x, y = (edge - size[0]) // 2, (edge - size[1]) // 2
    tile[y : y + size[1], x : x + size[0]] = np.clip(resize(image, size) + 0.5, 0, 255).astype(np.uint8)
    return tile


def png(image: Image) -> bytes:
    """The picture as the bytes of a PNG file."""
    done, data = cv2.imencode(".png", image)
    if not done:
        raise RuntimeError("the preview picture could not be encoded")
    return bytes(data.tobytes())
