"""The virtual machine: QEMU with everything emulated, its console to a file, its report line by line."""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from image import Image

_MEMORY: Final = "2560M"
_KERNEL_WORDS: Final = "console=ttyS0 rdinit=/init panic=-1 quiet random.trust_cpu=on mitigations=off"


def command(image: Image, console: Path) -> list[str]:
    """QEMU's command line.

    TCG always: a KVM device may be there and hang. With icount the guest's clock counts instructions and
    skips idle time, so that its 25 ticks a second do not depend on how busy or slow the host is.
    """
    return [
        "qemu-system-x86_64",
        *("-accel", "tcg", "-cpu", "max", "-smp", "1", "-m", _MEMORY),
        *("-icount", "shift=0,sleep=off", "-rtc", "clock=vm"),
        *("-kernel", str(image.kernel), "-initrd", str(image.initrd), "-append", _KERNEL_WORDS),
        *("-nodefaults", "-no-user-config", "-no-reboot", "-display", "none", "-monitor", "none"),
        *("-serial", f"file:{console}", "-serial", "stdio"),
    ]


def reports(image: Image, console: Path, timeout: float) -> Iterator[dict[str, Any]]:
    """Boot, and yield what the guest reports until it is off; state `hung` if it is not after `timeout` s."""
    process = subprocess.Popen(command(image, console), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
    assert process.stdout is not None
    try:
        for line in _lines(process.stdout.fileno(), time.monotonic() + timeout):
            if line.startswith(b"{"):
                yield json.loads(line)
    except TimeoutError:
        yield {"state": "hung"}
    finally:
        process.kill()
        process.wait()


def _lines(file: int, deadline: float) -> Iterator[bytes]:
    rest = b""
    with selectors.DefaultSelector() as selector:
        selector.register(file, selectors.EVENT_READ)
        while True:
            if not selector.select(max(0.0, deadline - time.monotonic())):
                raise TimeoutError
            piece = os.read(file, 65536)
            if not piece:
                return
            *lines, rest = (rest + piece).split(b"\n")
            yield from (line.strip() for line in lines)
