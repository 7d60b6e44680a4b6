"""What a person at the stick is told: one line, twice a second. Pure."""

from __future__ import annotations

from robot import faults
from robot.messages import Fault, Sent

WIDTH = 79
"""Columns of a plain terminal."""
_WORST_FIRST = {faults.Action.HALT: 0, faults.Action.STOP: 1, faults.Action.CARRY_ON: 2}


def status_line(state: str, sent: Sent, volts: float | None, active: tuple[Fault, ...]) -> str:
    """State, what the wheels were told, battery, who drives, what holds it up or the worst fault's key.

    >>> from robot.messages import Twist
    >>> status_line("teleop", Sent(Twist(0.12, -0.3), None, 0.0), 8.1, ())
    'teleop     v +0.12 w -0.30   8.1 V  you drive'
    """
    battery = f"{volts:4.1f} V" if volts is not None else "  ? V"
    line = f"{state:<9}  v {sent.twist.v:+.2f} w {sent.twist.w:+.2f}  {battery}  {_who(state)}"
    worst = min(active, key=lambda fault: (_WORST_FIRST[faults.row(fault).action], fault.key), default=None)
    if worst is not None:
        more = len({fault.key for fault in active}) - 1
        line += f"  ! {worst.key}" + (f" +{more}" if more else "")
    elif sent.limited_by is not None and sent.limited_by != "acceleration":
        line += f"  ({sent.limited_by})"
    return line if len(line) <= WIDTH else line[: WIDTH - 3] + "..."


def _who(state: str) -> str:
    match state:
        case "teleop":
            return "you drive"
        case "idle":
            return "t take, g go"
        case "halted":
            return "r to acknowledge"
    return "drives itself"
