"""Touch sensors and the ultrasonic sensor on a brick: one small exchange at a time, no waiting for a bus."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Final

from robot.hal.backoff import Backoff
from robot.hal.faultbook import FaultBook
from robot.hal.interfaces import DeviceError
from robot.hal.nxt.brick import Brick, ReplyTimeoutError
from robot.hal.nxt.pace import RateMeter
from robot.hal.nxt.replies import ProtocolError, Status, StatusError
from robot.hal.nxt.settings import RETRY_GROWTH, USB_NEAR, NearSettings
from robot.messages import Fault, Near

_SWITCH_TYPE: Final = 0x01
_BOOLEAN_MODE: Final = 0x20
_LOW_SPEED_9V_TYPE: Final = 0x0B
_RAW_MODE: Final = 0x00
# Read register 0x42 of the device at address 0x02: the first echo in centimetres.
_READ_DISTANCE: Final = b"\x02\x42"
_NO_ECHO: Final = 255
_CM: Final = 0.01
_EPSILON_S: Final = 1e-6


class _Touch:
    """A push button on one input."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.pressed = False
        self.read_at: float | None = None
        self.waits_since: float | None = None  # for a value

    def set_up(self, brick: Brick) -> None:
        brick.set_input_mode(self.port, _SWITCH_TYPE, _BOOLEAN_MODE)

    def step(self, brick: Brick, now: float) -> bool:
        """One exchange; True when a value was read. Raises StatusError or ProtocolError."""
        values = brick.input_values(self.port)
        if (values.sensor_type, values.sensor_mode) != (_SWITCH_TYPE, _BOOLEAN_MODE):
            self.set_up(brick)  # the brick was off meanwhile
            return False
        if not values.valid:
            return False
        self.pressed, self.read_at = values.scaled != 0, now
        return True


