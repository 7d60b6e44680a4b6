"""The tests' hand on the brick: pulls its cable, makes it silent, looks at its shafts."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from brick_gadget import SERIAL, SOCKET

_USB_DEVICES: Final = Path("/sys/bus/usb/devices")
_PATIENCE_S: Final = 20.0


@dataclass(frozen=True, slots=True)
class Shaft:
    """A motor's true angle in radians."""

    angle: float


class BrickRemote:
    """Orders to the gadget program; see brick_gadget.py."""

    def order(self, word: str) -> Any:
        """Give one order, return the answer."""
        wait_until(SOCKET.exists, "the gadget program to listen")
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as connection:
            connection.settimeout(_PATIENCE_S)
            connection.connect(str(SOCKET))
            connection.send(word.encode())
            return json.loads(connection.recv(4096))

    def unplug(self) -> None:
        """Pull the cable; returns when the kernel has seen it."""
        self.order("unplug")
        wait_until(lambda: not is_listed(), "the kernel to see the brick go")

    def plug(self) -> None:
        """Put the cable back; returns when the kernel lists the brick."""
        self.order("plug")
        wait_until(is_listed, "the kernel to list the brick")

    def shafts(self) -> list[Shaft]:
        """Left and right."""
        return [Shaft(angle) for angle in self.order("angles")]

    def make_well(self) -> None:
        """Plugged in, answering, and saying what it means, whatever a test left behind."""
        for word in ("restore", "clean"):
            self.order(word)
        if not is_listed():
            self.plug()


def is_listed() -> bool:
    """True while the kernel has a configured USB device with the brick's serial number and its node."""
    return any(_text(path) == SERIAL for path in _USB_DEVICES.glob("*/serial"))


def wait_until(holds: Callable[[], bool], what: str) -> None:
    """Raises TimeoutError if it does not come to hold."""
    end = time.monotonic() + _PATIENCE_S
    while not holds():
        if time.monotonic() > end:
            raise TimeoutError(f"waited {_PATIENCE_S:.0f} s for {what}")
        time.sleep(0.01)


def _text(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:  # it goes while we look
        return ""
