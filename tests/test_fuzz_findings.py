"""What the fuzz bench found, each held by the shortest input that shows it."""

from __future__ import annotations

import hashlib
import json
import struct
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bench.fuzz_files import ModelFile
from calib.files import CalibrationError, parse_rig
from robot import config, model_file, settings_file
from robot.errors import UserError
from robot.hal.interfaces import DeviceError
from robot.hal.modbus_client import client_for
from robot.hal.teleop.parser import StreamParser
from robot.hal.webcam.http_exchange import Connection, parse_address
from robot.sim.scene import SceneError, load_scene


@pytest.mark.parametrize("text", ["x = " + "7" * 5000, "x = " + "[" * 3000], ids=["digits", "nesting"])
def test_the_toml_readers_own_limits_are_told_in_one_line(text: str, tmp_path: Path) -> None:
    path = tmp_path / "odd.toml"
    path.write_text(text)
    for error, read in (
        (UserError, lambda: settings_file.parse(text, config.Config, "odd.toml")),
        (SceneError, lambda: load_scene(path)),
        (CalibrationError, lambda: parse_rig(text, "odd.toml")),
    ):
        with pytest.raises(error, match=r"odd\.toml: not .*TOML") as said:
            read()
        assert "\n" not in str(said.value)


@pytest.mark.parametrize("text", ["mo\nck", 'mo"ck', "mo\\ck", "mo\x01\x7fck", "möck"])
def test_odd_text_is_shown_in_one_line_that_reads_back(text: str) -> None:
    wrong = settings_file.commented(config.Config(base=config.Base(driver=text)))
    assert tomllib.loads(wrong)["base"]["driver"] == text
    with pytest.raises(UserError, match=r"base\.driver = .* is not allowed") as said:
        settings_file.parse(wrong, config.Config, "odd.toml")
    assert "\n" not in str(said.value)


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_rotation_of_huge_numbers_is_refused() -> None:
    eye = "width = 352\nheight = 288\nfx = 300.0\nfy = 300.0\ncx = 175.0\ncy = 143.0\n"
    rotation = "[1e200, 1e200, 0.0, 1e200, -1e200, 0.0, 0.0, 0.0, 1.0]"
    pair = f"[pair]\ntranslation = [-0.06, 0.0, 0.0]\nrotation = {rotation}\n"
    with pytest.raises(CalibrationError, match="not a rotation matrix"):
        parse_rig(f"[left]\n{eye}[right]\n{eye}{pair}", "rig.toml")


@pytest.mark.parametrize("metres", ["1e-320", "1e200", "60.0"], ids=["none", "endless", "millimetres"])
def test_a_baseline_that_no_pair_has_is_refused(metres: str) -> None:
    eye = "width = 352\nheight = 288\nfx = 300.0\nfy = 300.0\ncx = 175.0\ncy = 143.0\n"
    with pytest.raises(CalibrationError, match="m apart; give metres"):
        parse_rig(f"[left]\n{eye}[right]\n{eye}[pair]\ntranslation = [-{metres}, 0.0, 0.0]\n", "rig.toml")


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("shape", [[2**63], [2**64], [2**32, 2**32], [2**62, 4], [2**70, 0]], ids=str)
def test_a_model_that_lies_about_its_size_is_refused(shape: list[int]) -> None:
    with pytest.raises(UserError, match="holds no usable model"):
        model_file.from_bytes(_with_header(lambda header: header["arrays"][0].__setitem__(2, shape)))


@pytest.mark.parametrize(
    "spoil",
    [
        lambda header: header["arrays"][0].__setitem__(0, 7),
        lambda header: header.__setitem__("views", float("inf")),
        lambda header: header.__setitem__("height_m", 10**400),
        lambda header: header.__setitem__("arrays", None),
    ],
    ids=["name is a number", "infinitely many views", "endless height", "no arrays"],
)
def test_a_model_with_an_odd_header_is_refused(spoil: Callable[[dict[str, Any]], None]) -> None:
    with pytest.raises(UserError, match="holds no usable model"):
        model_file.from_bytes(_with_header(spoil))


def _with_header(spoil: Callable[[dict[str, Any]], None]) -> bytes:
    """A model whose header was changed, with a right checksum."""
    head = struct.Struct("<8sHI32s")
    data = ModelFile()._source._corpus[0]
    length = head.unpack_from(data)[2]
    header = json.loads(data[head.size : head.size + length])
    spoil(header)
    text = json.dumps(header).encode()
    body = text + data[head.size + length :]
    return head.pack(b"ROBOTMDL", model_file.VERSION, len(text), hashlib.sha256(body).digest()) + body


@pytest.mark.parametrize("host", ["a..b", ".0.7", "x" * 70])
def test_a_host_that_is_no_name_is_told(host: str) -> None:
    with pytest.raises(DeviceError, match="cannot be reached"):
        Connection(parse_address(f"http://{host}:80/"), 0.1)
    with pytest.raises(DeviceError, match="not known"):
        client_for(f"{host}:502", 115200, 0.1)


def test_an_endless_port_is_told() -> None:
    with pytest.raises(DeviceError, match="no address"):
        client_for("127.0.0.1:" + "7" * 5000, 115200, 0.1)


@pytest.mark.parametrize("noise", [b"u\x1bO\xc4", b"i\x1b[\x11", b"\x1b[A\x1b[\x07i"])
def test_bytes_that_are_no_keys_are_noise_in_an_escape_sequence_too(noise: bytes) -> None:
    parser = StreamParser()
    assert parser.feed(noise, 0.0) + parser.feed(b"", 1.0) == []
    assert parser.noise_bytes == len(noise)


def test_an_arrow_that_comes_in_pieces_right_behind_noise_is_noise() -> None:
    parser = StreamParser()
    words = parser.feed(b"\xb4\x1b", 0.0) + parser.feed(b"O", 0.008) + parser.feed(b"D", 0.012)
    assert words + parser.feed(b"", 1.0) == []
    assert [word.w for word in parser.feed(b"\x1b", 2.0) + parser.feed(b"OD", 2.03)] == [0.5]
