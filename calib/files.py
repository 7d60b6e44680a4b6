"""The calibration file of a stereo pair: TOML that a person can read, write and check against a ruler.

[left]
width = 352            # pixels
height = 288
fx = 305.0             # focal lengths and principal point in pixels
fy = 305.0
cx = 175.5
cy = 143.5
distortion = []        # k1, k2, p1, p2, k3 as OpenCV orders them; may be left out

[right]                # the same keys
...

[pair]                 # a point goes from left to right as X_r = R X_l + t
rotation = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]  # row by row; may be left out: parallel axes
translation = [-0.06, 0.0, 0.0]  # metres; the first is minus the baseline
"""

from __future__ import annotations

import contextlib
import math
import os
import tempfile
import tomllib
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta, Struct

from calib.model import Camera, StereoRig

DISTORTION_COUNTS = (0, 4, 5, 8)
ROTATION_TOLERANCE = 1e-3
"""How far R'R may be from the identity: what rounding to four decimals leaves."""
SHORTEST_BASELINE_M, LONGEST_BASELINE_M = 0.001, 10.0

_Pixels = Annotated[int, Meta(ge=2, le=32768)]
_Focal = Annotated[float, Meta(gt=0.0)]


class CalibrationError(ValueError):
    """A calibration file cannot be used. The message is one line and names the cure."""


class _Eye(Struct, frozen=True, forbid_unknown_fields=True):
    width: _Pixels
    height: _Pixels
    fx: _Focal
    fy: _Focal
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()


class _Pair(Struct, frozen=True, forbid_unknown_fields=True):
    translation: tuple[float, float, float]
    rotation: tuple[float, float, float, float, float, float, float, float, float] = (
        1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0,
    )  # fmt: skip


class _File(Struct, frozen=True, forbid_unknown_fields=True):
    left: _Eye
    right: _Eye
    pair: _Pair


def load_rig(path: Path) -> StereoRig:
    """Read a pair's calibration.

    Raises CalibrationError, one line with file and cure, for a file that is missing, not TOML, has unknown or
    missing keys or wrong types, or describes what no stereo pair can be.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise CalibrationError(
            f"{path}: no such calibration file; give the path of a pair's TOML file"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise CalibrationError(f"{path}: cannot be read ({error}); give a readable UTF-8 TOML file") from None
    return parse_rig(text, str(path))


def parse_rig(text: str, source: str) -> StereoRig:
    """Like `load_rig` for text already in memory; `source` is named in errors."""
    try:
        content = msgspec.convert(tomllib.loads(text), _File)
    except msgspec.ValidationError as error:
        words, _, where = str(error).partition(" - at `$")
        key = where.rstrip("`").lstrip(".") or "top level"
        raise CalibrationError(f"{source}: {key}: {words.replace('Object', 'Table')}") from None
    except (ValueError, RecursionError) as error:  # also tomllib's own limits: digits, nesting
        raise CalibrationError(f"{source}: not valid TOML: {error}") from None
    _check_numbers(content, source)
    _check_eyes(content, source)
    rotation = _check_pair(content.pair, source)
    left, right = (Camera(**msgspec.structs.asdict(eye)) for eye in (content.left, content.right))
    return StereoRig(left, right, rotation, content.pair.translation)


def save_rig(path: Path, rig: StereoRig) -> None:
    """Write a calibration so that the file is whole or not there; it reads back as the same rig.

    Raises CalibrationError where the folder cannot be written to.
    """
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    except OSError as error:
        raise CalibrationError(
            f"{path}: cannot be written ({error.strerror}); choose another place"
        ) from None
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(format_rig(rig))
        os.chmod(name, 0o644)
        os.replace(name, path)
    except OSError as error:
        raise CalibrationError(
            f"{path}: cannot be written ({error.strerror}); choose another place"
        ) from None
    finally:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(name)


def format_rig(rig: StereoRig) -> str:
    """The file's text; every number is written so that it reads back exactly."""
    lines = ["# Stereo calibration: pixels, metres; X_right = R X_left + t"]
    for name, eye in (("left", rig.left), ("right", rig.right)):
        lines += ["", f"[{name}]", f"width = {int(eye.width)}", f"height = {int(eye.height)}"]
        lines += [f"{key} = {float(getattr(eye, key))!r}" for key in ("fx", "fy", "cx", "cy")]
        lines.append(f"distortion = {_numbers(eye.distortion)}")
    lines += [
        "",
        "[pair]",
        f"rotation = {_numbers(rig.rotation)}",
        f"translation = {_numbers(rig.translation)}",
    ]
    return "\n".join(lines) + "\n"


def _numbers(values: tuple[float, ...]) -> str:
    return "[" + ", ".join(repr(float(value)) for value in values) + "]"


def _check_numbers(content: _File, source: str) -> None:
    """TOML has nan and inf; a calibration has not."""
    for table in ("left", "right", "pair"):
        for key, value in msgspec.structs.asdict(getattr(content, table)).items():
            if not np.isfinite(value).all():
                raise CalibrationError(f"{source}: {table}.{key}: must be finite; calibrate the pair again")


def _check_eyes(content: _File, source: str) -> None:
    left, right = content.left, content.right
    if (left.width, left.height) != (right.width, right.height):
        raise CalibrationError(
            f"{source}: the eyes differ in size, {left.width}x{left.height} and "
            f"{right.width}x{right.height}; calibrate both at the same picture size"
        )
    for name, eye in (("left", left), ("right", right)):
        if len(eye.distortion) not in DISTORTION_COUNTS:
            raise CalibrationError(
                f"{source}: {name}.distortion: {len(eye.distortion)} numbers; "
                "give k1, k2, p1, p2 and k3, or none"
            )


def _check_pair(pair: _Pair, source: str) -> tuple[float, ...]:
    """The rotation, made exactly one if rounding had spoiled it."""
    given = np.array(pair.rotation).reshape(3, 3)
    # Huge numbers first: their products are infinite, and what becomes of those no comparison holds.
    if (
        np.abs(given).max() > 1.0 + ROTATION_TOLERANCE
        or np.abs(given.T @ given - np.eye(3)).max() > ROTATION_TOLERANCE
        or np.linalg.det(given) < 0.0
    ):
        raise CalibrationError(
            f"{source}: pair.rotation: not a rotation matrix; give R row by row as calibrated"
        )
    sideways, *rest = pair.translation
    if sideways > 0.0:
        raise CalibrationError(
            f"{source}: pair.translation: the right eye lies left of the left one; "
            "exchange [left] and [right]"
        )
    if not -sideways > math.hypot(*rest):
        raise CalibrationError(
            f"{source}: pair.translation: the eyes must lie side by side: a negative first number, in metres"
        )
    if not SHORTEST_BASELINE_M <= -sideways <= LONGEST_BASELINE_M:
        raise CalibrationError(
            f"{source}: pair.translation: the eyes are {-sideways:g} m apart; give metres, "
            f"{SHORTEST_BASELINE_M:g} to {LONGEST_BASELINE_M:g}"
        )
    if np.abs(given.T @ given - np.eye(3)).max() < 1e-12:
        return pair.rotation
    u, _, v = np.linalg.svd(given)
    return tuple(float(c) for c in (u @ v).ravel())
