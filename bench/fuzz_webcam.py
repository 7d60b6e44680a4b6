"""The network camera's parsers under fuzz: multipart streams, answers' heads, control lists, addresses."""

from __future__ import annotations

import json
import random
import socket
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import pairwise
from typing import Any, Final
from unittest import mock

from bench.fuzz_mutation import Source
from robot.hal.interfaces import DeviceError
from robot.hal.modbus_client import client_for
from robot.hal.webcam.controls_http import parse_list, plugin_of
from robot.hal.webcam.http_exchange import Connection, parse_address, parse_head
from robot.hal.webcam.multipart import MultipartParser, StampMapper, boundary_of, stamp_of

_MOST_BYTES: Final = 4096
_MOST_HEAD_BYTES: Final = 8 * 1024
_JPEG: Final = bytes.fromhex("ffd8ffe000104a46494600010100000100010000") + b"picture\0\r\n" * 4 + b"\xff\xd9"


class Multipart:
    """`MultipartParser.feed` with random cuts, then `stamp_of` and `StampMapper` on what came."""

    name = "multipart"
    documented: tuple[type[Exception], ...] = ()

    def __init__(self) -> None:
        self._source = Source(_streams(), text=True, longest=60_000)

    def draw(self, rng: random.Random) -> bytes:
        """A stream."""
        return self._source.draw(rng)

    def take(self, data: bytes) -> bool:
        """Feed it in up to four pieces; True if a part came whole."""
        parser = MultipartParser("--b0undary" if len(data) % 2 else "b0undary", _MOST_BYTES)
        mapper = StampMapper()
        dice = zlib.crc32(data)
        cuts = sorted(
            {0, len(data), *((dice >> shift) % (len(data) + 1) for shift in (0, 5, 11)[: dice % 4])}
        )
        parts = 0
        for start, end in pairwise(cuts):
            try:
                whole = parser.feed(data[start:end])
            except DeviceError:
                return False
            for part in whole:
                parts += 1
                assert len(part.body) <= max(_MOST_BYTES, end), "a longer part than allowed"
                stamp = stamp_of(part.headers)
                if stamp is not None:
                    assert mapper.captured_at(stamp, float(parts)) <= parts, "captured after it arrived"
            kept = len(parser._buffer)
            assert kept <= _MOST_BYTES + _MOST_HEAD_BYTES + (end - start), f"{kept} bytes are kept"
        return parts > 0


class HttpHead:
    """`parse_head` and `boundary_of` of an answer's head."""

    name = "http-head"
    documented: tuple[type[Exception], ...] = (DeviceError,)

    def __init__(self) -> None:
        kinds = (
            'multipart/x-mixed-replace; boundary="b0undary"',
            "multipart/x-mixed-replace;boundary=--b0",
            "image/jpeg",
            "multipart/x; BOUNDARY = b",
        )
        heads = [f"HTTP/1.0 200 OK\r\nServer: x\r\nContent-Type: {kind}".encode() for kind in kinds]
        heads += [b"HTTP/1.1 401 Unauthorized\r\nWWW-Authenticate: Basic", b"HTTP/1.0 404\nA: b\n"]
        self._source = Source(heads, text=True, longest=20_000)

    def draw(self, rng: random.Random) -> bytes:
        """A head."""
        return self._source.draw(rng)

    def take(self, data: bytes) -> bool:
        """True if it is an answer."""
        head = parse_head(data, "http://eye:8080")
        assert 0 <= head.status <= 999, "no status"
        boundary = boundary_of(head.headers.get("content-type", ""))
        if boundary is not None:
            MultipartParser(boundary).feed(data)
        return True


class ControlList:
    """`parse_list` of mjpg-streamer's controls."""

    name = "http-controls"
    documented: tuple[type[Exception], ...] = (DeviceError,)

    def __init__(self) -> None:
        entry = {
            "name": "Pan", "id": "10094856", "type": "1", "min": "-36000", "max": "36000", "step": "3600",
            "default": "0", "value": "0", "dest": "0", "flags": "0", "group": "1",
        }  # fmt: skip
        numbers = {key: int(value) if value.lstrip("-").isdigit() else value for key, value in entry.items()}
        lists: tuple[list[Any], ...] = (
            [entry],
            [numbers, entry | {"id": 1}],
            [],
            [{"name": "class", "id": "9963776"}],
        )
        self._source = Source(
            [json.dumps({"controls": listed}, indent=1).encode() for listed in lists],
            text=True,
            longest=20_000,
        )

    def draw(self, rng: random.Random) -> bytes:
        """A document."""
        return self._source.draw(rng)

    def take(self, data: bytes) -> bool:
        """True if it is a list; every entry's numbers are whole."""
        for entry in parse_list(data, "http://eye:8080").values():
            for key in ("min", "max", "step", "default", "value"):
                int(entry[key])
        return True


class Addresses:
    """`parse_address`, `plugin_of` and the Modbus address; text as it would stand in a config."""

    name = "address"
    documented: tuple[type[Exception], ...] = ()

    def __init__(self) -> None:
        urls = (
            "http://eye.local:8080/?action=stream_1",
            "http://user:p%40ss@127.0.0.1:8080/video",
            "http://[::1]:81/",
            "127.0.0.1:502",
            "[::1]:5020",
            "10.0.0.7",
            "/dev/ttyUSB0",
        )
        self._source = Source([url.encode() for url in urls], text=True, longest=8000)

    def draw(self, rng: random.Random) -> bytes:
        """An address."""
        return self._source.draw(rng)

    def take(self, data: bytes) -> bool:
        """True if it is a camera's address."""
        text = data.decode("utf-8", "replace")
        with suppress(DeviceError), _no_name_server():
            client_for(text, 115200, 0.1)
        try:
            _camera_host(text)
        except DeviceError:
            return False
        plugin_of(text)
        return True


@contextmanager
def _no_name_server() -> Iterator[None]:
    """Within it names are not looked up, numbers are: nobody is asked a million odd questions."""
    real = socket.getaddrinfo

    def numbers_only(host: str, port: int, **options: Any) -> Any:
        return real(host, port, **options, flags=socket.AI_NUMERICHOST)

    with mock.patch.object(socket, "getaddrinfo", numbers_only):
        yield


def _camera_host(text: str) -> object:
    """Open the address as far as that goes without a name server: the host's name is put into wire form."""
    host = parse_address(text).host
    try:
        if "\0" not in host:
            return host.encode("idna")
        raise UnicodeError
    except UnicodeError:
        return Connection(parse_address(text), 0.1)  # must say so in its own words


def _streams() -> list[bytes]:
    def part(body: bytes, *headers: str) -> bytes:
        return "\r\n".join(["--b0undary", *headers, "", ""]).encode() + body + b"\r\n"

    length = f"Content-Length: {len(_JPEG)}"
    full = part(_JPEG, "Content-Type: image/jpeg", length, "X-Timestamp: 1712.345678")
    later = part(_JPEG, "Content-Type: image/jpeg", length, "X-Timestamp: 1712.385")
    return [
        full,
        full + later + full,
        b"\r\n" + part(_JPEG, "Content-Type: image/jpeg") + part(_JPEG),
        part(b"", "Content-Length: 0") + later,
        part(_JPEG, "Content-Length: 999999999999"),
        part(_JPEG, "Content-Length: 4097") + full,
        b"--b0undary\n" + b"Content-Length: 2\n\nhi\n" + b"--b0undary--\r\n",
    ]
