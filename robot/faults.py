"""The fault table: every way a device can fail, what the robot does about it, and words with the cure.

The table is total: a fault without a row is a programming error, found by a test and treated as HALT.
`worst_action(faults)` is the decision the loop acts on.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum

from robot.messages import Fault


class Action(IntEnum):
    """What a fault asks for; the higher one wins."""

    CARRY_ON = 0  # told and logged, the mission goes on
    STOP = 1  # stand still until it is over, then go on by recognize or search
    HALT = 2  # stand still and disarm; a person must look and arm again


@dataclass(frozen=True, slots=True)
class Row:
    """One row of the table. detection_s: within this time of happening it is noticed."""

    action: Action
    detection_s: float
    words: str


TABLE: dict[str, Row] = {
    "camera.missing": Row(
        Action.STOP, 0.5, "no picture yet or any more: check the cameras' cables and `cameras` in the config"
    ),
    "camera.stale": Row(
        Action.STOP, 0.5, "the pictures are old: check the USB bus (use MJPG, separate controllers)"
    ),
    "camera.frozen": Row(Action.STOP, 0.5, "the same picture again and again: unplug and replug the cameras"),
    "camera.black": Row(
        Action.STOP, 0.3, "the pictures are black: take the lens caps off, switch the light or the lamp on"
    ),
    "camera.unpaired": Row(
        Action.STOP, 0.5, "left and right were not taken at the same moment: same rate and exposure for both"
    ),
    "camera.size": Row(
        Action.HALT, 0.3, "the picture's size is not the configured one: mend cameras.width_px and height_px"
    ),
    "camera.swapped": Row(
        Action.HALT, 1.5, "left and right eye are swapped: exchange cameras.left and cameras.right"
    ),
    "camera.link": Row(Action.STOP, 0.5, "a camera does not answer: check its cable"),
    "head.link": Row(Action.STOP, 0.5, "the head does not answer: check its cable"),
    "head.stuck": Row(Action.STOP, 1.0, "the head does not reach its angle: free it, check its power"),
    "lamp.link": Row(Action.CARRY_ON, 0.5, "the lamp does not answer: it stays as it is"),
    "lamp.dead": Row(
        Action.CARRY_ON, 2.0, "the lamp gives no light: change it; in the dark the robot sees little"
    ),
    "base.link": Row(
        Action.STOP, 0.3, "the brick does not answer: check its cable, power and Bluetooth pairing"
    ),
    "base.stall": Row(
        Action.STOP, 0.4, "a wheel is commanded but does not turn: free it; pull the power if it hums"
    ),
    "base.battery_low": Row(Action.CARRY_ON, 15.0, "the base's battery is low: charge it soon"),
    "base.battery_empty": Row(Action.HALT, 15.0, "the base's battery is empty: charge it"),
    "base.refused": Row(
        Action.STOP, 0.3, "the brick refuses commands: restart it, check its firmware (1.29 or newer)"
    ),
    "arm.link": Row(Action.STOP, 0.5, "the arm's controller does not answer: check its cable and address"),
    "arm.fault": Row(
        Action.HALT, 0.5, "the arm's controller reports a fault: look at its panel and reset it"
    ),
    "arm.stopped": Row(Action.HALT, 0.5, "the arm's protective or emergency stop is active: release it"),
    "teleop.link": Row(
        Action.CARRY_ON, 0.5, "the teleop link does not answer: check its cable; autonomy goes on"
    ),
    "teleop.silent": Row(
        Action.STOP, 0.5, "the person at the stick went silent: the robot waits; take or release again"
    ),
    "recorder.full": Row(
        Action.CARRY_ON, 1.0, "the disk is full: the run goes on, its record ends here; make room"
    ),
    "recorder.error": Row(Action.CARRY_ON, 0.1, "the record met its own mistake and ends here: report it"),
    "vision.late": Row(Action.CARRY_ON, 1.0, "vision needs more time than there is: rates were lowered"),
    "vision.error": Row(Action.HALT, 0.5, "a vision stage met its own mistake: read the log, report it"),
    "loop.error": Row(Action.HALT, 0.1, "the program met its own mistake: read the log, report it"),
}


def row(fault: Fault) -> Row:
    """The fault's row; an unknown fault halts the robot rather than passing unnoticed."""
    return TABLE.get(fault.key, Row(Action.HALT, 0.1, f"unknown fault {fault.key}: report it"))


def worst_action(faults: Iterable[Fault]) -> Action:
    """The strongest action any of the faults asks for.

    >>> worst_action([Fault("lamp", "dead", 0.0), Fault("base", "stall", 0.0)]).name
    'STOP'
    """
    return max((row(fault).action for fault in faults), default=Action.CARRY_ON)


def explain(fault: Fault) -> str:
    """One line for a person: what, since when, and the cure."""
    evidence = f" ({fault.evidence})" if fault.evidence else ""
    return f"{fault.key} since {fault.since:.1f} s{evidence}: {row(fault).words}"
