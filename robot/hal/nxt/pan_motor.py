"""A motor that goes to an angle in short pulses under the mirrored tacho target. No I/O.

Like a wheel (wheel.py) it never has more to run than one pulse; besides, never further than its goal. All
angles are degrees of the motor shaft.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from robot.hal.nxt.replies import OutputState
from robot.hal.nxt.settings import PanSettings
from robot.hal.nxt.wheel import Order, top_up

_DEGREES_PER_SECOND_PER_POWER: Final = 10.0
# A new power costs a degree of limit: only a real change is worth it.
_SLOWER: Final = 0.7
_STANDING_TOLERANCE: Final = 1.5
# A brick that was switched off and on counts from zero: a longer way than this is not turned unseen.
_MOST_UNSEEN_DEG: Final = 720.0


@dataclass(frozen=True, slots=True)
class Step:
    """What to tell the motor: an order, or to hold; `brake`: hold it before the order, it turns round."""

    order: Order | None = None
    hold: bool = False
    brake: bool = False


class PanMotor:
    """Where the motor is, where it shall go, and whether it moves. `goal` may be set at any time."""

    def __init__(self, settings: PanSettings) -> None:
        self._settings = settings
        self.goal = 0.0
        self.position: float | None = None
        self._rotation = 0  # as counted by the brick
        self._zero = 0  # the count at position 0
        self._tacho = 0.0
        self._target: float | None = None  # None: not known, it has to be zeroed
        self._power = 0
        self._stood_at = 0.0  # where it was when it last moved on
        self._stood_since = 0.0
        self.stuck = False
        """It is told to turn and stands."""
        self.moved = False
        """It moved since it was last told to turn."""

    # -------------------------------------------------------------------------------------------- goal

    @property
    def remaining(self) -> float:
        """Degrees to the goal."""
        return self.goal - (self.position or 0.0)

    @property
    def arrived(self) -> bool:
        """True within the tolerance of the goal; a motor that stands is is given a little more."""
        return abs(self.remaining) <= self._settings.tolerance_deg * (
            1.0 if self.turning else _STANDING_TOLERANCE
        )

    @property
    def turning(self) -> bool:
        """True if the last word was an order to turn."""
        return self._power != 0

    def step(self) -> Step:
        """What to send now."""
        if self.arrived:
            return Step(hold=self.turning)
        way = self.remaining
        direction = 1 if way > 0 else -1
        s = self._settings
        rate = min(max(abs(way) / s.braking_s, s.slowest_deg_s), s.rate_deg_s)
        power = direction * max(1, round(rate / _DEGREES_PER_SECOND_PER_POWER))
        lead = max(1.0, min(abs(way), rate * s.pulse_s))
        limit: int | None = None
        turns_round = self._power * direction < 0
        if self._target is not None and not turns_round:
            limit = top_up(self._target, self._tacho, direction, lead, lead + s.tolerance_deg)
        if limit is None:
            return Step(Order(power, max(1, math.floor(lead)), anew=True), brake=turns_round)
        if limit == 0 and abs(power) > _SLOWER * abs(self._power):
            return Step()
        return Step(Order(power, max(1, limit)))

    # ----------------------------------------------------------------------------------------- what was sent

    def ordered(self, order: Order, now: float) -> None:
        """The order went out: mirror what the firmware makes of it."""
        if order.anew or self._target is None:
            self._target = self._tacho = 0.0
        if not self.turning:
            self._stood_at, self._stood_since = self.position or 0.0, now
            self.stuck = self.moved = False
        self._target += math.copysign(order.limit, order.power)
        self._power = order.power

    def held(self) -> None:
        """The hold went out (or the motor is to be taken for held)."""
        self._power, self._target = 0, None

    def lost(self) -> None:
        """An exchange failed: what the brick made of it nobody knows."""
        self._target = None

    # ---------------------------------------------------------------------------------------- what is read

    def observed(self, state: OutputState, now: float) -> None:
        """Take in an answer of the brick."""
        if self.position is None:
            self._zero = state.rotation
        self._rotation = state.rotation
        self.position = float(state.rotation - self._zero)
        self._tacho = float(state.tacho)
        if self.turning and state.power == 0:
            self.held()  # somebody stopped all motors
        elif self.turning and state.run_state == 0:
            self._target = None  # it ran into its target
        self._watch(now)

    def resumed(self, state: OutputState, now: float) -> None:
        """The first reading after a broken link; was the brick off meanwhile, the head stands as before."""
        jumped = abs(state.rotation - self._rotation) > _MOST_UNSEEN_DEG
        if jumped or (state.rotation == 0 and self._rotation != 0):
            self._zero = state.rotation - round(self.position or 0.0)
        self.held()
        self.observed(state, now)

    def _watch(self, now: float) -> None:
        position = self.position or 0.0
        if abs(position - self._stood_at) >= self._settings.stuck_travel_deg:
            self._stood_at, self._stood_since = position, now
            self.stuck, self.moved = False, True
        elif self.turning and now - self._stood_since >= self._settings.stuck_s - 1e-9:
            self.stuck = True
