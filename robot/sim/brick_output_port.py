"""One output port as the brick's firmware keeps it: registers, counters, ramps and speed regulation.

Functions on an `Output`; who calls them when, and what concerns several ports at once, is in brick_outputs.
"""

from __future__ import annotations

from dataclasses import dataclass

MODE_ON, MODE_BRAKE, MODE_REGULATED = 0x01, 0x02, 0x04
REGULATION_IDLE, REGULATION_SPEED, REGULATION_SYNC = 0, 1, 2
IDLE, RAMP_UP, RUNNING, RAMP_DOWN = 0x00, 0x10, 0x20, 0x40

P_GAIN, I_GAIN, D_GAIN = 3, 1, 1
"""The firmware's gain bytes 96, 32, 32 over its divisor 32."""

_MIN_MOVEMENT_POWER = 10


def toward_zero(value: int, divisor: int) -> int:
    """Integer division as the processor does it: towards zero.

    >>> toward_zero(-7, 2)
    -3
    """
    quotient = abs(value) // abs(divisor)
    return quotient if (value < 0) == (divisor < 0) else -quotient


def bounded(value: int, limit: int) -> int:
    """The value, at most `limit` away from 0."""
    return min(max(value, -limit), limit)


@dataclass(slots=True)
class Output:
    """What the firmware remembers of one output port."""

    # As last written by the host; run_state is kept up to date by the firmware.
    power: int = 0
    mode: int = 0
    regulation_written: int = 0
    turn_written: int = 0
    limit: int = 0

    run_state: int = IDLE
    regulation: int = REGULATION_IDLE
    braked: bool = False
    set_speed: int = 0
    target_speed: int = 0
    pulse_width: int = 0
    turn: int = 0
    forever: bool = True
    target_count: int = 0

    encoder: int = 0
    count: int = 0
    block_count: int = 0
    rotation_count: int = 0

    regulation_ms: int = 0
    delta_count: int = 0
    old_error: int = 0
    summed_error: int = 0

    ramp_step: int = 0
    ramp_count: int = 0
    ramp_ms: int = 0

    def forget_errors(self) -> None:
        """Start speed regulation afresh."""
        self.summed_error = self.old_error = 0

    @property
    def at_target(self) -> bool:
        """True if the count has reached the target in the direction of the set speed."""
        if self.set_speed == 0:
            return False
        ahead = self.target_count - self.count
        return ahead <= 0 if self.set_speed > 0 else ahead >= 0


def count(out: Output, encoder: int) -> None:
    """Add what the encoder turned since last time to every counter."""
    turned = encoder - out.encoder
    out.encoder = encoder
    out.count += turned
    out.delta_count += turned
    out.block_count += turned
    out.rotation_count += turned


def fade(out: Output) -> None:
    """What an idle output does each millisecond: float, and let the pulses shrink by one percent."""
    out.braked = False
    out.pulse_width = _one_step_to_zero(out.pulse_width)
    out.target_speed = _one_step_to_zero(out.target_speed)
    out.set_speed = _one_step_to_zero(out.set_speed)


def set_speed(out: Output, run_state: int, power: int, turn: int) -> None:
    """Take a new speed order; one that changes nothing does nothing."""
    if (out.set_speed, out.run_state, out.turn) == (power, run_state, turn) and run_state != IDLE:
        return
    if out.target_speed == 0:
        out.forget_errors()
        out.regulation_ms = out.delta_count = 0
    if run_state == RUNNING:
        out.set_speed = out.target_speed = power
        out.turn = turn
        if power == 0:  # the firmware's hold
            out.pulse_width = 0
            out.regulation_ms = out.delta_count = 0
    elif run_state == RAMP_UP:
        if out.set_speed != 0 and (out.set_speed >= power if power > 0 else out.set_speed <= power):
            run_state = RUNNING
        else:
            _start_ramp(out, power, turn)
    elif run_state == RAMP_DOWN:
        if out.set_speed <= power if out.target_speed >= 0 else out.set_speed >= power:
            run_state = RUNNING
        else:
            _start_ramp(out, power, turn)
    else:
        out.regulation = REGULATION_IDLE
    out.run_state = run_state


def set_limit(out: Output, limit: int) -> None:
    """Move the previous target by `limit` degrees in the direction of the run; 0: run forever."""
    out.forever = limit == 0
    direction = out.set_speed or out.target_speed
    out.target_count += limit if direction > 0 else -limit


def ramp_up(out: Output) -> None:
    """One percent more every `ramp_step` degrees, and every 100 ms if the shaft will not start."""
    sign = 1 if out.set_speed > 0 else -1
    if out.target_speed == 0:
        out.target_speed = sign * _MIN_MOVEMENT_POWER
    if out.ramp_step == 0:
        change = abs(out.set_speed - out.target_speed) or 1
        out.ramp_step = abs(out.target_count - out.count) // change
    if _ramp_is_due(out, sign) or (out.regulation != REGULATION_SPEED and out.ramp_ms > 100):
        out.ramp_count, out.ramp_ms = out.count, 0
        out.target_speed = sign * min(abs(out.target_speed) + 1, abs(out.set_speed))
    if (out.target_count - out.count) * sign <= 0:
        out.target_speed = out.set_speed
        out.run_state = IDLE
    elif out.regulation == REGULATION_IDLE:
        out.pulse_width = out.target_speed


def ramp_down(out: Output) -> None:
    """One percent less every `ramp_step` degrees; a little more again where the shaft gets stuck."""
    sign = 1 if out.target_speed > 0 else -1
    if out.ramp_step == 0:
        reserve = _MIN_MOVEMENT_POWER if out.set_speed == 0 else 0
        change = max(abs(out.target_speed - out.set_speed) - reserve, 1)
        out.ramp_step = max(abs(out.target_count - out.count) // change, 1)
    if _ramp_is_due(out, sign):
        out.ramp_count, out.ramp_ms = out.count, 0
        out.target_speed = sign * max(abs(out.target_speed) - 1, _MIN_MOVEMENT_POWER)
    elif out.regulation != REGULATION_SPEED and out.ramp_ms > 30 * out.ramp_step:
        out.ramp_ms = 20 * out.ramp_step
        out.target_speed += sign
    if (out.target_count - out.count) * sign <= 0:
        out.run_state = IDLE
        out.regulation = REGULATION_IDLE
        if out.set_speed == 0:
            out.target_speed = out.pulse_width = 0
    elif out.regulation == REGULATION_IDLE:
        out.pulse_width = out.target_speed


def regulate_speed(out: Output) -> None:
    """One tick of speed regulation: power 100 asks for 100 degrees a tick, about 1000 a second."""
    error = bounded(out.old_error - out.delta_count + out.target_speed, 32000)
    change = error - out.old_error
    out.old_error = error
    out.summed_error = bounded(toward_zero(out.summed_error * 3 + error, 4), 800)
    total = bounded(P_GAIN * error, 100) + bounded(I_GAIN * out.summed_error, 100) + D_GAIN * change
    out.pulse_width = bounded(toward_zero(total, 2), 100)


def _start_ramp(out: Output, power: int, turn: int) -> None:
    out.set_speed, out.turn = power, turn
    out.ramp_step = out.ramp_ms = 0
    out.ramp_count = out.count


def _ramp_is_due(out: Output, sign: int) -> bool:
    out.ramp_ms += 1
    return (out.count - out.ramp_count) * sign > out.ramp_step


def _one_step_to_zero(value: int) -> int:
    return value - (value > 0) + (value < 0)
