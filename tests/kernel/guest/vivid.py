"""The tests' hand on the two cameras: the kernel's vivid driver, its nodes, its ways to fail."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Final

from brick_remote import wait_until

_DRIVER: Final = Path("/sys/bus/platform/drivers/vivid")
_DEVICE: Final = "vivid.0"
_NODES: Final = Path("/sys/class/video4linux")
_START_OF_EXPOSURE: Final = 1
WIDTH: Final = 640
HEIGHT: Final = 360
RATE_HZ: Final = 25.0
PIXEL_FORMAT: Final = "YUYV"


def nodes() -> list[str]:
    """Device paths of the cameras, left one first; fewer while they are unplugged."""
    found = sorted(_NODES.glob("*/name"), key=lambda path: path.read_text())
    return [f"/dev/{path.parent.name}" for path in found if path.read_text().startswith("vivid-")]


def unplug() -> None:
    """Pull both cameras' cables, also from under a program that streams."""
    (_DRIVER / "unbind").write_text(_DEVICE)
    wait_until(lambda: not nodes(), "the kernel to see the cameras go")


def plug() -> None:
    """Put them back; returns when their nodes are there. No effect if they are."""
    if not (_DRIVER / _DEVICE).exists():
        (_DRIVER / "bind").write_text(_DEVICE)
    wait_until(lambda: len(nodes()) == 2 and all(Path(node).exists() for node in nodes()), "the cameras")
    subprocess.run(["udevadm", "settle", "--timeout=20"], check=True)
    for node in nodes():
        # Webcams stamp the start of exposure; vivid's other choice lies in the future.
        set_control(node, "timestamp_source", _START_OF_EXPOSURE)


def set_control(node: str, name: str, value: int) -> None:
    """Turn one of a camera's screws as `v4l2-ctl` does."""
    subprocess.run(["v4l2-ctl", "-d", node, "-c", f"{name}={value}"], check=True, capture_output=True)


def control(node: str, name: str) -> int:
    """Read one of them."""
    command = ["v4l2-ctl", "-d", node, "-C", name]
    told = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return int(told.rpartition(":")[2].split()[0])