class _Sonar:
    """The ultrasonic sensor: ask over the bus, look whether it answered, fetch."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.distance: float | None = None
        self.read_at: float | None = None
        self.waits_since: float | None = None  # for a value
        self._step: Callable[[Brick, float], bool] = self._look
        self._asked = False

    def set_up(self, brick: Brick) -> None:
        self._asked = False
        brick.set_input_mode(self.port, _LOW_SPEED_9V_TYPE, _RAW_MODE)

    def step(self, brick: Brick, now: float) -> bool:
        """One exchange; True when a value was read. Raises StatusError or ProtocolError."""
        if not self._asked:
            self._ask(brick)
        try:
            return self._step(brick, now)
        except StatusError as refusal:
            self._asked = False
            if refusal.status in (Status.CHANNEL_BUSY, Status.BAD_CHANNEL):
                self.set_up(brick)  # the brick was off meanwhile
            raise
        except OSError:
            self._asked = False
            raise

    def forget(self) -> None:
        """Its last value means nothing any more."""
        self.distance, self._asked = None, False

    def _ask(self, brick: Brick) -> None:
        brick.ls_write(self.port, _READ_DISTANCE, 1)
        self._asked, self._step = True, self._look

    def _look(self, brick: Brick, now: float) -> bool:
        ready = brick.ls_ready_bytes(self.port)
        if ready:
            self._step = self._fetch
        elif ready == 0:
            self._asked = False
        return False

    def _fetch(self, brick: Brick, now: float) -> bool:
        answer = brick.ls_read(self.port)
        self._asked = False
        if not answer:
            return False
        self.distance = None if answer[0] == _NO_ECHO else answer[0] * _CM
        self.read_at = now
        return True


class NxtNear:
    """`NearSensors` on a brick shared with the base (rules: robot/hal/interfaces.py).

    Each `read` makes at most one exchange (a second one to set an input up again after the brick was off);
    a sonar's value takes two calls or more. `Near.at` is when the oldest of the values was read; sensors that
    are at fault are left out. Opening raises DeviceError if no sensor is named or the brick does not answer.

    Faults: `link` (the brick is silent; tried again by itself), `sensor` (invalid values, or nobody on the
    sonar's bus; the evidence names the input). A touch sensor that is not plugged in cannot be told from
    one that is not pressed.
    """

    def __init__(self, brick: Brick, settings: NearSettings = USB_NEAR) -> None:
        self._brick = brick
        self._settings = settings
        self._touches = [_Touch(port) for port in settings.touch_ports]
        self._sonar = None if settings.sonar_port is None else _Sonar(settings.sonar_port)
        self._sensors: list[_Touch | _Sonar] = [*self._touches, *([self._sonar] if self._sonar else [])]
        self._waiting: deque[_Touch | _Sonar] = deque()
        self._faults = FaultBook("near")
        self._broken: dict[int, str] = {}
        self._backoff = Backoff(settings.retry_s, settings.retry_most_s, RETRY_GROWTH)
        self._rate = RateMeter()
        self._began_at: float | None = None
        self._heard_at = self._asked_at = self._round_at = -math.inf
        self._closed = False
        if not self._sensors:
            raise DeviceError("no sensor is named: set base.bumper_ports or base.sonar_port")
        brick.retain()
        try:
            for sensor in self._sensors:
                sensor.set_up(brick)
        except OSError as error:
            brick.release()
            raise DeviceError(f"the brick's sensors cannot be used: {error}") from error

    def read(self, now: float) -> Near:
        """Ask once if it is time, and return what is known; the last values while the brick is silent."""
        if self._began_at is None:
            self._began_at = self._heard_at = now
            self._age_from(now)
        if not self._closed and self._may_ask(now):
            self._ask(now)
        return self._value()

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong."""
        return self._faults.open

    def close(self) -> None:
        """Release the brick."""
        if not self._closed:
            self._closed = True
            self._brick.release()

    @property
    def measured_rate_hz(self) -> float | None:
        """How often all sensors were read lately; None while nothing answers."""
        return None if "link" in self._faults else self._rate.rate_hz(self._asked_at)

    # ------------------------------------------------------------------------------------------- within

    def _may_ask(self, now: float) -> bool:
        if "link" in self._faults:
            return self._backoff.due(now)
        if not self._waiting and now - self._round_at < self._settings.round_s - _EPSILON_S:
            return False
        period = self._settings.pace.period(self._brick.times.median_s)
        return now - self._asked_at >= period - _EPSILON_S

    def _ask(self, now: float) -> None:
        self._asked_at = now
        if not self._waiting:
            self._waiting.extend(self._sensors)
            self._round_at = now
            self._rate.happened(now)
        sensor = self._waiting[0]
        began = self._brick.seconds()
        try:
            if "link" in self._faults:
                sensor.set_up(self._brick)
            done = sensor.step(self._brick, now)
        except StatusError as refusal:
            self._heard(now)
            self._refused(sensor, refusal, now)
            return
        except OSError as error:
            self._failed(error, now)
            return
        at = now + self._brick.seconds() - began
        self._heard(at)
        if done:
            self._works(sensor)
        else:
            self._nothing_yet(sensor, at)

    def _works(self, sensor: _Touch | _Sonar) -> None:
        sensor.waits_since = None
        self._broken.pop(sensor.port, None)
        if not self._broken:
            self._faults.cleared("sensor")
        self._next()

    def _nothing_yet(self, sensor: _Touch | _Sonar, now: float) -> None:
        """Touch: not valid yet, the next one's turn. Sonar: the bus is at work, ask on."""
        patience = self._settings.settle_s if isinstance(sensor, _Touch) else self._settings.echo_s
        if sensor.waits_since is None:
            sensor.waits_since = now
        if now - sensor.waits_since > patience:
            kind = (
                "no valid values" if isinstance(sensor, _Touch) else "the sonar's answer is pending for ever"
            )
            self._tell(sensor, kind, now)
        if isinstance(sensor, _Touch):
            self._next()

    def _refused(self, sensor: _Touch | _Sonar, refusal: StatusError, now: float) -> None:
        self._tell(sensor, str(refusal), now)
        self._next()

    def _tell(self, sensor: _Touch | _Sonar, words: str, now: float) -> None:
        sensor.waits_since = None
        if isinstance(sensor, _Sonar):
            sensor.forget()
        self._broken[sensor.port] = f"input {sensor.port + 1}: {words}"
        self._faults.raised("sensor", now, "; ".join(self._broken.values()))

    def _next(self) -> None:
        self._waiting.popleft()

    def _heard(self, now: float) -> None:
        self._heard_at = now
        if "link" in self._faults:
            self._backoff.worked()
            self._faults.cleared("link")
            self._age_from(now)

    def _age_from(self, now: float) -> None:
        """Before its first reading a sensor counts as read when it was set up."""
        for sensor in self._sensors:
            sensor.read_at = now if sensor.read_at is None else sensor.read_at

    def _failed(self, error: OSError, now: float) -> None:
        may_pass = isinstance(error, ReplyTimeoutError | ProtocolError)
        if "link" not in self._faults and may_pass and now - self._heard_at < self._settings.silence_s:
            return
        self._waiting.clear()
        for sensor in self._sensors:
            sensor.waits_since = None
        if self._sonar is not None:
            self._sonar.forget()
        self._backoff.failed(now)
        self._faults.raised("link", now, str(error))

    def _value(self) -> Near:
        live = [s for s in self._sensors if s.port not in self._broken] or self._sensors
        at = min((s.read_at for s in live if s.read_at is not None), default=-math.inf)
        return Near(
            at=at,
            bumped=any(touch.pressed for touch in self._touches),
            distance=self._sonar.distance if self._sonar else None,
        )
