"""One NXT motor as the host sees it: the mirrored tacho target, the speed loop, the stall watch. No I/O.

The dead-man. Stock firmware has none, but a motor with a tacho limit stops by itself at its target. The
firmware adds each limit to its previous *target*, so the host mirrors the target (the sum of all limits) and
tops it up to no more than the lead: what the wheel turns in one pulse. A host or link that dies leaves a
wheel that runs out its lead and coasts. Where the wheel is between two readings is told from the slower of
its measured and its commanded speed: a target too near makes a wheel falter, one too far outlives its pulse.
All counts here are degrees of the motor shaft, forward positive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from robot.hal.nxt.lcp import RunState
from robot.hal.nxt.replies import OutputState

# From the telegram to a turning wheel: latency, the first regulation period, the rotor's inertia.
_START_LAG_S: Final = 0.1
# A wheel that starts is hardly ever further behind an even rate than this; it is taken to move for a while,
# because two readings tell no speed yet.
_FIRST_LAG_S: Final = 0.17
_START_S: Final = 0.35
# Until the firmware's regulation has swung in after a new speed.
_SETTLING_S: Final = 0.6
# A settled wheel that turned less than this share of its way between two readings may be about to stall.
_LAGGING_SHARE: Final = 0.8
# Less than this share is next to no motion.
_CRAWLING_SHARE: Final = 0.3
# So much less than a stall is enough to fear for the wheel when the link breaks.
_STRANDED_S: Final = 0.08
_STRANDED_TRAVEL_DEG: Final = 8.0
# One degree alone may be the encoder's last digit or the gears' play.
_MOTION_DEG: Final = 2.0


@dataclass(frozen=True, slots=True)
class WheelSettings:
    """Figures of one driven wheel.

    pulse_s: a lead never exceeds the commanded rate times this. lead_share: share of it that is topped up to;
    the rest is room for slowing down before the target has to be set anew. lead_slack_deg: the least room (a
    slow wheel's lead is only a few degrees). degrees_per_second_per_power: rate the firmware's speed
    regulation keeps at power 1. loop_gain: power per degree the wheel is behind. loop_limit: the most power
    the loop adds. stall_s and stall_travel_deg: a wheel stalls that stood still this long and should have
    turned this far meanwhile. forward: +1, or -1 if the motor is built in the other way round.
    """

    pulse_s: float = 0.3
    lead_share: float = 0.6
    lead_slack_deg: float = 5.0
    degrees_per_second_per_power: float = 10.0
    loop_gain: float = 0.03
    loop_limit: float = 15.0
    stall_s: float = 0.2
    stall_travel_deg: float = 30.0
    forward: int = 1


@dataclass(frozen=True, slots=True)
class Sample:
    """Rotation of a wheel in degrees at a time."""

    rotation: float
    at: float


@dataclass(frozen=True, slots=True)
class Order:
    """What to tell the motor: `limit` degrees more at `power`; anew: zero the firmware's target first."""

    power: int
    limit: int
    anew: bool = False


def top_up(target: float, tacho: float, direction: int, lead: float, ceiling: float) -> int | None:
    """Degrees to add to the target so that it is `lead` ahead; 0 for none, None if it is beyond `ceiling`.

    A target too far ahead cannot be taken back by a smaller limit: it has to be zeroed.

    >>> top_up(target=100, tacho=70, direction=1, lead=60, ceiling=75)
    30
    >>> top_up(target=100, tacho=20, direction=1, lead=10, ceiling=15) is None
    True
    """
    ahead = direction * (target - tacho)
    if ahead > ceiling:
        return None
    return max(0, math.floor(lead - ahead))


class Wheel:
    """State of one motor: what it was told, what it answered. The base sends what `order` says."""

    def __init__(self, port: int, settings: WheelSettings) -> None:
        self.port = port
        self.settings = settings
        self.rate = 0.0  # commanded, deg/s
        self.sample: Sample | None = None
        self._power = 0
        self._known = (
            False  # whether target and count are: not before they were zeroed, nor after a lost link
        )
        self._target = 0.0
        self._tacho = Sample(0.0, 0.0)
        self._speed = 0.0
        self._start_at = -math.inf
        self._start_rate = 0.0
        self._behind = 0.0
        self._settled_rate = 0.0
        self._settled_at = 0.0
        self._still_since = 0.0
        self._still_at = 0.0
        self._demand = 0.0
        self._seen_still = False
        self._lags = False

    # ----------------------------------------------------------------------------------------- commands

    def order(self, rate: float, now: float) -> Order | None:
        """What to send so that the wheel turns at `rate` deg/s (not 0) one more pulse; None for nothing."""
        if not self._runs_towards(rate):
            self._begin(now)
        self._note_change(rate, now)
        direction = 1 if rate > 0 else -1
        power = self._power_for(rate)
        lead, ceiling = self._lead(rate), self._ceiling(rate)
        limit: int | None = None
        if self._known and self._runs_towards(rate):
            limit = top_up(self._target, self._tacho_at(now), direction, lead, ceiling)
        self.rate = rate
        if limit is None:
            return Order(power, max(1, math.floor(abs(rate) * self.settings.pulse_s)), anew=True)
        if limit == 0 and power == self._power:
            return None
        return Order(power, max(1, limit))

    def ordered(self, order: Order, now: float) -> None:
        """The order went out and arrives `now`: mirror what the firmware makes of it."""
        if order.anew:
            self._known = True
            turns_round = self._speed * self.rate < 0
            self._start_at = -math.inf if turns_round else now + _FIRST_LAG_S
            self._start_rate = self.rate
            self._target, self._tacho, self._speed = 0.0, Sample(0.0, now), 0.0
        self._power = order.power
        self._target += math.copysign(order.limit, order.power)

    def held(self) -> None:
        """The hold went out: the next drive starts from a zeroed target."""
        self.rate = 0.0
        self._power = 0
        self._known = False
        self._behind = 0.0

    def lost(self) -> None:
        """An exchange failed: what the firmware's target is now nobody knows."""
        self._known = False

    @property
    def is_held(self) -> bool:
        """True if the last word was a hold."""
        return self.rate == 0.0

    # ----------------------------------------------------------------------------------------- readings

    def observed(self, state: OutputState, now: float) -> None:
        """Take in an answer of the brick."""
        forward = self.settings.forward
        sample = Sample(float(forward * state.rotation), now)
        before = self.sample
        self.sample = sample
        self._tacho = Sample(float(forward * state.tacho), now)
        if abs(self._tacho.rotation) < abs(self._started_by(now)):
            self._start_at = -math.inf  # it did not start as it should
        self._speed = 0.0
        if before is None or now <= before.at:
            return
        turned, dt = sample.rotation - before.rotation, now - before.at
        self._speed = turned / dt
        if self.is_held:
            return
        if state.run_state == RunState.IDLE:
            # It ran into its target, or never heard of the last one: the mirror is worth nothing.
            self._known = False
            self._settled_at = now + _SETTLING_S
            self._begin(now)
            return
        self._correct(before, sample)
        self._watch(before, sample)

    def jumped(self, state: OutputState, most: float) -> bool:
        """True if the brick was switched off meanwhile: it counts from 0, or by more than `most` degrees."""
        if self.sample is None:
            return False
        rotation = self.settings.forward * state.rotation
        return (rotation == 0 and self.sample.rotation != 0) or abs(rotation - self.sample.rotation) > most

    def resumed(self, state: OutputState, now: float) -> None:
        """The first reading after a broken link: no speed can be told from it."""
        self.sample = None
        self.observed(state, now)
        self._speed = 0.0

    def stalled(self, now: float) -> bool:
        """True if the wheel is told to turn, should have, and did not when it was last asked."""
        return self._stands(now, self.settings.stall_s, self.settings.stall_travel_deg)

    @property
    def stands(self) -> bool:
        """True if the wheel is told to turn and did not move lately, by its last readings."""
        until = -math.inf if self.sample is None else self.sample.at
        return self._stands(until, _STRANDED_S, _STRANDED_TRAVEL_DEG)

    @property
    def lags(self) -> bool:
        """True if it turned much less than it should between the last readings: worth asking again soon."""
        return not self.is_held and self._lags

    # ------------------------------------------------------------------------------------------- within

    def _runs_towards(self, rate: float) -> bool:
        return self.rate * rate > 0

    def _begin(self, now: float) -> None:
        """A new start from standing, or the other way round: old errors are no guide."""
        self._behind = 0.0
        self._settled_rate = 0.0
        self._lags = False
        self._still_since, self._demand, self._seen_still = now + _START_LAG_S, 0.0, False
        self._still_at = self.sample.rotation if self.sample else 0.0

    def _correct(self, before: Sample, sample: Sample) -> None:
        """Integrate how far the wheel is behind, but not while it still swings in."""
        if before.at < self._settled_at:
            return
        error = self.rate * (sample.at - before.at) - (sample.rotation - before.rotation)
        most = self.settings.loop_limit / self.settings.loop_gain
        self._behind = max(-most, min(most, self._behind + error))

    def _note_change(self, rate: float, now: float) -> None:
        if abs(rate - self._settled_rate) > 0.2 * abs(self._settled_rate) + 20.0:
            self._settled_rate, self._settled_at = rate, now + _SETTLING_S

    def _stands(self, until: float, seconds: float, travel_deg: float) -> bool:
        return (
            not self.is_held
            and self._seen_still
            and until - self._still_since >= seconds - 1e-9
            and self._demand >= travel_deg
        )

    def _watch(self, before: Sample, sample: Sample) -> None:
        """Note since when it stands. Readings may be rare: one that moved too little stopped on its way."""
        dt, turned = sample.at - before.at, abs(sample.rotation - before.rotation)
        due = abs(self.rate) * dt
        settled = before.at >= self._settled_at - _SETTLING_S / 2
        self._lags = settled and turned < _LAGGING_SHARE * due
        if abs(sample.rotation - self._still_at) < _MOTION_DEG:
            self._demand += due
            self._seen_still = True
            return
        moving_s = dt * min(1.0, turned / due)
        self._still_since = max(self._still_since, before.at + moving_s)
        self._still_at, self._seen_still = sample.rotation, settled and turned < _CRAWLING_SHARE * due
        self._demand = abs(self.rate) * (dt - moving_s)

    def _power_for(self, rate: float) -> int:
        s = self.settings
        power = rate / s.degrees_per_second_per_power + s.loop_gain * self._behind
        at_least = 1 if rate > 0 else -1
        whole = round(power)
        return at_least if whole * at_least < 1 else max(-100, min(100, whole))

    def _ceiling(self, rate: float) -> float:
        return abs(rate) * self.settings.pulse_s + self.settings.lead_slack_deg

    def _lead(self, rate: float) -> float:
        return max(abs(rate) * self.settings.pulse_s * self.settings.lead_share, 1.0)

    def _tacho_at(self, now: float) -> float:
        """Where the count is now at least: over Bluetooth the last reading is a good part of a pulse old."""
        read = self._tacho
        direction = 1 if self._target >= read.rotation else -1
        moved = 0.0
        if self._speed * direction > 0:
            moved = min(abs(self._speed), abs(self.rate)) * max(0.0, now - read.at)
        moved = max(moved, direction * (self._started_by(now) - read.rotation))
        return read.rotation + direction * min(moved, abs(self._target - read.rotation))

    def _started_by(self, now: float) -> float:
        """Where the count is soon after a start if all is well."""
        since = now - self._start_at
        return self._start_rate * since if 0.0 < since < _START_S else 0.0


def between(first: Sample, second: Sample, at: float) -> Sample:
    """The rotation at a time between two samples, by an even rate."""
    if second.at <= first.at:
        return replace(second, at=at)
    share = (at - first.at) / (second.at - first.at)
    return Sample(first.rotation + share * (second.rotation - first.rotation), at)
