"""MJPEG as servers send it: multipart/x-mixed-replace taken apart, without I/O, and their stamps read."""

from __future__ import annotations

import math
import re
from collections import deque
from dataclasses import dataclass
from typing import Final

from robot.hal.interfaces import DeviceError
from robot.hal.webcam.http_exchange import parse_headers

_MOST_PART_HEAD_BYTES: Final = 8 * 1024
_BLANK_LINE: Final = re.compile(rb"\r?\n\r?\n")
_LINE_END: Final = re.compile(rb"\r?\n")


@dataclass(frozen=True, slots=True)
class Part:
    """One picture as it came: its headers (names in lower case) and its bytes."""

    headers: dict[str, str]
    body: bytes


class MultipartParser:
    """Feed it what arrives, take the parts that are whole.

    A part with a believable Content-Length is that long; one without ends before the next boundary. What
    lies between parts is passed over, so that it finds its way again after a damaged part. Raises
    DeviceError for a part of more than `most_bytes`.

    >>> parser = MultipartParser("b")
    >>> [part.body for part in parser.feed(b"--b\\r\\nContent-Length: 2\\r\\n\\r\\nhi\\r\\n--b\\r\\n")]
    [b'hi']
    """

    def __init__(self, boundary: str, most_bytes: int = 8 << 20) -> None:
        # Some servers announce the boundary with its dashes, some without.
        self._delimiter = b"--" + boundary.lstrip("-").encode("latin-1")
        self._most_bytes = most_bytes
        self._buffer = bytearray()
        self._headers: dict[str, str] | None = None
        self._length: int | None = None
        self._searched = 0

    def feed(self, data: bytes) -> list[Part]:
        """Take these bytes in; returns the parts they complete."""
        self._buffer += data
        parts: list[Part] = []
        while True:
            if self._headers is None and not self._read_part_head():
                return parts
            part = self._read_body()
            if part is None:
                return parts
            parts.append(part)

    def _read_part_head(self) -> bool:
        start = self._buffer.find(self._delimiter)
        if start < 0:
            # The delimiter's first bytes may be there already.
            del self._buffer[: max(0, len(self._buffer) - len(self._delimiter) + 1)]
            return False
        del self._buffer[:start]
        line_end = _LINE_END.search(self._buffer)
        # From the line's end on, so that a part without headers has its blank line too.
        end = _BLANK_LINE.search(self._buffer, line_end.start()) if line_end else None
        if end is None:
            if len(self._buffer) > _MOST_PART_HEAD_BYTES:
                raise DeviceError("the picture stream has headers without end: it is no MJPEG stream")
            return False
        lines = bytes(self._buffer[: end.start()]).decode("latin-1").splitlines()[1:]
        del self._buffer[: end.end()]
        self._headers = parse_headers(lines)
        self._length = self._believed_length(self._headers.get("content-length", ""))
        self._searched = 0
        return True

    def _believed_length(self, text: str) -> int | None:
        if not re.fullmatch(r"[0-9]{1,12}", text) or int(text) == 0:
            return None
        length = int(text)
        if length > self._most_bytes:
            raise DeviceError(
                f"the picture stream announces {length} bytes for one picture: that is no camera"
            )
        return length

    def _read_body(self) -> Part | None:
        headers = self._headers
        assert headers is not None
        end = self._length if self._length is not None else self._body_end()
        if end is None or len(self._buffer) < end:
            return None
        body = bytes(self._buffer[:end])
        del self._buffer[:end]
        self._headers = None
        return Part(headers, body)

    def _body_end(self) -> int | None:
        end = self._buffer.find(self._delimiter, self._searched)
        if end >= 0:
            return end
        if len(self._buffer) > self._most_bytes:
            raise DeviceError(f"a picture of the stream is longer than {self._most_bytes} bytes: no camera")
        self._searched = max(0, len(self._buffer) - len(self._delimiter) + 1)
        return None


def boundary_of(content_type: str) -> str | None:
    """The boundary a Content-Type names; None if it is no multipart stream.

    >>> boundary_of('multipart/x-mixed-replace; boundary="boundarydonotcross"')
    'boundarydonotcross'
    """
    kind, _, rest = content_type.partition(";")
    if not kind.strip().lower().startswith("multipart/"):
        return None
    match = re.search(r'boundary\s*=\s*(?:"([^"]+)"|([^\s;]+))', rest, re.IGNORECASE)
    return (match[1] or match[2]) if match else None


def stamp_of(headers: dict[str, str]) -> float | None:
    """The capture stamp of a part (`X-Timestamp: SECONDS.MICROS`, any origin); None if there is none."""
    text = headers.get("x-timestamp", "")
    return float(text) if re.fullmatch(r"[0-9]{1,12}(\.[0-9]{1,9})?", text) else None


class StampMapper:
    """Brings a server's capture stamps onto the run's clock.

    Transport only ever delays: the smallest (arrival - stamp) of the last `window` seconds is the offset of
    the clocks plus the quickest way, after F. Cristian, "Probabilistic clock synchronization" (1989). A
    picture that was held up gets its true age, up to that quickest way, which is not known. A stamp that does
    not go forward, or is more than `most_age` seconds old by the offset, tells of a restarted server: the
    offset is learnt anew.

    >>> mapper = StampMapper()
    >>> mapper.captured_at(stamp=1000.0, arrival=5.0), mapper.captured_at(stamp=1000.5, arrival=5.75)
    (5.0, 5.5)
    """

    def __init__(self, window: float = 30.0, most_age: float = 3.0) -> None:
        self._window = window
        self._most_age = most_age
        self._offsets: deque[tuple[float, float]] = deque()  # (arrival, offset), offsets ascending
        self._last_stamp = -math.inf

    def captured_at(self, stamp: float, arrival: float) -> float:
        """The capture time on the run's clock; never later than `arrival`."""
        if stamp <= self._last_stamp:
            self._offsets.clear()
        self._last_stamp = stamp
        offset = arrival - stamp
        if self._offsets and offset - self._offsets[0][1] > self._most_age:
            self._offsets.clear()
        while self._offsets and self._offsets[-1][1] >= offset:
            self._offsets.pop()
        self._offsets.append((arrival, offset))
        while self._offsets[0][0] < arrival - self._window:
            self._offsets.popleft()
        return min(arrival, stamp + self._offsets[0][1])
