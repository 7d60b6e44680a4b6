"""A gamepad through Linux's joystick device (/dev/input/js0): left stick drives, four buttons ask.

The device gives events of 8 bytes: time u32 in ms, value i16, type u8, number u8 (linux/joystick.h). When it
is opened it first tells where everything is, with bit 0x80 set in the type.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Final

from robot.hal.teleop.frames import NO_BUTTONS, Button
from robot.hal.teleop.sticks import is_neutral

DEVICE: Final = "/dev/input/js0"
EVENT: Final = struct.Struct("<IhBB")
AXIS_LEFT_RIGHT, AXIS_UP_DOWN = 0, 1
BUTTONS: Final = {0: Button.TAKE, 1: Button.STOP, 2: Button.GIVE, 3: Button.RELEASE}
"""A, B, X, Y of an Xbox pad: take, stop, give, release."""

_IS_BUTTON, _IS_AXIS, _IS_INITIAL = 0x01, 0x02, 0x80
_FULL: Final = 32767
_DEAD_ZONE: Final = 0.12
_RETRY_S: Final = 1.0
_MOST_EVENTS: Final = 64


@dataclass(frozen=True, slots=True)
class Pad:
    """What the gamepad shows. v forward, w left, -1..1; 0 until it was let go once after being plugged in.

    held: buttons down now; pressed: those that went down since the last look.
    """

    present: bool = False
    v: float = 0.0
    w: float = 0.0
    held: Button = NO_BUTTONS
    pressed: Button = NO_BUTTONS
    live: bool = False
    axes: dict[int, int] = field(default_factory=dict)


def moved(pad: Pad, events: bytes) -> Pad:
    """The pad after these events; an incomplete one at the end is ignored.

    >>> let_go = EVENT.pack(0, 0, 0x82, 0) + EVENT.pack(0, 0, 0x82, 1)
    >>> pad = moved(Pad(present=True), let_go + EVENT.pack(9, -32767, 0x02, 1))
    >>> pad.v, pad.w
    (1.0, 0.0)
    """
    pad = replace(pad, pressed=NO_BUTTONS)
    for _, value, kind, number in EVENT.iter_unpack(events[: len(events) // EVENT.size * EVENT.size]):
        if kind & ~_IS_INITIAL == _IS_BUTTON and number in BUTTONS:
            pad = _button(pad, BUTTONS[number], bool(value), bool(kind & _IS_INITIAL))
        elif kind & ~_IS_INITIAL == _IS_AXIS:
            pad = _axis(pad, number, value)
    return pad


class Gamepad:
    """The device, opened when it is there and again after it was unplugged. `read` never waits or raises.

    open_device: opens the path non-blocking and returns the file descriptor; raises OSError.
    """

    def __init__(self, path: str = DEVICE, open_device: Callable[[str], int] | None = None) -> None:
        self.path = path
        self._open_device = open_device or (lambda name: os.open(name, os.O_RDONLY | os.O_NONBLOCK))
        self._fd: int | None = None
        self._retry_at = 0.0
        self._pad = Pad()

    def read(self, now: float) -> Pad:
        """How the pad stands; neutral and not present while it is unplugged."""
        if self._fd is None and now >= self._retry_at:
            self._retry_at = now + _RETRY_S
            with suppress(OSError):
                self._fd = self._open_device(self.path)
                self._pad = Pad(present=True)
        if self._fd is None:
            return Pad()
        try:
            events = os.read(self._fd, EVENT.size * _MOST_EVENTS)
        except BlockingIOError:
            events = b""
        except OSError:
            self.close()
            return Pad()
        self._pad = moved(self._pad, events)
        return self._pad

    def close(self) -> None:
        """Release the device. May be called twice."""
        if self._fd is not None:
            with suppress(OSError):
                os.close(self._fd)
            self._fd = None


def _button(pad: Pad, button: Button, down: bool, initial: bool) -> Pad:
    if not down:
        return replace(pad, held=pad.held & ~button)
    pressed = pad.pressed if initial else pad.pressed | button
    return replace(pad, held=pad.held | button, pressed=pressed)


def _axis(pad: Pad, number: int, value: int) -> Pad:
    axes = pad.axes | {number: value}
    v, w = _share(-axes.get(AXIS_UP_DOWN, 0)), _share(-axes.get(AXIS_LEFT_RIGHT, 0))
    known = AXIS_UP_DOWN in axes and AXIS_LEFT_RIGHT in axes  # they are told one after the other
    live = pad.live or (known and is_neutral(v, w))
    return replace(pad, axes=axes, live=live, v=v if live else 0.0, w=w if live else 0.0)


def _share(value: int) -> float:
    """-1..1 with the dead zone taken out, so that the motion begins gently at its edge."""
    share = min(max(value / _FULL, -1.0), 1.0)
    beyond = abs(share) - _DEAD_ZONE
    return 0.0 if beyond <= 0.0 else beyond / (1.0 - _DEAD_ZONE) * (1.0 if share > 0 else -1.0)
