"""The emulated brick on a USB cable: a gadget 0694:0002 behind which motors turn in real time.

A program of its own, so that neither the driver nor its tests share a process with it. It plugs itself in and
is told what to do over a Unix socket (SOCK_SEQPACKET): one word a connection, answered in JSON:

    plug, unplug                 the cable; the motors run on
    silence, restore             takes telegrams and answers nothing; answers again
    garbage, clean               random bytes for answers; proper ones again
    angles                       true shaft angles of B and C in radians
"""

from __future__ import annotations

import json
import os
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from functionfs import Endpoints, UsbGadget

from robot.sim.brick_emulator import BrickEmulator
from robot.sim.motor import FreeMotor

SOCKET: Final = Path("/run/brick.sock")
NAME: Final = "nxt"
SERIAL: Final = "001653000001"
_TELEGRAM_MAX: Final = 64
_STEP_S: Final = 0.005


class RealTimeBrick:
    """A brick whose time passes by itself; one lock for the cable, the motors and the person beside it."""

    def __init__(self, seed: int = 3) -> None:
        rng = np.random.default_rng(seed)
        self._motors = [FreeMotor(rng, load_inertia=0.0005), FreeMotor(rng, load_inertia=0.0005)]
        self.emulator = BrickEmulator([None, *self._motors], rng, sleep_minutes=60)
        self.lock = threading.Lock()

    def live(self) -> None:
        """Let time pass, for ever."""
        then = time.monotonic()
        while True:
            time.sleep(_STEP_S)
            now = time.monotonic()
            with self.lock:
                self.emulator.advance(now - then)
            then = now

    def handle(self, telegram: bytes) -> bytes | None:
        """Answer a telegram."""
        with self.lock:
            return self.emulator.handle(telegram)

    def angles(self) -> list[float]:
        """True shaft angles, radians."""
        with self.lock:
            return [motor.angle for motor in self._motors]


def serve_telegrams(endpoints: Endpoints, brick: RealTimeBrick, enabled: threading.Event) -> None:
    """Carry telegrams between the endpoints and the brick, for ever; a pulled cable breaks a transfer."""
    while True:
        enabled.wait()
        try:
            telegram = os.read(endpoints.from_host, _TELEGRAM_MAX)
            reply = brick.handle(telegram)
            if reply is not None:
                os.write(endpoints.to_host, reply)
        except OSError:
            # Unplugged or configured anew under our hands: the transfer is lost, as on a real cable.
            time.sleep(0.001)


def follow_events(endpoints: Endpoints, enabled: threading.Event) -> None:
    """Keep track of whether a host has configured us, for ever."""
    while True:
        event = endpoints.next_event().name
        if event == "ENABLE":
            enabled.set()
        elif event in ("DISABLE", "UNBIND"):
            enabled.clear()


def serve_orders(orders: dict[str, Callable[[], object]]) -> None:
    """Answer the person beside the brick, for ever."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(SOCKET))
        listener.listen()
        while True:
            connection, _ = listener.accept()
            with connection:
                word = connection.recv(64).decode()
                connection.send(json.dumps(orders[word]()).encode())


def main() -> None:
    """Plug the brick in and live."""
    brick = RealTimeBrick()
    gadget = UsbGadget(NAME, 0x0694, 0x0002, SERIAL, "NXT")
    endpoints = Endpoints(NAME, Path("/run/ffs"))
    enabled = threading.Event()
    for target, arguments in (
        (brick.live, ()),
        (follow_events, (endpoints, enabled)),
        (serve_telegrams, (endpoints, brick, enabled)),
    ):
        threading.Thread(target=target, args=arguments, daemon=True).start()
    gadget.plug()

    serve_orders(
        {
            "plug": gadget.plug,
            "unplug": gadget.unplug,
            "silence": brick.emulator.silence_link,
            "restore": brick.emulator.restore_link,
            "garbage": lambda: setattr(brick.emulator, "garbage", True),
            "clean": lambda: setattr(brick.emulator, "garbage", False),
            "angles": brick.angles,
        }
    )


if __name__ == "__main__":
    main()
