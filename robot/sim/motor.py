"""The NXT servo motor: power in, torque out, encoder back.

`Motor` is the electrical half: the brick sets its duty with `drive`, whoever owns the shaft (the physics of
the room) asks for `torque(shaft_speed)` and reports the true shaft back with `observe(angle, speed)`.
`FreeMotor` brings a shaft of its own, for benches and tests without a physics engine.

In a physics engine, once a sub-step of 1-5 ms:

    brick.advance(dt)                      # firmware and motor electronics
    joint.torque = motor.torque(joint.speed)
    engine.step(dt)                        # joint armature: ROTOR_INERTIA
    motor.observe(joint.angle, joint.speed)

Figures: about 1000 degrees a second unloaded at full power on 8 V and 0.5 Nm at standstill on 9 V, dead-band
12 %, one to two 2 ms exchanges from the firmware to the coil, encoder in whole degrees.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

ROTOR_INERTIA = 1.0e-3
"""Inertia of rotor and gears seen at the shaft, kg m^2: the joint's armature in a physics engine."""

STALL_TORQUE_PER_VOLT = 0.5 / 9.0
"""Nm of stall torque a volt of battery."""

BACK_EMF = 0.3915
"""Volts a rad/s, chosen so that the unloaded shaft reaches 1000 degrees a second on 8 V."""

FRICTION_TORQUE = 0.03
"""Coulomb friction of the gears at the shaft, Nm."""

VISCOUS_FRICTION = 0.002
"""Nm a rad/s at the shaft."""

DEAD_BAND = 0.12
"""Share of full power below which the shaft does not start to turn."""

AMPERES_PER_NM = 2.0 / 0.5
"""Current a Nm of electrical torque: 2 A at standstill on 9 V."""

_BREAKAWAY_DUTY = FRICTION_TORQUE / (STALL_TORQUE_PER_VOLT * 8.0)
_FRICTION_KNEE = 0.3  # rad/s over which Coulomb friction sets in: a step would chatter at 2 ms
_JAM_DAMPING = 0.3  # Nm s/rad of a jammed gear: stops a driven wheel, yet stable at 2 ms steps
_PLAY_RATE = math.radians(300.0)  # how fast the free rotor crosses the backlash
_EXCHANGE_S = 0.002  # period of the exchange between the main processor and the one that makes the pulses


def effective_duty(power: int) -> float:
    """Share -1..1 of the battery voltage that turns the rotor; 0 inside the dead-band.

    power in percent; what is beyond +-100 acts like +-100.

    >>> effective_duty(12), effective_duty(100), effective_duty(-128)
    (0.0, 1.0, -1.0)
    """
    share = min(abs(power) / 100.0, 1.0)
    if share <= DEAD_BAND:
        return 0.0
    duty = _BREAKAWAY_DUTY + (share - DEAD_BAND) / (1.0 - DEAD_BAND) * (1.0 - _BREAKAWAY_DUTY)
    return math.copysign(duty, power)


