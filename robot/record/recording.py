"""Whether the run is still being recorded. A full disk ends the record, never the run."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from robot.messages import Fault


@dataclass(frozen=True, slots=True)
class Stopped:
    """When (run time in seconds) and why recording ended before the run did."""

    at: float
    reason: str


class Recording:
    """Shared by everything that writes into one run folder: the first failure turns all of it off.

    >>> recording = Recording()
    >>> with recording.guarded(now=2.0):
    ...     raise OSError(28, "No space left on device")
    >>> recording.stopped
    Stopped(at=2.0, reason='No space left on device')
    """

    def __init__(self) -> None:
        self._stopped: Stopped | None = None

    @property
    def on(self) -> bool:
        """True while nothing has failed."""
        return self._stopped is None

    @property
    def stopped(self) -> Stopped | None:
        """Where the record ends early; None if it does not."""
        return self._stopped

    def stop(self, now: float, reason: str) -> None:
        """End the record; only the first call counts."""
        if self._stopped is None:
            self._stopped = Stopped(now, reason)

    @contextmanager
    def guarded(self, now: float) -> Iterator[None]:
        """Run a write; an OSError in it ends the record instead of the run."""
        try:
            yield
        except OSError as error:
            self.stop(now, error.strerror or str(error) or type(error).__name__)

    def faults(self, now: float) -> tuple[Fault, ...]:
        """The fault `recorder.full` from the moment the record ended early."""
        if self._stopped is None:
            return ()
        return (Fault("recorder", "full", self._stopped.at, self._stopped.reason),)

    def summary(self) -> dict[str, float | str]:
        """For the report: empty, or `recording_stopped_at` in s and `recording_stopped_reason`."""
        if self._stopped is None:
            return {}
        return {
            "recording_stopped_at": round(self._stopped.at, 3),
            "recording_stopped_reason": self._stopped.reason,
        }
