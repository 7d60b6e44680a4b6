"""Keeps simulated time beside the wall clock, and tells by how much it failed to."""

from __future__ import annotations

from collections.abc import Callable

from robot.sim.wire.messages import Pace


class Pacer:
    """Call `wait` after each `step_s` of simulated time; it sleeps until that time has come.

    slice_s: it wakes only this often, for each waking costs. tick_s: more than half of it late is late;
    who falls behind by more than a whole one has its time put back: late for good, not in haste for ever.

    >>> sleeps = []
    >>> pacer = Pacer(0.002, 0.004, 0.04, now=lambda: 10.0, sleep=sleeps.append)
    >>> pacer.begin()
    >>> for _ in range(4):
    ...     pacer.wait()
    >>> [round(seconds, 3) for seconds in sleeps]
    [0.004, 0.008]
    """

    def __init__(
        self,
        step_s: float,
        slice_s: float,
        tick_s: float,
        now: Callable[[], float],
        sleep: Callable[[float], None],
    ) -> None:
        self._step_s = step_s
        self._steps_a_slice = max(1, round(slice_s / step_s))
        self._tick_s = tick_s
        self._now = now
        self._sleep = sleep
        self._started = now()
        self._steps = 0
        self._ticks = self._late = 0
        self._worst = self._slipped = 0.0

    @property
    def pace(self) -> Pace:
        """How time was kept so far."""
        return Pace(self._ticks, self._late, self._worst, self._slipped)

    def begin(self) -> None:
        """Time passes from now on."""
        self._started = self._now()
        self._steps = 0

    def wait(self) -> None:
        """One more step of simulated time is over."""
        self._steps += 1
        if self._steps % self._steps_a_slice == 0:
            early = self._started + self._steps * self._step_s - self._now()
            if early > 0:
                self._sleep(early)

    def ticked(self) -> None:
        """A whole tick is over: was it in time?"""
        lateness = self._now() - (self._started + self._steps * self._step_s)
        self._ticks += 1
        self._late += lateness > 0.5 * self._tick_s
        self._worst = max(self._worst, lateness)
        if lateness > self._tick_s:
            self._started += lateness
            self._slipped += lateness
