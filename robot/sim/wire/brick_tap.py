"""Listens to what arrives at the brick: each motor command with the time it came."""

from __future__ import annotations

import time
from collections import deque

from robot.sim.brick_emulator import BrickEmulator
from robot.sim.wire.messages import MotorTelegram

_REMEMBERED = 100_000
_SET_OUTPUT_STATE = 0x04
_SHORTEST = 12


class BrickTap:
    """Stands before a brick: passes telegrams on and notes those that move motors.

    Whoever asks for `telegrams` holds the lock under which `handle` is called.
    """

    def __init__(self, brick: BrickEmulator) -> None:
        self._brick = brick
        self._telegrams: deque[MotorTelegram] = deque(maxlen=_REMEMBERED)

    @property
    def reachable(self) -> bool:
        """As the brick is."""
        return self._brick.reachable

    @property
    def telegrams(self) -> tuple[MotorTelegram, ...]:
        """All motor commands, oldest first."""
        return tuple(self._telegrams)

    def handle(self, telegram: bytes) -> bytes | None:
        """Note it, and let the brick answer."""
        noted = motor_telegram(telegram, time.monotonic())
        if noted is not None:
            self._telegrams.append(noted)
        return self._brick.handle(telegram)


def motor_telegram(telegram: bytes, at: float) -> MotorTelegram | None:
    """The command to a motor in it, None if it is something else.

    >>> motor_telegram(bytes.fromhex("80 04 01 ce 07 01 00 20 5a000000"), 1.5)
    MotorTelegram(at=1.5, port=1, power=-50, limit=90)
    """
    if len(telegram) < _SHORTEST or telegram[0] not in (0x00, 0x80) or telegram[1] != _SET_OUTPUT_STATE:
        return None
    power = int.from_bytes(telegram[3:4], "little", signed=True)
    return MotorTelegram(at, telegram[2], power, int.from_bytes(telegram[8:12], "little"))
