"""The person's end of the teleop port: a pseudo-terminal into which a test types."""

from __future__ import annotations

import os
import select
import threading
import time
import tty
from contextlib import suppress
from pathlib import Path

_HEARD_MOST = 16_384
_LOOK_S = 0.05


class Typist:
    """`link` is where the robot opens its teleop port. What it writes back is read at once and kept.

    `hang_up` pulls the cable (the robot reads a hang-up, the port is gone), `plug` puts it back.
    """

    def __init__(self, link: Path) -> None:
        self._link = link
        self._lock = threading.Lock()
        self._ends: tuple[int, int] | None = None
        self._heard = bytearray()
        self._closed = False
        self.plug()
        self._thread = threading.Thread(target=self._listen, name="typist", daemon=True)
        self._thread.start()

    @property
    def path(self) -> str:
        """Where the robot opens it."""
        return str(self._link)

    @property
    def heard(self) -> bytes:
        """The last kilobytes the robot wrote."""
        with self._lock:
            return bytes(self._heard)

    def type(self, data: bytes) -> float:
        """Write to the robot; returns the `time.monotonic()` of it. Lost if the port is gone or full."""
        with self._lock, suppress(OSError):
            if self._ends is not None:
                os.write(self._ends[0], data)
        return time.monotonic()

    def hang_up(self) -> None:
        """Pull the cable."""
        with self._lock:
            ends, self._ends = self._ends, None
            self._link.unlink(missing_ok=True)
            for end in ends or ():
                os.close(end)

    def plug(self) -> None:
        """Put it back, at the same path."""
        with self._lock:
            if self._ends is not None or self._closed:
                return
            ours, theirs = os.openpty()
            tty.setraw(theirs)
            os.set_blocking(ours, False)
            self._link.unlink(missing_ok=True)
            self._link.symlink_to(os.ttyname(theirs))
            self._ends = ours, theirs

    def close(self) -> None:
        """Hang up for good. May be called twice."""
        self._closed = True
        self._thread.join(timeout=2.0)
        self.hang_up()

    def _listen(self) -> None:
        while not self._closed:
            ends = self._ends
            if ends is None:
                time.sleep(_LOOK_S)
                continue
            with suppress(OSError, ValueError):
                if select.select([ends[0]], [], [], _LOOK_S)[0]:
                    self._read()

    def _read(self) -> None:
        with self._lock:
            if self._ends is not None:
                self._heard += os.read(self._ends[0], 4096)
                del self._heard[:-_HEARD_MOST]
