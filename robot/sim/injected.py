"""Faults one can order for a simulated device: `DEVICE.KIND@TIME[:DURATION]`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot.errors import UserError
from robot.sim.brick_emulator import BrickEmulator

KINDS: dict[str, tuple[str, ...]] = {
    "camera": (
        "black", "frozen", "swapped", "stale", "unpaired", "dropped", "link", "size", "missing",
        "misrectified",
    ),
    "head": ("stuck", "link"),
    "lamp": ("dead", "link"),
    "base": (
        "link", "silent", "garbage", "stall", "power", "battery_low", "battery_empty",
        "lifted", "tipped", "pushed", "lifted_slowly", "tipped_slowly", "pushed_slowly",
    ),
}  # fmt: skip
"""What can be broken: device -> kinds."""


@dataclass(frozen=True, slots=True)
class InjectedFault:
    """A device breaks at `at` seconds and works again after `duration` seconds (None: never).

    Raises UserError for a device or a kind that cannot be broken.
    """

    device: str
    kind: str
    at: float
    duration: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS.get(self.device, ()):
            allowed = ", ".join(f"{device}.{kind}" for device, kinds in KINDS.items() for kind in kinds)
            raise UserError(f"fault '{self.device}.{self.kind}': cannot be simulated; possible: {allowed}")
        if not (math.isfinite(self.at) and self.at >= 0.0 and (self.duration is None or self.duration > 0.0)):
            raise UserError(f"fault '{self.device}.{self.kind}': time must be >= 0 s and duration > 0 s")

    def active(self, now: float) -> bool:
        """True while the device is broken.

        >>> InjectedFault("camera", "black", 5.0, 2.0).active(6.0)
        True
        """
        return self.at - 1e-9 <= now < (math.inf if self.duration is None else self.at + self.duration) - 1e-9


def active_kinds(faults: tuple[InjectedFault, ...], device: str, now: float) -> frozenset[str]:
    """The kinds of fault a device has at `now`."""
    return frozenset(f.kind for f in faults if f.device == device and f.active(now))


FRESH_MV, LOW_MV, EMPTY_MV = 7900.0, 6700.0, 6000.0
STALLED_PORT = 2
"""The right wheel's."""


def switch_base_faults(brick: BrickEmulator, begun: frozenset[str], over: frozenset[str]) -> None:
    """End the faults in `over`, then begin those in `begun`. A brick that is switched off stays off.

    What hands do to the base (`handling.KINDS`) is no business of the brick's and passes unnoticed here.
    """
    for kind in sorted(over):
        match kind:
            case "link" | "silent":
                brick.restore_link()
            case "garbage":
                brick.garbage = False
            case "stall":
                brick.release(STALLED_PORT)
            case "battery_low" | "battery_empty":
                brick.set_battery(FRESH_MV)
    for kind in sorted(begun):
        match kind:
            case "link":
                brick.cut_link()
            case "silent":
                brick.silence_link()
            case "garbage":
                brick.garbage = True
            case "stall":
                brick.stall(STALLED_PORT)
            case "power":
                brick.power_off()
            case "battery_low":
                brick.set_battery(LOW_MV)
            case "battery_empty":
                brick.set_battery(EMPTY_MV)
