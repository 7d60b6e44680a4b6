"""Figures of what is plugged into the brick, for the cable and for Bluetooth."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

from robot.hal.interfaces import DeviceError
from robot.hal.kinematics import Limits, Wheels
from robot.hal.nxt.lcp import ALL_PORTS, Port
from robot.hal.nxt.pace import PaceSettings
from robot.hal.nxt.wheel import WheelSettings

_USB_BASE_PACE: Final = PaceSettings(share=0.6, shortest_s=0.02, longest_s=0.2)
_USB_PACE: Final = PaceSettings(share=0.3, shortest_s=0.02, longest_s=0.5)

RETRY_GROWTH: Final = 1.5
"""Each pause between two tries of a silent brick is so many times the last: it may only be out of reach."""


@dataclass(frozen=True, slots=True)
class NxtSettings:
    """Figures of the base; the defaults fit the USB cable.

    speed_limit in m/s, turn_limit in rad/s. left_port, right_port: brick ports 0-2. wheel_rate_deg_s: top
    rate the motors keep under load. pace: how often it is read and renewed. motors_per_read: 2, or 1 to read
    them in turn. hold_ports: what a stop holds; all three by one telegram, unless another driver has a motor
    that shall not be stopped by it. battery_low_mv, battery_empty_mv: fault below, over again 200 mV above.
    silence_s: no answer for this long is a link fault. retry_s, retry_most_s: first and longest pause between
    tries of a broken link. stall_told_s: a stall is told at least this long.
    """

    wheels: Wheels = field(default_factory=lambda: Wheels(radius=0.028, track_width=0.15))
    wheel: WheelSettings = field(default_factory=WheelSettings)
    speed_limit: float = 0.25
    turn_limit: float = math.radians(70.0)
    wheel_rate_deg_s: float = 800.0
    left_port: int = Port.B
    right_port: int = Port.C
    pace: PaceSettings = _USB_BASE_PACE
    motors_per_read: int = 2
    hold_ports: tuple[int, ...] = (ALL_PORTS,)
    battery_low_mv: int = 6800
    battery_empty_mv: int = 6300
    battery_period_s: float = 5.0
    keep_alive_period_s: float = 30.0
    silence_s: float = 0.2
    retry_s: float = 0.5
    retry_most_s: float = 5.0
    stall_told_s: float = 1.0

    @property
    def limits(self) -> Limits:
        """The limits a twist is scaled to."""
        return Limits(self.speed_limit, self.turn_limit, math.radians(self.wheel_rate_deg_s))


@dataclass(frozen=True, slots=True)
class NearSettings:
    """Figures of the sensors at the body's edge; the defaults fit the USB cable.

    touch_ports: brick inputs 0-3 with touch sensors. sonar_port: that of the ultrasonic sensor, None without.
    pace: pauses between single exchanges. round_s: all of them are read at most this often. silence_s,
    retry_s, retry_most_s: as for the base. settle_s: an input may give no valid value for this long after its
    mode was set. echo_s: the longest a sonar's answer may be pending.
    """

    touch_ports: tuple[int, ...] = ()
    sonar_port: int | None = None
    pace: PaceSettings = _USB_PACE
    round_s: float = 0.075
    silence_s: float = 0.2
    retry_s: float = 0.5
    retry_most_s: float = 5.0
    settle_s: float = 0.4
    echo_s: float = 0.4

    def plugged(self, bumper_ports: str, sonar_port: str) -> NearSettings:
        """These figures with the sensors where the config says: inputs '1' to '4', '' for none.

        Raises DeviceError if an input is named twice.

        >>> NearSettings().plugged("12", "4").touch_ports
        (0, 1)
        """
        named = bumper_ports + sonar_port
        if len(set(named)) < len(named):
            raise DeviceError(f"bumper_ports {bumper_ports!r} and sonar_port {sonar_port!r} share an input")
        touch = tuple(int(port) - 1 for port in bumper_ports)
        return replace(self, touch_ports=touch, sonar_port=int(sonar_port) - 1 if sonar_port else None)


@dataclass(frozen=True, slots=True)
class PanSettings:
    """Figures of a pan motor; the defaults fit the USB cable.

    port: brick port 0-2. gear: motor turns a head turn, negative if the head turns the other way (not 0).
    pan_limit: radians to either side. tilt: the eyes' fixed tilt, radians down. rate_deg_s, slowest_deg_s:
    the motor's rate on a long way and near the goal. braking_s: it slows down where that rate would need less
    than this to the goal. tolerance_deg: of the motor; nearer than this it is held. pulse_s: no order drives
    for longer. pace, idle_s: pauses between readings while it turns, while it stands. stuck_s,
    stuck_travel_deg: stuck if it is to turn and moved less than this for so long. again_s: a stuck head is
    tried again after this. silence_s, retry_s, retry_most_s: as for the base.
    """

    port: int = Port.C
    gear: float = 1.0
    pan_limit: float = math.radians(80.0)
    tilt: float = math.radians(20.0)
    rate_deg_s: float = 300.0
    slowest_deg_s: float = 60.0
    braking_s: float = 0.4
    tolerance_deg: float = 2.0
    pulse_s: float = 0.3
    pace: PaceSettings = _USB_PACE
    idle_s: float = 0.25
    stuck_s: float = 0.6
    stuck_travel_deg: float = 5.0
    again_s: float = 1.0
    silence_s: float = 0.2
    retry_s: float = 0.5
    retry_most_s: float = 5.0


USB: Final = NxtSettings()
USB_NEAR: Final = NearSettings()
USB_PAN: Final = PanSettings()
# Each change of direction costs a Bluetooth link some 30 ms: fewer exchanges, one motor at a time, and some
# 60 % of all time for the base and one other.
BLUETOOTH: Final = NxtSettings(
    # Renewed more rarely, the wheels need nearly the whole pulse.
    wheel=WheelSettings(lead_share=0.9),
    pace=PaceSettings(share=0.4, shortest_s=0.125, longest_s=0.2),
    motors_per_read=1,
)
BLUETOOTH_NEAR: Final = NearSettings(
    pace=PaceSettings(share=0.2, shortest_s=0.2, longest_s=1.0), silence_s=0.4, settle_s=1.5, echo_s=2.0
)
BLUETOOTH_PAN: Final = PanSettings(
    pace=PaceSettings(share=0.2, shortest_s=0.125, longest_s=0.3),
    rate_deg_s=200.0,
    idle_s=2.0,
    silence_s=0.4,
)
