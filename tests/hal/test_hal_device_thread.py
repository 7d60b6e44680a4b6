"""Workers in threads: nothing a device does holds up the loop, and nothing is lost that must not be."""

from __future__ import annotations

import threading

import pytest

from robot.clock import MonotonicClock, SteppedClock
from robot.hal.device_thread import DeviceThread, Inline
from robot.hal.kinematics import limited
from robot.hal.mock import MockBase, MockTeleop
from robot.hal.mock.base import DEFAULT_LIMITS, DEFAULT_WHEELS
from robot.hal.threaded import ThreadedBase, ThreadedTeleop, decisive
from robot.messages import Odometry, TeleopInput, Twist

SOON = 5.0


def limit(twist: Twist) -> Twist:
    return limited(twist, DEFAULT_LIMITS, DEFAULT_WHEELS)


class HangingBase(MockBase):
    """A base whose link hangs inside `read` until it is let go."""

    def __init__(self) -> None:
        super().__init__()
        self.hangs = threading.Event()
        self.let_go = threading.Event()

    def read(self, now: float) -> Odometry:
        if self.hangs.is_set():
            self.let_go.wait(SOON)
        return super().read(now)


def test_a_worker_works_by_itself_and_at_once_when_woken() -> None:
    worked = threading.Semaphore(0)
    thread = DeviceThread("test", MonotonicClock(), period_s=60.0)
    thread.start(lambda now: worked.release())
    assert worked.acquire(timeout=SOON)
    thread.wake()
    assert worked.acquire(timeout=SOON)
    thread.end(lambda now: worked.release())
    assert worked.acquire(timeout=SOON)


def test_a_hanging_driver_is_told_and_holds_nobody() -> None:
    base = HangingBase()
    clock = MonotonicClock()
    threaded = ThreadedBase(base, DeviceThread("base", clock, 0.001, deadline_s=0.02), limit)
    base.hangs.set()
    deadline = clock.now() + SOON
    while not threaded.faults(clock.now()):
        assert clock.now() < deadline
    assert {fault.key for fault in threaded.faults(clock.now())} == {"base.link"}
    assert threaded.send(Twist(v=0.1), clock.now()) == Twist()
    threaded.stop(clock.now())
    begun = clock.now()
    threaded.close()
    assert clock.now() - begun < 1.0
    base.let_go.set()


def test_a_mistake_of_the_driver_is_a_fault_not_the_end() -> None:
    class Mistaken(MockBase):
        def read(self, now: float) -> Odometry:
            raise ZeroDivisionError("a mistake")

    clock = MonotonicClock()
    threaded = ThreadedBase(Mistaken(), DeviceThread("base", clock, 0.001), limit)
    deadline = clock.now() + SOON
    while not threaded.faults(clock.now()):
        assert clock.now() < deadline
    (fault,) = threaded.faults(clock.now())
    assert fault.key == "driver.error"
    assert "a mistake" in fault.evidence
    threaded.close()


def test_a_stop_is_done_before_the_command_that_follows_it() -> None:
    base, clock = MockBase(), SteppedClock()
    worker = Inline(clock)
    threaded = ThreadedBase(base, worker, limit)
    held = threaded._worker  # the mailbox alone: nothing is done until the worker wakes
    threaded._worker = type("Asleep", (), {"wake": lambda self: None, "faults": lambda *a: ()})()
    threaded.send(Twist(v=0.2), 0.0)
    threaded.stop(0.0)
    threaded.send(Twist(v=0.1), 0.0)
    threaded._worker = held
    base.calls.clear()
    worker.wake()
    assert [call.method for call in base.calls][:2] == ["stop", "send"]
    assert base.calls[1].args == (Twist(v=0.1),)


def test_a_command_that_is_not_renewed_is_ended_by_a_stop() -> None:
    base, clock = MockBase(), SteppedClock()
    worker = Inline(clock)
    threaded = ThreadedBase(base, worker, limit, command_life_s=0.2)
    threaded.send(Twist(v=0.2), clock.now())
    for _ in range(10):
        clock.step()
        worker.wake()
    sent = [call for call in base.calls if call.method == "send"]
    stopped = [call for call in base.calls if call.method == "stop"]
    assert max(call.now for call in sent) <= 0.2
    assert len(stopped) == 1
    assert 0.2 < stopped[0].now <= 0.24 + 1e-9


def test_no_decisive_word_is_lost_between_two_looks() -> None:
    link, clock = MockTeleop(), SteppedClock(0.01)
    worker = Inline(clock)
    teleop = ThreadedTeleop(link, worker)
    for word in (TeleopInput(0.01, v=0.5), TeleopInput(0.02, stop=True), TeleopInput(0.03, v=0.4)):
        link.say(word)
    for _ in range(4):
        clock.step()
        worker.wake()
    assert teleop.latest(clock.now()) == TeleopInput(0.02, stop=True)
    assert teleop.latest(clock.now()) == TeleopInput(0.02, stop=True)


def test_a_stop_goes_to_the_wheels_without_waiting_for_the_loop() -> None:
    link, clock = MockTeleop(), SteppedClock(0.01)
    worker = Inline(clock)
    stopped: list[float] = []
    ThreadedTeleop(link, worker, stopped.append)
    link.say(TeleopInput(0.01, v=0.5))
    link.say(TeleopInput(0.02, stop=True))
    for _ in range(4):
        clock.step()
        worker.wake()
    assert stopped == [0.02]


@pytest.mark.parametrize(
    ("words", "which"),
    [
        ([TeleopInput(1.0), TeleopInput(1.1, v=0.2)], 1),
        ([TeleopInput(1.0, take=True), TeleopInput(1.1)], 0),
        ([TeleopInput(1.0, stop=True), TeleopInput(1.1, take=True)], 0),
    ],
)
def test_what_decides(words: list[TeleopInput], which: int) -> None:
    assert decisive(words) is words[which]
