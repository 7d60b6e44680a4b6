"""The drive base on an NXT brick: twists to regulated motors under a dead-man, encoders to odometry."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from robot.hal.faultbook import FaultBook
from robot.hal.interfaces import DeviceError
from robot.hal.kinematics import limited
from robot.hal.nxt.brick import Brick, ReplyTimeoutError
from robot.hal.nxt.odometry import WheelOdometry
from robot.hal.nxt.replies import ProtocolError, StatusError
from robot.hal.nxt.settings import USB, NxtSettings
from robot.hal.nxt.wheel import Wheel
from robot.messages import Fault, Odometry, Twist

# A brick that was switched off and on counts from zero: a longer way than this is not driven unseen.
_MOST_UNSEEN_DEG: Final = 720.0
_BATTERY_HYSTERESIS_MV: Final = 200
# Slower than this the motor regulator has nothing to count: the wheel is held.
_SLOWEST_DEG_S: Final = 1.0
_EPSILON_S: Final = 1e-6


class NxtBase:
    """`DriveBase` on a brick (rules: robot/hal/interfaces.py). Each tick `read`, then `send` or `stop`.

    Opening stops what runs on the brick and zeroes its counts. Raises DeviceError with the cure if the brick
    does not answer or its firmware cannot zero the motors' targets, which the dead-man needs. The link is
    closed then.

    Faults: `link` (no answer; tried again by itself), `refused` (the brick answers with an error), `stall` (a
    wheel is commanded and does not turn: both are held, and nothing is driven until a stop or a zero twist
    acknowledged it and `stall_told_s` are over), `battery_low`, `battery_empty`.
    """

    def __init__(self, brick: Brick, settings: NxtSettings = USB) -> None:
        self._brick = brick
        self._settings = settings
        self._left = Wheel(settings.left_port, settings.wheel)
        self._right = Wheel(settings.right_port, settings.wheel)
        self._in_turn: deque[Wheel] = deque([self._left, self._right])
        self._odometry = WheelOdometry(settings.wheels)
        self._faults = FaultBook("base")
        self._battery_mv: int | None = None
        self._sent = Twist()
        self._renewed_at = self._sent_at = self._polled_at = -math.inf
        self._battery_due = self._keep_alive_due = self._retry_at = -math.inf
        self._heard_at: float | None = None
        self._stall_over_at: float | None = None
        self._closed = False
        try:
            self._open()
        except OSError as error:
            brick.close()
            raise DeviceError(f"the brick cannot be used: {error}") from error

    # ----------------------------------------------------------------------------------- what it is told

    def send(self, twist: Twist, now: float) -> Twist:
        """Drive like this for one pulse; returns the twist really asked for.

        Too fast a twist is scaled as a whole, so that the curve keeps its shape. The zero twist brakes and
        holds. While a fault keeps the base from driving the zero twist is returned.
        """
        wanted = limited(twist, self._settings.limits, self._settings.wheels)
        if wanted.is_zero:
            self._acknowledge()
            if self._is_driving:
                self._hold(now)
            return Twist()
        if not self._can_drive(now):
            return Twist()
        self._sent_at = now
        if self._is_driving and now - self._renewed_at < self._settings.exchange_period_s - _EPSILON_S:
            return self._sent
        try:
            self._drive(wanted, now)
        except OSError as error:
            self._failed(error, now)
            return Twist()
        self._renewed_at = now
        self._sent = wanted
        return wanted

    def stop(self, now: float) -> None:
        """Brake and hold all three motors at once; written every time it is called."""
        self._acknowledge()
        if not self._closed and "link" not in self._faults:
            self._hold(now)

    def close(self) -> None:
        """Stop the motors and release the link."""
        if self._closed:
            return
        self._hold(self._polled_at)
        self._closed = True
        self._brick.close()

    # -------------------------------------------------------------------------------------- what it tells

    def read(self, now: float) -> Odometry:
        """Poll the brick (at most once) and return pose and speed; the last known ones while it is silent."""
        if self._closed:
            return self._odometry.value
        if self._heard_at is None:
            self._heard_at = now
        if "link" in self._faults:
            self._try_again(now)
        elif now - self._polled_at >= self._settings.exchange_period_s - _EPSILON_S:
            self._expire(now)
            self._poll(now)
            self._watch_stall(now)
        return self._odometry.value

    def battery_volts(self) -> float | None:
        """Battery voltage as last read."""
        return None if self._battery_mv is None else self._battery_mv / 1000

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong."""
        if self._stall_over_at is not None and now >= self._stall_over_at:
            self._stall_over_at = None
            self._faults.cleared("stall")
        return self._faults.open

    # ------------------------------------------------------------------------------------------- driving

    @property
    def _is_driving(self) -> bool:
        return not (self._left.is_held and self._right.is_held)

    def _can_drive(self, now: float) -> bool:
        self.faults(now)
        return not (self._closed or "link" in self._faults or "stall" in self._faults)

    def _drive(self, twist: Twist, now: float) -> None:
        left, right = self._settings.wheels.rates(twist)
        self._turn_wheel(self._left, math.degrees(left), now)
        self._turn_wheel(self._right, math.degrees(right), now)

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
        if order.anew:
            self._brick.reset_count(wheel.port)
        self._brick.drive(wheel.port, wheel.settings.forward * order.power, order.limit)
        wheel.ordered(order, now)

    def _hold(self, now: float) -> None:
        self._sent = Twist()
        self._left.held()
        self._right.held()
        try:
            self._brick.hold_all()
        except OSError as error:
            self._failed(error, now)

    def _expire(self, now: float) -> None:
        """The wheels ran out by themselves; braked they stay where they are."""
        if self._is_driving and now - self._sent_at > self._settings.wheel.pulse_s + _EPSILON_S:
            self._hold(now)

    # ------------------------------------------------------------------------------------------- polling

    def _poll(self, now: float) -> None:
        self._polled_at = now
        try:
            for _ in range(self._settings.motors_per_read):
                wheel = self._in_turn[0]
                wheel.observed(self._brick.output_state(wheel.port), now)
                self._in_turn.rotate()
            self._keep_house(now)
        except OSError as error:
            self._failed(error, now)
            return
        self._heard(now)
        self._update_odometry()

    def _keep_house(self, now: float) -> None:
        """Rarely one exchange more: battery, or keeping the brick awake (motor commands do not)."""
        if now >= self._battery_due:
            self._battery_due = now + self._settings.battery_period_s
            self._judge_battery(self._brick.battery_mv(), now)
        elif now >= self._keep_alive_due:
            self._keep_alive_due = now + self._settings.keep_alive_period_s
            self._brick.keep_alive()

    def _judge_battery(self, millivolts: int, now: float) -> None:
        self._battery_mv = millivolts
        s = self._settings
        limits = {"battery_low": s.battery_low_mv, "battery_empty": s.battery_empty_mv}
        for kind, limit in limits.items():
            if millivolts < limit:
                self._faults.raised(kind, now, f"{millivolts / 1000:.1f} V")
            elif millivolts >= limit + _BATTERY_HYSTERESIS_MV:
                self._faults.cleared(kind)

    def _update_odometry(self) -> None:
        if self._left.sample is not None and self._right.sample is not None:
            self._odometry.update(self._left.sample, self._right.sample)

    def _watch_stall(self, now: float) -> None:
        stalled = [name for name, w in (("left", self._left), ("right", self._right)) if w.stalled(now)]
        if stalled:
            self._hold(now)
            self._stall_over_at = None
            self._faults.raised("stall", now, f"{' and '.join(stalled)} wheel")

    def _acknowledge(self) -> None:
        if "stall" in self._faults and self._stall_over_at is None:
            since = next(fault.since for fault in self._faults.open if fault.kind == "stall")
            self._stall_over_at = since + self._settings.stall_told_s

    # ---------------------------------------------------------------------------------------------- link

    def _open(self) -> None:
        version = self._brick.version()
        if version.protocol[0] != 1:
            raise DeviceError(f"it speaks protocol {version.protocol[0]}, not 1: update its firmware to 1.29")
        self._brick.stop_program()
        try:
            self._take_over()
        except StatusError as error:
            major, minor = version.firmware
            raise DeviceError(
                f"firmware {major}.{minor:02d} cannot zero the motors' targets: update it to 1.29 or newer"
            ) from error
        self._battery_mv = self._brick.battery_mv()

    def _take_over(self) -> None:
        """Whoever spoke to the motors before: they stand still, and their targets are known."""
        self._brick.hold_all()
        for wheel in (self._left, self._right):
            self._brick.reset_count(wheel.port)
            wheel.held()
        # A zeroed motor is at its target and floats: hold it again.
        self._brick.hold_all()

    def _heard(self, now: float) -> None:
        self._heard_at = now
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
        self._sent = Twist()
        for wheel in (self._left, self._right):
            wheel.held()
        self._retry_at = now + self._settings.retry_s
        self._faults.raised("link", now, str(error))

    def _try_again(self, now: float) -> None:
        if now < self._retry_at:
            return
        try:
            self._take_over()
            states = [(wheel, self._brick.output_state(wheel.port)) for wheel in (self._left, self._right)]
        except OSError as error:
            self._retry_at = now + self._settings.retry_s
            self._faults.raised("link", now, str(error))
            return
        if any(wheel.jumped(state, _MOST_UNSEEN_DEG) for wheel, state in states):
            self._odometry.restart()
        for wheel, state in states:
            wheel.resumed(state, now)
        self._faults.cleared("link")
        self._heard(now)
        self._update_odometry()
