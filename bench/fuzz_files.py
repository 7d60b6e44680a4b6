"""Files under fuzz: config, scene, calibration and model, as they lie on a disk that somebody edited.

Scenes go through a real file each. Of the others the in-memory form is measured (`parse`, `parse_rig`,
`from_bytes`), one table or a small file at a time, and every 64th input goes through a file and its path.
"""

from __future__ import annotations

import hashlib
import json
import math
import random
import re
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from bench.fuzz_mutation import Source
from calib.files import format_rig, parse_rig
from calib.model import StereoRig
from robot import config, settings_file
from robot.errors import UserError
from robot.model_file import VERSION, Model, from_bytes, to_bytes
from robot.model_file import load as load_model
from robot.rig_file import load_rig
from robot.sim.scene import FOLDER, load_scene
from robot.vision.colour import LAYOUT_LENGTH
from robot.vision.target_finder import TargetFinder
from robot.vision.window_features import DIRECTIONS
from robot.vision.window_net import ANSWERS

_FILE_EVERY: Final = 64
_HEAD: Final = struct.Struct("<8sHI32s")


class _File:
    """What the four have in common: an input goes through memory, every 64th through a file."""

    name = ""
    documented: tuple[type[Exception], ...] = (UserError,)

    def __init__(self, source: Source, ending: str) -> None:
        self._source = source
        self._folder = tempfile.TemporaryDirectory(prefix="fuzz-")
        self._path = Path(self._folder.name) / f"input{ending}"

    def draw(self, rng: random.Random) -> bytes:
        """A file's content."""
        return self._source.draw(rng)

    def _through_file(self, data: bytes, load: Callable[[Path], object]) -> None:
        if len(data) % _FILE_EVERY == 0:
            self._path.write_bytes(data)
            load(self._path)


class ConfigFile(_File):
    """`settings_file.parse` into Config and `robot.config.load`."""

    name = "config"

    def __init__(self) -> None:
        whole = re.sub(r"[ \t]+#.*", "", config.commented_defaults())
        tables = ["[" + table.strip() + "\n" for table in whole.split("\n[")[1:]]
        super().__init__(Source(_encoded([*tables, tables[0] + tables[1]]), text=True, longest=8000), ".toml")

    def take(self, data: bytes) -> bool:
        """True if it is a config."""
        self._through_file(data, config.load)
        settings = settings_file.parse(data.decode("utf-8", "replace"), config.Config, "input")
        assert 0.05 <= settings.base.pulse_s <= 0.3, "a pulse longer than the dead-man allows"
        return True


class SceneFile(_File):
    """`load_scene`."""

    name = "scene"

    def __init__(self) -> None:
        scenes = [path.read_text() for path in sorted(FOLDER.glob("*.toml"))]
        super().__init__(Source(_encoded(scenes), text=True, longest=8000), ".toml")

    def take(self, data: bytes) -> bool:
        """True if it is a scene; always through a file, for that is quick beside reading the TOML."""
        self._path.write_bytes(data)
        load_scene(self._path)
        return True


class CalibrationFile(_File):
    """`calib.files.parse_rig` and `robot.rig_file.load_rig`."""

    name = "calibration"

    def __init__(self) -> None:
        plain = format_rig(StereoRig.parallel(352, 288, 305.0, 0.06))
        turned = plain.replace("distortion = []", "distortion = [-0.1, 0.02, 0.0, 0.0, 0.0]").replace(
            "rotation = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]",
            "rotation = [0.9998, 0.0, 0.02, 0.0, 1.0, 0.0, -0.02, 0.0, 0.9998]",
        )
        assert plain != turned
        super().__init__(Source(_encoded([plain, turned]), text=True, longest=8000), ".toml")

    def take(self, data: bytes) -> bool:
        """True if it is a pair's calibration; its rotation must be one, its numbers finite."""
        self._through_file(data, load_rig)
        try:
            rig = parse_rig(data.decode("utf-8", "replace"), "input")
        except ValueError as error:
            # `CalibrationError` is a ValueError of its own; the robot turns it into a UserError.
            if type(error).__name__ != "CalibrationError":
                raise AssertionError(f"{type(error).__name__}: {error}") from error
            return False
        assert np.abs(rig.R.T @ rig.R - np.eye(3)).max() < 1e-6, "the rotation is none"
        assert 0.0 < rig.baseline < math.inf, "no baseline"
        return True


class ModelFile(_File):
    """`model_file.from_bytes` and `model_file.load`; half of the inputs have a right checksum."""

    name = "model"

    def __init__(self) -> None:
        models = [to_bytes(_model(name, groups)) for name, groups in (("box", 1), ("cup", 2))]
        source = Source(models, text=True, mend=_sealed, longest=65536)
        super().__init__(source, ".model")

    def take(self, data: bytes) -> bool:
        """True if it is a model."""
        self._through_file(data, load_model)
        model = from_bytes(data)
        assert model.finder.recognizer.groups, "a model without views"
        return True


