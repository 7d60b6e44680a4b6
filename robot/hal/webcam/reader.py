"""A thread that drains one source and keeps its newest pictures."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from robot.hal.interfaces import DeviceError
from robot.hal.webcam.source import EndOfPicturesError, Source, TimedImage

# So long at most until a reader that is told to end looks up from a silent source.
_GRAB_S: Final = 0.1
_JOIN_S: Final = 1.0


@dataclass(frozen=True, slots=True)
class Backoff:
    """Seconds to wait before the n-th new attempt: doubling from `first` to `most`.

    >>> [Backoff().wait(n) for n in range(6)]
    [0.5, 1.0, 2.0, 4.0, 5.0, 5.0]
    """

    first: float = 0.5
    most: float = 5.0

    def wait(self, attempts: int) -> float:
        """Seconds to wait after so many attempts that failed in a row."""
        return min(self.first * 2.0 ** min(attempts, 30), self.most)


DEFAULT_BACKOFF: Final = Backoff()


@dataclass(frozen=True, slots=True)
class ReaderState:
    """How a source is. broken: why it does not deliver, '' if it does; ended: it is over for good."""

    broken: str = ""
    ended: bool = False


class Reader:
    """Opens a source, keeps its newest `keep` pictures in a mailbox, opens it again whenever it breaks.

    `start` opens the source in the caller's thread and raises its DeviceError; later ones are told by
    `state` while the reader tries again, 0.5 s to 5 s apart. on_open is called after each opening, in the
    thread that opened: there the picture's controls are set again on a camera that was plugged in again.
    """

    def __init__(
        self,
        source: Source,
        keep: int = 4,
        backoff: Backoff = DEFAULT_BACKOFF,
        on_open: Callable[[], None] | None = None,
    ) -> None:
        self._source = source
        self._backoff = backoff
        self._on_open = on_open
        self._mailbox: deque[TimedImage] = deque(maxlen=keep)
        self._arrived = threading.Condition()
        self._ending = threading.Event()
        self._state = ReaderState()
        self._thread = threading.Thread(target=self._run, name=f"eye {source.name}", daemon=True)

    @property
    def name(self) -> str:
        """The source's name."""
        return self._source.name

    @property
    def state(self) -> ReaderState:
        """How the source is now."""
        return self._state

    def start(self) -> None:
        """Open the source and begin to drain it. Raises DeviceError if it cannot be opened."""
        try:
            self._open()
        except DeviceError:
            self._source.close()
            raise
        self._thread.start()

    def recent(self) -> tuple[TimedImage, ...]:
        """The newest pictures, the oldest of them first; empty before the first."""
        with self._arrived:
            return tuple(self._mailbox)

    def wait_newer(self, at: float, timeout: float) -> bool:
        """Wait until there is a picture captured after `at`; False if none came within `timeout` seconds."""
        with self._arrived:
            return self._arrived.wait_for(lambda: self._newest_at() > at or self._over(), timeout) and (
                self._newest_at() > at
            )

    def close(self) -> None:
        """End the thread and release the source; the last pictures stay. May be called twice.

        A source that hangs in the kernel is waited for at most one second.
        """
        self._ending.set()
        with self._arrived:
            self._arrived.notify_all()
        if self._thread.is_alive():
            self._thread.join(_JOIN_S)

    def _newest_at(self) -> float:
        return self._mailbox[-1].at if self._mailbox else -float("inf")

    def _over(self) -> bool:
        return self._ending.is_set() or self._state.ended

    def _open(self) -> None:
        self._source.open()
        if self._on_open is not None:
            self._on_open()

    def _run(self) -> None:
        failures, is_open = 0, True
        try:
            while not self._ending.is_set():
                try:
                    if not is_open:
                        self._open()
                        is_open = True
                    failures = 0 if self._drain() else failures
                except EndOfPicturesError as error:
                    self._set(ReaderState(str(error), ended=True))
                    return
                except Exception as error:  # whatever it is, it may not end the thread unseen
                    self._set(ReaderState(_words(error)))
                    self._close_source()
                    is_open = False
                    self._ending.wait(self._backoff.wait(failures))
                    failures += 1
        finally:
            self._close_source()

    def _drain(self) -> bool:
        """Grab one picture; False if none came. Only a picture proves that a source works again."""
        picture = self._source.grab(_GRAB_S)
        if picture is None:
            return False
        with self._arrived:
            # Capture times only go forward: an estimate that steps back would pair a picture twice.
            if picture.at > self._newest_at():
                self._mailbox.append(picture)
            self._set(ReaderState())
        return True

    def _set(self, state: ReaderState) -> None:
        with self._arrived:
            self._state = state
            self._arrived.notify_all()

    def _close_source(self) -> None:
        with suppress(OSError):
            self._source.close()


def wait_all_newer(readers: tuple[Reader, ...], since: tuple[float, ...], timeout: float) -> bool:
    """Wait until every reader has a picture captured after its time in `since`, `timeout` seconds in all."""
    until = time.monotonic() + timeout
    return all(
        reader.wait_newer(at, max(0.0, until - time.monotonic()))
        for reader, at in zip(readers, since, strict=True)
    )


def _words(error: Exception) -> str:
    return str(error) if isinstance(error, DeviceError) else f"{type(error).__name__}: {error}"
