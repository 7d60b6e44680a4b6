"""The little HTTP a camera in the network needs, with a deadline for everything.

Own and small because the library's reader waits anew for every byte: a server that drips would hold it.
Requests are HTTP/1.0, so that the answer comes in one piece and not in chunks.
"""

from __future__ import annotations

import base64
import re
import select
import socket
import time
from dataclasses import dataclass
from typing import Final
from urllib.parse import unquote, urlsplit

from robot.hal.interfaces import DeviceError

_MOST_HEAD_BYTES: Final = 16 * 1024
_HEAD_END: Final = re.compile(rb"\r?\n\r?\n")


@dataclass(frozen=True, slots=True)
class Address:
    """Where a server is: host, port, path with query, and the Authorization header's value ('' for none)."""

    host: str
    port: int
    target: str
    authorization: str = ""


@dataclass(frozen=True, slots=True)
class Head:
    """Status and headers (names in lower case) of an answer."""

    status: int
    headers: dict[str, str]


def parse_address(url: str) -> Address:
    """Take an http:// address apart. Raises DeviceError with the cure for anything else.

    >>> parse_address("http://eye.local:8080/?action=stream")
    Address(host='eye.local', port=8080, target='/?action=stream', authorization='')
    """
    try:
        parts = urlsplit(url)
        port = parts.port or 80
    except ValueError as error:
        raise DeviceError(f"{url} is no address ({error}): write http://HOST:PORT/PATH") from error
    if parts.scheme != "http" or not parts.hostname or re.search(r"\s", url) or not url.isascii():
        raise DeviceError(f"{url} is no address of this kind: write http://HOST:PORT/PATH")
    target = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
    if parts.username is None:
        return Address(parts.hostname, port, target)
    secret = f"{unquote(parts.username)}:{unquote(parts.password or '')}".encode()
    return Address(parts.hostname, port, target, "Basic " + base64.b64encode(secret).decode())


class Connection:
    """One request and the bytes that come back. Opening raises DeviceError; `timeout` bounds all of it."""

    def __init__(self, address: Address, timeout: float) -> None:
        self._until = time.monotonic() + timeout
        self._where = f"http://{address.host}:{address.port}"
        try:
            self._socket = socket.create_connection((address.host, address.port), timeout)
        except (OSError, ValueError) as error:  # ValueError: no name at all, like a..b
            raise DeviceError(
                f"{self._where} cannot be reached ({error}): start its server, check the network"
            ) from error
        try:
            self._socket.settimeout(self._left())
            self._socket.sendall(_request(address))
            self.head, self.rest = self._read_head()
        except OSError as error:
            self.close()
            raise self._broke(error) from error

    def receive(self, timeout: float, most: int = 65536) -> bytes | None:
        """What there is within `timeout` seconds; None if nothing came, b'' at the end.

        Raises DeviceError if the connection broke.
        """
        try:
            ready, _, _ = select.select([self._socket], [], [], max(0.0, timeout))
            return self._socket.recv(most) if ready else None
        except (OSError, ValueError) as error:
            raise self._broke(error) from error

    def close(self) -> None:
        """Hang up. May be called twice."""
        self._socket.close()

    def _left(self) -> float:
        return max(0.001, self._until - time.monotonic())

    def _read_head(self) -> tuple[Head, bytes]:
        received = b""
        while True:
            end = _HEAD_END.search(received)
            if end is not None:
                return parse_head(received[: end.start()], self._where), received[end.end() :]
            if len(received) > _MOST_HEAD_BYTES:
                raise DeviceError(f"{self._where} sends headers without end: it is no camera server")
            if time.monotonic() >= self._until:
                raise DeviceError(f"{self._where} takes the call but does not answer: restart its server")
            piece = self.receive(self._left())
            if piece == b"":
                raise DeviceError(f"{self._where} hung up without an answer: restart its server")
            received += piece or b""

    def _broke(self, error: Exception) -> DeviceError:
        if isinstance(error, DeviceError):
            return error
        return DeviceError(f"the connection to {self._where} broke ({error}): check the network")


def fetch(address: Address, timeout: float, most: int = 1 << 20) -> bytes:
    """GET the whole of a small document within `timeout` seconds.

    Raises DeviceError if it does not come, is longer than `most` bytes, or the status is not 200.
    """
    until = time.monotonic() + timeout
    connection = Connection(address, timeout)
    try:
        if connection.head.status != 200:
            raise refusal(address, connection.head.status)
        body = connection.rest
        while len(body) <= most:
            left = until - time.monotonic()
            piece = connection.receive(left) if left > 0 else None
            if piece is None:
                raise DeviceError(f"http://{address.host}:{address.port} does not finish its answer")
            if piece == b"":
                return body
            body += piece
        raise DeviceError(f"http://{address.host}:{address.port}{address.target} is longer than {most} bytes")
    finally:
        connection.close()


def refusal(address: Address, status: int) -> DeviceError:
    """The error for an answer that is no success, with the cure."""
    cure = {
        401: "put USER:PASSWORD@ before the host's name",
        403: "put USER:PASSWORD@ before the host's name",
        404: "check the path after the port",
    }.get(status, "look at its log")
    return DeviceError(f"http://{address.host}:{address.port}{address.target} answers {status}: {cure}")


def parse_head(head: bytes, where: str) -> Head:
    """Status line and headers. Raises DeviceError if it is no HTTP answer.

    >>> parse_head(b"HTTP/1.0 200 OK\\r\\nContent-Type: image/jpeg", "x")
    Head(status=200, headers={'content-type': 'image/jpeg'})
    """
    lines = head.decode("latin-1").splitlines()
    match = re.match(r"HTTP/1\.[01] (\d{3})(?: |$)", lines[0]) if lines else None
    if match is None:
        raise DeviceError(f"{where} does not speak HTTP: check host and port")
    return Head(int(match[1]), parse_headers(lines[1:]))


def parse_headers(lines: list[str]) -> dict[str, str]:
    """'Name: value' lines as a dictionary, names in lower case; other lines are passed over."""
    pairs = (line.partition(":") for line in lines)
    return {name.strip().lower(): value.strip() for name, colon, value in pairs if colon}


def _request(address: Address) -> bytes:
    lines = [f"GET {address.target} HTTP/1.0", f"Host: {address.host}:{address.port}"]
    if address.authorization:
        lines.append(f"Authorization: {address.authorization}")
    return "\r\n".join([*lines, "", ""]).encode("latin-1")
