"""Byte links under the drivers: who carries a telegram, not what it means."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Protocol


class Link(Protocol):
    """Carries whole telegrams both ways. Raises OSError (DeviceError) when it is broken."""

    def write(self, telegram: bytes) -> None:
        """Send one telegram."""
        ...

    def read(self, timeout: float) -> bytes | None:
        """Return the next telegram, or None if none came within `timeout` seconds."""
        ...

    def close(self) -> None:
        """Release the link. May be called twice."""
        ...


class MemoryLink:
    """A link to something in the same process: `handle(telegram)` answers at once, None for no reply.

    >>> link = MemoryLink(lambda telegram: telegram[::-1])
    >>> link.write(b"ab")
    >>> link.read(0.0)
    b'ba'
    """

    def __init__(self, handle: Callable[[bytes], bytes | None]) -> None:
        self._handle = handle
        self._replies: deque[bytes] = deque()
        self.cut = False

    def write(self, telegram: bytes) -> None:
        """Hand the telegram over and keep the reply for `read`."""
        self._check()
        reply = self._handle(telegram)
        if reply is not None:
            self._replies.append(reply)

    def read(self, timeout: float) -> bytes | None:
        """Return the oldest reply; never waits."""
        self._check()
        return self._replies.popleft() if self._replies else None

    def close(self) -> None:
        """Break the link for good."""
        self.cut = True

    def _check(self) -> None:
        if self.cut:
            raise ConnectionError("the link is down")
