"""A brick behind a link: one method a command, replies matched to requests, refusals as errors."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Final, TypeVar

from robot.hal.interfaces import DeviceError
from robot.hal.links import Link
from robot.hal.nxt import lcp
from robot.hal.nxt.pace import ExchangeTimes
from robot.hal.nxt.replies import (
    DeviceInfo,
    InputValues,
    OutputState,
    ProtocolError,
    Status,
    StatusError,
    Version,
)

R = TypeVar("R")

# More foreign telegrams than this before the reply: the two ends do not talk of the same thing.
_MOST_FOREIGN: Final = 4


class ReplyTimeoutError(DeviceError):
    """The brick did not answer in time."""


class Brick:
    """Client of one NXT brick, shared by the drivers of all that is plugged into it.

    Every method may raise DeviceError (an OSError): the link's own, `ReplyTimeoutError`, `ProtocolError` or
    `StatusError`. Motor commands are sent without asking for a reply, so that they cost one telegram and
    nobody waits; whether they were obeyed is seen in the next `output_state`.

    Each exchange is one piece: drivers in several threads wait for each other, so nobody waits for longer
    than the exchange under way and his own. Each driver calls `retain` when it begins and `release` at its
    end; the last one's closes the link. `close` closes it at once.

    reply_timeout: seconds to wait for one answer. At most four foreign ones (a late answer to a request that
    timed out) are passed over meanwhile. clock: seconds, to measure exchanges with (`times`) and to keep the
    time-out when telegrams trickle in: time.monotonic on a real link; without one exchanges take no time,
    which is true in lockstep.

    >>> from robot.hal.links import MemoryLink
    >>> Brick(MemoryLink(lambda telegram: bytes.fromhex("020b00b81e"))).battery_mv()
    7864
    """

    def __init__(
        self, link: Link, reply_timeout: float = 0.1, clock: Callable[[], float] | None = None
    ) -> None:
        self._link = link
        self._reply_timeout = reply_timeout
        self._clock = clock or (lambda: 0.0)
        self._lock = threading.Lock()
        self._users = 0
        self.times = ExchangeTimes()
        """How long exchanges took."""
        # Answers to somebody else's questions may wait in the link.
        self._stale = True

    def seconds(self) -> float:
        """The measuring clock's time, 0 without one: to tell how long a call took."""
        return self._clock()

    # ------------------------------------------------------------------------------------------ motors

    def drive(self, port: int, power: int, limit_deg: int) -> None:
        """Run one motor speed-regulated; limit_deg >= 1 is added to its target (0 would mean forever)."""
        if limit_deg < 1:
            raise ValueError(f"limit_deg {limit_deg} would run forever: it must be at least 1")
        mode = lcp.Mode.ON | lcp.Mode.BRAKE | lcp.Mode.REGULATED
        self._tell(lcp.set_output_state(port, power, mode, lcp.Regulation.SPEED, limit_deg))

    def hold(self, port: int) -> None:
        """Brake one motor and keep its position."""
        self._tell(lcp.hold(port))

    def hold_all(self) -> None:
        """Brake all three motors and keep their positions: the stop."""
        self._tell(lcp.hold(lcp.ALL_PORTS))

    def coast(self, port: int) -> None:
        """Let one motor go."""
        self._tell(lcp.coast(port))

    def output_state(self, port: int) -> OutputState:
        """Power, mode and counters of one motor."""
        return self._ask(lcp.get_output_state(port))

    def reset_count(self, port: int) -> None:
        """Zero the tacho count and the cumulative target of one motor (waits for the reply)."""
        self._ask(lcp.reset_count(port))

    def reset_motor_position(self, port: int, relative: bool) -> None:
        """Zero the block counter (relative) or the rotation counter of one motor."""
        self._ask(lcp.reset_motor_position(port, relative))

    # ------------------------------------------------------------------------------------------- brick

    def version(self) -> Version:
        """Protocol and firmware version."""
        return self._ask(lcp.get_version())

    def device_info(self) -> DeviceInfo:
        """Name, Bluetooth address, signal, free flash."""
        return self._ask(lcp.get_device_info())

    def battery_mv(self) -> int:
        """Battery voltage in millivolts."""
        return self._ask(lcp.get_battery_level())

    def keep_alive(self) -> int:
        """Restart the auto-off timer; returns its length in milliseconds, 0 for never."""
        return self._ask(lcp.keep_alive())

    def stop_program(self) -> bool:
        """Stop the program on the brick; False if none ran. Motors run on."""
        try:
            self._ask(lcp.stop_program())
        except StatusError as refusal:
            if refusal.status == Status.NO_PROGRAM:
                return False
            raise
        return True

    def play_tone(self, hertz: int, duration_ms: int) -> None:
        """Beep."""
        self._tell(lcp.play_tone(hertz, duration_ms))

    # ----------------------------------------------------------------------------------------- sensors

    def set_input_mode(self, port: int, sensor_type: int, sensor_mode: int) -> None:
        """Say which sensor sits on input 0-3 (waits for the reply)."""
        self._ask(lcp.set_input_mode(port, sensor_type, sensor_mode))

    def input_values(self, port: int) -> InputValues:
        """Reading of input 0-3; trust `scaled` only if `valid`."""
        return self._ask(lcp.get_input_values(port))

    def ls_write(self, port: int, data: bytes, reply_bytes: int) -> None:
        """Start a transaction on the sensor bus; whether it went well `ls_ready_bytes` tells."""
        self._tell(lcp.ls_write(port, data, reply_bytes))

    def ls_ready_bytes(self, port: int) -> int | None:
        """How many bytes the sensor answered, None while it has not yet."""
        try:
            return self._ask(lcp.ls_get_status(port))
        except StatusError as refusal:
            if refusal.status == Status.PENDING:
                return None
            raise

    def ls_read(self, port: int) -> bytes:
        """The sensor's answer."""
        return self._ask(lcp.ls_read(port))

    # ------------------------------------------------------------------------------------------ within

    def retain(self) -> None:
        """One driver more uses this brick."""
        with self._lock:
            self._users += 1

    def release(self) -> None:
        """A driver is done; the last one's release closes the link."""
        with self._lock:
            self._users -= 1
            last = self._users <= 0
        if last:
            self.close()

    def close(self) -> None:
        """Release the link, whoever uses it. May be called twice."""
        with self._lock:
            self._link.close()

    def _tell(self, request: lcp.Request[None]) -> None:
        with self._lock:
            self._link.write(request.silent)

    def _ask(self, request: lcp.Request[R]) -> R:
        with self._lock:
            began = self._clock()
            if self._stale:
                self._drain()
            self._link.write(request.telegram)
            self._stale = True
            try:
                value = self._answer_to(request)
            except StatusError:
                self.times.took(self._clock() - began)
                raise
            self.times.took(self._clock() - began)
            return value

    def _answer_to(self, request: lcp.Request[R]) -> R:
        deadline = self._clock() + self._reply_timeout
        foreign: ProtocolError | None = None
        for _ in range(_MOST_FOREIGN + 1):
            reply = self._link.read(max(0.0, deadline - self._clock()))
            if reply is None:
                break
            try:
                value = request.parse(reply)
            except StatusError:
                self._stale = False
                raise
            except ProtocolError as error:
                foreign = error
            else:
                self._stale = False
                return value
        raise foreign or ReplyTimeoutError(f"no answer to {request.name} within {self._reply_timeout:.2f} s")

    def _drain(self) -> None:
        """Throw away answers that came after their time-out: they would answer the wrong question."""
        # A link that breaks meanwhile is mended, or complains, when the question is written.
        with suppress(OSError):
            for _ in range(_MOST_FOREIGN):
                if self._link.read(0.0) is None:
                    return