class Motor:
    """The electrical half of one motor: no shaft of its own.

    Every motor differs a little; the differences are drawn once from `rng`: strength (3 % standard deviation,
    at most 8 %), latency, backlash (2-4 degrees) and the uneven spacing of the encoder's edges.

    >>> import numpy as np
    >>> motor = Motor(np.random.default_rng(1))
    >>> motor.drive(power=100, braked=True, volts=8.0)
    >>> motor.torque(0.0)          # the command has not reached the coil yet
    0.0
    >>> motor.advance(0.05)
    >>> 0.35 < motor.torque(0.0) < 0.5
    True
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.gain = 1.0 + float(np.clip(rng.normal(0.0, 0.03), -0.08, 0.08))
        """Strength (torque and unloaded speed) against the nominal motor."""
        self.latency_s = float(rng.uniform(1.0, 2.0)) * _EXCHANGE_S
        """Seconds from `drive` to the coil."""
        self.backlash_rad = math.radians(float(rng.uniform(2.0, 4.0)))
        """Play between rotor (where the encoder sits) and shaft, from end to end."""
        self.jammed = False
        """True: the gears are blocked, whatever the coil does."""
        self._edges = rng.normal(0.0, 0.15, 360).tolist()  # degrees each encoder edge sits off its place
        self._waiting: deque[tuple[float, int, bool]] = deque()
        self._now = 0.0
        self._power = 0
        self._braked = False
        self._volts = 0.0
        self._angle = 0.0
        self._speed = 0.0
        self._play = 0.0
        self._electrical_torque = 0.0

    # ---------------------------------------------------------------------------------- the brick's side

    def drive(self, power: int, braked: bool, volts: float) -> None:
        """Ask for a duty in percent; it reaches the coil after `latency_s`.

        braked: short the coil between the pulses (slow decay, stiff) instead of letting it float.
        volts: battery voltage, at once in force. Call as often as you like: only changes are queued.
        """
        self._volts = volts
        newest = self._waiting[-1][1:] if self._waiting else (self._power, self._braked)
        if newest != (power, braked):
            self._waiting.append((self._now + self.latency_s, power, braked))

    def advance(self, dt: float) -> None:
        """Let `dt` seconds pass in coil and backlash."""
        self._now += dt
        while self._waiting and self._waiting[0][0] <= self._now + 1e-9:
            _, self._power, self._braked = self._waiting.popleft()
        side = 0.5 * self.backlash_rad
        if self._electrical_torque != 0.0:
            step = math.copysign(_PLAY_RATE * dt, self._electrical_torque)
            self._play = min(max(self._play + step, -side), side)

    @property
    def encoder_degrees(self) -> int:
        """Whole degrees the encoder has counted since the shaft was at 0 (rounded down)."""
        angle = math.degrees(self._angle + self._play)
        count = math.floor(angle)
        return count if angle - count >= self._edges[count % 360] else count - 1

    @property
    def current_amperes(self) -> float:
        """Current drawn from the battery at the last torque asked for, >= 0."""
        if self._power * self._electrical_torque <= 0:
            return 0.0  # braking warms the coil, not the battery
        return abs(self._electrical_torque * effective_duty(self._power)) * AMPERES_PER_NM

    # ---------------------------------------------------------------------------------- the shaft's side

    def torque(self, shaft_speed: float) -> float:
        """Torque on the shaft in Nm, gear friction included, at this shaft speed in rad/s."""
        if self.jammed:
            # A stalled coil still draws its full current.
            self._electrical_torque = self._coil_torque(0.0)
            return -_JAM_DAMPING * shaft_speed
        self._electrical_torque = self._coil_torque(shaft_speed)
        friction = FRICTION_TORQUE * math.tanh(shaft_speed / _FRICTION_KNEE) + VISCOUS_FRICTION * shaft_speed
        return self._electrical_torque - friction

    def observe(self, angle: float, speed: float) -> None:
        """Tell where the shaft truly is (radians, unwrapped) and how fast it turns (rad/s)."""
        self._angle = angle
        self._speed = speed

    def _coil_torque(self, speed: float) -> float:
        duty = effective_duty(self._power)
        volts = self.gain * self._volts
        if self._braked:
            return STALL_TORQUE_PER_VOLT * (duty * volts - BACK_EMF * speed)
        # Floating between the pulses: the coil pushes during the pulse only and never brakes.
        pushed = abs(duty) * STALL_TORQUE_PER_VOLT * (volts - BACK_EMF * math.copysign(speed, duty * speed))
        return math.copysign(max(pushed, 0.0), duty)


class FreeMotor(Motor):
    """A motor with a shaft of its own: rotor, a load's inertia and a load's friction.

    load_inertia in kg m^2, load_torque in Nm (Coulomb, against the motion).

    >>> import numpy as np
    >>> motor = FreeMotor(np.random.default_rng(1))
    >>> motor.drive(power=100, braked=True, volts=8.0)
    >>> for _ in range(500):
    ...     motor.advance(0.002)
    >>> 900 < math.degrees(motor.speed) < 1100
    True
    """

    def __init__(self, rng: np.random.Generator, load_inertia: float = 0.0, load_torque: float = 0.0) -> None:
        super().__init__(rng)
        self._inertia = ROTOR_INERTIA + load_inertia
        self._load_torque = load_torque

    @property
    def angle(self) -> float:
        """True shaft angle in radians."""
        return self._angle

    @property
    def speed(self) -> float:
        """True shaft speed in rad/s."""
        return self._speed

    def advance(self, dt: float) -> None:
        """Let `dt` seconds pass: electronics, then the shaft by semi-implicit Euler, at most 2 ms a step."""
        super().advance(dt)
        steps = max(1, math.ceil(dt / 0.002 - 1e-9))
        for _ in range(steps):
            self._turn(dt / steps)

    def _turn(self, dt: float) -> None:
        load = self._load_torque * math.tanh(self._speed / _FRICTION_KNEE)
        speed = self._speed + dt * (self.torque(self._speed) - load) / self._inertia
        self.observe(self._angle + dt * speed, speed)
