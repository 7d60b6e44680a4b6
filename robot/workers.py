"""Where vision jobs run: in a thread of their own (real time), or inline with simulated latency."""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from robot.clock import Clock
from robot.messages import View


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """One stage of vision on one view."""

    stage: str
    view: View
    run: Callable[[View], object]


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """What a job gave: its value or the error it died of, and the seconds it took."""

    stage: str
    view: View
    value: object
    seconds: float
    error: str | None = None


class Worker(Protocol):
    """Runs batches of jobs one after the other; takes a new batch only when idle."""

    def idle(self, now: float) -> bool:
        """True if a batch may be submitted."""
        ...

    def submit(self, jobs: Sequence[Job], now: float) -> None:
        """Start a batch."""
        ...

    def collect(self, now: float) -> list[Result]:
        """Everything finished since the last call, oldest first."""
        ...

    def close(self) -> None:
        """Stop working."""
        ...


class SteppedWorker:
    """Lockstep: a job runs at once, its result is released after the stage's configured cost.

    So latency is simulated, no wall time decides anything, and the same seed gives the same run.
    """

    def __init__(self, costs: Mapping[str, float], slow: float = 1.0) -> None:
        self._costs = {stage: cost * slow for stage, cost in costs.items()}
        self._pending: deque[tuple[float, Result]] = deque()
        self._busy_until = 0.0

    def idle(self, now: float) -> bool:
        """True once the simulated time of the last batch is over."""
        return now >= self._busy_until - 1e-9

    def submit(self, jobs: Sequence[Job], now: float) -> None:
        """Run the jobs now; they count as finished one after the other from `now` on."""
        at = now
        for job in jobs:
            cost = self._costs[job.stage]
            at += cost
            self._pending.append((at, run(job, cost)))
        self._busy_until = at

    def collect(self, now: float) -> list[Result]:
        """Results whose time has come."""
        done: list[Result] = []
        while self._pending and self._pending[0][0] <= now + 1e-9:
            done.append(self._pending.popleft()[1])
        return done

    def close(self) -> None:
        """Drop what was pending."""
        self._pending.clear()


class ThreadWorker:
    """Real time: one thread; numpy and OpenCV release the interpreter's lock while they work."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._inbox: queue.SimpleQueue[Sequence[Job] | None] = queue.SimpleQueue()
        self._outbox: queue.SimpleQueue[Result] = queue.SimpleQueue()
        self._busy = threading.Event()
        self._thread = threading.Thread(target=self._work, name="vision", daemon=True)
        self._thread.start()

    def idle(self, now: float) -> bool:
        """True if the thread has nothing to do."""
        return not self._busy.is_set()

    def submit(self, jobs: Sequence[Job], now: float) -> None:
        """Hand the batch to the thread."""
        self._busy.set()
        self._inbox.put(jobs)

    def collect(self, now: float) -> list[Result]:
        """Results that are ready; never waits."""
        done: list[Result] = []
        while not self._outbox.empty():
            done.append(self._outbox.get())
        return done

    def close(self) -> None:
        """End the thread after the job it is at."""
        self._inbox.put(None)
        self._thread.join(timeout=2.0)

    def _work(self) -> None:
        while (jobs := self._inbox.get()) is not None:
            for job in jobs:
                start = self._clock.now()
                result = run(job, 0.0)
                seconds = self._clock.now() - start
                self._outbox.put(Result(result.stage, result.view, result.value, seconds, result.error))
            self._busy.clear()


def run(job: Job, seconds: float) -> Result:
    """Run a job; its error becomes part of the result, for it must not end the control loop."""
    try:
        return Result(job.stage, job.view, job.run(job.view), seconds)
    except Exception as error:  # any mistake in a vision stage is a fault of the robot, not its end
        return Result(job.stage, job.view, None, seconds, f"{type(error).__name__}: {error}")
