"""The file a taught target lives in: windows, ferns and NMF views, name, preview and where it came from.

Layout: the 8 bytes `ROBOTMDL`, the format's version (2 bytes), length of the header (4 bytes), SHA-256 of
everything behind it (32 bytes), a JSON header, then the arrays and the preview one after the other. All
numbers little-endian; nothing in it is ever executed.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
import struct
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import UserError
from robot.vision.recognizer import Recognizer
from robot.vision.target_finder import TargetFinder

VERSION = 3
NMF_ALONE = "nmf"
_MAGIC = b"ROBOTMDL"
_HEAD = struct.Struct("<8sHI32s")
_DTYPES = ("<f4", "<f8", "<i4")
_CURE = "teach the target again (`robot teach`)"


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A taught target.

    name: what detections are labelled with. views: how many were learnt. height_m: the object's own
    height in metres, None if the views had no distances. created_from: in words, what it was taught from.
    preview_png: bytes of a PNG picture of the object, may be empty.
    """

    name: str
    finder: TargetFinder
    views: int
    height_m: float | None = None
    created_from: str = ""
    preview_png: bytes = b""

    def recognition(self, method: str) -> TargetFinder | Recognizer:
        """What looks for the target by this method (`vision.method` of the config)."""
        return self.finder.recognizer if method == NMF_ALONE else self.finder


def save(path: Path | str, model: Model) -> None:
    """Write a model so that the file is either whole or not there, even if the power fails.

    Raises UserError where the folder cannot be written to.
    """
    path = Path(path)
    data = to_bytes(model)
    try:
        _write_whole(path, data)
    except OSError as error:
        reason = error.strerror or str(error)
        raise UserError(f"cannot write the model {path}: {reason}; choose another place") from error


def load(path: Path | str) -> Model:
    """Read a model. Raises UserError with the cure for a file missing, foreign, damaged or too old."""
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise UserError(
            f"cannot read the model {path}: {reason}; give a file made by `robot teach`"
        ) from error
    try:
        return from_bytes(data)
    except UserError as error:
        raise UserError(f"{path}: {error}") from error


def is_outdated(path: Path) -> bool:
    """True for a model file of an older format than this program reads."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD.size)
    except OSError:
        return False
    if len(head) < _HEAD.size:
        return False
    magic, version, *_ = _HEAD.unpack(head)
    return bool(magic == _MAGIC and version < VERSION)


def to_bytes(model: Model) -> bytes:
    """The file's content; the same model gives the same bytes."""
    arrays = {key: _portable(array) for key, array in sorted(model.finder.arrays().items())}
    blocks = [array.tobytes() for array in arrays.values()]
    header = {
        "name": model.name,
        "views": model.views,
        "height_m": model.height_m,
        "created_from": model.created_from,
        "preview_bytes": len(model.preview_png),
        "arrays": [[key, array.dtype.str, list(array.shape)] for key, array in arrays.items()],
    }
    text = json.dumps(header, sort_keys=True, allow_nan=False).encode()
    body = b"".join([text, *blocks, model.preview_png])
    return _HEAD.pack(_MAGIC, VERSION, len(text), hashlib.sha256(body).digest()) + body


def from_bytes(data: bytes) -> Model:
    """The inverse of `to_bytes`. Raises UserError with the cure."""
    if len(data) < _HEAD.size:
        raise UserError(f"is no model of the robot or was cut short; {_CURE}")
    magic, version, header_length, digest = _HEAD.unpack_from(data)
    if magic != _MAGIC:
        raise UserError("is no model of the robot; give a file made by `robot teach`")
    if version != VERSION:
        raise UserError(f"has format version {version}, this program reads {VERSION}; {_CURE}")
    body = memoryview(data)[_HEAD.size :]
    if hashlib.sha256(body).digest() != digest:
        raise UserError(f"is damaged or cut short (its checksum is wrong); copy it anew or {_CURE}")
    try:
        return _model(json.loads(bytes(body[:header_length])), body[header_length:])
    except (LookupError, TypeError, ValueError, ArithmeticError, AttributeError, RecursionError) as error:
        raise UserError(f"holds no usable model ({error}); {_CURE}") from error


def _model(header: dict[str, Any], blocks: memoryview) -> Model:
    arrays: dict[str, NDArray[np.generic]] = {}
    offset = 0
    for key, dtype, shape in header["arrays"]:
        if dtype not in _DTYPES or not all(isinstance(edge, int) and edge >= 0 for edge in shape):
            raise ValueError(f"array {key} has an unknown form")
        count = math.prod(shape)
        arrays[key] = np.frombuffer(blocks, dtype, count, offset).reshape(shape)
        offset += arrays[key].nbytes
    preview = bytes(blocks[offset:])
    if len(preview) != header["preview_bytes"]:
        raise ValueError("its length is wrong")
    name = str(header["name"])
    height = None if header["height_m"] is None else float(header["height_m"])
    finder = TargetFinder.from_arrays(name, arrays)
    return Model(name, finder, int(header["views"]), height, str(header["created_from"]), preview)


def _portable(array: NDArray[np.generic]) -> NDArray[np.generic]:
    little = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
    if little.dtype.str not in _DTYPES:
        raise ValueError(f"arrays of {array.dtype} have no place in a model file")
    return little


def _write_whole(path: Path, data: bytes) -> None:
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(name)
        raise
    _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    """Make the rename itself last; file systems that cannot do that for folders are left alone."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
