"""The output module of the brick's firmware: three motors, counted and regulated once a millisecond.

An independent reading of firmware 1.29, quirks included:

* The tacho limit is cumulative: each limit moves the *previous target*, not the present position. Only a run
  without limit, or a reset of the count, brings the target back to where the motor is.
* At the limit the motor goes idle: the pulse width fades by one percent a millisecond with a floating coil,
  so the shaft overshoots.
* Speed and sync regulation tick every 101 ms (the counter must exceed 100) with integer PID arithmetic.
* Sync pairs whichever motors carry the flag, A first; a third one left flagged is dragged along.
* Power is not range-checked: -128..127 goes in; the pulse width ends at 100.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from robot.sim import brick_output_port as port_rules
from robot.sim.brick_output_port import (
    D_GAIN,
    I_GAIN,
    IDLE,
    MODE_BRAKE,
    MODE_ON,
    MODE_REGULATED,
    P_GAIN,
    RAMP_DOWN,
    RAMP_UP,
    REGULATION_IDLE,
    REGULATION_SPEED,
    REGULATION_SYNC,
    RUNNING,
    Output,
    bounded,
    toward_zero,
)
from robot.sim.motor import Motor

OUTPUT_COUNT = 3

_REGULATION_MS = 100


class OutputModule:
    """Three outputs and the motors on them (None: nothing plugged in)."""

    def __init__(self, motors: Sequence[Motor | None]) -> None:
        if len(motors) != OUTPUT_COUNT:
            raise ValueError(
                f"{len(motors)} motors for {OUTPUT_COUNT} output ports: use None for an empty port"
            )
        self.motors = tuple(motors)
        self.outputs = tuple(Output(encoder=m.encoder_degrees if m else 0) for m in motors)
        self._sync_errors = [0, 0]  # last and summed
        self._sync_turned = 0

    # ----------------------------------------------------------------------------------- what the host does

    def write(
        self, port: int, power: int, mode: int, regulation: int, turn: int, run_state: int, limit: int
    ) -> None:
        """SETOUTPUTSTATE for one port; takes effect at once (telegrams never share a millisecond)."""
        out = self.outputs[port]
        out.power, out.mode, out.limit = power, mode, limit
        out.regulation_written, out.turn_written = regulation, turn
        if mode & MODE_ON:
            port_rules.set_speed(out, run_state, power, turn)
            out.braked = bool(mode & MODE_BRAKE)
            self._set_regulation(out, regulation if mode & MODE_REGULATED else REGULATION_IDLE)
        else:
            out.braked = False
            out.run_state = IDLE
            out.regulation = REGULATION_IDLE
        port_rules.set_limit(out, limit)

    def state(self, port: int) -> bytes:
        """The 22 bytes of GETOUTPUTSTATE that follow the status."""
        out = self.outputs[port]
        return struct.pack(
            "<BbBBbBIiii",
            port,
            out.power,
            out.mode,
            out.regulation_written,
            out.turn_written,
            out.run_state,
            out.limit,
            out.count,
            out.block_count,
            out.rotation_count,
        )

    def reset_block_count(self, port: int) -> None:
        """RESETMOTORPOSITION, relative."""
        self.outputs[port].block_count = 0

    def reset_rotation_count(self, port: int) -> None:
        """RESETMOTORPOSITION, absolute."""
        self.outputs[port].rotation_count = 0

    def reset_count(self, port: int) -> None:
        """Opcode 0x21: clear count and target, of a synced partner too."""
        out = self.outputs[port]
        partner = self._partner(port) if out.regulation & REGULATION_SYNC else None
        for each in (out, partner):
            if each is not None:
                each.count = each.target_count = 0
        out.forever = False

    def all_idle(self) -> None:
        """What the end of a program does: every output floats."""
        for port in range(OUTPUT_COUNT):
            self.write(port, 0, 0, 0, 0, IDLE, 0)

    def _set_regulation(self, out: Output, regulation: int) -> None:
        out.regulation = regulation
        if regulation & REGULATION_SPEED and out.set_speed == 0 and out.run_state != RAMP_DOWN:
            out.forget_errors()
        if regulation & REGULATION_SYNC and out.run_state != RAMP_DOWN:
            self._sync_errors = [0, 0]
            self._sync_turned = 0

    # --------------------------------------------------------------------- what every millisecond does

    def tick(self, volts: float) -> None:
        """One firmware millisecond: count, ramp, limit, regulate, drive the motors."""
        for port, out in enumerate(self.outputs):
            motor = self.motors[port]
            if motor is not None:
                port_rules.count(out, motor.encoder_degrees)
            out.regulation_ms += 1
            if out.run_state == RAMP_UP:
                port_rules.ramp_up(out)
            elif out.run_state == RAMP_DOWN:
                port_rules.ramp_down(out)
            if out.run_state == RUNNING:
                self._check_limit(port, out)
            if out.run_state == IDLE:
                port_rules.fade(out)
            if out.regulation_ms > _REGULATION_MS:
                out.regulation_ms = 0
                self._regulate(port, out)
                out.delta_count = 0
        for out, motor in zip(self.outputs, self.motors, strict=True):
            if motor is not None:
                motor.drive(bounded(out.pulse_width, 100), out.braked, volts)

    def _check_limit(self, port: int, out: Output) -> None:
        if out.forever:
            if out.target_speed != 0:
                out.target_count = out.count
        elif out.regulation & REGULATION_SYNC:
            self._check_sync_limit(port, out)
        elif out.at_target:
            out.run_state = IDLE
            out.regulation = REGULATION_IDLE
        if out.regulation == REGULATION_IDLE:
            out.pulse_width = out.target_speed

    def _check_sync_limit(self, port: int, out: Output) -> None:
        partner = self._partner(port)
        if partner is None:
            return
        if out.turn == 0:
            if out.at_target or partner.at_target:
                out.run_state = partner.run_state = IDLE
            return
        # In a curve only the outer, faster wheel decides.
        outer, inner = (partner, out) if (out.turn > 0) == (out.target_speed >= 0) else (out, partner)
        ahead = outer.target_count - outer.count
        if ahead <= 0 if outer.target_speed >= 0 else ahead >= 0:
            out.run_state = partner.run_state = IDLE
            inner.count, inner.target_count = outer.count, outer.target_count

    def _partner(self, port: int) -> Output | None:
        flagged = (o for p, o in enumerate(self.outputs) if p != port and o.regulation & REGULATION_SYNC)
        return next(flagged, None)

    # --------------------------------------------------------------------------------------------- regulation

    def _regulate(self, port: int, out: Output) -> None:
        if out.regulation & REGULATION_SPEED:
            port_rules.regulate_speed(out)
        elif out.regulation & REGULATION_SYNC:
            pair = self._sync_pair(port)
            if pair is not None:
                self._sync(*pair)

    def _sync_pair(self, port: int) -> tuple[Output, Output] | None:
        flagged = [bool(o.regulation & REGULATION_SYNC) for o in self.outputs]
        if port == 0 and flagged[1]:
            return self.outputs[0], self.outputs[1]
        if port < 2 and flagged[2]:
            return self.outputs[port], self.outputs[2]
        return None

    def _sync(self, one: Output, two: Output) -> None:
        if one.turn:
            forward = one.target_speed >= 0
            leader = two if (one.turn > 0) == forward else one
            self._sync_turned += 2 * toward_zero(leader.turn * abs(leader.target_speed), 100)
        difference = bounded(one.block_count - two.block_count + self._sync_turned, 500)
        change = difference - self._sync_errors[0]
        summed = bounded(self._sync_errors[1] + difference, 900)
        self._sync_errors = [difference, summed]
        correction = toward_zero(P_GAIN * difference + I_GAIN * summed + D_GAIN * change, 4)
        for out, speed in ((one, one.target_speed - correction), (two, two.target_speed + correction)):
            out.pulse_width = bounded(speed, min(abs(out.target_speed), 100) if one.turn else 100)
