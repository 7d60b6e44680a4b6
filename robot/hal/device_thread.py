"""One worker per device: the control loop hands over and reads the newest value, the worker waits.

`DeviceThread` runs a device's exchanges in real time. `Inline` runs the same work at once in the caller:
for tests, where one thread and a stepped clock must do.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Final, Protocol

from robot.clock import Clock
from robot.messages import Fault

Work = Callable[[float], None]

# After a mistake of the driver's own the worker tries again this often, not at full rate.
_AFTER_ERROR_S: Final = 0.5
_END_WITHIN_S: Final = 0.4


class Worker(Protocol):
    """Calls a device's work again and again, and sooner when woken."""

    def start(self, work: Work) -> None:
        """Begin; `work(now)` is called from one thread only."""
        ...

    def wake(self) -> None:
        """There is something new to do: work now."""
        ...

    def faults(self, device: str, now: float) -> tuple[Fault, ...]:
        """What is wrong with the worker itself: the work hangs or met its own mistake."""
        ...

    def end(self, last: Work) -> None:
        """Do `last` after the work under way, then no more. Waits 0.4 s at most. May be called twice."""
        ...


class DeviceThread:
    """A worker in a thread of its own.

    period_s: the work is done at least this often. deadline_s: work that takes longer is told as
    `DEVICE.link`: something behind the driver hangs, and no word of it can be trusted.
    """

    def __init__(self, name: str, clock: Clock, period_s: float, deadline_s: float = 0.3) -> None:
        self._clock = clock
        self._period_s = period_s
        self._deadline_s = deadline_s
        self._woken = threading.Event()
        self._ending = threading.Event()
        self._last: Work | None = None
        self._work: Work | None = None
        self._begun_at: float | None = None
        self._error: Fault | None = None
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self, work: Work) -> None:
        """Begin working."""
        self._work = work
        self._thread.start()

    def wake(self) -> None:
        """Work now."""
        self._woken.set()

    def faults(self, device: str, now: float) -> tuple[Fault, ...]:
        """`DEVICE.link` while the work hangs, `driver.error` after a mistake of the driver."""
        error = self._error
        if error is not None:
            return (error,)
        begun = self._begun_at
        if begun is None or now - begun < self._deadline_s:
            return ()
        return (Fault(device, "link", begun, f"no word from its driver for {now - begun:.1f} s"),)

    def end(self, last: Work) -> None:
        """Do `last` in the worker's thread and end it; given up after 0.4 s if the device hangs."""
        if self._ending.is_set():
            return
        self._last = last
        self._ending.set()
        self._woken.set()
        if self._thread.is_alive():
            self._thread.join(_END_WITHIN_S)

    def _run(self) -> None:
        assert self._work is not None
        while not self._ending.is_set():
            pause = self._period_s if self._do(self._work) else _AFTER_ERROR_S
            self._woken.wait(max(0.0, pause))
            self._woken.clear()
        if self._last is not None:
            self._do(self._last)

    def _do(self, work: Work) -> bool:
        """One turn of work; False if it met a mistake, which must end neither thread nor robot unseen."""
        now = self._begun_at = self._clock.now()
        try:
            work(now)
        except Exception as error:
            words = f"{self._thread.name}: {type(error).__name__}: {error}"
            self._error = Fault("driver", "error", now, words)
            return False
        finally:
            self._begun_at = None
        return True


class Inline:
    """A worker that works at once, in the caller's thread, at the time it is given."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._work: Work | None = None

    def start(self, work: Work) -> None:
        """Work once, so that there is a first value."""
        self._work = work
        work(self._clock.now())

    def wake(self) -> None:
        """Work now."""
        if self._work is not None:
            self._work(self._clock.now())

    def faults(self, device: str, now: float) -> tuple[Fault, ...]:
        """None: an error reaches the caller."""
        return ()

    def end(self, last: Work) -> None:
        """Do `last`, then nothing more."""
        if self._work is not None:
            self._work = None
            last(self._clock.now())
