"""When the next tick of a real-time run is due: a period after the last one, in step with the pictures."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

PERIOD = 0.04
EARLIEST, LATEST = 0.7, 1.1
"""A new picture starts a tick between these shares of a period; without one it comes at the latest."""

WaitForPicture = Callable[[float], bool]


class Pacer:
    """Waits from tick to tick. A tick that comes late is not made up for.

    wait_for_picture: waits at most so many seconds for a pair newer than the one seen last and says whether
    there is one. In step with the camera a picture waits for no tick, and the command that follows from it
    goes out a whole period earlier. None: ticks come at an even rate.
    """

    def __init__(self, stop: threading.Event, wait_for_picture: WaitForPicture | None = None) -> None:
        self._stop = stop
        self._wait_for_picture = wait_for_picture
        self._due = time.monotonic()

    def pause(self) -> None:
        """Wait until the next tick is due, or until told to stop."""
        if self._wait_for_picture is None:
            self._due = max(self._due + PERIOD, time.monotonic())
            self._stop.wait(self._due - time.monotonic())
            return
        latest = self._due + LATEST * PERIOD
        self._stop.wait(self._due + EARLIEST * PERIOD - time.monotonic())
        left = latest - time.monotonic()
        if left > 0.0 and not self._stop.is_set() and not self._wait_for_picture(left):
            self._stop.wait(latest - time.monotonic())
        self._due = max(time.monotonic(), self._due + EARLIEST * PERIOD)


SWITCH_S = 0.0005


@contextmanager
def quick_hand_over() -> Iterator[None]:
    """Let the interpreter change threads ten times as readily as usual, as long as this lasts.

    A device's worker that has its answer must wait until vision lets go of the interpreter: at the usual
    5 ms each, the few hand-overs of one exchange would cost more than the wire.
    """
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_S)
    try:
        yield
    finally:
        sys.setswitchinterval(before)
