"""Devices behind workers: same interfaces, but nothing here ever waits for a wire.

Writing leaves the newest command in a mailbox and wakes the worker; reading returns what the worker brought
last. A command that was not renewed within its life is not sent any more, whatever state the loop is in. A
stop is never overwritten by a later command: the worker does it first.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from robot.hal.device_thread import Worker
from robot.hal.interfaces import Device, DriveBase, LampDevice, NearSensors, PanTilt, TeleopLink
from robot.messages import Fault, HeadPose, Near, Odometry, TeleopInput, Twist

T = TypeVar("T")
_MOST_WORDS: Final = 64


@dataclass(frozen=True, slots=True)
class _Posted(Generic[T]):
    """A command and when it was given."""

    value: T
    at: float


class _Threaded:
    """What all have in common: the driver's faults as last told, the worker's own, a safe end."""

    def __init__(self, name: str, driver: Device, worker: Worker) -> None:
        self._name = name
        self._driver = driver
        self._worker = worker
        self._told: tuple[Fault, ...] = ()
        self._closed = False

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What the driver told last and, while its worker hangs, that."""
        return self._told + self._worker.faults(self._name, now)

    def close(self) -> None:
        """Leave the device safe, from its own thread. May be called twice."""
        self._closed = True
        self._worker.end(lambda now: self._driver.close())

    def _broken(self, now: float) -> bool:
        return self._closed or any(
            fault.kind == "link" or fault.device == "driver" for fault in self.faults(now)
        )


class ThreadedBase(_Threaded):
    """A drive base. limit: what the driver would make of a twist, without asking it.

    command_life_s: a twist older than this drives no more: the wheels are stopped.
    """

    def __init__(
        self, driver: DriveBase, worker: Worker, limit: Callable[[Twist], Twist], command_life_s: float = 0.2
    ) -> None:
        super().__init__("base", driver, worker)
        self._base = driver
        self._limit = limit
        self._command_life_s = command_life_s
        self._order: _Posted[Twist] | None = None
        self._taken: _Posted[Twist] | None = None
        self._stop: float | None = None
        self._odometry = Odometry()
        self._volts: float | None = None
        worker.start(self._exchange)

    def send(self, twist: Twist, now: float) -> Twist:
        """Leave the twist for the worker; returns it after the limits, no motion while the base is broken."""
        self._order = _Posted(twist, now)
        self._worker.wake()
        return Twist() if self._broken(now) else self._limit(twist)

    def stop(self, now: float) -> None:
        """Let the worker stop before anything else."""
        self._order = None
        self._stop = now
        self._worker.wake()

    def read(self, now: float) -> Odometry:
        """Pose and speed as last read; `at` says when."""
        return self._odometry

    def battery_volts(self) -> float | None:
        """Battery voltage as last read."""
        return self._volts

    def _exchange(self, now: float) -> None:
        """In the worker: stop, then drive, then ask."""
        stop, self._stop = self._stop, None
        if stop is not None:
            self._base.stop(now)
        self._drive(now)
        self._odometry = self._base.read(now)
        self._volts = self._base.battery_volts()
        self._told = self._base.faults(now)

    def _drive(self, now: float) -> None:
        order = self._order
        if order is None:
            return
        if now - order.at > self._command_life_s:
            if self._order is order:  # a newer one may have come meanwhile
                self._order = None
            self._base.stop(now)
            return
        if order is not self._taken and self._base.send(order.value, now) == self._limit(order.value):
            # A driver that paces its link may put an order off; then it is offered again.
            self._taken = order


