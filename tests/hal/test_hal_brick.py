"""The client matches answers to questions, and says what went wrong."""

from __future__ import annotations

import threading
import time
from collections import deque

import pytest

from robot.hal.interfaces import DeviceError
from robot.hal.links import MemoryLink
from robot.hal.nxt.brick import Brick, ReplyTimeoutError
from robot.hal.nxt.replies import ProtocolError, StatusError

BATTERY = bytes.fromhex("020b00401f")
KEEP_ALIVE = bytes.fromhex("020d0000000000")


class Scripted:
    """A link that answers each telegram with what the test says; '' is silence."""

    def __init__(self, *answers: list[bytes]) -> None:
        self.sent: list[bytes] = []
        self.waiting: deque[bytes] = deque()
        self._answers = deque(answers)

    def write(self, telegram: bytes) -> None:
        self.sent.append(telegram)
        if self._answers:
            self.waiting.extend(self._answers.popleft())

    def read(self, timeout: float) -> bytes | None:
        return self.waiting.popleft() if self.waiting else None

    def close(self) -> None:
        pass


def test_a_foreign_reply_is_passed_over() -> None:
    assert Brick(Scripted([KEEP_ALIVE, BATTERY])).battery_mv() == 8000


def test_an_answer_that_comes_too_late_does_not_answer_the_next_question() -> None:
    link = Scripted([], [bytes.fromhex("020b00581b")])
    brick = Brick(link)
    with pytest.raises(ReplyTimeoutError, match="GETBATTERYLEVEL"):
        brick.battery_mv()
    link.waiting.append(BATTERY)  # the late one
    assert brick.battery_mv() == 7000


def test_only_foreign_replies_are_an_error_of_the_protocol() -> None:
    with pytest.raises(ProtocolError, match="GETBATTERYLEVEL"):
        Brick(Scripted([KEEP_ALIVE])).battery_mv()


def test_endless_noise_does_not_hold_the_caller() -> None:
    link = Scripted([KEEP_ALIVE] * 100)
    with pytest.raises(ProtocolError):
        Brick(link).battery_mv()
    assert len(link.waiting) > 90


def test_every_error_is_a_device_error() -> None:
    for error in (ReplyTimeoutError, ProtocolError, StatusError):
        assert issubclass(error, DeviceError)
    assert issubclass(DeviceError, OSError)


def test_stop_program_tells_whether_one_ran() -> None:
    assert Brick(Scripted([bytes.fromhex("020100")])).stop_program()
    assert not Brick(Scripted([bytes.fromhex("0201ec")])).stop_program()
    with pytest.raises(StatusError):
        Brick(Scripted([bytes.fromhex("0201ff")])).stop_program()


def test_motor_commands_ask_for_no_reply() -> None:
    link = Scripted()
    brick = Brick(link)
    brick.drive(1, -50, 90)
    brick.hold(1)
    brick.hold_all()
    brick.coast(2)
    assert [telegram[0] for telegram in link.sent] == [0x80] * 4
    assert link.sent[0] == bytes.fromhex("80 04 01 ce 07 01 00 20 5a000000")
    assert link.sent[2] == bytes.fromhex("80 04 ff 00 07 01 00 20 00000000")


def test_a_drive_without_limit_is_refused() -> None:
    with pytest.raises(ValueError, match=r"for ?ever"):
        Brick(Scripted()).drive(1, 50, 0)


def test_ultrasonic_transaction() -> None:
    link = Scripted(
        [bytes.fromhex("020f00")],
        [bytes.fromhex("020e2000")],
        [bytes.fromhex("020e0001")],
        [bytes.fromhex("02100001 2a" + "00" * 15)],
    )
    brick = Brick(link)
    brick.ls_write(3, b"\x02\x42", 1)
    assert brick.ls_ready_bytes(3) is None
    assert brick.ls_ready_bytes(3) == 1
    assert brick.ls_read(3) == b"\x2a"


def test_a_cut_link_is_an_error_at_once() -> None:
    link = MemoryLink(lambda telegram: BATTERY)
    brick = Brick(link)
    brick.close()
    brick.close()
    with pytest.raises(OSError, match="down"):
        brick.battery_mv()


# ------------------------------------------------------------------------------ shared, timed, bounded


def test_the_last_driver_that_releases_it_closes_the_link() -> None:
    link = MemoryLink(lambda telegram: BATTERY)
    brick = Brick(link)
    brick.retain()
    brick.retain()
    brick.release()
    assert brick.battery_mv() == 8000
    brick.release()
    assert link.cut


def test_exchanges_of_several_threads_never_mix() -> None:
    class Half:
        """A link on which a second question before the first answer is a mistake."""

        def __init__(self) -> None:
            self.waiting: bytes | None = None
            self.mixed = False

        def write(self, telegram: bytes) -> None:
            self.mixed |= self.waiting is not None
            if telegram[0] == 0x00:
                time.sleep(0)
                self.waiting = BATTERY if telegram[1] == 0x0B else KEEP_ALIVE

        def read(self, timeout: float) -> bytes | None:
            time.sleep(0.0002)
            reply, self.waiting = self.waiting, None
            return reply

        def close(self) -> None:
            pass

    link = Half()
    brick = Brick(link)
    wrong: list[object] = []

    def work(ask, answer) -> None:  # type: ignore[no-untyped-def]
        for _ in range(50):
            value = ask()
            if value != answer:
                wrong.append(value)
            brick.hold_all()

    threads = [
        threading.Thread(target=work, args=args)
        for args in ((brick.battery_mv, 8000), (brick.keep_alive, 0), (brick.battery_mv, 8000))
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=20)
    assert not any(thread.is_alive() for thread in threads)
    assert wrong == []
    assert not link.mixed


def test_a_trickle_of_foreign_telegrams_does_not_outlast_the_time_out() -> None:
    now = [0.0]
    waits: list[float] = []

    class Trickle(Scripted):
        def read(self, timeout: float) -> bytes | None:
            if timeout > 0:
                waits.append(timeout)
                now[0] += 0.04
            return KEEP_ALIVE if timeout > 0 else None

    with pytest.raises(ProtocolError):
        Brick(Trickle(), 0.1, lambda: now[0]).battery_mv()
    assert waits == pytest.approx([0.1, 0.06, 0.02])


def test_exchanges_are_measured() -> None:
    now = [0.0]

    class Slow(Scripted):
        def read(self, timeout: float) -> bytes | None:
            if self.waiting:
                now[0] += 0.03
            return super().read(timeout)

    brick = Brick(Slow(*[[BATTERY]] * 3), 0.1, lambda: now[0])
    assert brick.times.median_s is None
    for _ in range(3):
        brick.battery_mv()
    assert brick.times.median_s == pytest.approx(0.03)


def test_a_link_that_is_down_is_opened_again_by_the_next_question() -> None:
    class Down(Scripted):
        up = False

        def write(self, telegram: bytes) -> None:
            self.up = True
            super().write(telegram)

        def read(self, timeout: float) -> bytes | None:
            if not self.up:
                raise DeviceError("the link is down")
            return super().read(timeout)

    assert Brick(Down([BATTERY])).battery_mv() == 8000
