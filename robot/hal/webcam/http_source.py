"""A camera in the network: MJPEG over HTTP (mjpg-streamer, a phone's webcam app)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import cv2
import numpy as np

from robot.clock import Clock
from robot.hal.interfaces import DeviceError
from robot.hal.webcam.http_exchange import Connection, parse_address, refusal
from robot.hal.webcam.multipart import MultipartParser, Part, StampMapper, boundary_of, stamp_of
from robot.hal.webcam.source import TimedImage
from robot.messages import Image

_STREAM: Final = "/?action=stream"
_MOST_BROKEN: Final = 10
# What is taken from the socket at one go, so that a server that sends without pause is not read for ever.
_MOST_DRAINED_BYTES: Final = 4 << 20
_THIS_COMPUTER: Final = ("127.0.0.1", "::1", "localhost")
_OLDEST_S: Final = 2.0


class HttpSource:
    """`Source` over `http://HOST:PORT/PATH` that answers multipart/x-mixed-replace of JPEG pictures.

    Without a path it is mjpg-streamer's, /?action=stream.

    connect_timeout bounds connecting and the answer's head, in seconds; a stream silent for `silence` seconds
    is broken. Of the pictures that wait the newest is decoded. Capture times come from the `X-Timestamp` of
    each part (StampMapper), without it they are the times of arrival.
    """

    def __init__(
        self,
        url: str,
        clock: Clock,
        connect_timeout: float = 1.0,
        silence: float = 1.0,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        address = parse_address(url)
        self._address = replace(address, target=_STREAM) if address.target == "/" else address
        self._clock = clock
        self._connect_timeout = connect_timeout
        self._silence = silence
        self._monotonic = monotonic
        self._connection: Connection | None = None
        self._parser = MultipartParser("")
        self._stamps = StampMapper()
        self._waiting: list[Part] = []
        self._broken = 0
        self._heard_at = -math.inf

    @property
    def name(self) -> str:
        """Host and port, without the path and what may be secret."""
        return f"http://{self._address.host}:{self._address.port}"

    def open(self) -> None:
        """Ask for the stream. Raises DeviceError with the cure."""
        self.close()
        connection = Connection(self._address, self._connect_timeout)
        head = connection.head
        boundary = boundary_of(head.headers.get("content-type", ""))
        if head.status != 200 or boundary is None:
            connection.close()
            raise refusal(self._address, head.status) if head.status != 200 else self._no_stream()
        self._connection = connection
        self._parser = MultipartParser(boundary)
        self._stamps = StampMapper()
        self._broken = 0
        self._heard_at = self._monotonic()
        self._waiting = self._parser.feed(connection.rest)

    def grab(self, timeout: float) -> TimedImage | None:
        """The newest picture that has come whole; None also for one that came broken."""
        if self._connection is None:
            raise DeviceError(f"{self.name} is closed")
        until = self._monotonic() + timeout
        parts, self._waiting = self._waiting, []
        while not parts:
            left = until - self._monotonic()
            piece = self._connection.receive(left)
            parts = [] if piece is None else self._take(piece)
            if not parts and (piece is None or left <= 0):
                self._check_silence()
                return None
        parts += self._drain(self._connection)
        self._heard_at = self._monotonic()
        return self._decoded(parts[-1])

    def close(self) -> None:
        """Hang up."""
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()

    def _take(self, piece: bytes) -> list[Part]:
        if piece == b"":
            raise DeviceError(f"{self.name} ended the stream: start its server again")
        try:
            return self._parser.feed(piece)
        except DeviceError as error:
            raise DeviceError(f"{self.name}: {error}") from error

    def _drain(self, connection: Connection) -> list[Part]:
        """All that waits already: its pictures are newer."""
        parts: list[Part] = []
        drained = 0
        while drained < _MOST_DRAINED_BYTES:
            piece = connection.receive(0.0)
            if not piece:  # nothing there, or the end, which the next grab meets again
                break
            drained += len(piece)
            parts += self._take(piece)
        return parts

    def _decoded(self, part: Part) -> TimedImage | None:
        arrival = self._clock.now()
        stamp = stamp_of(part.headers)
        image = _decode(part.body)
        if image is None:
            self._broken += 1
            if self._broken >= _MOST_BROKEN:
                raise DeviceError(
                    f"{self.name}: {self._broken} pictures in a row are no JPEG: check its server"
                )
            return None
        self._broken = 0
        return TimedImage(image, arrival if stamp is None else self._captured_at(stamp, arrival))

    def _captured_at(self, stamp: float, arrival: float) -> float:
        """A server on this computer stamps by this computer's clock; any other clock has to be found out."""
        age = self._monotonic() - stamp
        if self._address.host in _THIS_COMPUTER and 0.0 <= age <= _OLDEST_S:
            return arrival - age
        return self._stamps.captured_at(stamp, arrival)

    def _check_silence(self) -> None:
        if self._monotonic() - self._heard_at > self._silence:
            raise DeviceError(f"{self.name} sends no picture for {self._silence:g} s: restart its server")

    def _no_stream(self) -> DeviceError:
        return DeviceError(
            f"{self.name}{self._address.target} is no MJPEG stream: mjpg-streamer's is at /?action=stream"
        )


def _decode(jpeg: bytes) -> Image | None:
    if not jpeg:
        return None
    try:
        image = cv2.imdecode(np.frombuffer(jpeg, dtype=np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        return None
    return None if image is None else np.asarray(image, dtype=np.uint8)
