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
    """One row of the table.

    detection_s: within this time of happening it is noticed. clears: what ends the fault (after a HALT the
    robot waits besides for a person to release and arm it). words: what is wrong, and the cure.
    person_may_drive: a person who took the stick drives on all the same, without the eyes' help.
    """

    action: Action
    detection_s: float
    clears: str
    words: str
    person_may_drive: bool = False


CARRY_ON, STOP, HALT = Action.CARRY_ON, Action.STOP, Action.HALT

TABLE: dict[str, Row] = {
    # ------------------------------------------------------------------------------------------ cameras
    "camera.missing": Row(
        STOP,
        0.5,
        "a pair of pictures arrives",
        "no picture yet or any more: check the cameras' cables and `cameras` in the config",
        person_may_drive=True,
    ),
    "camera.stale": Row(
        STOP,
        0.5,
        "a fresh pair arrives",
        "the pictures are old: check the USB bus (use MJPG, separate controllers)",
        person_may_drive=True,
    ),
    "camera.frozen": Row(
        STOP,
        0.5,
        "the picture changes",
        "the same picture again and again: unplug and replug the cameras",
        person_may_drive=True,
    ),
    "camera.black": Row(
        STOP,
        0.3,
        "the pictures show something",
        "the pictures are black: take the lens caps off, switch the light or the lamp on",
        person_may_drive=True,
    ),
    "camera.unpaired": Row(
        STOP,
        0.5,
        "left and right come together again",
        "left and right were not taken at the same moment: same rate and exposure for both",
        person_may_drive=True,
    ),
    "camera.size": Row(
        HALT,
        0.3,
        "the configured size arrives",
        "the picture's size is not the configured one: mend cameras.width_px and height_px",
        person_may_drive=True,
    ),
    "camera.swapped": Row(
        HALT,
        1.5,
        "the eyes are in order",
        "left and right eye are swapped: exchange cameras.left and cameras.right",
        person_may_drive=True,
    ),
    "camera.misrectified": Row(
        HALT,
        6.0,
        "the rows agree again",
        "the eyes no longer stand as calibrated: was a camera bumped? calibrate again",
        person_may_drive=True,
    ),
    "camera.link": Row(
        STOP,
        0.5,
        "it answers again (tried again by itself)",
        "a camera does not answer: check its cable",
        person_may_drive=True,
    ),
    # --------------------------------------------------------------------------------------- head, lamp
    "head.link": Row(
        STOP,
        0.5,
        "it answers again (tried again by itself)",
        "the head does not answer: check its cable",
        person_may_drive=True,
    ),
    "head.stuck": Row(
        STOP,
        1.0,
        "it moves again",
        "the head does not reach its angle: free it, check its power",
        person_may_drive=True,
    ),
    "lamp.link": Row(
        CARRY_ON,
        0.5,
        "it answers again (tried again by itself)",
        "the lamp does not answer: check its cable; it stays as it is",
    ),
    "lamp.dead": Row(
        CARRY_ON,
        2.0,
        "the picture brightens with the lamp",
        "the lamp gives no light: change it; in the dark the robot sees little",
    ),
    # --------------------------------------------------------------------------------------------- base
    "base.link": Row(
        STOP,
        0.3,
        "it answers again (tried again by itself)",
        "the brick does not answer: check its cable, power and Bluetooth pairing; "
        "if a wheel still pushes, switch the brick off",
    ),
    "base.stall": Row(
        STOP,
        0.4,
        "one second after the wheels were stopped",
        "a wheel is commanded but does not turn: free it; pull the power if it hums",
    ),
    "base.stranded": Row(
        HALT,
        0.5,
        "the brick answers again",
        "the link broke while a wheel was stalled: no software can stop it now, switch the brick off",
    ),
    "base.moved": Row(
        STOP,
        0.6,
        "it has stood still for a second; if it was lifted, it was seen to come down, driven or armed again",
        "the base was lifted, tipped or pushed, or its wheels slip: set it down; the map is begun anew",
        person_may_drive=True,
    ),
    "base.battery_low": Row(
        CARRY_ON, 15.0, "the voltage is 0.2 V above the limit", "the base's battery is low: charge it soon"
    ),
    "base.battery_empty": Row(
        HALT, 15.0, "the voltage is 0.2 V above the limit", "the base's battery is empty: charge it"
    ),
    "base.refused": Row(
        STOP,
        0.3,
        "the brick obeys again",
        "the brick refuses commands: restart it, check its firmware (1.29 or newer)",
    ),
    # ------------------------------------------------------------------------------------- near sensors
    "near.bump": Row(
        STOP,
        0.2,
        "the bumper is free",
        "the bumper touches something the eyes did not see: move it, or drive back by teleop",
        person_may_drive=True,
    ),
    "near.link": Row(
        CARRY_ON,
        0.5,
        "they answer again (tried again by itself)",
        "bumper and sonar do not answer: check the brick; the eyes alone guard",
    ),
    "near.sensor": Row(
        CARRY_ON,
        1.0,
        "the sensor gives values again",
        "bumper or sonar gives no values: check its plug and base.bumper_ports, base.sonar_port",
    ),
    # ---------------------------------------------------------------------------------------------- arm
    "arm.link": Row(
        STOP,
        0.5,
        "it answers again (tried again by itself)",
        "the arm's controller does not answer: press its red button if it moves, check its cable and address",
    ),
    "arm.fault": Row(
        HALT,
        0.5,
        "the controller's fault is reset",
        "the arm's controller reports a fault: look at its panel and reset it",
    ),
    "arm.stopped": Row(
        HALT,
        0.5,
        "the stop is released",
        "the arm's protective or emergency stop is active: release it",
    ),
    "arm.refused": Row(
        STOP,
        0.5,
        "it accepts the next command",
        "the arm refuses the command: out of its reach, or its drives are off",
    ),
    # ------------------------------------------------------------------------------------------- teleop
    "teleop.link": Row(
        CARRY_ON,
        0.5,
        "the port opens again (tried again by itself)",
        "the teleop link does not answer: check its cable; autonomy goes on",
    ),
    "teleop.silent": Row(
        STOP,
        0.5,
        "the person is heard again",
        "the person at the stick went silent: the robot waits; take or release again",
    ),
    "teleop.noise": Row(
        CARRY_ON,
        0.5,
        "a second without noise",
        "the teleop line carries noise: check baud rate and cable; such bytes move nothing",
    ),
    # -------------------------------------------------------------------------------------- the program
    "recorder.full": Row(
        CARRY_ON,
        1.0,
        "the next run",
        "the disk is full: the run goes on, its record ends here; make room",
    ),
    "recorder.error": Row(
        CARRY_ON, 0.1, "the next run", "the record met its own mistake and ends here: report it"
    ),
    "vision.late": Row(
        CARRY_ON,
        1.0,
        "the costs fall",
        "vision needs more time than there is: rates were lowered",
    ),
    "vision.error": Row(
        HALT,
        0.5,
        "the next start",
        "a vision stage met its own mistake: read the log, report it",
        person_may_drive=True,
    ),
    "driver.error": Row(HALT, 0.5, "the next start", "a driver met its own mistake: read the log, report it"),
    "loop.late": Row(
        CARRY_ON,
        1.0,
        "a second without a late tick",
        "control ticks come late: close other programs, check the processor's temperature",
    ),
    "loop.error": Row(
        HALT,
        0.1,
        "the next start",
        "the program met its own mistake: read the log, report it",
        person_may_drive=True,
    ),
}


def row(fault: Fault) -> Row:
    """The fault's row; an unknown fault halts the robot rather than passing unnoticed."""
    return TABLE.get(fault.key, Row(HALT, 0.1, "the next start", f"unknown fault {fault.key}: report it"))


def action(fault: Fault, state: str) -> Action:
    """What a fault asks for in a state: a person at the stick drives on where the row allows it.

    >>> blind = Fault("camera", "black", 0.0)
    >>> action(blind, "track").name, action(blind, "teleop").name
    ('STOP', 'CARRY_ON')
    """
    entry = row(fault)
    return CARRY_ON if state == "teleop" and entry.person_may_drive else entry.action


def worst_action(faults: Iterable[Fault], state: str = "") -> Action:
    """The strongest action any of the faults asks for in this state.

    >>> worst_action([Fault("lamp", "dead", 0.0), Fault("base", "stall", 0.0)]).name
    'STOP'
    """
    return max((action(fault, state) for fault in faults), default=CARRY_ON)


def explain(fault: Fault) -> str:
    """One line for a person: what, since when, and the cure."""
    evidence = f" ({fault.evidence})" if fault.evidence else ""
    return f"{fault.key} since {fault.since:.1f} s{evidence}: {row(fault).words}"
