"""Taking a brick over: whoever spoke to its motors before, they stand still and their targets are known."""

from __future__ import annotations

from collections.abc import Sequence

from robot.hal.interfaces import DeviceError
from robot.hal.nxt.brick import Brick
from robot.hal.nxt.replies import Status, StatusError


def check_firmware(brick: Brick) -> None:
    """End the brick's own program, which would drive against us.

    Raises DeviceError (the link's; with the cure if the brick speaks another protocol).
    """
    version = brick.version()
    if version.protocol[0] != 1:
        raise DeviceError(f"it speaks protocol {version.protocol[0]}, not 1: update its firmware to 1.29")
    brick.stop_program()


def zero_motors(brick: Brick, ports: Sequence[int], hold_ports: Sequence[int]) -> None:
    """Hold the motors on `hold_ports` and zero counts and targets of those on `ports`.

    Raises DeviceError (the link's; with the cure if the firmware cannot).
    """
    for port in hold_ports:
        brick.hold(port)
    try:
        for port in ports:
            brick.reset_count(port)
    except StatusError as error:
        if error.status != Status.UNKNOWN_OPCODE:
            raise
        major, minor = brick.version().firmware
        raise DeviceError(
            f"firmware {major}.{minor:02d} cannot zero the motors' targets: update it to 1.29 or newer"
        ) from error
    # A zeroed motor is at its target and floats: hold it again.
    for port in hold_ports:
        brick.hold(port)
