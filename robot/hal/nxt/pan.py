"""A head that only pans: a motor on a brick it shares with the drive base."""

from __future__ import annotations

import math

from robot.hal.backoff import Backoff
from robot.hal.faultbook import FaultBook
from robot.hal.interfaces import DeviceError
from robot.hal.nxt.brick import Brick, ReplyTimeoutError
from robot.hal.nxt.pace import RateMeter
from robot.hal.nxt.pan_motor import PanMotor
from robot.hal.nxt.replies import ProtocolError, StatusError
from robot.hal.nxt.settings import RETRY_GROWTH, USB_PAN, PanSettings
from robot.hal.nxt.takeover import zero_motors
from robot.messages import Fault, HeadPose

_EPSILON_S = 1e-6


class NxtPan:
    """`PanTilt` on a motor of a brick (rules: robot/hal/interfaces.py); the tilt is fixed.

    Where the head stands when it is opened is straight ahead. Each `send` gives the motor at most one
    short pulse towards the angle, so a head nobody sends any more stands after `pulse_s`. A
    stop of all motors by the base stops the head too, until the next `send`. Opening raises DeviceError with
    the cure.

    Faults: `link` (no answer; tried again by itself), `stuck` (told to turn it stood for `stuck_s`:
    the motor is held, and tried again every `again_s` until it moves).
    """

    def __init__(self, brick: Brick, settings: PanSettings = USB_PAN) -> None:
        if settings.gear == 0:
            raise DeviceError("head.pan_gear is 0: say how often the motor turns in one turn of the head")
        self._brick = brick
        self._settings = settings
        self._motor = PanMotor(settings)
        self._goal = HeadPose(tilt=settings.tilt)
        self._faults = FaultBook("head")
        self._backoff = Backoff(settings.retry_s, settings.retry_most_s, RETRY_GROWTH)
        self._rate = RateMeter()
        self._read_at = self._sent_at = self._again_at = -math.inf
        self._heard_at: float | None = None
        self._closed = False
        brick.retain()
        try:
            zero_motors(brick, (settings.port,), (settings.port,))
            self._motor.observed(brick.output_state(settings.port), 0.0)
        except OSError as error:
            brick.release()
            raise DeviceError(f"the pan motor on {'ABC'[settings.port]} cannot be used: {error}") from error

    def send(self, pose: HeadPose, now: float) -> HeadPose:
        """Turn towards this pan for one pulse; returns the pose asked for, the old one while it is broken."""
        self._keep_up(now)
        if self._closed or "link" in self._faults:
            return self._goal
        before = self._goal
        self._aim(pose)
        if now >= self._again_at and now - self._sent_at >= self._period_s - _EPSILON_S:
            try:
                self._turn(now)
            except OSError as error:
                self._failed(error, now)
                if "link" in self._faults:
                    self._aim(before)
        return self._goal

    def read(self, now: float) -> HeadPose:
        """Poll the motor (at most once) and return where the head is, as last known while it is silent."""
        self._keep_up(now)
        pan = math.radians((self._motor.position or 0.0) / self._settings.gear)
        return HeadPose(pan, self._settings.tilt)

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong."""
        return self._faults.open

    def close(self) -> None:
        """Hold the motor and release the brick."""
        if self._closed:
            return
        self._closed = True
        try:
            self._brick.hold(self._settings.port)
        except OSError:
            pass  # its pulse runs out by itself
        finally:
            self._brick.release()

    @property
    def measured_rate_hz(self) -> float | None:
        """How often the motor was read lately; None while nothing answers."""
        return None if "link" in self._faults else self._rate.rate_hz(self._read_at)

    # ------------------------------------------------------------------------------------------- within

    def _aim(self, pose: HeadPose) -> None:
        limit = self._settings.pan_limit
        pan = 0.0 if math.isnan(pose.pan) else max(-limit, min(limit, pose.pan))
        self._goal = HeadPose(pan, self._settings.tilt)
        self._motor.goal = math.degrees(pan) * self._settings.gear

    def _keep_up(self, now: float) -> None:
        if self._heard_at is None:
            self._heard_at = now
        if self._closed:
            return
        if "link" in self._faults:
            self._try_again(now)
        elif now - self._read_at >= self._reading_period_s - _EPSILON_S:
            self._poll(now)

    @property
    def _period_s(self) -> float:
        return self._settings.pace.period(self._brick.times.median_s)

    @property
    def _reading_period_s(self) -> float:
        moves = self._motor.turning or not self._motor.arrived
        return self._period_s if moves else self._settings.idle_s

    def _turn(self, now: float) -> None:
        step = self._motor.step()
        port = self._settings.port
        if step.hold or step.brake:
            self._brick.hold(port)
            self._motor.held()
        if step.order is None:
            return
        self._sent_at = now
        if step.order.anew:
            self._brick.reset_count(port)
        self._brick.drive(port, step.order.power, step.order.limit)
        self._motor.ordered(step.order, now)

    def _poll(self, now: float) -> None:
        self._read_at = now
        began = self._brick.seconds()
        try:
            state = self._brick.output_state(self._settings.port)
            at = now + self._brick.seconds() - began
            self._motor.observed(state, at)
            self._watch(at)
        except OSError as error:
            self._failed(error, now)
            return
        self._rate.happened(now)
        self._heard_at = at

    def _watch(self, now: float) -> None:
        if self._motor.moved or self._motor.arrived:
            self._faults.cleared("stuck")
        if self._motor.stuck and self._motor.turning:
            self._brick.hold(self._settings.port)
            self._motor.held()
            self._again_at = now + self._settings.again_s
            self._faults.raised("stuck", now, f"{abs(self._motor.remaining):.0f} degrees of the motor to go")

    def _failed(self, error: OSError, now: float) -> None:
        self._motor.lost()
        may_pass = isinstance(error, ReplyTimeoutError | ProtocolError) and not isinstance(error, StatusError)
        if may_pass and self._heard_at is not None and now - self._heard_at < self._settings.silence_s:
            return
        self._motor.held()
        self._backoff.failed(now)
        self._faults.raised("link", now, str(error))

    def _try_again(self, now: float) -> None:
        if not self._backoff.due(now):
            return
        port = self._settings.port
        try:
            zero_motors(self._brick, (port,), (port,))
            self._motor.resumed(self._brick.output_state(port), now)
        except OSError as error:
            self._backoff.failed(now)
            self._faults.raised("link", now, str(error))
            return
        self._backoff.worked()
        self._faults.cleared("link")
        self._heard_at = self._read_at = now
