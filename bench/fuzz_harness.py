"""Puts inputs through a parser and writes down what must not happen: crash, hang, motion, greed."""

from __future__ import annotations

import random
import resource
import signal
import time
import tracemalloc
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from types import FrameType
from typing import Final, Protocol

KINDS: Final[tuple[str, ...]] = ("crash", "hang", "motion", "memory")
CHUNK: Final = 5_000
"""Inputs that share one random generator; the unit of work of `--jobs`."""
CPU_LIMIT_S: Final = 2.0
"""Computing time one input may take."""
WALL_LIMIT_S: Final = 20.0
"""Wall time one input may take: on a busy computer a parser waits for its turn."""
_PROBE_EVERY: Final = 100
_KEPT_FINDINGS: Final = 3
_FREE_BYTES: Final = 1 << 20
_BYTES_PER_BYTE: Final = 512
_ADDRESS_SPACE_BYTES: Final = 1 << 30


class Subject(Protocol):
    """One parser with its inputs."""

    name: str
    documented: tuple[type[Exception], ...]
    """What it may raise for a bad input."""

    def draw(self, rng: random.Random) -> bytes:
        """The next input."""
        ...

    def take(self, data: bytes) -> bool:
        """Put it through the parser, as a function of `data` alone; True if it was accepted as valid.

        Raises `InvalidMotionError` if an invalid input would move something, AssertionError if what came
        out breaks a promise.
        """
        ...


class InvalidMotionError(AssertionError):
    """Something would move that no valid input asked for."""


class _OverdueError(BaseException):
    """The time of one input is over. Not an Exception, so that no parser can swallow it."""


@dataclass(frozen=True, slots=True)
class Finding:
    """An input that did what must not happen. kind: crash, hang, motion or memory."""

    parser: str
    kind: str
    words: str
    data: bytes

    def __str__(self) -> str:
        return f"{self.parser}: {self.kind}: {self.words}: {self.data.hex()}"


@dataclass(slots=True)
class Tally:
    """What came out of some inputs; `add` sums up. peak_bytes and slowest_s are the largest of one input."""

    parser: str
    inputs: int = 0
    accepted: int = 0
    cpu_s: float = 0.0
    slowest_s: float = 0.0
    peak_bytes: int = 0
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(KINDS, 0))
    findings: list[Finding] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        """Take another's figures in; of its findings the first few of each kind."""
        self.inputs += other.inputs
        self.accepted += other.accepted
        self.cpu_s += other.cpu_s
        self.slowest_s = max(self.slowest_s, other.slowest_s)
        self.peak_bytes = max(self.peak_bytes, other.peak_bytes)
        for finding in other.findings:
            self._keep(finding)
        for kind, count in other.counts.items():
            self.counts[kind] += count

    def found(self, kind: str, words: str, data: bytes) -> None:
        """Count it, and keep it if it is among the first."""
        self.counts[kind] += 1
        self._keep(Finding(self.parser, kind, words, data))

    def _keep(self, finding: Finding) -> None:
        if sum(kept.kind == finding.kind for kept in self.findings) < _KEPT_FINDINGS:
            self.findings.append(finding)


def run_chunk(subject: Subject, seed: int, index: int, count: int = CHUNK) -> Tally:
    """Draw and try `count` inputs; the same (seed, parser, index) gives the same inputs.

    Must be called in the main thread of its process: the watchdog is a signal.
    """
    rng = random.Random(f"{seed}/{subject.name}/{index}")
    tally = Tally(subject.name)
    began = time.process_time()
    with watchdog():
        for number in range(count):
            data = subject.draw(rng)
            try_one(subject, data, tally, probed=number % _PROBE_EVERY == 1)
    tally.cpu_s = time.process_time() - began
    return tally


def try_one(subject: Subject, data: bytes, tally: Tally, probed: bool = False) -> None:
    """Put one input through, within `watchdog`. probed: its memory is measured too."""
    tally.inputs += 1
    began = time.process_time()
    tally.accepted += _judged(subject, data, tally)
    tally.slowest_s = max(tally.slowest_s, time.process_time() - began)
    if probed:
        # Once more, for what the first time leaves in caches is no part of it.
        peak = _peak_bytes(subject, data)
        tally.peak_bytes = max(tally.peak_bytes, peak)
        if peak > _FREE_BYTES + _BYTES_PER_BYTE * len(data):
            tally.found("memory", f"{peak} bytes for an input of {len(data)}", data)


def _judged(subject: Subject, data: bytes, tally: Tally) -> bool:
    """True if it was accepted; what must not happen is written down."""
    try:
        return _bounded(subject, data)
    except InvalidMotionError as error:
        tally.found("motion", _words(error), data)
    except subject.documented as error:
        if not str(error) or "\n" in str(error):
            tally.found("crash", f"an error's words are not one line: {_words(error)}", data)
    except MemoryError as error:
        tally.found("memory", _words(error), data)
    except _OverdueError as error:
        tally.found("hang", _words(error), data)
    except Exception as error:
        tally.found("crash", _words(error), data)
    return False


def _peak_bytes(subject: Subject, data: bytes) -> int:
    """The most memory it takes at any time, whatever becomes of it."""
    tracemalloc.start()
    try:
        with suppress(Exception, _OverdueError):
            _bounded(subject, data)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def _bounded(subject: Subject, data: bytes) -> bool:
    _arm(CPU_LIMIT_S, WALL_LIMIT_S)
    try:
        return subject.take(data)
    finally:
        _arm(0.0, 0.0)


@contextmanager
def watchdog() -> Iterator[None]:
    """Within it `try_one` notices an input that takes too long."""
    before = [(number, signal.signal(number, _overdue)) for number in (signal.SIGALRM, signal.SIGPROF)]
    try:
        with warnings.catch_warnings():
            # What numpy only warns of reaches the person's terminal all the same.
            warnings.simplefilter("error", RuntimeWarning)
            yield
    finally:
        for number, handler in before:
            signal.signal(number, handler)


def limit_memory() -> None:
    """This process may grow by 1 GB at most: a lying length ends in MemoryError, not in swapping."""
    with open("/proc/self/statm") as file:
        present = int(file.read().split()[0]) * resource.getpagesize()
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (present + _ADDRESS_SPACE_BYTES, hard))


def _arm(cpu_s: float, wall_s: float) -> None:
    signal.setitimer(signal.ITIMER_PROF, cpu_s)
    signal.setitimer(signal.ITIMER_REAL, wall_s)


def _overdue(number: int, frame: FrameType | None) -> None:
    limit = f"{CPU_LIMIT_S} s of computing" if number == signal.SIGPROF else f"{WALL_LIMIT_S} s of waiting"
    raise _OverdueError(f"not done after {limit}")


def _words(error: BaseException) -> str:
    """What was raised and where, in one line."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    where = f"{trace.tb_frame.f_code.co_filename.rpartition('/')[2]}:{trace.tb_lineno}" if trace else "?"
    return f"{type(error).__name__} at {where}: {' '.join(str(error).split())[:200]}"
