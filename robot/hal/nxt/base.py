"""The drive base on an NXT brick: twists to regulated motors under a dead-man, encoders to odometry."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from robot.hal.backoff import Backoff
from robot.hal.faultbook import FaultBook
from robot.hal.interfaces import DeviceError
from robot.hal.kinematics import limited
from robot.hal.nxt.battery import BatteryWatch
from robot.hal.nxt.brick import Brick, ReplyTimeoutError
from robot.hal.nxt.odometry import WheelOdometry
from robot.hal.nxt.pace import RateMeter
from robot.hal.nxt.replies import ProtocolError, StatusError
from robot.hal.nxt.settings import RETRY_GROWTH, USB, NxtSettings
from robot.hal.nxt.stall_notice import StallNotice
from robot.hal.nxt.takeover import check_firmware, zero_motors
from robot.hal.nxt.wheel import Wheel
from robot.messages import Fault, Odometry, Twist

# A brick that was switched off and on counts from zero: a longer way than this is not driven unseen.
_MOST_UNSEEN_DEG: Final = 720.0
_LOW_TONE_HZ: Final = 440
_LOW_TONE_MS: Final = 300
# Slower than this the motor regulator has nothing to count: the wheel is held.
_SLOWEST_DEG_S: Final = 1.0
_EPSILON_S: Final = 1e-6


class NxtBase:
    """`DriveBase` on a brick (rules: robot/hal/interfaces.py). Each tick `read`, then `send` or `stop`.

    The brick may be shared with other drivers, also in other threads; the base itself belongs to one thread.
    Opening stops what runs on the brick and zeroes the wheels' counts. Raises DeviceError with the cure if
    the brick does not answer or its firmware cannot zero the motors' targets, which the dead-man needs. The
    brick is released then.

    Faults: `link` (no answer; tried again by itself), `stranded` besides, if a commanded wheel did not turn
    when the link broke: it may push on without end, only the brick's switch stops it, `refused` (the brick
    answers with an error), `stall` (a wheel is commanded and does not turn: both are held, and nothing is
    driven until a stop or a zero twist acknowledged it and `stall_told_s` are over), `battery_low` (the
    brick beeps once), `battery_empty`.
    """

    def __init__(self, brick: Brick, settings: NxtSettings = USB) -> None:
        self._brick = brick
        self._settings = settings
        self._left = Wheel(settings.left_port, settings.wheel)
        self._right = Wheel(settings.right_port, settings.wheel)
        self._in_turn: deque[Wheel] = deque([self._left, self._right])
        self._odometry = WheelOdometry(settings.wheels)
        self._faults = FaultBook("base")
        self._battery = BatteryWatch(settings.battery_low_mv, settings.battery_empty_mv, self._faults)
        self._backoff = Backoff(settings.retry_s, settings.retry_most_s, RETRY_GROWTH)
        self._rate = RateMeter()
        self._sent = Twist()
        self._renewed_at = self._sent_at = self._polled_at = -math.inf
        self._battery_due = self._keep_alive_due = -math.inf
        self._heard_at: float | None = None
        self._stall = StallNotice(settings.stall_told_s)
        self._unheld: tuple[str, ...] = ()  # stalled wheels whose hold the brick has not been heard after
        self._asked_again = False
        self._closed = False
        brick.retain()
        try:
            check_firmware(brick)
            self._take_over()
            self._battery.millivolts = brick.battery_mv()
        except OSError as error:
            brick.release()
            raise DeviceError(f"the brick cannot be used: {error}") from error

    # ----------------------------------------------------------------------------------- what it is told

    def send(self, twist: Twist, now: float) -> Twist:
        """Drive like this for one pulse; returns the twist really asked for.

        Too fast a twist is scaled as a whole, so that the curve keeps its shape. The zero twist brakes and
        holds. While a fault keeps the base from driving the zero twist is returned.
        """
        wanted = limited(twist, self._settings.limits, self._settings.wheels)
        if wanted.is_zero:
            self._stall.acknowledge()
            if self._is_driving:
                self._hold(now)
            return Twist()
        if not self._can_drive(now):
            return Twist()
        self._sent_at = now
        if self._is_driving and now - self._renewed_at < self._period_s - _EPSILON_S:
            return self._sent
        try:
            self._drive(wanted, now)
        except OSError as error:
            self._failed(error, now)
            self._hold(now)  # the other wheel may have been told
            return Twist()
        self._renewed_at = now
        self._sent = wanted
        return wanted

    def stop(self, now: float) -> None:
        """Brake and hold at once (`hold_ports`: all three motors); written every time it is called."""
        self._stall.acknowledge()
        if not self._closed and "link" not in self._faults:
            self._hold(now)

    def close(self) -> None:
        """Stop the motors, also if others still use the brick, and release it."""
        if self._closed:
            return
        self._hold(self._polled_at)
        self._closed = True
        self._brick.release()

    # -------------------------------------------------------------------------------------- what it tells

    def read(self, now: float) -> Odometry:
        """Poll the brick (at most once) and return pose and speed; the last known ones while it is silent."""
        if self._closed:
            return self._odometry.value
        if self._heard_at is None:
            self._heard_at = now
        if "link" in self._faults:
            self._try_again(now)
        elif now - self._polled_at >= self._period_s - _EPSILON_S:
            self._expire(now)
            self._poll(now)
        return self._odometry.value

    def battery_volts(self) -> float | None:
        """Battery voltage as last read."""
        millivolts = self._battery.millivolts
        return None if millivolts is None else millivolts / 1000

    @property
    def measured_rate_hz(self) -> float | None:
        """How often the wheels were read lately; None while nothing answers."""
        return None if "link" in self._faults else self._rate.rate_hz(self._polled_at)

    @property
    def exchange_s(self) -> float | None:
        """Median time of an exchange with the brick; None before the first."""
        return self._brick.times.median_s

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong."""
        if self._stall.over(now):
            self._faults.cleared("stall")
        return self._faults.open

    # ------------------------------------------------------------------------------------------- driving

    @property
    def _period_s(self) -> float:
        return self._settings.pace.period(self._brick.times.median_s, self._settings.motors_per_read)

    @property
    def _wheels(self) -> tuple[tuple[str, Wheel], ...]:
        return ("left", self._left), ("right", self._right)

    @property
    def _is_driving(self) -> bool:
        return not (self._left.is_held and self._right.is_held)

    def _can_drive(self, now: float) -> bool:
        self.faults(now)
        return not (self._closed or "link" in self._faults or "stall" in self._faults)

    def _drive(self, twist: Twist, now: float) -> None:
        left, right = self._settings.wheels.rates(twist)
        began = self._brick.seconds()
        self._turn_wheel(self._left, math.degrees(left), now)
        self._turn_wheel(self._right, math.degrees(right), now + self._brick.seconds() - began)

    def _turn_wheel(self, wheel: Wheel, rate: float, now: float) -> None:
        if abs(rate) < _SLOWEST_DEG_S:
            if not wheel.is_held:
                self._brick.hold(wheel.port)
                wheel.held()
            return
        if wheel.rate * rate < 0:
            self._brick.hold(wheel.port)
        order = wheel.order(rate, now)
        if order is None:
            return
        began = self._brick.seconds()
        if order.anew:
            self._brick.reset_count(wheel.port)
        self._brick.drive(wheel.port, wheel.settings.forward * order.power, order.limit)
        on_its_way = self._brick.times.median_s or 0.0
        wheel.ordered(order, now + self._brick.seconds() - began + on_its_way)

    def _hold(self, now: float) -> None:
        self._unheld += self._standing
        self._sent = Twist()
        self._left.held()
        self._right.held()
        try:
            self._hold_ports()
        except OSError as error:
            self._failed(error, now)

    def _hold_ports(self) -> None:
        for port in self._settings.hold_ports:
            self._brick.hold(port)

    def _expire(self, now: float) -> None:
        """The wheels ran out by themselves; braked they stay where they are."""
        if self._is_driving and now - self._sent_at > self._settings.wheel.pulse_s + _EPSILON_S:
            self._hold(now)

    # ------------------------------------------------------------------------------------------- polling

    def _poll(self, now: float) -> None:
        """Ask; what was answered is dated when it came, for over Bluetooth that is a tenth of a second."""
        self._polled_at = now
        began = self._brick.seconds()
        at = now
        try:
            for _ in range(self._settings.motors_per_read):
                wheel = self._in_turn[0]
                state = self._brick.output_state(wheel.port)
                at = now + self._brick.seconds() - began
                wheel.observed(state, at)
                self._next_wheel()
            self._keep_house(at)
        except OSError as error:
            self._failed(error, now)
            # If that was one lost answer, the next tick asks again at once.
            self._polled_at = -math.inf
            return
        self._rate.happened(now)
        self._heard(at)
        self._update_odometry()
        self._watch_stall(at)

    def _next_wheel(self) -> None:
        """A wheel that lags is asked twice before it is the other's turn: it may be stalling."""
        self._asked_again = self._in_turn[0].lags and not self._asked_again
        if not self._asked_again or self._settings.motors_per_read > 1:
            self._in_turn.rotate()

    def _keep_house(self, now: float) -> None:
        """Rarely one exchange more: battery, or keeping the brick awake (motor commands do not)."""
        if now >= self._battery_due:
            self._battery_due = now + self._settings.battery_period_s
            if self._battery.judge(self._brick.battery_mv(), now):
                self._brick.play_tone(_LOW_TONE_HZ, _LOW_TONE_MS)
        elif now >= self._keep_alive_due:
            self._keep_alive_due = now + self._settings.keep_alive_period_s
            self._brick.keep_alive()

    def _update_odometry(self) -> None:
        if self._left.sample is not None and self._right.sample is not None:
            self._odometry.update(self._left.sample, self._right.sample)

    def _watch_stall(self, now: float) -> None:
        stalled = [name for name, wheel in self._wheels if wheel.stalled(now)]
        if stalled:
            self._hold(now)
            self._stall.told(now)
            self._faults.raised("stall", now, f"{' and '.join(stalled)} wheel")

    @property
    def _standing(self) -> tuple[str, ...]:
        return tuple(name for name, wheel in self._wheels if wheel.stands and name not in self._unheld)

    # ---------------------------------------------------------------------------------------------- link

    def _take_over(self) -> None:
        ports = (self._left.port, self._right.port)
        zero_motors(self._brick, ports, self._settings.hold_ports)
        self._left.held()
        self._right.held()

    def _heard(self, now: float) -> None:
        self._heard_at = now
        self._unheld = ()
        self._faults.cleared("refused")

    def _failed(self, error: OSError, now: float) -> None:
        """An exchange failed: what the brick made of it nobody knows."""
        for wheel in (self._left, self._right):
            wheel.lost()
        if isinstance(error, StatusError):
            self._faults.raised("refused", now, str(error))
            return
        may_pass = isinstance(error, ReplyTimeoutError | ProtocolError)
        if may_pass and self._heard_at is not None and now - self._heard_at < self._settings.silence_s:
            return
        self._strand(now)
        self._sent = Twist()
        for wheel in (self._left, self._right):
            wheel.held()
        if "link" not in self._faults:
            self._backoff.failed(now)
        self._faults.raised("link", now, str(error))

    def _strand(self, now: float) -> None:
        """A wheel that pushed against something when the link broke never reaches its target."""
        names = self._unheld + self._standing
        if names:
            self._faults.raised("stranded", now, f"{' and '.join(names)} wheel")

    def _try_again(self, now: float) -> None:
        if not self._backoff.due(now):
            return
        try:
            self._take_over()
            states = [(wheel, self._brick.output_state(wheel.port)) for wheel in (self._left, self._right)]
        except OSError as error:
            self._backoff.failed(now)
            self._faults.raised("link", now, str(error))
            return
        if any(wheel.jumped(state, _MOST_UNSEEN_DEG) for wheel, state in states):
            self._odometry.restart()
        for wheel, state in states:
            wheel.resumed(state, now)
        self._backoff.worked()
        self._faults.cleared("link")
        self._faults.cleared("stranded")
        self._heard(now)
        self._update_odometry()
