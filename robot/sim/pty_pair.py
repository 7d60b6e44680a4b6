"""A serial cable without serial ports: two pseudo-terminals joined end to end."""

from __future__ import annotations

import asyncio
import os
import tty
from contextlib import suppress
from typing import Final

_CHUNK: Final = 4096


class PtyPair:
    """`near` and `far` are paths to open as serial ports; what is written to one is read from the other.

    Runs on the asyncio loop it was made in. `cut`: what is written is lost. `close()` hangs both ends up:
    whoever has one open sees the port vanish.
    """

    def __init__(self) -> None:
        self._masters: list[int] = []
        self._slaves: list[int] = []
        for _ in range(2):
            master, slave = os.openpty()
            tty.setraw(slave)
            os.set_blocking(master, False)
            self._masters.append(master)
            # Kept open, so that the cable stays while nobody has a port of it open.
            self._slaves.append(slave)
        self.near, self.far = (os.ttyname(slave) for slave in self._slaves)
        self.cut = False
        self._loop = asyncio.get_running_loop()
        first, second = self._masters
        self._loop.add_reader(first, self._carry, first, second)
        self._loop.add_reader(second, self._carry, second, first)

    def close(self) -> None:
        """Hang both ends up. May be called twice; in the loop's thread."""
        for master in self._masters:
            self._loop.remove_reader(master)
        for end in (*self._masters, *self._slaves):
            os.close(end)
        self._masters, self._slaves = [], []

    def _carry(self, source: int, sink: int) -> None:
        # A full buffer or a hung-up end loses bytes, as a cable would.
        with suppress(OSError):
            data = os.read(source, _CHUNK)
            if data and not self.cut:
                os.write(sink, data)