def _encoded(texts: list[str]) -> list[bytes]:
    return [text.encode() for text in texts]


def _model(name: str, groups: int) -> Model:
    """The smallest model there can be: spaces of two by two pixels, a window of two by two cells with one
    hidden unit, one fern of two tests."""
    arrays: dict[str, NDArray[np.generic]] = {
        "half_judge": np.array([0.5, 0.25, 0.25, 0.0]),
        "nmf.judge": np.array([0.5, 0.25, 0.25, 0.0]),
        "nmf.aspects": np.ones(groups),
    }
    for group in range(groups):
        for space in ("coarse", "fine"):
            arrays |= {
                f"nmf.{group}.{space}.size": np.array([2, 2], np.int32),
                f"nmf.{group}.{space}.inverse": np.eye(1, 4, dtype=np.float32),
                f"nmf.{group}.{space}.encodings": np.ones((1, 1), np.float32),
                f"nmf.{group}.{space}.columns": np.full((1, 4), 0.5, np.float32),
                f"nmf.{group}.{space}.gauge": np.ones((1, 1), np.float32),
            }
        arrays[f"nmf.{group}.layouts"] = np.zeros((1, LAYOUT_LENGTH), np.float32)
        arrays[f"common.{group}"] = np.zeros((1, 4), np.float32)
    arrays |= {f"windows.{key}": array for key, array in _windows().items()}
    arrays |= {f"ferns.{key}": array for key, array in _ferns().items()}
    return Model(name, TargetFinder.from_arrays(name, arrays), 1, 0.2, "written by the bench", b"\x89PNG")


def _windows() -> dict[str, NDArray[np.generic]]:
    """What a net with one hidden unit learnt of windows of two by two cells."""
    return {
        "shape": np.array([2.0, 2.0, 8.0, 8.0]),
        "net.first": np.full((4 * DIRECTIONS, 1), 0.1, np.float32),
        "net.first_bias": np.zeros(1, np.float32),
        "net.second": np.ones((1, ANSWERS), np.float32),
        "net.second_bias": np.zeros(ANSWERS, np.float32),
    }


def _ferns() -> dict[str, NDArray[np.generic]]:
    """What one fern of two tests learnt of a class of 8 px, one cell of offsets."""
    return {
        "settings": np.array([1, 2, 6, 2, 8, 0], np.int32),
        "background": np.ones((1, 4), np.float32),
        "tests.channel": np.array([[0, 1]], np.int32),
        "tests.first": np.zeros((1, 2, 2), np.int32),
        "tests.second": np.ones((1, 2, 2), np.int32),
        "tests.reach": np.array(6, np.int32),
        "0.extent": np.array([8.0, 8.0]),
        "0.met": np.ones((1, 4), np.float32),
        "0.offsets": np.ones((1, 4, 1), np.float32),
        "0.counts": np.array([0, 0, 1], np.int32),
    }


def _sealed(rng: random.Random, data: bytes) -> bytes:
    """Make the checksum, and often the header's length, right for whatever it became."""
    body = data[_HEAD.size :]
    length = len(body)
    if rng.getrandbits(2):
        end = body.find(b"}")
        length = end + 1 if end >= 0 else length
        body = _with_odd_header(rng, body, length)
        length = body.find(b"}") + 1 if b"}" in body else len(body)
    return _HEAD.pack(b"ROBOTMDL", VERSION, length, hashlib.sha256(body).digest()) + body


def _with_odd_header(rng: random.Random, body: bytes, length: int) -> bytes:
    """Sometimes one value of the header replaced by another JSON value."""
    try:
        header = json.loads(body[:length])
    except (ValueError, RecursionError):
        return body
    if not isinstance(header, dict) or not header or rng.getrandbits(1):
        return body
    key = rng.choice(list(header))
    arrays = header.get("arrays")
    if key == "arrays" and isinstance(arrays, list) and arrays and rng.getrandbits(2):
        entry = rng.choice(arrays)
        if isinstance(entry, list) and entry:
            entry[int(rng.random() * len(entry))] = rng.choice(_ODD_VALUES)
    else:
        header[key] = rng.choice(_ODD_VALUES)
    return json.dumps(header, sort_keys=True).encode() + body[length:]


_ODD_VALUES: Final[tuple[object, ...]] = (
    None, True, 0, -1, 1, 2**31, 2**63, 2**64, 2**70, 10**400, 1.5, math.inf, math.nan,
    "", "x", "<f4", "<f8", "<i4", ">f4", "<M8[s]", "|O",
    [], [0], [-1], [1, 4], [2**32, 2**32], [2**62, 4], [2**70], [2**31, 2**31, 4], [True], [1.0], [[]],
    [1] * 40, {"a": 1},
)  # fmt: skip
