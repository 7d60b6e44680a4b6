"""Rigs of devices behind workers. The work is done inline, so that one stepped clock rules everything."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rig import MockRig, Rig
from rigs_base import NxtRig

from robot.config import Base
from robot.hal.device_thread import Inline
from robot.hal.factory import nxt_settings
from robot.hal.head_limits import DEFAULT_LIMITS as HEAD_LIMITS
from robot.hal.kinematics import limited
from robot.hal.mock import MockArm, MockBase, MockHead, MockLamp, MockTeleop
from robot.hal.mock.base import DEFAULT_LIMITS, DEFAULT_WHEELS
from robot.hal.nxt.settings import USB
from robot.hal.threaded import ThreadedBase, ThreadedHead, ThreadedLamp, ThreadedTeleop
from robot.hal.threaded_arm import ThreadedArm
from robot.messages import TeleopInput


class RigClock:
    """A rig's time as a clock."""

    def __init__(self, rig: Rig[Any]) -> None:
        self._rig = rig

    def now(self) -> float:
        """The rig's time."""
        return self._rig.now


class ThreadedRig(Rig[Any]):
    """A rig whose device is put behind a worker, which works when it is woken and once a tick."""

    def __init__(self, inner: Rig[Any], behind: Callable[[Any, Inline], Any]) -> None:
        self._inner = inner
        self._worker = Inline(RigClock(inner))
        self.motors = getattr(inner, "motors", ())
        super().__init__(behind(inner.device, self._worker))

    def wait(self, seconds: float) -> None:
        """Time passes for the far end; the worker goes on working."""
        for _ in range(max(1, round(seconds / 0.04))):
            self._inner.wait(min(seconds, 0.04))
            self._worker.wake()
        self.now = self._inner.now

    def break_down(self) -> None:
        """Let the far end fail."""
        self._inner.break_down()
        self._worker.wake()

    def mend(self) -> None:
        """Let the far end work again."""
        self._inner.mend()
        self._worker.wake()


def _base(driver: Any, worker: Inline) -> ThreadedBase:
    return ThreadedBase(driver, worker, lambda twist: limited(twist, DEFAULT_LIMITS, DEFAULT_WHEELS))


def _script() -> list[TeleopInput]:
    return [TeleopInput(at=0.2 * index, v=0.1 * index) for index in range(5)]


ARM = ("enable", "move_joints", "move_linear", "limit_speed", "grip", "stop", "read")
MAKERS = {
    "base": {
        "threaded mock": lambda folder: ThreadedRig(MockRig(MockBase(), ("send", "stop", "read")), _base),
        "threaded nxt": lambda folder: ThreadedRig(NxtRig(nxt_settings(Base(), USB)), _base),
    },
    "head": {
        "threaded mock": lambda folder: ThreadedRig(
            MockRig(MockHead(), ("send", "read")),
            lambda driver, worker: ThreadedHead(driver, worker, HEAD_LIMITS.applied),
        )
    },
    "lamp": {"threaded mock": lambda folder: ThreadedRig(MockRig(MockLamp(), ("send",)), ThreadedLamp)},
    "arm": {"threaded mock": lambda folder: ThreadedRig(MockRig(MockArm(), ARM), ThreadedArm)},
    "teleop": {
        "threaded mock": lambda folder: ThreadedRig(
            MockRig(MockTeleop(_script()), ("latest", "tell")), ThreadedTeleop
        )
    },
}
