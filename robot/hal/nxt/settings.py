"""Figures of the NXT base."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

from robot.hal.kinematics import Limits, Wheels
from robot.hal.nxt.lcp import Port
from robot.hal.nxt.wheel import WheelSettings


@dataclass(frozen=True, slots=True)
class NxtSettings:
    """Figures of the base; the defaults fit the USB cable.

    speed_limit in m/s, turn_limit in rad/s. left_port, right_port: brick ports 0-2. wheel_rate_deg_s: top
    rate the motors keep under load. exchange_period_s: readings and renewals at most this often.
    motors_per_read: 2, or 1 to read them in turn. battery_low_mv, battery_empty_mv: fault below, over again
    200 mV above. silence_s: no answer for this long is a link fault. retry_s: how often a broken link is
    tried again. stall_told_s: a stall is told at least this long.
    """

    wheels: Wheels = field(default_factory=lambda: Wheels(radius=0.028, track_width=0.15))
    wheel: WheelSettings = field(default_factory=WheelSettings)
    speed_limit: float = 0.25
    turn_limit: float = math.radians(70.0)
    wheel_rate_deg_s: float = 800.0
    left_port: int = Port.B
    right_port: int = Port.C
    exchange_period_s: float = 0.0
    motors_per_read: int = 2
    battery_low_mv: int = 6800
    battery_empty_mv: int = 6300
    battery_period_s: float = 5.0
    keep_alive_period_s: float = 30.0
    silence_s: float = 0.2
    retry_s: float = 0.5
    stall_told_s: float = 1.0

    @property
    def limits(self) -> Limits:
        """The limits a twist is scaled to."""
        return Limits(self.speed_limit, self.turn_limit, math.radians(self.wheel_rate_deg_s))


USB: Final = NxtSettings()
# Each change of direction costs a Bluetooth link some 30 ms: fewer exchanges, one motor at a time.
BLUETOOTH: Final = NxtSettings(exchange_period_s=0.15, motors_per_read=1)
