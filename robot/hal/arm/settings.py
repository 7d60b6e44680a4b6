"""Figures of the arm's driver."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ModbusArmSettings:
    """How to speak to the controller.

    unit: Modbus unit number. low_first: the low word of 32-bit values comes first. watchdog_ms: the
    controller stops by itself when no heartbeat came for so long. owner: this robot's token, 1..65535; the
    same at every start, so that a robot that died takes its arm over again.
    silence_s: no answer for so long is a fault. echo_s: a heartbeat not echoed for so long is one.
    resend_s: a command not seen to begin is sent again (same number) after this, until command_life_s are
    over. refused_told_s: so long a refused command is told. owner_check_s: how often is looked who owns the
    controller.
    """

    unit: int = 1
    low_first: bool = False
    watchdog_ms: int = 300
    owner: int = 0x5242
    silence_s: float = 0.3
    echo_s: float = 0.4
    resend_s: float = 0.1
    command_life_s: float = 0.5
    refused_told_s: float = 1.0
    owner_check_s: float = 1.0