class ThreadedHead(_Threaded):
    """A pan-tilt head. limit: the pose within the head's limits."""

    def __init__(self, driver: PanTilt, worker: Worker, limit: Callable[[HeadPose], HeadPose]) -> None:
        super().__init__("head", driver, worker)
        self._head = driver
        self._limit = limit
        self._wanted: HeadPose | None = None
        self._pose = _Posted(HeadPose(), 0.0)
        worker.start(self._exchange)

    def send(self, pose: HeadPose, now: float) -> HeadPose:
        """Leave the pose for the worker; returns it within the limits."""
        wanted = self._limit(pose)
        if not self._broken(now):
            self._wanted = wanted
            self._worker.wake()
        return self._wanted or self._pose.value

    def read(self, now: float) -> HeadPose:
        """The pose as last read; `read_at` says when."""
        return self._pose.value

    @property
    def read_at(self) -> float:
        """When the pose was read."""
        return self._pose.at

    def _exchange(self, now: float) -> None:
        wanted = self._wanted
        if wanted is not None:
            self._head.send(wanted, now)
        self._pose = _Posted(self._head.read(now), now)
        self._told = self._head.faults(now)


class ThreadedLamp(_Threaded):
    """A lamp. Its level is written when it changes, and again now and then."""

    def __init__(self, driver: LampDevice, worker: Worker) -> None:
        super().__init__("lamp", driver, worker)
        self._lamp = driver
        self._wanted = 0.0
        self._level = 0.0
        worker.start(self._exchange)

    def send(self, level: float, now: float) -> float:
        """Leave the level for the worker; returns what the lamp last took while it is broken."""
        wanted = min(max(level, 0.0), 1.0) if level == level else self._wanted
        if wanted != self._wanted:
            self._wanted = wanted
            self._worker.wake()
        return self._level if self._broken(now) else wanted

    def close(self) -> None:
        """The driver leaves it dark."""
        super().close()
        self._level = 0.0

    def _exchange(self, now: float) -> None:
        self._level = self._lamp.send(self._wanted, now)
        self._told = self._lamp.faults(now)


class ThreadedNear(_Threaded):
    """Bumper and sonar."""

    def __init__(self, driver: NearSensors, worker: Worker) -> None:
        super().__init__("near", driver, worker)
        self._near = driver
        self._reading = Near(at=0.0)
        worker.start(self._exchange)

    def read(self, now: float) -> Near:
        """As last read."""
        return self._reading

    def _exchange(self, now: float) -> None:
        self._reading = self._near.read(now)
        self._told = self._near.faults(now)


class ThreadedTeleop(_Threaded):
    """A person's link. Words that came between two looks are not lost: what decides is kept.

    stop: called at once, from the worker, when the person says stop; the loop hears of it at its next tick.
    """

    def __init__(
        self, driver: TeleopLink, worker: Worker, stop: Callable[[float], None] | None = None
    ) -> None:
        super().__init__("teleop", driver, worker)
        self._stop = stop
        self._link = driver
        self._words: deque[TeleopInput] = deque(maxlen=_MOST_WORDS)
        self._heard_at = -1.0
        self._newest: TeleopInput | None = None
        self._line: str | None = None
        worker.start(self._exchange)

    def latest(self, now: float) -> TeleopInput | None:
        """The newest word; if a stop, take, release or arm came since the last look, that one."""
        words = [self._words.popleft() for _ in range(len(self._words))]
        if words:
            self._newest = decisive(words)
        return self._newest

    def tell(self, line: str, now: float) -> None:
        """Leave the line for the worker; a newer one replaces it."""
        self._line = line

    def _exchange(self, now: float) -> None:
        word = self._link.latest(now)
        if word is not None and word.at > self._heard_at:
            self._heard_at = word.at
            self._words.append(word)
            if word.stop and self._stop is not None:
                self._stop(now)
        line, self._line = self._line, None
        if line is not None:
            self._link.tell(line, now)
        self._told = self._link.faults(now)


def decisive(words: list[TeleopInput]) -> TeleopInput:
    """The word to act on out of several, oldest first: a stop, else the newest that asks for something.

    >>> decisive([TeleopInput(at=1.0, stop=True), TeleopInput(at=1.1, v=0.5)]).stop
    True
    """
    for wanted in (
        [word for word in words if word.stop],
        [word for word in words if word.take or word.release or word.arm],
    ):
        if wanted:
            return wanted[-1]
    return words[-1]
